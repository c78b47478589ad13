"""Runs the migrations from Python: no alembic.ini, nothing in the current folder."""

from __future__ import annotations

from pathlib import Path

from alembic import command
from alembic.config import Config
from sqlalchemy import Connection

from supermap_schema import SCHEMA_VERSION


def upgrade(connection: Connection, revision: str = "head") -> None:
    """Bring a database to the newest version (or to `revision`), within the connection's transaction.

    An empty database gets all tables, so this is how one is made.
    """
    command.upgrade(alembic_config(connection), revision)
    if connection.dialect.name == "sqlite" and revision == "head":
        connection.exec_driver_sql(f"PRAGMA user_version = {SCHEMA_VERSION}")


def alembic_config(connection: Connection) -> Config:
    """Alembic's configuration for the migrations shipped with this package, on an open connection."""
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
    config.attributes["connection"] = connection
    return config
