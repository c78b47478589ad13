"""A map in an SQLite file."""

from __future__ import annotations

import os
import shutil
import sqlite3
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.exc import DatabaseError, OperationalError

from supermap_cli.errors import MemoryStoreError
from supermap_cli.input_files import check_readable
from supermap_cli.memory.databases.interface import SqlRows
from supermap_cli.memory.databases.sqlite_errors import gone, is_busy, sqlite_error
from supermap_cli.memory.databases.sqlite_lock import FileLock
from supermap_cli.memory.databases.sqlite_sql import read_rows
from supermap_cli.memory.databases.waiting import ATTEMPT_S, Waiting
from supermap_schema import models, sqlite

_IMMUTABLE = "immutable=1"
_TABLES = tuple(table.name for table in models.Base.metadata.sorted_tables)
"""A view under one of these names could do anything, and never end."""
_FILE_MAGIC = b"SQLite format 3\x00"


@dataclass(frozen=True)
class SqliteFile:
    """The file at `path`."""

    path: Path
    waiting: Waiting = field(default_factory=Waiting)

    @classmethod
    def of(cls, path: str, waiting: Waiting | None = None) -> SqliteFile:
        """The file at a path. Raises `MemoryStoreError` for an empty path."""
        if not path:
            raise MemoryStoreError("the database's path is empty", cure="give a path with --db")
        return cls(Path(path), waiting or Waiting())

    @property
    def where(self) -> str:
        """The path as it was given."""
        return str(self.path)

    @property
    def identity(self) -> str:
        """The absolute path with links resolved."""
        return str(self.path.resolve())

    @property
    def file(self) -> Path:
        """The path as it was given."""
        return self.path

    def is_stored(self) -> bool:
        """Whether the file exists and holds anything."""
        return not self._is_missing()

    def stored_version(self) -> int | None:
        """`PRAGMA user_version` of a map; `None` for a file without tables, left by a build that was killed early."""
        if self._is_missing():
            return None
        try:
            with closing(self.connect_read_only()) as connection:
                application_id, version = (
                    int(connection.execute(f"PRAGMA {name}").fetchone()[0])
                    for name in ("application_id", "user_version")
                )
                kinds = dict(connection.execute("SELECT name, type FROM sqlite_master").fetchall())
        except (sqlite3.Error, UnicodeDecodeError) as error:
            self._check_is_sqlite()
            raise self._unreadable(error) from error
        if application_id == 0 and not kinds:
            return None
        if application_id != sqlite.APPLICATION_ID:
            raise MemoryStoreError(
                "a SQLite database, but no SuperMap map", where=self.where, cure="choose another file with --db"
            )
        if not_tables := [name for name in _TABLES if kinds.get(name, "table") != "table"]:
            raise MemoryStoreError(
                f"the map is damaged: {not_tables[0]} is a {kinds[not_tables[0]]}, no table",
                where=self.where,
                cure="`supermap db recover --out NEW.db` saves what can be saved",
            )
        return version

    def take_lock(self) -> FileLock:
        """A lock file beside the database."""
        if not self.path.absolute().parent.is_dir():
            raise MemoryStoreError(
                "the folder of the map database does not exist",
                where=self.where,
                cure="make the folder, or change --db",
            )
        if not self._is_missing() and not os.access(self.path, os.W_OK):
            raise MemoryStoreError(
                "the map database is not writable", where=self.where, cure="check the file's rights, or change --db"
            )
        lock = FileLock(self.path)
        lock.acquire()
        return lock

    def writer_engine(self) -> Engine:
        """WAL mode; transactions that write begin as IMMEDIATE, so that none fails half-way for a lock."""
        exists = not self._is_missing()

        def connect() -> sqlite3.Connection:
            nonlocal exists
            connection = self._connect_writer(create=not exists)
            exists = True  # from now on a missing file is one that was taken away
            return connection

        engine = create_engine("sqlite://", creator=connect)

        def begin(connection: Connection) -> None:
            if connection.get_execution_options().get("writes"):
                self._patiently(lambda seconds: _begin_writing(connection, seconds))
            else:
                connection.exec_driver_sql("BEGIN")

        event.listen(engine, "begin", begin)
        return engine

    def _patiently(self, action: Callable[[float], None]) -> None:
        """Do something that another program's lock can hinder, until it is done or the waiting is over.

        The action is given the seconds that one attempt may take. Raises `MemoryStoreError`.
        """
        deadline_s, told = time.monotonic() + self.waiting.limit_s, False
        while True:
            left_s = max(deadline_s - time.monotonic(), 0.0)
            try:
                action(min(ATTEMPT_S, left_s))
            except sqlite3.OperationalError as error:
                if not is_busy(error) or time.monotonic() >= deadline_s:
                    raise sqlite_error(error, self.where) from error
            else:
                return
            if not told:
                self.waiting.tell_about(self.where)
            told = True

    def reader_engine(self) -> Engine:
        """Query-only connections."""
        engine = create_engine("sqlite://", creator=self.connect_read_only)
        event.listen(engine, "begin", lambda connection: connection.exec_driver_sql("BEGIN"))
        return engine

    def prepare(self, connection: Connection) -> None:
        """Nothing to do: the file is created with its first table."""

    def remove(self) -> None:
        """Delete the file and SQLite's files beside it."""
        for suffix in ("", "-wal", "-shm", "-journal"):
            self._beside(suffix).unlink(missing_ok=True)

    def size_bytes(self, connection: Connection) -> int:
        """Size of the file, without the WAL of a running build."""
        return self.path.stat().st_size

    def release_free_pages(self) -> None:
        """Truncate the file by its free pages; if that fails, the next build reuses them."""
        with suppress(sqlite3.OperationalError, MemoryStoreError), closing(self._connect_writer()) as connection:
            connection.executescript("PRAGMA incremental_vacuum")  # `execute` takes one step, which is one page

    def vacuum(self, engine: Engine) -> None:
        """VACUUM: SQLite writes a compact copy of the map, and then truncates the file.

        While a reader still uses an older snapshot, the file is truncated when the next build or the last reader ends.
        """
        needed = self.path.stat().st_size
        free = shutil.disk_usage(self.path.absolute().parent).free
        no_room = MemoryStoreError(
            f"the map cannot be made smaller: that takes up to {needed / 1e6:.0f} MB beside it, and as much where "
            f"SQLite keeps temporary files ($SQLITE_TMPDIR); {free / 1e6:.0f} MB are free beside it",
            where=self.where,
            cure="free space and try again; what was given up stays so",
        )
        if free < needed:
            raise no_room
        with closing(self._connect_writer()) as connection:
            try:
                connection.execute("VACUUM")
                connection.execute("PRAGMA busy_timeout = 500")  # a reader that takes longer is not waited for
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            except sqlite3.OperationalError as error:
                raise (no_room if "full" in str(error) else self._refusal(error)) from error

    def _refusal(self, error: sqlite3.Error) -> MemoryStoreError:
        if is_busy(error):
            return sqlite_error(error, self.where)
        return MemoryStoreError(f"the map cannot be made smaller: {error}", where=self.where, cure="try again later")

    def failure(self, error: DatabaseError) -> MemoryStoreError:
        """A full disk, a damaged file, another program that writes."""
        return sqlite_error(error.orig or error, self.where)

    def read_sql(
        self, statement: str, prepare: Callable[[sqlite3.Connection], None] | None = None, limit_s: float = 0.0
    ) -> AbstractContextManager[SqlRows]:
        """Run one read-only statement."""
        return read_rows(self.connect_read_only, statement, prepare, limit_s)

    def connect_read_only(self) -> sqlite3.Connection:
        """A connection that never writes; it also works on a database in a read-only folder.

        A writable file is opened for writing all the same, with `query_only`, because the last such connection to close
        removes the WAL files.
        """
        file = self.path.resolve()
        if os.access(file, os.W_OK) and os.access(file.parent, os.W_OK):
            mode = "mode=rw"
        elif self._beside("-wal").exists():
            mode = "mode=ro"
        else:
            mode = _IMMUTABLE
        try:
            return self._connect_reader(mode)
        except sqlite3.OperationalError as error:
            if not _no_room(error) or mode == _IMMUTABLE or self._beside("-wal").exists():
                raise
            return self._connect_reader(_IMMUTABLE)  # no space for SQLite's shared memory, and no writer

    def _connect_reader(self, mode: str) -> sqlite3.Connection:
        connection = sqlite3.connect(
            f"file:{quote(str(self.path.resolve()))}?{mode}", uri=True, check_same_thread=False
        )
        connection.isolation_level = None
        try:
            for pragma in sqlite.CONNECTION_PRAGMAS + sqlite.READER_PRAGMAS:
                connection.execute(pragma)
            connection.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchone()
        except sqlite3.Error:
            connection.close()
            raise
        return connection

    def _unreadable(self, error: Exception) -> MemoryStoreError:
        """The error for a damaged file, or for a WAL of a killed build that cannot be recovered for lack of space."""
        if _no_room(error) and self._beside("-wal").exists():
            return MemoryStoreError(
                "the map database has a log (-wal) that cannot be read where it lies",
                where=self.where,
                cure="free space on its disk, or copy it with its -wal to where there is some",
            )
        return sqlite_error(error, self.where)

    def _beside(self, suffix: str) -> Path:
        """One of SQLite's files beside the database, with links resolved."""
        file = self.path.resolve()
        return file.with_name(file.name + suffix)

    def _connect_writer(self, *, create: bool = False) -> sqlite3.Connection:
        mode = "rwc" if create else "rw"
        try:
            connection = sqlite3.connect(
                f"file:{quote(str(self.path.resolve()))}?mode={mode}", uri=True, check_same_thread=False
            )
        except sqlite3.OperationalError as error:
            raise (sqlite_error(error, self.where) if create or self.path.exists() else gone(self.where)) from error
        connection.isolation_level = None
        try:
            self._patiently(lambda seconds: _prepare_writer(connection, seconds))
        except BaseException:
            connection.close()
            raise
        return connection

    def _is_missing(self) -> bool:
        check_readable(self.path, MemoryStoreError, what="a map database with --db", folder=True)
        if self.path.is_dir():
            raise MemoryStoreError("a folder, not a map database", where=self.where, cure="name a file with --db")
        if not self.path.exists():
            return True
        if not self.path.is_file():
            raise MemoryStoreError("no regular file", where=self.where, cure="name a file with --db")
        return self.path.stat().st_size == 0

    def _check_is_sqlite(self) -> None:
        try:
            with self.path.open("rb") as file:
                magic = file.read(len(_FILE_MAGIC))
        except OSError as error:
            raise MemoryStoreError(
                f"the map database cannot be read: {error.strerror}", where=self.where, cure="check the file's rights"
            ) from error
        if magic != _FILE_MAGIC:
            raise MemoryStoreError("no map database", where=self.where, cure="choose another file with --db")


