"""A map in a schema of a PostgreSQL database, the first one of the connection's search path."""

from __future__ import annotations

import os
import socket
import sqlite3
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import URL, Connection, Engine, create_engine, event, make_url, text
from sqlalchemy.exc import ArgumentError, DatabaseError
from sqlalchemy.pool import NullPool

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.databases.interface import SqlRows
from supermap_cli.memory.databases.postgresql_errors import no_driver, postgresql_error
from supermap_cli.memory.databases.postgresql_lock import AdvisoryLock
from supermap_cli.memory.databases.postgresql_sql import read_rows
from supermap_cli.memory.databases.postgresql_waiting import limit_waiting, wait_for_others
from supermap_cli.memory.databases.waiting import Waiting
from supermap_schema import models, postgresql

models.with_postgresql_conditions()

_SECRETS = ("password", "passfile", "sslpassword")
_CONNECT_TIMEOUT_S = 10

_FIRST_SCHEMA = "SELECT btrim(split_part(current_setting('search_path'), ',', 1), ' \"')"
"""The name of the schema of a new map, which may not exist yet."""

_OWN_RELATIONS = """
    SELECT c.oid, c.relname, c.relkind FROM pg_class c
    WHERE c.relnamespace = quote_ident(current_schema())::regnamespace
    AND c.relkind IN ('r', 'p', 'v', 'm', 'f') AND NOT EXISTS (
      SELECT 1 FROM pg_depend d WHERE d.classid = 'pg_class'::regclass AND d.objid = c.oid AND d.deptype = 'e')
"""
"""Tables and views of the schema, without those of extensions (PostGIS)."""

_MARK_FOUND = """
    SELECT obj_description(c.oid, 'pg_class') FROM pg_class c
    WHERE c.relnamespace = quote_ident(current_schema())::regnamespace AND c.relname = 'traversal'
"""


