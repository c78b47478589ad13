"""The first version: all tables of the 4D memory, its triggers, indices and views."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from supermap_schema import sqlite
from supermap_schema.columns import Blob, Int64, Json, Label, Real

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

TABLES = (
    "traversal",
    "keyframe",
    "instance",
    "observation",
    "state",
    "visit",
    "spatial_edge",
    "temporal_edge",
    "before_image",
)


def upgrade() -> None:
    """Create everything."""
    _create_traversals()
    _create_instances()
    _create_observations()
    _create_states()
    _create_spatial_edges()
    _create_temporal_edges()
    _create_before_images()
    if op.get_bind().dialect.name == "sqlite":
        op.execute(f"PRAGMA application_id = {sqlite.APPLICATION_ID}")
        for statement in sqlite.OBJECTS_0001:
            op.execute(statement)


def downgrade() -> None:
    """Drop everything."""
    if op.get_bind().dialect.name == "sqlite":
        for view in ("current_objects", "object_history", "changes", "trajectory"):
            op.execute(f"DROP VIEW {view}")
        for index in ("state_box", "instance_label"):
            op.execute(f"DROP TABLE {index}")
    for table in reversed(TABLES):
        op.drop_table(table)


def _integer(name: str) -> sa.Column[int]:
    return sa.Column(name, Int64, nullable=False)


def _text(name: str) -> sa.Column[str]:
    return sa.Column(name, Label, nullable=False)


def _reals(*names: str) -> list[sa.Column[float]]:
    return [sa.Column(name, Real, nullable=False) for name in names]


def _place() -> list[sa.Column[float]]:
    return _reals("x", "y", "z", "center_x", "center_y", "center_z", "size_x", "size_y", "size_z", "yaw")


def _create_traversals() -> None:
    op.create_table(
        "traversal",
        _integer("id"),
        _integer("number"),
        _text("name"),
        _text("recording"),
        _text("fingerprint"),
        _integer("start_ns"),
        _integer("end_ns"),
        sa.Column("T_map_odom", Json, nullable=False),
        sa.Column("config", Json, nullable=False),
        sa.Column("versions", Json, nullable=False),
        _text("status"),
        sa.Column("mapped_ns", Int64),
        sa.Column("timings", Json),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_traversal")),
        sa.UniqueConstraint("number", name=op.f("uq_traversal_number")),
        sa.UniqueConstraint("name", name=op.f("uq_traversal_name")),
        sa.CheckConstraint("end_ns >= start_ns", name=op.f("ck_traversal_span")),
        sa.CheckConstraint("status IN ('building', 'complete')", name=op.f("ck_traversal_status")),
        sqlite_strict=True,
    )
    op.create_index("ix_traversal_fingerprint", "traversal", ["fingerprint"])
    op.create_table(
        "keyframe",
        _integer("id"),
        _integer("traversal_id"),
        _integer("stamp_ns"),
        _integer("detected"),
        sa.Column("T_map_base", Json, nullable=False),
        sa.Column("T_map_camera", Json, nullable=False),
        sa.Column("camera", Json, nullable=False),
        _integer("depth_step"),
        sa.Column("depth_png", Blob, nullable=False),
        sa.Column("thumbnail_jpeg", Blob),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_keyframe")),
        sa.ForeignKeyConstraint(["traversal_id"], ["traversal.id"], name=op.f("fk_keyframe_traversal_id")),
        sa.UniqueConstraint("traversal_id", "stamp_ns", name=op.f("uq_keyframe_traversal_id_stamp_ns")),
        sa.CheckConstraint("detected IN (0, 1)", name=op.f("ck_keyframe_detected")),
        sa.CheckConstraint("depth_step >= 1", name=op.f("ck_keyframe_depth_step")),
        sqlite_strict=True,
    )


def _create_instances() -> None:
    op.create_table(
        "instance",
        _integer("number"),
        _text("id"),
        _text("label"),
        _text("presence"),
        *_reals("existence_log_odds"),
        _integer("first_seen_ns"),
        _integer("last_seen_ns"),
        *_place(),
        _integer("observations"),
        sa.Column("merged_into", Int64),
        _integer("traversal_id"),
        sa.Column("label_belief", Json, nullable=False),
        sa.Column("engine_state", Json, nullable=False),
        sa.Column("voxels", Blob, nullable=False),
        sa.Column("embedding", Blob),
        sa.PrimaryKeyConstraint("number", name=op.f("pk_instance")),
        sa.UniqueConstraint("id", name=op.f("uq_instance_id")),
        sa.ForeignKeyConstraint(
            ["merged_into"],
            ["instance.number"],
            name=op.f("fk_instance_merged_into"),
            deferrable=True,
            initially="DEFERRED",
        ),
        sa.ForeignKeyConstraint(["traversal_id"], ["traversal.id"], name=op.f("fk_instance_traversal_id")),
        sa.CheckConstraint("presence IN ('present', 'absent', 'doubted')", name=op.f("ck_instance_presence")),
        sa.CheckConstraint("last_seen_ns >= first_seen_ns", name=op.f("ck_instance_span")),
        sa.CheckConstraint("size_x >= 0 AND size_y >= 0 AND size_z >= 0", name=op.f("ck_instance_size")),
        sa.CheckConstraint("observations >= 0", name=op.f("ck_instance_observations")),
        sa.CheckConstraint("merged_into <> number", name=op.f("ck_instance_merged_into")),
        sqlite_strict=True,
    )
    op.create_index("ix_instance_label", "instance", ["label"])


def _create_observations() -> None:
    op.create_table(
        "observation",
        _integer("id"),
        _integer("keyframe_id"),
        _integer("instance_number"),
        _integer("track_id"),
        _text("label"),
        *_reals("score", "u_min", "v_min", "u_max", "v_max", "x", "y", "z"),
        _integer("evidence_for"),
        _integer("evidence_against"),
        sa.Column("hypotheses", Json, nullable=False),
        sa.Column("crop_jpeg", Blob),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_observation")),
        sa.ForeignKeyConstraint(["keyframe_id"], ["keyframe.id"], name=op.f("fk_observation_keyframe_id")),
        sa.ForeignKeyConstraint(["instance_number"], ["instance.number"], name=op.f("fk_observation_instance_number")),
        sa.CheckConstraint("score >= 0 AND score <= 1", name=op.f("ck_observation_score")),
        sa.CheckConstraint("evidence_for >= 0 AND evidence_against >= 0", name=op.f("ck_observation_evidence")),
        sqlite_strict=True,
    )
    op.create_index("ix_observation_keyframe_id", "observation", ["keyframe_id"])
    op.create_index("ix_observation_instance_number", "observation", ["instance_number"])


def _create_states() -> None:
    op.create_table(
        "state",
        _integer("id"),
        _integer("instance_number"),
        _integer("state_index"),
        _integer("first_seen_ns"),
        _integer("last_seen_ns"),
        sa.Column("gone_ns", Int64),
        sa.Column("empty_before_ns", Int64),
        _text("label"),
        *_reals("confidence"),
        *_place(),
        _integer("traversal_id"),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_state")),
        sa.UniqueConstraint("instance_number", "state_index", name=op.f("uq_state_instance_number_state_index")),
        sa.ForeignKeyConstraint(["instance_number"], ["instance.number"], name=op.f("fk_state_instance_number")),
        sa.ForeignKeyConstraint(["traversal_id"], ["traversal.id"], name=op.f("fk_state_traversal_id")),
        sa.CheckConstraint("state_index >= 0", name=op.f("ck_state_state_index")),
        sa.CheckConstraint("last_seen_ns >= first_seen_ns", name=op.f("ck_state_support")),
        sa.CheckConstraint("gone_ns > last_seen_ns", name=op.f("ck_state_gone")),
        sa.CheckConstraint("empty_before_ns < first_seen_ns", name=op.f("ck_state_empty_before")),
        sa.CheckConstraint("confidence >= 0 AND confidence <= 1", name=op.f("ck_state_confidence")),
        sa.CheckConstraint("size_x >= 0 AND size_y >= 0 AND size_z >= 0", name=op.f("ck_state_size")),
        sqlite_strict=True,
    )
    op.create_table(
        "visit",
        _integer("traversal_id"),
        _integer("instance_number"),
        _integer("supported"),
        _integer("in_view"),
        _integer("contradicted"),
        sa.Column("first_support_ns", Int64),
        sa.Column("last_support_ns", Int64),
        sa.PrimaryKeyConstraint("traversal_id", "instance_number", name=op.f("pk_visit")),
        sa.ForeignKeyConstraint(["traversal_id"], ["traversal.id"], name=op.f("fk_visit_traversal_id")),
        sa.ForeignKeyConstraint(["instance_number"], ["instance.number"], name=op.f("fk_visit_instance_number")),
        sa.CheckConstraint("supported >= 0 AND in_view >= 0 AND contradicted >= 0", name=op.f("ck_visit_counts")),
        sa.CheckConstraint("last_support_ns >= first_support_ns", name=op.f("ck_visit_support")),
        sqlite_strict=True,
    )


def _create_spatial_edges() -> None:
    op.create_table(
        "spatial_edge",
        _integer("id"),
        _integer("subject_number"),
        _text("relation"),
        _integer("object_number"),
        _integer("since_ns"),
        sa.Column("until_ns", Int64),
        *_reals("confidence"),
        _integer("traversal_id"),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_spatial_edge")),
        sa.UniqueConstraint(
            "subject_number",
            "relation",
            "object_number",
            "since_ns",
            name=op.f("uq_spatial_edge_subject_number_relation_object_number_since_ns"),
        ),
        sa.ForeignKeyConstraint(["subject_number"], ["instance.number"], name=op.f("fk_spatial_edge_subject_number")),
        sa.ForeignKeyConstraint(["object_number"], ["instance.number"], name=op.f("fk_spatial_edge_object_number")),
        sa.ForeignKeyConstraint(["traversal_id"], ["traversal.id"], name=op.f("fk_spatial_edge_traversal_id")),
        sa.CheckConstraint("subject_number <> object_number", name=op.f("ck_spatial_edge_two_ends")),
        sa.CheckConstraint("until_ns > since_ns", name=op.f("ck_spatial_edge_interval")),
        sa.CheckConstraint("confidence >= 0 AND confidence <= 1", name=op.f("ck_spatial_edge_confidence")),
        sqlite_strict=True,
    )
    op.create_index("ix_spatial_edge_object_number", "spatial_edge", ["object_number"])


def _create_temporal_edges() -> None:
    states = ["state.instance_number", "state.state_index"]
    op.create_table(
        "temporal_edge",
        _integer("id"),
        _text("kind"),
        _integer("from_number"),
        sa.Column("from_state", Int64),
        _integer("to_number"),
        sa.Column("to_state", Int64),
        sa.Column("not_before_ns", Int64),
        _integer("not_after_ns"),
        *_reals("probability"),
        sa.Column("distance_m", Real),
        _integer("traversal_id"),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_temporal_edge")),
        sa.ForeignKeyConstraint(["from_number"], ["instance.number"], name=op.f("fk_temporal_edge_from_number")),
        sa.ForeignKeyConstraint(["to_number"], ["instance.number"], name=op.f("fk_temporal_edge_to_number")),
        sa.ForeignKeyConstraint(
            ["from_number", "from_state"],
            states,
            name=op.f("fk_temporal_edge_from_number_from_state"),
            deferrable=True,
            initially="DEFERRED",
        ),
        sa.ForeignKeyConstraint(
            ["to_number", "to_state"],
            states,
            name=op.f("fk_temporal_edge_to_number_to_state"),
            deferrable=True,
            initially="DEFERRED",
        ),
        sa.ForeignKeyConstraint(["traversal_id"], ["traversal.id"], name=op.f("fk_temporal_edge_traversal_id")),
        sa.CheckConstraint(
            "kind IN ('appeared', 'persisted', 'moved', 'disappeared', 'reappeared', 'merged', 'split', 'candidate')",
            name=op.f("ck_temporal_edge_kind"),
        ),
        sa.CheckConstraint("not_before_ns <= not_after_ns", name=op.f("ck_temporal_edge_bounds")),
        sa.CheckConstraint("probability >= 0 AND probability <= 1", name=op.f("ck_temporal_edge_probability")),
        sa.CheckConstraint("distance_m >= 0", name=op.f("ck_temporal_edge_distance")),
        sqlite_strict=True,
    )
    op.create_index("ix_temporal_edge_from_number_from_state", "temporal_edge", ["from_number", "from_state"])
    op.create_index("ix_temporal_edge_to_number_to_state", "temporal_edge", ["to_number", "to_state"])


def _create_before_images() -> None:
    op.create_table(
        "before_image",
        _integer("traversal_id"),
        _text("table_name"),
        _integer("row_key"),
        sa.Column("content", Json, nullable=False),
        sa.PrimaryKeyConstraint("traversal_id", "table_name", "row_key", name=op.f("pk_before_image")),
        sa.ForeignKeyConstraint(["traversal_id"], ["traversal.id"], name=op.f("fk_before_image_traversal_id")),
        sqlite_strict=True,
    )