def _timeout(seconds: float) -> str:
    return f"PRAGMA busy_timeout = {round(seconds * 1000)}"


def _begin_writing(connection: Connection, seconds: float) -> None:
    connection.exec_driver_sql(_timeout(seconds))
    try:
        connection.exec_driver_sql("BEGIN IMMEDIATE")
    except OperationalError as error:
        raise (error.orig or error) from error
    connection.exec_driver_sql(sqlite.BUSY_TIMEOUT)


def _prepare_writer(connection: sqlite3.Connection, seconds: float) -> None:
    """The pragmas of a writer; those that are stored in the file need its write lock, and stay as they are there."""
    for pragma in sqlite.CONNECTION_PRAGMAS:
        connection.execute(pragma)
    connection.execute(_timeout(seconds))
    stored = connection.execute("PRAGMA page_count").fetchone()[0] > 0
    for pragma in sqlite.WRITER_PRAGMAS:
        if not (stored and "auto_vacuum" in pragma):
            connection.execute(pragma)
    connection.execute(sqlite.BUSY_TIMEOUT)


def _no_room(error: Exception) -> bool:
    """Whether SQLite could not create or write a file."""
    return getattr(error, "sqlite_errorname", "").startswith(("SQLITE_IOERR", "SQLITE_FULL", "SQLITE_CANTOPEN"))
