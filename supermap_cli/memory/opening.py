"""Opens a map database."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from sqlalchemy.exc import DatabaseError

from supermap_cli.errors import MemoryStoreError, QueryError
from supermap_cli.memory.databases import Database, SqlRows, Waiting, database_of
from supermap_cli.memory.store import MapStore
from supermap_schema import SCHEMA_VERSION

OPENED: dict[str, None] = {}
"""Paths and URLs of the maps that this process has opened, in their order."""


def open_store(url: str, *, create: bool = False, read_only: bool = False, waiting: Waiting | None = None) -> MapStore:
    """Open the map database at a path or URL.

    A store that is not `read_only` holds the build lock until it is closed. With `create` the map may be missing: it is
    created at the first write, so that a build that fails earlier leaves nothing behind. `waiting` says how long to
    wait while another program writes.

    Raises `MemoryStoreError`: not found, no map database, of another version, not writable, or locked by another build.
    """
    database = database_of(url, waiting)
    OPENED[url] = None
    # A file that is there is locked before it is opened: SQLite must not open one that is written under another name.
    lock = database.take_lock() if not read_only and database.is_stored() else None
    try:
        version = _known_version(database)
        _check_usable(database, version, create=create)
        if read_only:
            return MapStore(database, None if version is None else database.reader_engine(), None)
        lock = lock or database.take_lock()
        return MapStore(database, None if version is None else database.writer_engine(), lock)
    except BaseException:
        if lock is not None:
            lock.release()
        raise


def _check_usable(database: Database, version: int | None, *, create: bool) -> None:
    if version is not None:
        _check_is_current(database, version)
    elif not create:
        raise _missing(database)


def current_database(url: str) -> Database:
    """An existing map database of this program's version. Raises `MemoryStoreError` otherwise."""
    database = database_of(url)
    _check_is_current(database, _version(database))
    return database


@contextmanager
def read_sql(
    url: str, statement: str, prepare: Callable[[sqlite3.Connection], None] | None = None, limit_s: float = 0.0
) -> Iterator[SqlRows]:
    """Run one read-only SQL statement (see `Database.read_sql`)."""
    if not statement.isprintable() and any(_is_no_text(letter) for letter in statement):
        raise QueryError("the SQL statement holds what is no text", cure="give it in UTF-8, without NUL")
    with current_database(url).read_sql(statement, prepare, limit_s) as rows:
        yield rows


def _is_no_text(letter: str) -> bool:
    """NUL, and what stands for bytes that are no UTF-8."""
    return letter == "\0" or "\ud800" <= letter <= "\udfff"


def upgrade_database(url: str, waiting: Waiting | None = None) -> tuple[int, int]:
    """Upgrade a map database to this program's version in one transaction; returns the versions before and after.

    Raises `MemoryStoreError` as `open_store` does.
    """
    from supermap_schema.upgrading import upgrade  # noqa: PLC0415 - Alembic is needed only here

    database = database_of(url, waiting)
    before = _version(database)
    lock, engine = database.take_lock(), database.writer_engine()
    try:
        with engine.connect().execution_options(writes=True) as connection, connection.begin():
            lock.check(connection)
            upgrade(connection)
    except DatabaseError as error:
        raise database.failure(error) from error
    finally:
        engine.dispose()
        lock.release()
    return before, _version(database)


def mend_edges(url: str, waiting: Waiting | None = None) -> int:
    """End the spatial edges that went on although an end had left its place, as builds of older versions wrote them;
    returns how many there were. Raises `MemoryStoreError` as `open_store` does.
    """
    database = database_of(url, waiting)
    _check_is_current(database, _version(database))
    lock, engine = database.take_lock(), database.writer_engine()
    try:
        with engine.connect().execution_options(writes=True) as connection, connection.begin():
            lock.check(connection)
            from supermap_cli.memory.stale_edges import end_stale_edges  # noqa: PLC0415 - needed only here

            return end_stale_edges(connection)
    except DatabaseError as error:
        raise database.failure(error) from error
    finally:
        engine.dispose()
        lock.release()


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
