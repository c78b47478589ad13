"""Opens a map database, and says clearly why one cannot be opened."""

from __future__ import annotations

import os
import sqlite3
from pathlib import Path
from urllib.parse import quote

from sqlalchemy import Connection, Engine, create_engine, event

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.lock import BuildLock
from supermap_cli.memory.store import MapStore
from supermap_schema import SCHEMA_VERSION, sqlite

_SQLITE_PREFIX = "sqlite:///"
_FILE_MAGIC = b"SQLite format 3\x00"


def open_store(url: str, *, create: bool = False, read_only: bool = False) -> MapStore:
    """Open the map database at a path or a ``sqlite:///`` URL.

    A store that is not `read_only` holds the build lock until it is closed. With `create` the file may be missing;
    it is made at the first write, so that a build that fails before leaves nothing behind.

    Raises `MemoryStoreError`: not found, no map database, of another version, not writable, or locked by another build.
    """
    path = database_path(url)
    missing = _is_missing(path)
    if missing and not create:
        raise MemoryStoreError("there is no map database", where=str(path), cure="make one with `supermap build`")
    if not missing:
        check_is_current(path)
    if read_only:
        return MapStore(path, None if missing else _reader_engine(path), None, None)
    lock = _take_lock(path, missing=missing)
    return MapStore(path, None if missing else _writer_engine(path), lambda: _writer_engine(path), lock)


def current_database(url: str) -> Path:
    """The file of a map database that is there and has this program's version. Raises `MemoryStoreError` otherwise."""
    path = _existing(url)
    check_is_current(path)
    return path


def upgrade_database(url: str) -> tuple[int, int]:
    """Bring a map database to this program's version, in one transaction; returns the versions before and after.

    Raises `MemoryStoreError` as `open_store` does.
    """
    from supermap_schema.upgrading import upgrade  # noqa: PLC0415 - Alembic is needed only here

    path = _existing(url)
    before = stored_version(path)
    lock, engine = _take_lock(path, missing=False), _writer_engine(path)
    try:
        with engine.connect().execution_options(writes=True) as connection, connection.begin():
            upgrade(connection)
    finally:
        engine.dispose()
        lock.release()
    return before, stored_version(path)


def database_path(url: str) -> Path:
    """The file a path or URL means. Raises `MemoryStoreError` for other databases than SQLite."""
    if url.startswith(_SQLITE_PREFIX):
        url = url.removeprefix(_SQLITE_PREFIX)
    elif "://" in url:
        scheme = url.partition("://")[0]
        raise MemoryStoreError(
            f"databases of kind {scheme!r} cannot be used", where=scheme, cure="give a path or a sqlite:/// URL"
        )
    if not url:
        raise MemoryStoreError("the database's path is empty", cure="give a path with --db")
    return Path(url)


def check_is_current(path: Path) -> None:
    """Raise `MemoryStoreError` unless the file is a map database of this program's version."""
    version = stored_version(path)
    if version < SCHEMA_VERSION:
        raise MemoryStoreError(
            f"the map database has the older version {version}, this program needs {SCHEMA_VERSION}",
            where=str(path),
            cure="run `supermap db upgrade`",
        )


def stored_version(path: Path) -> int:
    """The version of a map database. Raises `MemoryStoreError` for any other file, and for a newer version."""
    _check_is_sqlite(path)
    try:
        connection = connect_read_only(path)
        try:
            application_id, version = (
                int(connection.execute(f"PRAGMA {name}").fetchone()[0]) for name in ("application_id", "user_version")
            )
        finally:
            connection.close()
    except sqlite3.Error as error:
        raise MemoryStoreError(
            f"the map database cannot be read: {error}", where=str(path), cure="restore it from a copy"
        ) from error
    if application_id != sqlite.APPLICATION_ID:
        raise MemoryStoreError(
            "a SQLite database, but no SuperMap map", where=str(path), cure="choose another file with --db"
        )
    if version > SCHEMA_VERSION:
        raise MemoryStoreError(
            f"the map database has the newer version {version}, this program knows {SCHEMA_VERSION}",
            where=str(path),
            cure="install a newer supermap-cli (an older database is lifted by `supermap db upgrade`)",
        )
    return version


def connect_read_only(path: Path) -> sqlite3.Connection:
    """A connection that never writes; it works on a database in a read-only folder, too.

    Where folder and file are writable it is opened for writing all the same, with `query_only`, because the last such
    connection to close tidies the WAL files away.
    """
    location = f"file:{quote(str(path.absolute()))}"
    if os.access(path, os.W_OK) and os.access(path.absolute().parent, os.W_OK):
        mode = "mode=rw"
    elif path.with_name(path.name + "-wal").exists():
        mode = "mode=ro"
    else:
        mode = "immutable=1"
    connection = sqlite3.connect(f"{location}?{mode}", uri=True, check_same_thread=False)
    connection.isolation_level = None
    for pragma in sqlite.CONNECTION_PRAGMAS + sqlite.READER_PRAGMAS:
        connection.execute(pragma)
    return connection


def _existing(url: str) -> Path:
    path = database_path(url)
    if _is_missing(path):
        raise MemoryStoreError("there is no map database", where=str(path), cure="make one with `supermap build`")
    return path


def _is_missing(path: Path) -> bool:
    if path.is_dir():
        raise MemoryStoreError("a folder, not a map database", where=str(path), cure="name a file with --db")
    if not path.exists():
        return True
    if not path.is_file():
        raise MemoryStoreError("no regular file", where=str(path), cure="name a file with --db")
    return path.stat().st_size == 0


def _check_is_sqlite(path: Path) -> None:
    try:
        with path.open("rb") as file:
            magic = file.read(len(_FILE_MAGIC))
    except OSError as error:
        raise MemoryStoreError(
            f"the map database cannot be read: {error.strerror}", where=str(path), cure="check the file's rights"
        ) from error
    if magic != _FILE_MAGIC:
        raise MemoryStoreError("no map database", where=str(path), cure="choose another file with --db")


def _take_lock(path: Path, *, missing: bool) -> BuildLock:
    if not path.absolute().parent.is_dir():
        raise MemoryStoreError(
            "the folder of the map database does not exist", where=str(path), cure="make the folder, or change --db"
        )
    if not missing and not os.access(path, os.W_OK):
        raise MemoryStoreError(
            "the map database is not writable", where=str(path), cure="check the file's rights, or change --db"
        )
    lock = BuildLock(path)
    lock.acquire()
    return lock


def _reader_engine(path: Path) -> Engine:
    engine = create_engine("sqlite://", creator=lambda: connect_read_only(path))
    event.listen(engine, "begin", lambda connection: connection.exec_driver_sql("BEGIN"))
    return engine


def _writer_engine(path: Path) -> Engine:
    engine = create_engine("sqlite://", creator=lambda: _connect_writer(path))

    def begin(connection: Connection) -> None:
        connection.exec_driver_sql("BEGIN IMMEDIATE" if connection.get_execution_options().get("writes") else "BEGIN")

    event.listen(engine, "begin", begin)
    return engine


def _connect_writer(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(path, check_same_thread=False)
    connection.isolation_level = None
    for pragma in sqlite.CONNECTION_PRAGMAS + sqlite.WRITER_PRAGMAS:
        connection.execute(pragma)
    return connection