@dataclass(frozen=True)
class PostgresqlSchema:
    """The schema that `url` selects, accessed with psycopg."""

    url: URL
    waiting: Waiting = field(default_factory=Waiting)

    @classmethod
    def of(cls, url: str, waiting: Waiting | None = None) -> PostgresqlSchema:
        """The schema of a URL. Raises `MemoryStoreError` for a malformed one."""
        scheme, _, rest = url.partition("://")
        cure = "write postgresql+psycopg://USER@HOST/DATABASE"
        if scheme not in {"postgresql+psycopg", "postgresql", "postgres"}:
            raise MemoryStoreError(f"the driver {scheme.partition('+')[2]!r} is not known", where=scheme, cure=cure)
        try:
            parsed = make_url(f"postgresql+psycopg://{rest}")
        except (ArgumentError, ValueError) as error:
            raise MemoryStoreError("the database's URL is not understood", where=scheme, cure=cure) from error
        if not parsed.database and "dbname" not in parsed.query:
            raise MemoryStoreError("the database's URL names no database", where=_without_secrets(parsed), cure=cure)
        return cls(parsed, waiting or Waiting())

    @property
    def where(self) -> str:
        """The URL without its password."""
        return _without_secrets(self.url)

    @property
    def identity(self) -> str:
        """The URL without its password; two names of one server are not recognised as equal."""
        return self.where

    @property
    def file(self) -> None:
        """There is none: the map is on a server."""

    def is_stored(self) -> bool:
        """There is no file."""
        return False

    def stored_version(self) -> int | None:
        """The number of the newest migration of a schema that is marked as a map."""
        with self._connected("AUTOCOMMIT") as connection:
            try:
                return self._version(connection)
            except DatabaseError as error:
                raise postgresql_error(error, self.where) from error

    def _version(self, connection: Connection) -> int | None:
        if int(connection.exec_driver_sql("SHOW server_version_num").scalar_one()) < postgresql.OLDEST_SERVER:
            raise MemoryStoreError(
                f"the server is PostgreSQL {connection.exec_driver_sql('SHOW server_version').scalar_one()}",
                where=self.where,
                cure=f"use PostgreSQL {postgresql.OLDEST_SERVER // 10000} or newer",
            )
        tables = {row.relname for row in connection.exec_driver_sql(_OWN_RELATIONS)}
        if not tables:
            return None
        if connection.exec_driver_sql(_MARK_FOUND).scalar() != postgresql.MARK:
            schema = connection.exec_driver_sql("SELECT current_schema()").scalar_one()
            raise MemoryStoreError(
                f"the schema {schema!r} holds tables, but no SuperMap map",
                where=self.where,
                cure="give the map a schema of its own: add ?options=-csearch_path%3Dsupermap to the URL",
            )
        return int(connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar_one())

    def take_lock(self) -> AdvisoryLock:
        """An advisory lock on a connection of its own."""
        return AdvisoryLock.taken(self._connected("AUTOCOMMIT"), self.where)

    def writer_engine(self) -> Engine:
        """READ COMMITTED, because there is one writer; one that writes first waits for other programs that do."""
        engine = self._engine()

        def begin(connection: Connection) -> None:
            if connection.get_execution_options().get("writes"):
                wait_for_others(connection, self.waiting, self.where)

        event.listen(engine, "begin", begin)
        return engine

    def reader_engine(self) -> Engine:
        """REPEATABLE READ and read only."""
        return self._engine().execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)

    def prepare(self, connection: Connection) -> None:
        """Create the first schema of the search path if it does not exist."""
        if connection.exec_driver_sql("SELECT current_schema()").scalar_one() is None:
            name = connection.exec_driver_sql(_FIRST_SCHEMA).scalar_one()
            quoted = connection.dialect.identifier_preparer.quote(name)
            connection.exec_driver_sql(f"CREATE SCHEMA {quoted}".replace("%", "%%"))
            connection.execute(text(f"COMMENT ON SCHEMA {quoted} IS '{postgresql.MARK}'"))

    def remove(self) -> None:
        """Drop everything that belongs to the map, and its schema if that was created for it."""
        with self._connected() as connection, connection.begin():
            made = connection.exec_driver_sql(
                "SELECT obj_description(quote_ident(current_schema())::regnamespace, 'pg_namespace')"
            ).scalar_one()
            if made == postgresql.MARK:
                name = connection.exec_driver_sql("SELECT current_schema()").scalar_one()
                quoted = connection.dialect.identifier_preparer.quote(name)
                connection.exec_driver_sql(f"DROP SCHEMA {quoted} CASCADE".replace("%", "%%"))
                return
            names = [*(table.name for table in models.Base.metadata.sorted_tables), "alembic_version"]
            connection.exec_driver_sql(f"DROP TABLE IF EXISTS {', '.join(names)} CASCADE")
            connection.exec_driver_sql(f"DROP FUNCTION IF EXISTS {', '.join(postgresql.FUNCTIONS)} CASCADE")
            connection.exec_driver_sql(f"DROP TEXT SEARCH CONFIGURATION IF EXISTS {postgresql.LABEL_SEARCH}")
            connection.exec_driver_sql("DROP TEXT SEARCH DICTIONARY IF EXISTS supermap_porter")

    def size_bytes(self, connection: Connection) -> int:
        """Size of all tables with their indices."""
        size = f"SELECT coalesce(sum(pg_total_relation_size(oid)), 0)::bigint FROM ({_OWN_RELATIONS}) AS own"
        return int(connection.exec_driver_sql(size).scalar_one())

    def release_free_pages(self) -> None:
        """Nothing to do: the server's autovacuum does it."""

    def vacuum(self, engine: Engine) -> None:
        """VACUUM, which makes the space reusable; VACUUM FULL would return it to the system, but blocks readers."""
        with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            for model in (models.Observation, models.Keyframe, models.Traversal):
                connection.exec_driver_sql(f"VACUUM (ANALYZE) {model.__tablename__}")

    def failure(self, error: DatabaseError) -> MemoryStoreError:
        """For a lost connection or a full disk."""
        return postgresql_error(error, self.where)

    def read_sql(
        self, statement: str, prepare: Callable[[sqlite3.Connection], None] | None = None, limit_s: float = 0.0
    ) -> AbstractContextManager[SqlRows]:
        """Run one read-only statement; functions of plugins exist for SQLite only."""
        return read_rows(self._connect, statement, limit_s)

    def _engine(self, **options: Any) -> Engine:
        try:
            engine = create_engine(self.url, connect_args=self._connect_arguments(), **options)
        except ImportError as error:
            raise no_driver(self.where) from error
        event.listen(engine, "connect", lambda connection, _: limit_waiting(connection, self.waiting))
        return engine

    def _connect_arguments(self) -> dict[str, Any]:
        """The application name is shown by the server, and to another build that waits for the lock."""
        return {
            "connect_timeout": int(str(self.url.query.get("connect_timeout", _CONNECT_TIMEOUT_S))),
            "application_name": f"supermap, process {os.getpid()} on {socket.gethostname()}",
        }

    def _connected(self, isolation_level: str | None = None) -> Connection:
        """A separate connection. Raises `MemoryStoreError` if the server is not reached."""
        engine = self._engine(poolclass=NullPool)
        try:
            connection = engine.connect()
        except DatabaseError as error:
            raise postgresql_error(error, self.where) from error
        return connection.execution_options(isolation_level=isolation_level) if isolation_level else connection

    def _connect(self) -> Any:
        """The driver's connection, for plain SQL."""
        import psycopg  # noqa: PLC0415 - only where a map lies in PostgreSQL

        arguments, options = self._engine().dialect.create_connect_args(self.url)
        try:
            return psycopg.connect(*arguments, **{**options, **self._connect_arguments()})
        except psycopg.Error as error:
            raise postgresql_error(error, self.where) from error


def _without_secrets(url: URL) -> str:
    """Passwords may also be in the URL's query."""
    return url._replace(password=None).difference_update_query(_SECRETS).render_as_string()
