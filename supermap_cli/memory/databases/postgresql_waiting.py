"""Waiting for other programs that write to the tables of a PostgreSQL map (psql, a browser, a restore)."""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import Connection

from supermap_cli.memory.databases.waiting import ATTEMPT_S, Waiting, another_program_writes

_POLL_S = 0.1
"""Seconds between two looks at the server's locks. Chosen."""

_OTHERS_WRITE = """
    SELECT EXISTS (SELECT 1 FROM pg_locks l JOIN pg_class c ON c.oid = l.relation
    WHERE l.locktype = 'relation' AND l.granted AND l.pid IS DISTINCT FROM pg_backend_pid()
    AND l.database = (SELECT oid FROM pg_database WHERE datname = current_database())
    AND c.relnamespace = quote_ident(current_schema())::regnamespace AND c.relkind IN ('r', 'p')
    AND l.mode IN ('RowExclusiveLock', 'ShareLock', 'ShareRowExclusiveLock', 'ExclusiveLock', 'AccessExclusiveLock'))
"""
"""Whether a transaction holds a lock that writing takes or waits for; autovacuum holds a weaker one and gives way."""


def wait_for_others(connection: Connection, waiting: Waiting, where: str) -> None:
    """At the begin of a transaction that writes: wait until no other program has one, and say so after a second.

    PostgreSQL makes a statement wait for the rows that another transaction changed, silently; so it is asked first,
    as SQLite is by BEGIN IMMEDIATE. Raises `MemoryStoreError` when the waiting is over.
    """
    began_s, told = time.monotonic(), False
    while connection.exec_driver_sql(_OTHERS_WRITE).scalar_one():
        waited_s = time.monotonic() - began_s
        if waited_s >= waiting.limit_s:
            raise another_program_writes(where)
        if waited_s >= ATTEMPT_S and not told:
            waiting.tell_about(where)
            told = True
        time.sleep(min(_POLL_S, waiting.limit_s - waited_s))


def limit_waiting(connection: Any, waiting: Waiting) -> None:
    """End every statement of a new connection that waits longer for a lock; 0 would be no limit to the server."""
    with connection.cursor() as cursor:
        cursor.execute(f"SET lock_timeout = {max(round(waiting.limit_s * 1000), 1)}")
    connection.commit()
