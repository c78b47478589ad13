"""SQL that differs between databases, chosen by an open connection."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from sqlalchemy import Connection, Select, Table, column, func, literal, select, table, text
from sqlalchemy.dialects import sqlite
from sqlalchemy.schema import CreateIndex

from supermap_cli.memory.values import Invariant, Problem
from supermap_schema import models
from supermap_schema import postgresql as postgresql_schema
from supermap_schema import sqlite as sqlite_schema

if TYPE_CHECKING:
    from sqlalchemy.dialects import postgresql

    Upsert = sqlite.Insert | postgresql.Insert

_BOX = table("state_box", *map(column, ("state_id", "min_x", "max_x", "min_y", "max_y", "min_z", "max_z", "ground")))
_WORDS = table("instance_label", *map(column, ("rowid", "number", "words")))


_JSON = (
    ("traversal", "name", ('"T_map_odom"', "config", "versions", "timings", "warnings")),
    ("keyframe", "id", ('"T_map_base"', '"T_map_camera"', "camera")),
    ("observation", "id", ("hypotheses",)),
    ("instance", "id", ("label_belief", "engine_state")),
    ("before_image", "row_key", ("content",)),
)
"""Table, column that names a row, columns that are JSON; PostgreSQL checks these by constraints."""


def _no_json(column_name: str) -> str:
    """Condition for broken JSON; some versions of SQLite call NULL invalid."""
    return f"({column_name} IS NOT NULL AND NOT json_valid({column_name}))"


def _images(literal: str) -> Iterator[Invariant]:
    """Images must begin with the magic number of their format; `literal` formats hexadecimal digits as bytes."""
    for table_name, image, kind, magic in (
        ("keyframe", "thumbnail_jpeg", "JPEG", "ffd8ff"),
        ("observation", "crop_jpeg", "JPEG", "ffd8ff"),
    ):
        start = f"substr({image}, 1, {len(magic) // 2}) <> {literal.format(magic)}"
        sql = f"SELECT id FROM {table_name} WHERE {start}"
        yield Invariant(table_name, f"has a {image} that is no {kind}", sql)


class Dialect(Protocol):
    """The SQL of one kind of database."""

    invariants: tuple[Invariant, ...]
    """Invariants in this database's own SQL, beside `supermap_cli.memory.invariants`."""

    own_objects: tuple[str, ...]
    """Names of the triggers and other objects that a schema must have beside models and views."""

    def upsert(self, into: Table | type[models.Base]) -> Upsert:
        """An INSERT with `on_conflict_do_update`."""

    def states_near(self, lower_m: Sequence[float], upper_m: Sequence[float]) -> Select[tuple[int]]:
        """The ids of all states whose box may touch the box from `lower_m` (x, y, z) to `upper_m`, by an index.

        A superset: boxes in the index are as wide as they can be at any yaw, and rounded outwards.
        """

    def matching_labels(self, words: str) -> Select[tuple[int]]:
        """The numbers of all instances with this phrase in their id or one of their labels, compared by word stems.

        Answered by an index.
        """

    def defer_foreign_keys(self, connection: Connection) -> None:
        """Check foreign keys at the end of the transaction only."""

    def align_row_ids(self, connection: Connection) -> None:
        """Make the next row of every table get the id after the largest one."""

    def objects(self, connection: Connection) -> set[str]:
        """The names of all existing and enabled tables, views, indices, triggers and constraints."""

    def altered(self, connection: Connection) -> set[str]:
        """The names of existing objects whose definition differs from the schema's."""

    def damage(self, connection: Connection) -> Iterator[Problem]:
        """Damage of the storage itself, and dangling foreign keys."""


