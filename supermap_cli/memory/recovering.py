"""Saves what can be read of a damaged map in an SQLite file into a new one (`supermap db recover`)."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Table
from sqlalchemy.exc import DatabaseError

from supermap_cli.errors import STUMBLES, MemoryStoreError, SupermapError
from supermap_cli.memory.checking import problems_of
from supermap_cli.memory.damaged_tables import DamagedTables
from supermap_cli.memory.databases.sqlite import SqliteFile
from supermap_cli.memory.databases.sqlite_errors import sqlite_error
from supermap_cli.memory.databases.sqlite_pages import mend_header
from supermap_cli.memory.mending import Row, drop_named, make_anew, make_spans, make_traversals, mended
from supermap_cli.memory.names import clean_text
from supermap_cli.memory.repairing import repair
from supermap_cli.temporary_folders import temporary_folder
from supermap_schema import SCHEMA_VERSION, models, sqlite
from supermap_schema.checksums import store_all_sums
from supermap_schema.upgrading import upgrade

_UNREADABLE = (sqlite3.Error, UnicodeDecodeError)
"""What SQLite's module raises over damage; the latter where the error itself quotes what is no text."""
_ROUNDS = 20
"""Rows whose loss breaks others are dropped in rounds; a chain of states and changes is sound long before."""


@dataclass(frozen=True)
class Recovered:
    """By table: rows that were saved, and rows that could not be read or contradict the others.

    `repaired` says in words what was made anew.
    """

    saved: dict[str, int]
    lost: dict[str, int]
    repaired: tuple[str, ...] = ()


def recover(url: str, out: Path) -> Recovered:
    """Copy what can be read of the damaged map at `url` into a new map at `out`; the damaged one is only read.

    Raises `MemoryStoreError` where `out` exists, where it is no SQLite file, or where nothing can be read.
    """
    source = SqliteFile.of(url.removeprefix("sqlite:///")).path
    if not source.is_file():
        raise MemoryStoreError("there is no map database", where=str(source), cure="name a file with --db")
    if out.exists() or out.is_symlink():
        raise MemoryStoreError("is there already", where=str(out), cure="name a new file with --out")
    if not out.absolute().parent.is_dir():
        raise MemoryStoreError("the folder does not exist", where=str(out), cure="make it, or change --out")
    with temporary_folder(".supermap-recover-", out.absolute().parent) as folder:
        copy, made = folder / "copy.db", SqliteFile(folder / "new.db")
        _copy(source, copy)
        try:
            found = _rebuilt(copy, made)
        except (sqlite3.Error, DatabaseError, UnicodeDecodeError) as error:
            raise sqlite_error(getattr(error, "orig", None) or error, str(source)) from error
        seen = found.saved.get("keyframe", 0) + found.saved.get("instance", 0)
        if not found.saved.get("traversal") or (not seen and any(found.lost.values())):
            raise MemoryStoreError(
                "nothing of the map can be read", where=str(source), cure="go back to a copy of it, or build anew"
            )
        made.path.rename(out)
    return found


