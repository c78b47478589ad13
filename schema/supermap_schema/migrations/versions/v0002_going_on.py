"""Checkpoints of builds, clocks that run behind the map's, and observations that were given up."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from supermap_schema import postgresql, sqlite
from supermap_schema.columns import Blob, Int64, Label

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add what is new."""
    op.add_column("traversal", sa.Column("clock_shift_ns", Int64, nullable=False, server_default=sa.text("0")))
    op.add_column("traversal", sa.Column("crops_kept_from_ns", Int64))
    op.add_column("traversal", sa.Column("observations_kept_from_ns", Int64))
    op.create_table(
        "checkpoint",
        sa.Column("traversal_id", Int64, nullable=False),
        sa.Column("part", Label, nullable=False),
        sa.Column("stamp_ns", Int64, nullable=False),
        sa.Column("content", Blob, nullable=False),
        sa.PrimaryKeyConstraint("traversal_id", "part", name=op.f("pk_checkpoint")),
        sa.ForeignKeyConstraint(["traversal_id"], ["traversal.id"], name=op.f("fk_checkpoint_traversal_id")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_visit_instance_number_traversal_id"), "visit", ["instance_number", "traversal_id"])
    objects = {"sqlite": sqlite.OBJECTS_0002, "postgresql": postgresql.OBJECTS_0002}
    for statement in objects[op.get_bind().dialect.name]:
        op.execute(statement)


def downgrade() -> None:
    """The versions of a released database only go up."""
    raise NotImplementedError("a map database is never taken back to an older version")
