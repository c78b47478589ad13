"""Everything that differs between the two databases of a map, SQLite and PostgreSQL.

- `Database`: the place of a map; opens, locks, measures and removes it, and runs plain SQL.
- `Dialect`: SQL that differs; needs only an open connection (`dialect_of`).

Tables, migrations and all other SQL are common to both.
"""

from __future__ import annotations

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.databases.dialects import Dialect, dialect_of
from supermap_cli.memory.databases.interface import Database, Lock, SqlRows, SqlValue
from supermap_cli.memory.databases.postgresql_errors import is_shut_out
from supermap_cli.memory.databases.sqlite_errors import is_busy
from supermap_cli.memory.databases.waiting import Waiting

__all__ = ["Database", "Dialect", "Lock", "SqlRows", "SqlValue", "Waiting", "database_of", "dialect_of", "is_no_damage"]

_SQLITE_PREFIX = "sqlite:///"


def database_of(url: str, waiting: Waiting | None = None) -> Database:
    """The database of a path or URL; nothing is opened. Raises `MemoryStoreError` for other kinds.

    `waiting` says how long writers wait for other programs.
    """
    if "://" in url and not url.startswith(_SQLITE_PREFIX):
        scheme = url.partition("://")[0]
        if scheme.partition("+")[0] not in {"postgresql", "postgres"}:
            raise MemoryStoreError(
                f"databases of kind {scheme!r} cannot be used",
                where=scheme,
                cure="give a path, a sqlite:/// URL or a postgresql+psycopg:// URL",
            )
        from supermap_cli.memory.databases.postgresql import PostgresqlSchema  # noqa: PLC0415 - only where it is used

        return PostgresqlSchema.of(url, waiting)
    from supermap_cli.memory.databases.sqlite import SqliteFile  # noqa: PLC0415

    return SqliteFile.of(url.removeprefix(_SQLITE_PREFIX), waiting)


def is_no_damage(error: BaseException) -> bool:
    """Whether a statement failed only because another program holds a lock, or the connection was lost."""
    cause = getattr(error, "orig", None)
    return is_busy(cause) or is_shut_out(cause) or bool(getattr(error, "connection_invalidated", False))
