"""The map database: SQLAlchemy models, Alembic migrations, JSON Schemas of what leaves the program.

- `models`: the tables, portable SQL.
- `sqlite`: everything specific to SQLite: pragmas, triggers, views, R*Tree and full-text index.
- `postgresql`: everything specific to PostgreSQL.
- `checksums`: the checksums of immutable rows.
- `upgrading`: runs the migrations from Python; imports Alembic.
- `json_schemas`: `load_schema(name)`.

Importing this package imports none of them.
"""

SCHEMA_VERSION = 4
"""The version this program reads and writes: the number of the newest migration.

Stored as `PRAGMA user_version` in SQLite, in Alembic's own table in PostgreSQL.
"""
