"""Several cameras whose keyframes may share a stamp, and the warnings of a traversal."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from supermap_schema import postgresql, sqlite
from supermap_schema.columns import Blob, Int64, Json, Label

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

OLD_KEY = "uq_keyframe_traversal_id_stamp_ns"
NEW_KEY = "uq_keyframe_traversal_id_stamp_ns_camera_id"


def upgrade() -> None:
    """Add `traversal.warnings` and `keyframe.camera_id`, which becomes a part of the keyframe's key.

    A map had one camera; it is called "camera" now.
    """
    op.add_column("traversal", sa.Column("warnings", Json, nullable=False, server_default=sa.text("'[]'")))
    if op.get_bind().dialect.name == "sqlite":
        _recreate_keyframe()
        statements = sqlite.OBJECTS_0003
    else:
        op.add_column("keyframe", sa.Column("camera_id", Label, nullable=False, server_default="camera"))
        op.alter_column("keyframe", "camera_id", server_default=None)
        op.drop_constraint(op.f(OLD_KEY), "keyframe", type_="unique")
        op.create_unique_constraint(op.f(NEW_KEY), "keyframe", ["traversal_id", "stamp_ns", "camera_id"])
        statements = postgresql.OBJECTS_0003
    for statement in statements:
        op.execute(statement)


def _recreate_keyframe() -> None:
    """SQLite cannot change the constraints of a table: its rows are copied, and it is dropped and created again.

    In between the observations' foreign keys dangle; they are checked at the end of the transaction.
    """
    op.execute("PRAGMA defer_foreign_keys = ON")
    op.execute("CREATE TEMP TABLE keyframe_0002 AS SELECT *, 'camera' AS camera_id FROM keyframe")
    op.drop_table("keyframe")
    op.create_table(
        "keyframe",
        sa.Column("id", Int64, nullable=False),
        sa.Column("traversal_id", Int64, nullable=False),
        sa.Column("stamp_ns", Int64, nullable=False),
        sa.Column("detected", Int64, nullable=False),
        sa.Column("T_map_base", Json, nullable=False),
        sa.Column("T_map_camera", Json, nullable=False),
        sa.Column("camera", Json, nullable=False),
        sa.Column("depth_step", Int64, nullable=False),
        sa.Column("depth_png", Blob, nullable=False),
        sa.Column("thumbnail_jpeg", Blob),
        sa.Column("camera_id", Label, nullable=False),
        sa.CheckConstraint("detected IN (0, 1)", name=op.f("ck_keyframe_detected")),
        sa.CheckConstraint("depth_step >= 1", name=op.f("ck_keyframe_depth_step")),
        sa.ForeignKeyConstraint(["traversal_id"], ["traversal.id"], name=op.f("fk_keyframe_traversal_id")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_keyframe")),
        sa.UniqueConstraint("traversal_id", "stamp_ns", "camera_id", name=op.f(NEW_KEY)),
        sqlite_strict=True,
    )
    op.execute("INSERT INTO keyframe SELECT * FROM temp.keyframe_0002 ORDER BY id")
    op.execute("DROP TABLE temp.keyframe_0002")


def downgrade() -> None:
    """The versions of a released database only go up."""
    raise NotImplementedError("a map database is never taken back to an older version")
