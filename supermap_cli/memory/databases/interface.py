"""The interface of the databases that can hold a map."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from sqlalchemy import Connection, Engine
from sqlalchemy.exc import DatabaseError

from supermap_cli.errors import MemoryStoreError

SqlValue = int | float | str | bytes | None


@dataclass(frozen=True)
class SqlRows:
    """The result of one statement; its rows are read from the database while they are iterated over."""

    columns: tuple[str, ...]
    rows: Iterator[tuple[SqlValue, ...]]


class Lock(Protocol):
    """The write lock, held by one process at a time and released by the system when that process dies."""

    def check(self, connection: Connection) -> None:
        """Raise `MemoryStoreError` if the lock was lost, so that another build may be writing."""

    def check_place(self) -> None:
        """Raise `MemoryStoreError` if the database is no longer where it was when the lock was taken."""

    def leave_file(self) -> None:
        """The database is about to be removed by the holder, who may create it anew."""

    def release(self) -> None:
        """Release the lock; does nothing if it is not held."""


class Database(Protocol):
    """A path or URL where a map exists or may be created."""

    @property
    def where(self) -> str:
        """The path, or the URL without its password, for messages."""

    @property
    def identity(self) -> str:
        """Equal for equal places, however they are written."""

    @property
    def file(self) -> Path | None:
        """The SQLite file; `None` for a database on a server."""

    def is_stored(self) -> bool:
        """Whether there is a file to be locked. Raises `MemoryStoreError` for a path that is no file's."""

    def stored_version(self) -> int | None:
        """The schema version of the map; `None` if there is none.

        Raises `MemoryStoreError` if there is something else, or if it cannot be reached or read.
        """

    def take_lock(self) -> Lock:
        """Take the write lock. Raises `MemoryStoreError` if another process holds it, or if nothing can be written."""

    def writer_engine(self) -> Engine:
        """For the holder of the lock; a transaction that writes has the execution option `writes`."""

    def reader_engine(self) -> Engine:
        """For readers: every transaction reads one snapshot, writes nothing, and blocks no other."""

    def prepare(self, connection: Connection) -> None:
        """Prepare the place for a new map before its tables are created."""

    def remove(self) -> None:
        """Remove a map that got no traversal; no connection is open."""

    def size_bytes(self, connection: Connection) -> int:
        """The size of the map on disk."""

    def release_free_pages(self) -> None:
        """Release the space of rows that a build deleted at its end, without rewriting the map."""

    def vacuum(self, engine: Engine) -> None:
        """Release the space of deleted rows, as far as that blocks no reader; the engine holds no transaction.

        Raises `MemoryStoreError` if there is not enough free space to do so.
        """

    def failure(self, error: DatabaseError) -> MemoryStoreError:
        """A `MemoryStoreError`, with a cure, for an error of the database."""

    def read_sql(
        self, statement: str, prepare: Callable[[sqlite3.Connection], None] | None = None, limit_s: float = 0.0
    ) -> AbstractContextManager[SqlRows]:
        """Run one read-only statement; `prepare` may add functions to an SQLite connection first.

        `limit_s` is how many seconds it may compute, 0 = any.

        Raises `QueryError`, with the database's message, for a statement that is wrong, that would write, or that is
        more than one; also while rows are iterated over.
        """
