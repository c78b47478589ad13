"""SQL that is not the same everywhere, by an open connection."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from sqlalchemy import Connection, Select, Table, column, func, literal, select, table, text
from sqlalchemy.dialects import postgresql, sqlite

from supermap_cli.memory.values import Problem
from supermap_schema import models
from supermap_schema.postgresql import LABEL_SEARCH

Upsert = sqlite.Insert | postgresql.Insert

_BOX = table("state_box", *map(column, ("state_id", "min_x", "max_x", "min_y", "max_y", "min_z", "max_z", "ground")))
_WORDS = table("instance_label", *map(column, ("rowid", "number", "words")))


class Dialect(Protocol):
    """The words of one kind of database."""

    def upsert(self, into: Table | type[models.Base]) -> Upsert:
        """An INSERT that can say what happens where the key is there already (`on_conflict_do_update`)."""

    def states_near(self, lower_m: Sequence[float], upper_m: Sequence[float]) -> Select[tuple[int]]:
        """The ids of all states whose box may touch the box from `lower_m` (x, y, z) to `upper_m`, by an index.

        None is left out, but some come that do not touch it: boxes are taken as wide as they can be at any heading, and
        rounded outwards.
        """

    def labelled(self, words: str) -> Select[tuple[int]]:
        """The numbers of all instances that have these words, one after the other and whatever their endings, in their
        id, their label or another label they may have; by an index.
        """

    def defer_foreign_keys(self, connection: Connection) -> None:
        """Until the transaction ends, rows may point to rows that are not there yet."""

    def align_row_ids(self, connection: Connection) -> None:
        """The next row of every table gets the id after the largest there is."""

    def damage(self, connection: Connection) -> Iterator[Problem]:
        """What is wrong with the storage itself."""


class Sqlite:
    """R*Tree, FTS5 and pragmas."""

    def upsert(self, into: Table | type[models.Base]) -> Upsert:
        """As SQLite has it."""
        return sqlite.insert(into)

    def states_near(self, lower_m: Sequence[float], upper_m: Sequence[float]) -> Select[tuple[int]]:
        """By the R*Tree."""
        return select(_BOX.c.state_id).where(*_overlaps("xyz", lower_m, upper_m))

    def labelled(self, words: str) -> Select[tuple[int]]:
        """By FTS5."""
        phrase = f'"{_plain(words)}"'
        return select(_WORDS.c.rowid.label("number")).where(
            text("instance_label MATCH :phrase").bindparams(phrase=phrase)
        )

    def defer_foreign_keys(self, connection: Connection) -> None:
        """All of them."""
        connection.exec_driver_sql("PRAGMA defer_foreign_keys = ON")

    def align_row_ids(self, connection: Connection) -> None:
        """SQLite does so by itself."""

    def damage(self, connection: Connection) -> Iterator[Problem]:
        """Pages, indices, constraints and foreign keys."""
        for (message,) in connection.exec_driver_sql("PRAGMA integrity_check"):
            if message != "ok":
                yield Problem("file", "integrity", message)
        for child, row, parent, _ in connection.exec_driver_sql("PRAGMA foreign_key_check"):
            yield Problem(child, str(row), f"points to a row of {parent} that does not exist")


class Postgresql:
    """GiST, text search and sequences."""

    def upsert(self, into: Table | type[models.Base]) -> Upsert:
        """As PostgreSQL has it."""
        return postgresql.insert(into)

    def states_near(self, lower_m: Sequence[float], upper_m: Sequence[float]) -> Select[tuple[int]]:
        """On the ground by GiST, then by height."""
        corners = (func.point(*map(float, corner[:2])) for corner in (lower_m, upper_m))
        on_the_ground = _BOX.c.ground.op("&&")(func.box(*corners))
        return select(_BOX.c.state_id).where(on_the_ground, *_overlaps("z", lower_m[2:], upper_m[2:]))

    def labelled(self, words: str) -> Select[tuple[int]]:
        """By GIN."""
        phrase = func.phraseto_tsquery(text(f"'{LABEL_SEARCH}'"), _plain(words))
        return select(_WORDS.c.number).where(_WORDS.c.words.op("@@")(phrase))

    def defer_foreign_keys(self, connection: Connection) -> None:
        """Those that are declared so: `merged_into`, and the states of temporal edges."""
        connection.exec_driver_sql("SET CONSTRAINTS ALL DEFERRED")

    def align_row_ids(self, connection: Connection) -> None:
        """Sequences also count what was taken out or rolled back."""
        for each in models.Base.metadata.sorted_tables:
            if each.autoincrement_column is not None:
                largest = select(func.max(each.autoincrement_column)).scalar_subquery()
                sequence = func.pg_get_serial_sequence(each.name, each.autoincrement_column.name)
                next_id = func.coalesce(largest + 1, literal(1))
                connection.execute(select(func.setval(sequence, next_id, literal(False))))  # noqa: FBT003

    def damage(self, connection: Connection) -> Iterator[Problem]:
        """Foreign keys; the server itself looks after its files."""
        for child in models.Base.metadata.sorted_tables:
            for key in child.foreign_key_constraints:
                yield from _orphans(connection, child, key)


_DIALECTS: dict[str, Dialect] = {"sqlite": Sqlite(), "postgresql": Postgresql()}


def dialect_of(connection: Connection) -> Dialect:
    """The dialect that an open connection understands."""
    return _DIALECTS[connection.dialect.name]


def _overlaps(axes: str, lower_m: Sequence[float], upper_m: Sequence[float]) -> Iterator[Any]:
    for axis, lower, upper in zip(axes, lower_m, upper_m, strict=True):
        yield _BOX.c[f"min_{axis}"] <= float(upper)
        yield _BOX.c[f"max_{axis}"] >= float(lower)


def _plain(words: str) -> str:
    """Letters and digits only: neither database then reads an operator into a name."""
    return " ".join(re.findall(r"[^\W_]+", words))


def _orphans(connection: Connection, child: Table, key: Any) -> Iterator[Problem]:
    """Rows whose foreign key leads nowhere: PostgreSQL refuses them, unless its triggers were switched off."""
    parent = key.referred_table.alias("parent")
    pairs = [(element.parent, parent.c[element.column.name]) for element in key.elements]
    missing = select(child.primary_key.columns[0].label("row")).where(
        *(own.is_not(None) for own, _ in pairs),
        ~select(literal(1)).where(*(own == other for own, other in pairs)).correlate(child).exists(),
    )
    for (row,) in connection.execute(missing):
        yield Problem(child.name, str(row), f"points to a row of {key.referred_table.name} that does not exist")
