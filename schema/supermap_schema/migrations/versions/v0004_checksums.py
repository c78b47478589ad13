"""A checksum of the immutable rows of every traversal."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from supermap_schema.checksums import store_all_sums
from supermap_schema.columns import Int64, Label

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the table, and the checksums of what the traversals of the map hold now."""
    op.create_table(
        "checksum",
        sa.Column("traversal_id", Int64, nullable=False),
        sa.Column("table_name", Label, nullable=False),
        sa.Column("row_count", Int64, nullable=False),
        sa.Column("digest", Label, nullable=False),
        sa.PrimaryKeyConstraint("traversal_id", "table_name", name=op.f("pk_checksum")),
        sa.ForeignKeyConstraint(["traversal_id"], ["traversal.id"], name=op.f("fk_checksum_traversal_id")),
        sqlite_strict=True,
    )
    store_all_sums(op.get_bind())


def downgrade() -> None:
    """The versions of a released database only go up."""
    raise NotImplementedError("a map database is never taken back to an older version")
