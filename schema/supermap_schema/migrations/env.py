"""Run by Alembic: the connection comes from `supermap_schema.upgrading`, within its transaction."""

from alembic import context

from supermap_schema.models import Base

context.configure(connection=context.config.attributes["connection"], target_metadata=Base.metadata)
with context.begin_transaction():
    context.run_migrations()