def _copy(source: Path, copy: Path) -> None:
    """Copy a file and its log, with a header that SQLite takes, and move the log into the copy."""
    has_log = False
    for suffix in ("", "-wal"):
        beside = source.resolve().with_name(source.resolve().name + suffix)
        if beside.is_file():
            shutil.copyfile(beside, copy.with_name(copy.name + suffix))
            has_log = suffix == "-wal" and beside.stat().st_size > 0
    mend_header(copy, has_log=has_log)
    with suppress(*_UNREADABLE), closing(sqlite3.connect(copy)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
    mend_header(copy, has_log=False)


def _rebuilt(copy: Path, made: SqliteFile) -> Recovered:
    engine = made.writer_engine()
    saved: dict[str, int] = {}
    lost: dict[str, int] = {}
    try:
        with (
            closing(sqlite3.connect(copy)) as source,
            engine.connect().execution_options(writes=True) as target,
            target.begin(),
        ):
            source.row_factory = sqlite3.Row
            source.text_factory = _as_text
            damaged = DamagedTables(copy)
            upgrade(target)
            for name in sqlite.TRIGGERS:
                target.exec_driver_sql(f"DROP TRIGGER {name}")
            target.exec_driver_sql("PRAGMA defer_foreign_keys = ON")
            for table in reversed(models.Base.metadata.sorted_tables):  # traversals last: keyframes tell their spans
                if table.name == "checksum" and not _has(source, table):  # a map of an earlier version
                    continue
                saved[table.name], lost[table.name] = _copy_table(source, target, table, damaged)
            if "checksum" not in saved:
                store_all_sums(target)
            repaired = _made_sound(target, saved, lost)
            target.exec_driver_sql(f"PRAGMA user_version = {SCHEMA_VERSION}")
    finally:
        engine.dispose()  # the last connection moves all of the -wal into the file
    return Recovered(saved, lost, repaired)


def _has(source: sqlite3.Connection, table: Table) -> bool:
    try:
        return bool(source.execute("SELECT 1 FROM sqlite_master WHERE name = ?", (table.name,)).fetchall())
    except _UNREADABLE:
        return True


def _as_text(content: bytes) -> str:
    return content.decode("utf-8", "replace")


def _copy_table(
    source: sqlite3.Connection, target: Connection, table: Table, damaged: DamagedTables
) -> tuple[int, int]:
    """How many rows were copied, and how many were not."""
    saved, lost = 0, 0
    for row in _readable(source, table, damaged):
        values = None
        if row is not None:
            try:
                values = mended(table.name, {name: _text_cleaned(row.get(name)) for name in table.columns.keys()})  # noqa: SIM118
            except (SupermapError, *STUMBLES):
                values = None
        kept = values is not None and _inserted(target, table, values)
        saved, lost = saved + kept, lost + (not kept)
    return saved, lost


def _text_cleaned(value: Any) -> Any:
    return clean_text(value) if isinstance(value, str) else value


def _inserted(target: Connection, table: Table, values: Row) -> bool:
    given = {name: value for name, value in values.items() if value is not None}
    names = ", ".join(f'"{name}"' for name in given)
    marks = ", ".join("?" * len(given))
    statement = f'INSERT OR IGNORE INTO "{table.name}" ({names}) VALUES ({marks})'  # noqa: S608 - names of the schema
    try:
        return target.exec_driver_sql(statement, tuple(given.values())).rowcount == 1
    except Exception as error:
        if not isinstance(getattr(error, "orig", None), sqlite3.Error):
            raise
        return False


def _readable(source: sqlite3.Connection, table: Table, damaged: DamagedTables) -> Iterator[Row | None]:
    """The rows in the order of their row ids; `None` for a lost one.

    Where SQLite meets damage it is asked from the other end, and what lies between is read page by page.
    """
    seen: set[int] = set()
    failed = False
    for row in _walked(source, table):
        if row is None:
            failed = True
        else:
            seen.add(row["row id"])
            yield row
    if not failed:
        return
    lost = 0
    for row in damaged.rows(table):
        if row is None:
            lost += 1
        elif row["row id"] not in seen:
            seen.add(row["row id"])
            yield row
    yield from [None] * max(lost, 1)


def _walked(source: sqlite3.Connection, table: Table) -> Iterator[Row | None]:
    """The rows that SQLite reads from both ends of what it cannot; `None` in between."""
    last = yield from _walk(source, table, "ASC", None)
    if last is not None:
        yield None
        yield from _walk(source, table, "DESC", last)


def _walk(source: sqlite3.Connection, table: Table, order: str, beyond: int | None) -> Any:
    """Rows one after the other, upwards or downwards until those up to `beyond`.

    Returns the last row id before one that cannot be read, `None` if there was none.
    """
    at: int | None = None
    while True:
        rows, failed = _some_rows(source, table, order, at)
        for row in rows:
            row_id = row["row id"]
            if (beyond is not None and row_id <= beyond) or (at is not None and (row_id > at) is not (order == "ASC")):
                return None
            at = row_id
            yield row
        if failed and not rows:
            return -(1 << 63) if at is None else at
        if not rows:
            return None


def _some_rows(source: sqlite3.Connection, table: Table, order: str, at: int | None) -> tuple[list[Row], bool]:
    """The next rows, and whether one after them cannot be read."""
    after = "" if at is None else f"WHERE rowid {'>' if order == 'ASC' else '<'} {at}"
    query = f'SELECT rowid AS "row id", * FROM "{table.name}" NOT INDEXED {after} ORDER BY rowid {order} LIMIT 200'  # noqa: S608
    rows: list[Row] = []
    try:
        for row in source.execute(query):
            rows.append(dict(row))  # noqa: PERF401 - those before the one that fails are kept
    except _UNREADABLE:
        return rows, True
    return rows, False


def _made_sound(target: Connection, saved: dict[str, int], lost: dict[str, int]) -> tuple[str, ...]:
    """Mend and drop until every invariant holds. Returns in words what was made anew."""
    added = make_traversals(target)
    saved["traversal"], lost["traversal"] = saved["traversal"] + added, max(lost["traversal"] - added, 0)
    make_spans(target)
    repaired: tuple[str, ...] = ()
    for _ in range(_ROUNDS):
        for name in sqlite.TRIGGERS:
            target.exec_driver_sql(f"DROP TRIGGER IF EXISTS {name}")
        _drop_contradictions(target, saved, lost)
        make_anew(target, observations_lost=lost["observation"] > 0)
        repaired += tuple(done for done in repair(target) if done not in repaired)
        problems = problems_of(target)
        if not problems:
            break
        for name in sqlite.TRIGGERS:
            target.exec_driver_sql(f"DROP TRIGGER IF EXISTS {name}")
        dropped = drop_named(target, problems)
        for table, count in dropped.items():
            saved[table] -= count
            lost[table] += count
        if not any(dropped.values()):
            repaired += repair(target)
            break
    return repaired


def _drop_contradictions(target: Connection, saved: dict[str, int], lost: dict[str, int]) -> None:
    """Rows that point nowhere, and things without a state, until there are none."""
    for _ in range(20):
        dangling = target.exec_driver_sql("PRAGMA foreign_key_check").fetchall()
        for child, row_id, *_ in dangling:
            _drop(target, str(child), f"rowid = {row_id}", saved, lost)
        stateless = """merged_into IS NULL AND NOT EXISTS
            (SELECT 1 FROM state WHERE state.instance_number = instance.number)"""
        if not _drop(target, "instance", stateless, saved, lost) and not dangling:
            return


def _drop(target: Connection, table: str, where: str, saved: dict[str, int], lost: dict[str, int]) -> int:
    count = target.exec_driver_sql(f'DELETE FROM "{table}" WHERE {where}').rowcount  # noqa: S608 - names of the schema
    saved[table] -= count
    lost[table] += count
    return count
