"""Opens a map database."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.databases import Database, SqlRows, database_of
from supermap_cli.memory.store import MapStore
from supermap_schema import SCHEMA_VERSION


def open_store(url: str, *, create: bool = False, read_only: bool = False) -> MapStore:
    """Open the map database at a path or URL.

    A store that is not `read_only` holds the build lock until it is closed. With `create` the map may be missing: it is
    created at the first write, so that a build that fails earlier leaves nothing behind.

    Raises `MemoryStoreError`: not found, no map database, of another version, not writable, or locked by another build.
    """
    database = database_of(url)
    version = _known_version(database)
    if version is None and not create:
        raise _missing(database)
    if version is not None:
        _check_is_current(database, version)
    if read_only:
        return MapStore(database, None if version is None else database.reader_engine(), None)
    lock = database.take_lock()
    return MapStore(database, None if version is None else database.writer_engine(), lock)


def current_database(url: str) -> Database:
    """An existing map database of this program's version. Raises `MemoryStoreError` otherwise."""
    database = database_of(url)
    _check_is_current(database, _version(database))
    return database


@contextmanager
def read_sql(
    url: str, statement: str, prepare: Callable[[sqlite3.Connection], None] | None = None
) -> Iterator[SqlRows]:
    """Run one read-only SQL statement (see `Database.read_sql`)."""
    with current_database(url).read_sql(statement, prepare) as rows:
        yield rows


def upgrade_database(url: str) -> tuple[int, int]:
    """Upgrade a map database to this program's version in one transaction; returns the versions before and after.

    Raises `MemoryStoreError` as `open_store` does.
    """
    from supermap_schema.upgrading import upgrade  # noqa: PLC0415 - Alembic is needed only here

    database = database_of(url)
    before = _version(database)
    lock, engine = database.take_lock(), database.writer_engine()
    try:
        with engine.connect().execution_options(writes=True) as connection, connection.begin():
            upgrade(connection)
    finally:
        engine.dispose()
        lock.release()
    return before, _version(database)


def _version(database: Database) -> int:
    version = _known_version(database)
    if version is None:
        raise _missing(database)
    return version


def _known_version(database: Database) -> int | None:
    version = database.stored_version()
    if version is not None and version > SCHEMA_VERSION:
        raise MemoryStoreError(
            f"the map database has the newer version {version}, this program knows {SCHEMA_VERSION}",
            where=database.where,
            cure="install a newer supermap-cli (an older database is lifted by `supermap db upgrade`)",
        )
    return version


def _check_is_current(database: Database, version: int) -> None:
    if version < SCHEMA_VERSION:
        raise MemoryStoreError(
            f"the map database has the older version {version}, this program needs {SCHEMA_VERSION}",
            where=database.where,
            cure="run `supermap db upgrade`",
        )


def _missing(database: Database) -> MemoryStoreError:
    return MemoryStoreError("there is no map database", where=database.where, cure="make one with `supermap build`")
