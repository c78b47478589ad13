"""Errors of a PostgreSQL server, or of the connection to it, as one line with a cure."""

from __future__ import annotations

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.databases.waiting import another_program_writes

_CURES = (
    ("does not exist", "database", "make it with `createdb`, or name another in the URL"),
    ("does not exist", "role", "name a user that the server knows in the URL"),
    ("password", "", "give the password in ~/.pgpass or PGPASSWORD, or in the URL"),
    ("authentication failed", "", "name a user that may log in, see the server's pg_hba.conf"),
    ("no pg_hba.conf entry", "", "allow this user and computer in the server's pg_hba.conf"),
    ("refused", "", "start the server, or check host and port in the URL"),
    ("No such file", "", "start the server, or name its host in the URL"),
    ("resolve", "", "check the host in the URL"),
    ("Name or service not known", "", "check the host in the URL"),
    ("timeout", "", "check host, port and network"),
    ("too many", "", "wait, or let the server take more connections"),
    ("starting up", "", "wait until the server is up"),
    ("shutting down", "", "start the server again"),
    ("permission denied", "", "let the user make and use tables there (GRANT CREATE, USAGE ON SCHEMA)"),
    ("No space left", "", "free space on the server"),
    ("read-only transaction", "", "name the server that takes writes"),
)
"""Two parts of the message (both must be in it) and the cure."""
_LOCK_NOT_AVAILABLE = "55P03"
"""The state of a statement that `lock_timeout` ended (PostgreSQL's manual, appendix A)."""
_LOST = ("server closed the connection", "connection is lost", "terminating connection", "connection is closed")


def no_driver(where: str) -> MemoryStoreError:
    """The driver is an optional dependency."""
    return MemoryStoreError(
        "PostgreSQL needs the driver psycopg", where=where, cure="pip install 'supermap-cli[postgresql]'"
    )


def is_shut_out(error: BaseException | None) -> bool:
    """Whether a statement waited too long for another program's lock."""
    return getattr(error, "sqlstate", None) == _LOCK_NOT_AVAILABLE


def postgresql_error(error: Exception, where: str) -> MemoryStoreError:
    """The error of a connection or a statement, without the driver's own details."""
    message = _message(getattr(error, "orig", None) or error)
    if getattr(error, "connection_invalidated", False) or any(part in message for part in _LOST):
        return MemoryStoreError(
            f"the connection to the PostgreSQL server was lost: {message}",
            where=where,
            cure="when the server is there again, repeat the command: whatever was committed is kept",
        )
    if is_shut_out(getattr(error, "orig", None) or error):
        return another_program_writes(where)
    cures = (cure for first, second, cure in _CURES if first in message and second in message)
    return MemoryStoreError(f"PostgreSQL says: {message}", where=where, cure=next(cures, "see the server's log"))


def _message(error: BaseException) -> str:
    """The first line that the server sent; the driver repeats it for every address that it tried."""
    diagnosis = getattr(getattr(error, "diag", None), "message_primary", None)
    lines = [line.strip() for line in str(diagnosis or error).splitlines() if line.strip()]
    line = next((text for text in lines if "failed:" in text), lines[0] if lines else type(error).__name__)
    return line.removeprefix("connection failed: ").removeprefix("- ")
