"""Alembic's environment: `env` runs the migrations in `versions` on the connection that `upgrading` hands over."""
