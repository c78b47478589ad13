"""What every database of a map must be able to do."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

from sqlalchemy import Connection, Engine
from sqlalchemy.exc import DatabaseError

from supermap_cli.errors import MemoryStoreError

SqlValue = int | float | str | bytes | None


@dataclass(frozen=True)
class SqlRows:
    """The answer to one statement; its rows are read from the database while they are taken."""

    columns: tuple[str, ...]
    rows: Iterator[tuple[SqlValue, ...]]


class Lock(Protocol):
    """The right to write, held by one process at a time; the system gives it back when that process dies."""

    def check(self, connection: Connection) -> None:
        """Raise `MemoryStoreError` if the lock was lost: another build may be writing."""

    def release(self) -> None:
        """Give it back; does nothing where it is not held."""


class Database(Protocol):
    """A place where a map is, or may be made."""

    @property
    def where(self) -> str:
        """The place for people: a path, or a URL without its password."""

    @property
    def identity(self) -> str:
        """The same for the same place, however it was written."""

    def stored_version(self) -> int | None:
        """The version of the map that is there; `None` where nothing is. Raises `MemoryStoreError` for anything else,
        and for what cannot be reached or read.
        """

    def take_lock(self) -> Lock:
        """Become the one who writes. Raises `MemoryStoreError` if another is, or if nothing can be written."""

    def writer_engine(self) -> Engine:
        """For the one who holds the lock; a transaction that writes has the execution option `writes`."""

    def reader_engine(self) -> Engine:
        """For everybody else: every transaction sees one moment, changes nothing, and blocks nobody."""

    def prepare(self, connection: Connection) -> None:
        """Make room for a new map, before its tables are made."""

    def remove(self) -> None:
        """Take a map away that was made in vain; no connection is open."""

    def size_bytes(self, connection: Connection) -> int:
        """What the map takes on the disk."""

    def release_free_pages(self) -> None:
        """Give back what a build freed when it came to its end, as far as that costs no more than what was freed."""

    def vacuum(self, engine: Engine) -> None:
        """Give back what deleted rows took, as far as that blocks no reader; by the writer's engine, which holds no
        transaction. Raises `MemoryStoreError` where there is no room for it.
        """

    def failure(self, error: DatabaseError) -> MemoryStoreError:
        """An error of the database that a user can mend, as one that says how."""

    def read_sql(
        self, statement: str, prepare: Callable[[sqlite3.Connection], None] | None = None
    ) -> AbstractContextManager[SqlRows]:
        """Run one statement that only reads; `prepare` may add functions to an SQLite connection before.

        Raises `QueryError`, with the database's message, for a statement that is wrong, that would write, or that is
        more than one; while rows are taken, too.
        """