class Sqlite:
    """R*Tree, FTS5 and pragmas."""

    own_objects: tuple[str, ...] = (*sqlite_schema.TRIGGERS, "state_box", "instance_label")
    invariants: tuple[Invariant, ...] = (
        Invariant(
            "state_box",
            "does not stand for every state once",
            """SELECT id FROM state WHERE id NOT IN (SELECT state_id FROM state_box)
               UNION ALL SELECT state_id FROM state_box WHERE state_id NOT IN (SELECT id FROM state)""",
        ),
        Invariant(
            "state_box",
            "does not lie where its state does",
            """SELECT s.id FROM (SELECT *, (size_x + size_y) / 2 AS reach FROM state) s
               JOIN state_box b ON b.state_id = s.id
               WHERE b.min_x > s.center_x - s.reach OR b.max_x < s.center_x + s.reach
               OR b.min_y > s.center_y - s.reach OR b.max_y < s.center_y + s.reach
               OR b.min_z > s.center_z - s.size_z / 2 OR b.max_z < s.center_z + s.size_z / 2""",
        ),
        Invariant(
            "instance_label",
            "does not name every instance once",
            """SELECT id FROM instance WHERE number NOT IN (SELECT rowid FROM instance_label)
               UNION ALL SELECT id FROM instance_label WHERE rowid NOT IN (SELECT number FROM instance)""",
        ),
        Invariant(
            "instance_label",
            "has another label than its instance",
            """SELECT i.id FROM instance_label l JOIN instance i ON i.number = l.rowid
               WHERE i.id <> l.id OR i.label <> l.label""",
        ),
        *(
            Invariant(
                table,
                "holds broken JSON",
                f"""SELECT {row} FROM {table} WHERE {" OR ".join(map(_no_json, columns))}""",
            )
            for table, row, columns in _JSON
        ),
        Invariant(
            "observation",
            "has another label than its best hypothesis, or hypotheses that are no list",
            """SELECT id FROM observation WHERE CASE WHEN json_valid(hypotheses)
               THEN json_extract(hypotheses, '$[0][0]') IS NOT label END""",
        ),
        *_images("x'{}'"),
    )

    def upsert(self, into: Table | type[models.Base]) -> Upsert:
        """SQLite's INSERT."""
        return sqlite.insert(into)

    def states_near(self, lower_m: Sequence[float], upper_m: Sequence[float]) -> Select[tuple[int]]:
        """Uses the R*Tree."""
        return select(_BOX.c.state_id).where(*_overlaps("xyz", lower_m, upper_m))

    def matching_labels(self, words: str) -> Select[tuple[int]]:
        """Uses FTS5."""
        phrase = f'"{_plain(words)}"'
        return select(_WORDS.c.rowid.label("number")).where(
            text("instance_label MATCH :phrase").bindparams(phrase=phrase)
        )

    def defer_foreign_keys(self, connection: Connection) -> None:
        """Applies to all foreign keys."""
        connection.exec_driver_sql("PRAGMA defer_foreign_keys = ON")

    def align_row_ids(self, connection: Connection) -> None:
        """Nothing to do: SQLite always takes the next id."""

    def objects(self, connection: Connection) -> set[str]:
        """Everything in `sqlite_master`."""
        return set(connection.exec_driver_sql("SELECT name FROM sqlite_master").scalars())

    def altered(self, connection: Connection) -> set[str]:
        """Compares the statements that SQLite stores with the schema's."""
        made = sqlite_schema.definitions() | dict(_indices(connection.dialect))
        found = connection.exec_driver_sql("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL")
        return {name for name, sql in found if name in made and _on_one_line(sql) != _on_one_line(made[name])}

    def damage(self, connection: Connection) -> Iterator[Problem]:
        """Pages, indices, constraints and foreign keys."""
        for (message,) in connection.exec_driver_sql("PRAGMA integrity_check"):
            if message != "ok":
                yield Problem("file", "integrity", message)
        for child, row, parent, _ in connection.exec_driver_sql("PRAGMA foreign_key_check"):
            yield Problem(child, str(row), f"points to a row of {parent} that does not exist")


