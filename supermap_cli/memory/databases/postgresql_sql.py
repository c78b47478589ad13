"""Read-only SQL on a map in PostgreSQL."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Any

from supermap_cli.errors import QueryError
from supermap_cli.memory.databases.interface import SqlRows, SqlValue

if TYPE_CHECKING:
    import psycopg

_CURES = {
    "42P01": "",  # undefined table: the names that there are
    "42703": "`SELECT column_name FROM information_schema.columns WHERE table_name = 'NAME'` lists the columns",
    "42883": "see `supermap db sql --help`; functions of plugins are for SQLite",
    "25006": "this command only reads: give one SELECT",
}
"""SQLSTATE -> cure."""


@contextmanager
def read_rows(
    connect: Callable[[], psycopg.Connection[Any]], statement: str, limit_s: float = 0.0
) -> Iterator[SqlRows]:
    """Run one statement (see `Database.read_sql`) in a read-only transaction.

    It uses the protocol for prepared statements, which takes one statement at a time and streams its rows.
    """
    import psycopg  # noqa: PLC0415 - only where a map lies in PostgreSQL

    with closing(connect()) as connection:
        connection.isolation_level = psycopg.IsolationLevel.REPEATABLE_READ
        connection.read_only = True
        _plain_values(connection)
        connection.execute("SELECT set_config('statement_timeout', %s, false)", (str(round(limit_s * 1000)),))
        with _refusals_as_query_errors(connection):
            columns = _columns(connection, statement)
        if not columns:
            raise QueryError("the SQL statement returns no rows", cure="give one SELECT")
        with closing(_rows(connection, statement)) as rows:
            yield SqlRows(columns, rows)


def _columns(connection: psycopg.Connection[Any], statement: str) -> tuple[str, ...]:
    """The names of the columns, none if the statement returns no rows; the statement is not run."""
    from psycopg.errors import error_from_result  # noqa: PLC0415
    from psycopg.pq import ExecStatus  # noqa: PLC0415

    result = connection.pgconn.prepare(b"", statement.encode())
    if result.status == ExecStatus.COMMAND_OK:
        result = connection.pgconn.describe_prepared(b"")
    if result.status != ExecStatus.COMMAND_OK:
        raise error_from_result(result)
    return tuple((result.fname(index) or b"").decode() for index in range(result.nfields))


def _rows(connection: psycopg.Connection[Any], statement: str) -> Generator[tuple[SqlValue, ...], None, None]:
    with _refusals_as_query_errors(connection):
        yield from connection.cursor().stream(statement.encode())


@contextmanager
def _refusals_as_query_errors(connection: psycopg.Connection[Any]) -> Iterator[None]:
    import psycopg  # noqa: PLC0415

    try:
        yield
    except psycopg.Error as error:
        message = error.diag.message_primary or str(error)
        if "multiple commands" in message:
            raise QueryError("one SQL statement at a time", cure="give one SELECT") from error
        cure = _CURES.get(error.sqlstate or "", "see `supermap db sql --help`")
        raise QueryError(f"PostgreSQL says: {message}", cure=cure or _names(connection)) from error


def _names(connection: psycopg.Connection[Any]) -> str:
    """The tables and views of the schema; ends the transaction that a refused statement has aborted."""
    connection.rollback()
    found = connection.execute(
        "SELECT table_name FROM information_schema.tables WHERE table_schema = current_schema() "
        "ORDER BY table_type = 'VIEW' DESC, table_name"
    )
    return "there are " + ", ".join(name for (name,) in found)


def _plain_values(connection: psycopg.Connection[Any]) -> None:
    """Load numbers, texts and bytes as SQLite does; all other types as text."""
    from psycopg.adapt import Loader  # noqa: PLC0415
    from psycopg.types.string import TextLoader  # noqa: PLC0415

    class BoolLoader(Loader):
        def load(self, data: Any) -> int:
            return int(bytes(data) == b"t")

    class NumericLoader(Loader):
        def load(self, data: Any) -> int | float:
            written = bytes(data).decode()
            return int(written) if written.lstrip("-").isdigit() else float(written)

    for type_ in connection.adapters.types:
        if type_.name not in {"int2", "int4", "int8", "oid", "float4", "float8", "bytea"}:
            connection.adapters.register_loader(type_.oid, TextLoader)
        if type_.array_oid:
            connection.adapters.register_loader(type_.array_oid, TextLoader)
    connection.adapters.register_loader("bool", BoolLoader)
    connection.adapters.register_loader("numeric", NumericLoader)
