"""The map database: SQLAlchemy models, Alembic migrations, JSON Schemas of what leaves the program.

- `models`: the tables, portable SQL.
- `sqlite`: all that holds for SQLite only: pragmas, triggers, views, R*Tree and full-text index.
- `postgresql`: its twin.
- `upgrading`: runs the migrations from Python; imports Alembic.
- `json_schemas`: `load_schema(name)`.

Importing this package imports none of them.
"""

SCHEMA_VERSION = 3
"""The version this program reads and writes: the number of the newest migration.

SQLite keeps it as `PRAGMA user_version`, PostgreSQL in Alembic's own table.
"""
