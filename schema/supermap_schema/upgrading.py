"""Runs the migrations from Python, without alembic.ini or files in the current folder."""

from __future__ import annotations

from pathlib import Path

from alembic import command
from alembic.config import Config
from sqlalchemy import Connection

from supermap_schema import SCHEMA_VERSION


def upgrade(connection: Connection, revision: str = "head") -> None:
    """Upgrade a database to the newest version (or to `revision`) within the connection's transaction.

    In an empty database all tables are created.
    """
    command.upgrade(alembic_config(connection), revision)
    if connection.dialect.name == "sqlite" and revision == "head":
        connection.exec_driver_sql(f"PRAGMA user_version = {SCHEMA_VERSION}")


def alembic_config(connection: Connection) -> Config:
    """Alembic's configuration for the migrations of this package on an open connection."""
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
    config.attributes["connection"] = connection
    return config
