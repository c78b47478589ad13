"""Checkpoints of builds, clock shifts, limits of pruning, and indices for large maps."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from supermap_schema import postgresql, sqlite
from supermap_schema.columns import Blob, Int64, Label

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

INDICES: tuple[tuple[str, list[str], str | None], ...] = (
    ("instance", ["label", "presence", "last_seen_ns"], "merged_into IS NULL"),
    ("instance", ["presence", "last_seen_ns"], "merged_into IS NULL"),
    ("instance", ["merged_into"], "merged_into IS NOT NULL"),
    ("observation", ["instance_number", "keyframe_id", "score"], None),
    ("observation", ["instance_number"], "crop_jpeg IS NOT NULL"),
    ("state", ["label", "instance_number"], None),
    ("state", ["first_seen_ns", "instance_number"], None),
    ("state", ["gone_ns", "instance_number"], "gone_ns IS NOT NULL"),
    ("visit", ["instance_number", "traversal_id"], None),
    ("temporal_edge", ["not_after_ns"], None),
)
"""Table, columns, and the condition of a partial index."""


def upgrade() -> None:
    """Add columns, indices, the checkpoint table and new views and triggers."""
    op.add_column("traversal", sa.Column("clock_shift_ns", Int64, nullable=False, server_default=sa.text("0")))
    op.add_column("traversal", sa.Column("crops_kept_from_ns", Int64))
    op.add_column("traversal", sa.Column("observations_kept_from_ns", Int64))
    op.add_column("traversal", sa.Column("thumbnails_kept_from_ns", Int64))
    _count_rows()
    _add_indices()
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
    objects = {"sqlite": sqlite.OBJECTS_0002, "postgresql": postgresql.OBJECTS_0002}
    for statement in objects[op.get_bind().dialect.name]:
        op.execute(statement)


def _count_rows() -> None:
    for name in ("keyframes", "observations"):
        op.add_column("traversal", sa.Column(name, Int64, nullable=False, server_default=sa.text("0")))
    op.execute(
        """UPDATE traversal SET
           keyframes = (SELECT count(*) FROM keyframe WHERE keyframe.traversal_id = traversal.id),
           observations = (SELECT count(*) FROM observation JOIN keyframe ON keyframe.id = observation.keyframe_id
                           WHERE keyframe.traversal_id = traversal.id)"""
    )


def _add_indices() -> None:
    op.drop_index(op.f("ix_observation_instance_number"), "observation")
    for table, columns, where in INDICES:
        rows = None if where is None else sa.text(where)
        name = op.f(f"ix_{table}_{'_'.join(columns)}")
        op.create_index(name, table, columns, sqlite_where=rows, postgresql_where=rows)


def downgrade() -> None:
    """The versions of a released database only go up."""
    raise NotImplementedError("a map database is never taken back to an older version")
