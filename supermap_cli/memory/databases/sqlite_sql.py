"""Read-only SQL on a map in SQLite."""

from __future__ import annotations

import sqlite3
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
) -> Iterator[SqlRows]:
    """Run one statement (see `Database.read_sql`)."""
    with closing(connect()) as connection:
        if prepare is not None:
            prepare(connection)
        connection.set_authorizer(_authorize)
        connection.set_progress_handler(lambda: None, 100_000)  # lets Ctrl-C through to a long statement
        with _refusals_as_query_errors(connection):
            cursor = connection.execute(statement)
        if cursor.description is None:
            raise QueryError("the SQL statement returns no rows", cure="give one SELECT")
        with closing(_rows(cursor)) as rows:
            yield SqlRows(tuple(column[0] for column in cursor.description), rows)


def _authorize(action: int, first: str | None, *_: str | None) -> int:
    """Refuse what `query_only` allows: other files (ATTACH, VACUUM INTO), and pragmas that change something."""
    if action in {sqlite3.SQLITE_ATTACH, sqlite3.SQLITE_DETACH}:
        return sqlite3.SQLITE_DENY
    if action == sqlite3.SQLITE_PRAGMA and str(first).lower() not in _READING_PRAGMAS:
        return sqlite3.SQLITE_DENY
    return sqlite3.SQLITE_OK


def _rows(cursor: sqlite3.Cursor) -> Generator[tuple[SqlValue, ...], None, None]:
    with _refusals_as_query_errors(cursor.connection):
        yield from cursor


@contextmanager
def _refusals_as_query_errors(connection: sqlite3.Connection) -> Iterator[None]:
    try:
        yield
    except (sqlite3.Error, sqlite3.Warning) as error:
        message = str(error)
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
