"""The write lock of a PostgreSQL map: an advisory lock that the server releases when its connection ends."""

from __future__ import annotations

import time
from dataclasses import dataclass

from sqlalchemy import Connection, text

from supermap_cli.errors import MemoryStoreError
from supermap_schema.sqlite import APPLICATION_ID

_TIMEOUT_S = 2.0
"""How long to wait for the lock: the server needs a moment to notice that a build was killed."""

_SCHEMA = "coalesce(current_schema()::text, btrim(split_part(current_setting('search_path'), ',', 1), ' \"'))"
_KEY = f"{APPLICATION_ID}, hashtext({_SCHEMA})"
_HELD = f"""l.locktype = 'advisory' AND l.granted AND l.database = (
    SELECT oid FROM pg_database WHERE datname = current_database())
    AND l.classid = {APPLICATION_ID} AND l.objid::bigint = hashtext({_SCHEMA})::bigint & 4294967295"""


@dataclass(frozen=True)
class AdvisoryLock:
    """The lock of one schema; `connection` only holds it, `backend` is its process id on the server."""

    connection: Connection
    backend: int
    where: str

    @classmethod
    def taken(cls, connection: Connection, where: str) -> AdvisoryLock:
        """Take the lock with a connection. Raises `MemoryStoreError`, naming the holder, if another build has it."""
        deadline_s = time.monotonic() + _TIMEOUT_S
        while not connection.exec_driver_sql(f"SELECT pg_try_advisory_lock({_KEY})").scalar_one():
            if time.monotonic() < deadline_s:
                time.sleep(0.05)
                continue
            holder = connection.exec_driver_sql(
                "SELECT coalesce(nullif(replace(a.application_name, 'supermap, ', ''), ''), 'process ' || l.pid) "
                "|| ', since ' || to_char(a.backend_start AT TIME ZONE 'UTC', 'YYYY-MM-DD HH24:MI:SS') || ' UTC' "
                f"FROM pg_locks l LEFT JOIN pg_stat_activity a ON a.pid = l.pid WHERE {_HELD}"
            ).scalar()
            _close(connection)
            raise MemoryStoreError(
                f"another build is writing this map ({holder or 'unknown'})",
                where=where,
                cure="wait for it, or give another --db",
            )
        backend = connection.exec_driver_sql("SELECT pg_backend_pid()").scalar_one()
        return cls(connection, backend, where)

    def check(self, connection: Connection) -> None:
        """Ask the server whether the lock is still held: it is lost with its connection."""
        held = connection.execute(
            text(f"SELECT count(*) FROM pg_locks l WHERE {_HELD} AND l.pid = :backend"), {"backend": self.backend}
        )
        if not held.scalar_one():
            raise MemoryStoreError(
                "the connection that held the build lock was lost", where=self.where, cure="run the build again"
            )

    def check_place(self) -> None:
        """Nothing to check: a schema that is dropped ends the statements of this build."""

    def leave_file(self) -> None:
        """Nothing to leave: the lock is the server's."""

    def release(self) -> None:
        """Close the connection, which releases the lock."""
        _close(self.connection)


def _close(connection: Connection) -> None:
    if not connection.closed:
        engine = connection.engine
        connection.close()
        engine.dispose()
