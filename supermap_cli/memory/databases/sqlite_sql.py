"""Read-only SQL on a map in SQLite."""

from __future__ import annotations

import math
import sqlite3
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager

from supermap_cli.errors import QueryError
from supermap_cli.memory.databases.interface import SqlRows, SqlValue

_READING_PRAGMAS = frozenset(
    (
        *("table_list", "table_info", "table_xinfo", "index_list", "index_info", "index_xinfo", "foreign_key_list"),
        *("function_list", "collation_list", "compile_options", "application_id", "user_version"),
        "data_version",  # FTS5 asks for it in every search
    )
)
_CURES = {
    "no such column": "`PRAGMA table_info(NAME)` lists the columns of a table or view",
    "no such function": "plugins may add SQL functions, see `supermap plugins`",
    "readonly": "this command only reads: give one SELECT",
    "not authorized": "this command only reads: give one SELECT",
    "one statement": "give one SELECT",
    "disk image": "see `supermap db check`",
    "locked": "another program writes: try again when it has ended",
}
"""Part of SQLite's message -> cure."""


@contextmanager
def read_rows(
    connect: Callable[[], sqlite3.Connection],
    statement: str,
    prepare: Callable[[sqlite3.Connection], None] | None = None,
    limit_s: float = 0.0,
) -> Iterator[SqlRows]:
    """Run one statement (see `Database.read_sql`); what `prepare` changes of the connection's rights is undone."""
    with closing(connect()) as connection:
        if prepare is not None:
            connection.set_authorizer(_authorize)  # what a plugin adds must not lift that nothing is written
            prepare(connection)
            connection.set_authorizer(None)
            connection.row_factory, connection.text_factory, connection.isolation_level = None, str, None
        connection.execute("PRAGMA query_only = ON")
        connection.set_authorizer(_authorize)
        deadline_s = time.thread_time() + limit_s if limit_s else math.inf
        connection.set_progress_handler(lambda: time.thread_time() > deadline_s, 100_000)  # lets Ctrl-C through, too
        with _refusals_as_query_errors(connection, deadline_s):
            cursor = connection.execute(statement)
        if cursor.description is None:
            raise QueryError("the SQL statement returns no rows", cure="give one SELECT")
        with closing(_rows(cursor, deadline_s)) as rows:
            yield SqlRows(tuple(column[0] for column in cursor.description), rows)


def _authorize(action: int, first: str | None, *_: str | None) -> int:
    """Refuse what `query_only` allows: other files (ATTACH, VACUUM INTO), and pragmas that change something."""
    if action in {sqlite3.SQLITE_ATTACH, sqlite3.SQLITE_DETACH}:
        return sqlite3.SQLITE_DENY
    if action == sqlite3.SQLITE_PRAGMA and str(first).lower() not in _READING_PRAGMAS:
        return sqlite3.SQLITE_DENY
    return sqlite3.SQLITE_OK


def _rows(cursor: sqlite3.Cursor, deadline_s: float) -> Generator[tuple[SqlValue, ...], None, None]:
    with _refusals_as_query_errors(cursor.connection, deadline_s):
        yield from cursor


@contextmanager
def _refusals_as_query_errors(connection: sqlite3.Connection, deadline_s: float = math.inf) -> Iterator[None]:
    try:
        yield
    except UnicodeEncodeError as error:
        raise QueryError("the SQL statement holds what is no text", cure="give it in UTF-8") from error
    except UnicodeDecodeError as error:
        raise QueryError("the map holds what is no text", cure="see `supermap db check`") from error
    except (sqlite3.Error, sqlite3.Warning) as error:
        message = str(error)
        if message == "interrupted" and time.thread_time() > deadline_s:
            cure = "--timeout SECONDS allows more, 0 any; a view that asks itself never ends"
            raise QueryError("the SQL statement takes too long", cure=cure) from error
        if message == "interrupted":
            raise KeyboardInterrupt from error
        cures = (cure for part, cure in _CURES.items() if part in message)
        cure = _names(connection) if "no such table" in message else next(cures, "see `supermap db sql --help`")
        raise QueryError(f"SQLite says: {message}", cure=cure) from error


def _names(connection: sqlite3.Connection) -> str:
    """The tables and views, without SQLite's own."""
    found = connection.execute(
        "SELECT name FROM pragma_table_list WHERE schema = 'main' AND type <> 'shadow' AND name NOT LIKE 'sqlite%' "
        "ORDER BY type = 'view' DESC, name"
    )
    return "there are " + ", ".join(name for (name,) in found)
