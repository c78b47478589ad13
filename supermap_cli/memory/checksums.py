"""Keeps the checksums of immutable rows (`supermap_schema.checksums`) right, and finds rows that they do not fit."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Iterator, Sequence
from typing import Any

from sqlalchemy import Connection, column, delete, insert, select, update

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.stored_values import parsed_texts
from supermap_cli.memory.values import Problem
from supermap_schema.checksums import IMMUTABLE, Sum, sums, sums_of
from supermap_schema.models import Checksum, Traversal

Names = dict[int, str]
"""Traversals' names by their ids."""


def take_off(connection: Connection, table: str, ids: Sequence[int], *, only_image: bool = False) -> None:
    """Take some rows (or their images alone) off the checksums of their traversals, before they are pruned.

    A row that was changed unnoticed is taken off as it is now: the checksum stays wrong.
    """
    for traversal_id, pruned in sums(
        connection, IMMUTABLE[table], column("id").in_(ids), only_image=only_image
    ).items():
        key = Checksum.traversal_id == traversal_id, Checksum.table_name == table
        stored = connection.execute(select(Checksum.row_count, Checksum.digest).where(*key)).one_or_none()
        rest = None if stored is None else _sum(stored)
        if rest is not None:
            rest -= pruned
            connection.execute(update(Checksum).where(*key).values(row_count=rest.rows, digest=rest.digest))


def changed_rows(connection: Connection, table: str) -> Iterator[Problem]:
    """Complete traversals whose immutable rows of a table are not those that their build stored."""
    names = _complete(connection)
    stored = _stored(connection, table)
    found = sums(connection, IMMUTABLE[table])
    for traversal_id, name in names.items():
        was, now = stored.get(traversal_id), found.get(traversal_id, Sum())
        if was is None:
            yield Problem("checksum", f"{name} {table}", "is missing or no checksum")
        elif was.rows != now.rows:
            what = f"has {now.rows} rows of this traversal, not the {was.rows} that were stored when it was built"
            yield Problem(table, name, what)
        elif was != now:
            yield Problem(table, name, "has rows of this traversal that were changed since it was built (checksum)")


def sums_without_rows(connection: Connection) -> Iterator[Problem]:
    """Checksums of a traversal that is still being built, or of a table that has none."""
    names = _complete(connection)
    for row in connection.execute(select(Checksum.traversal_id, Checksum.table_name).order_by(Checksum.traversal_id)):
        if row.traversal_id not in names or row.table_name not in IMMUTABLE:
            yield Problem("checksum", f"{row.traversal_id} {row.table_name}", "belongs to nothing that is complete")


def renew_sums(connection: Connection) -> tuple[str, ...]:
    """Make the checksums those of the rows as they are. Returns in words which ones were not.

    A traversal whose rows were not those that were built says so from then on, by a warning with the day.
    """
    names = _complete(connection)
    connection.execute(delete(Checksum).where(Checksum.traversal_id.not_in(list(names))))
    connection.execute(delete(Checksum).where(Checksum.table_name.not_in(list(IMMUTABLE))))
    done = []
    changed: dict[int, list[str]] = {}
    # The traversal's own row comes last: the warning is a part of it.
    for table, immutable in sorted(IMMUTABLE.items(), key=lambda item: item[0] == "traversal"):
        stored = _stored(connection, table)
        if table == "traversal":
            own = sums_of(connection, names, immutable)
            for traversal_id in names:
                if stored.get(traversal_id) != own[traversal_id]:
                    changed.setdefault(traversal_id, []).append(table)
            for traversal_id, tables in changed.items():
                _warn(connection, traversal_id, tables)
        for traversal_id, now in sums_of(connection, names, immutable).items():
            was = stored.get(traversal_id)
            if was == now:
                continue
            key = Checksum.traversal_id == traversal_id, Checksum.table_name == table
            connection.execute(delete(Checksum).where(*key))
            values = {"traversal_id": traversal_id, "table_name": table}
            connection.execute(insert(Checksum), {**values, "row_count": now.rows, "digest": now.digest})
            if table != "traversal":
                changed.setdefault(traversal_id, []).append(table)
            if table in changed[traversal_id]:
                why = "it was missing" if was is None else "its rows are not those that were built"
                done.append(f"checksum of {table} of traversal {names[traversal_id]} made anew: {why}")
    return tuple(done)


def _warn(connection: Connection, traversal_id: int, tables: Sequence[str]) -> None:
    """Keep for good that rows of a traversal are not sure to be those that were built."""
    today = dt.datetime.now(dt.UTC).date().isoformat()
    row = connection.execute(select(Traversal.warnings).where(Traversal.id == traversal_id)).scalar_one()
    try:
        warnings = parsed_texts(row, "warnings")
    except MemoryStoreError:  # a fault of its own
        return
    what = f"repaired on {today}: whether {', '.join(tables)} rows are as they were built cannot be verified since"
    if what not in warnings:
        values = json.dumps([*warnings, what])
        connection.execute(update(Traversal).where(Traversal.id == traversal_id).values(warnings=values))


def _complete(connection: Connection) -> Names:
    """The complete traversals, in the order of building."""
    complete = select(Traversal.id, Traversal.name).where(Traversal.status == "complete").order_by(Traversal.number)
    return {row.id: row.name for row in connection.execute(complete)}


def _stored(connection: Connection, table: str) -> dict[int, Sum]:
    """The stored sums of a table by traversal id, without those that are none."""
    columns = select(Checksum.traversal_id, Checksum.row_count, Checksum.digest)
    rows = connection.execute(columns.where(Checksum.table_name == table)).all()
    found = ((row.traversal_id, _sum(row)) for row in rows)
    return {traversal_id: each for traversal_id, each in found if each is not None}


def _sum(row: Any) -> Sum | None:
    """The stored sum; `None` for one that is damaged."""
    try:
        each = Sum(int(row.row_count), int(row.digest, 16))
    except (TypeError, ValueError):
        return None
    return each if each.digest == row.digest else None