class Postgresql:
    """GiST, text search and sequences."""

    own_objects: tuple[str, ...] = (
        *(name for _, name in postgresql_schema.TRIGGERS),
        *postgresql_schema.INDICES,
        *(
            str(constraint.name)
            for table in models.Base.metadata.sorted_tables
            for constraint in table.constraints
            if constraint.name is not None
        ),
        *(postgresql_schema.json_constraint(table, column) for table, column in postgresql_schema.JSON_COLUMNS),
    )
    invariants: tuple[Invariant, ...] = (
        Invariant(
            "observation",
            "has another label than its best hypothesis, or hypotheses that are no list",
            "SELECT id FROM observation WHERE (hypotheses::json -> 0 ->> 0) IS DISTINCT FROM label",
        ),
        *_images("decode('{}', 'hex')"),
    )

    def upsert(self, into: Table | type[models.Base]) -> Upsert:
        """PostgreSQL's INSERT."""
        from sqlalchemy.dialects import postgresql  # noqa: PLC0415 - a tenth of a second that SQLite does not need

        return postgresql.insert(into)

    def states_near(self, lower_m: Sequence[float], upper_m: Sequence[float]) -> Select[tuple[int]]:
        """Uses the GiST index on ground rectangles, then compares heights."""
        corners = (func.point(*map(float, corner[:2])) for corner in (lower_m, upper_m))
        on_the_ground = _BOX.c.ground.op("&&")(func.box(*corners))
        return select(_BOX.c.state_id).where(on_the_ground, *_overlaps("z", lower_m[2:], upper_m[2:]))

    def matching_labels(self, words: str) -> Select[tuple[int]]:
        """Uses the GIN index."""
        phrase = func.phraseto_tsquery(text(f"'{postgresql_schema.LABEL_SEARCH}'"), _plain(words))
        return select(_WORDS.c.number).where(_WORDS.c.words.op("@@")(phrase))

    def defer_foreign_keys(self, connection: Connection) -> None:
        """Applies to deferrable foreign keys: `merged_into`, and the states of temporal edges."""
        connection.exec_driver_sql("SET CONSTRAINTS ALL DEFERRED")

    def align_row_ids(self, connection: Connection) -> None:
        """Sequences also count rows that were deleted or rolled back."""
        counted = ((table.name, table.autoincrement_column) for table in models.Base.metadata.sorted_tables)
        connection.execute(
            select(
                *(
                    func.setval(
                        func.pg_get_serial_sequence(name, row_id.name),
                        func.coalesce(select(func.max(row_id)).scalar_subquery() + 1, literal(1)),
                        literal(False),  # noqa: FBT003 - the next one is that itself
                    )
                    for name, row_id in counted
                    if row_id is not None
                )
            )
        )

    def objects(self, connection: Connection) -> set[str]:
        """Objects of the schema without invalid indices and constraints and disabled triggers."""
        listed = """
            SELECT c.relname FROM pg_class c LEFT JOIN pg_index x ON x.indexrelid = c.oid
            WHERE c.relnamespace = quote_ident(current_schema())::regnamespace AND x.indisvalid IS NOT FALSE
            UNION ALL SELECT conname FROM pg_constraint
            WHERE connamespace = quote_ident(current_schema())::regnamespace AND convalidated
            UNION ALL SELECT t.tgname FROM pg_trigger t JOIN pg_class c ON c.oid = t.tgrelid
            WHERE c.relnamespace = quote_ident(current_schema())::regnamespace AND t.tgenabled IN ('O', 'A')"""
        return set(connection.exec_driver_sql(listed).scalars())

    def altered(self, connection: Connection) -> set[str]:
        """Compares triggers, their functions and indices; PostgreSQL does not store the text of views."""
        made = postgresql_schema.definitions() | dict(_indices(connection.dialect))
        found = connection.exec_driver_sql("""
            SELECT t.tgname, pg_get_triggerdef(t.oid), current_schema() FROM pg_trigger t
            JOIN pg_class c ON c.oid = t.tgrelid
            WHERE NOT t.tgisinternal AND c.relnamespace = quote_ident(current_schema())::regnamespace
            UNION ALL SELECT proname, prosrc, current_schema() FROM pg_proc
            WHERE pronamespace = quote_ident(current_schema())::regnamespace
            UNION ALL SELECT indexname, indexdef, schemaname FROM pg_indexes WHERE schemaname = current_schema()""")
        return {
            name
            for name, sql, schema in found
            if name in made and _bare(sql.replace(f"{schema}.", "")) != _bare(made[name])
        }

    def damage(self, connection: Connection) -> Iterator[Problem]:
        """Dangling foreign keys; the server checks its files itself."""
        for child in models.Base.metadata.sorted_tables:
            for key in child.foreign_key_constraints:
                yield from _orphans(connection, child, key)


_DIALECTS: dict[str, Dialect] = {"sqlite": Sqlite(), "postgresql": Postgresql()}


def dialect_of(connection: Connection) -> Dialect:
    """The dialect of an open connection."""
    return _DIALECTS[connection.dialect.name]


def _indices(dialect: Any) -> Iterator[tuple[str, str]]:
    """The statements that create the models' indices, by name."""
    for model_table in models.Base.metadata.sorted_tables:
        for index in model_table.indexes:
            yield str(index.name), str(CreateIndex(index).compile(dialect=dialect))


def _on_one_line(sql: str) -> str:
    return " ".join(sql.split())


def _bare(sql: str) -> str:
    """Without what PostgreSQL adds: the index method, and brackets."""
    return _on_one_line(re.sub(r" USING btree|[()]", " ", sql))


def _overlaps(axes: str, lower_m: Sequence[float], upper_m: Sequence[float]) -> Iterator[Any]:
    for axis, lower, upper in zip(axes, lower_m, upper_m, strict=True):
        yield _BOX.c[f"min_{axis}"] <= float(upper)
        yield _BOX.c[f"max_{axis}"] >= float(lower)


def _plain(words: str) -> str:
    """Letters and digits only, so that neither database takes a part of a name for an operator."""
    return " ".join(re.findall(r"[^\W_]+", words))


def _orphans(connection: Connection, child: Table, key: Any) -> Iterator[Problem]:
    """Rows with a dangling foreign key; PostgreSQL refuses them unless its triggers were disabled."""
    parent = key.referred_table.alias("parent")
    pairs = [(element.parent, parent.c[element.column.name]) for element in key.elements]
    missing = select(child.primary_key.columns[0].label("row")).where(
        *(own.is_not(None) for own, _ in pairs),
        ~select(literal(1)).where(*(own == other for own, other in pairs)).correlate(child).exists(),
    )
    for (row,) in connection.execute(missing):
        yield Problem(child.name, str(row), f"points to a row of {key.referred_table.name} that does not exist")
