"""The tables of the 4D memory (SQLAlchemy 2, portable SQL; `sqlite` and `postgresql` have the rest).

Times are sensor time, int nanoseconds since the epoch (`_ns`). Positions are metres in the map frame (z up, level): a
position is `x, y, z`, of an instance or state the centre of its box; a box is `center_*`, `size_*` along its own axes
and `yaw` in radians about z. Transforms are JSON, four rows of four numbers. `traversal_id` of an instance, state or
edge is the traversal that wrote it first.
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    CheckConstraint,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    MetaData,
    UniqueConstraint,
    text,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from supermap_schema.columns import Blob, Int64, Json, Label, Real
from supermap_schema.postgresql import MARK

PRESENCES = ("present", "absent", "doubted")
TRAVERSAL_STATUSES = ("building", "complete")
TEMPORAL_KINDS = ("appeared", "persisted", "moved", "disappeared", "reappeared", "merged", "split", "candidate")


WITH_CROP = text("crop_jpeg IS NOT NULL")
GONE = text("gone_ns IS NOT NULL")
MERGED = text("merged_into IS NOT NULL")
NOT_MERGED = text("merged_into IS NULL")
"""Nearly all queries ask for surviving instances only; their indices contain no others."""


def _one_of(column: str, values: tuple[str, ...]) -> str:
    return f"{column} IN ({', '.join(repr(value) for value in values)})"


class Base(DeclarativeBase):
    """All tables; constraints have names, so that migrations can refer to them."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_N_name)s",
            "pk": "pk_%(table_name)s",
        }
    )


STRICT: dict[str, Any] = {"sqlite_strict": True}


class Traversal(Base):
    """One recording, or a part of one, that was built into the map.

    `fingerprint` identifies the recording; `config` and `versions` say how it was built; `timings` holds seconds per
    stage and is the only column that differs between equal builds; `status` is "building" until the build is complete;
    `mapped_ns` is the stamp of the newest committed keyframe; `keyframes` and `observations` are numbers of rows;
    `warnings` is a JSON list of the warnings of the recording, the odometry and the build.

    All times of a traversal are its recording's plus `clock_shift_ns`, which is 0 unless the recording starts before
    the end of the map: the map's time increases in the order of building. Most crops, observations and thumbnails of
    keyframes before `crops_kept_from_ns`, `observations_kept_from_ns` and `thumbnails_kept_from_ns` were pruned
    (`supermap db vacuum`).
    """

    __tablename__ = "traversal"

    id: Mapped[int] = mapped_column(Int64, primary_key=True)
    number: Mapped[int] = mapped_column(Int64, unique=True)
    name: Mapped[str] = mapped_column(Label, unique=True)
    recording: Mapped[str] = mapped_column(Label)
    fingerprint: Mapped[str] = mapped_column(Label, index=True)
    start_ns: Mapped[int] = mapped_column(Int64)
    end_ns: Mapped[int] = mapped_column(Int64)
    T_map_odom: Mapped[str] = mapped_column(Json)
    config: Mapped[str] = mapped_column(Json)
    versions: Mapped[str] = mapped_column(Json)
    status: Mapped[str] = mapped_column(Label)
    mapped_ns: Mapped[int | None] = mapped_column(Int64)
    timings: Mapped[str | None] = mapped_column(Json)
    clock_shift_ns: Mapped[int] = mapped_column(Int64, server_default=text("0"))
    crops_kept_from_ns: Mapped[int | None] = mapped_column(Int64)
    observations_kept_from_ns: Mapped[int | None] = mapped_column(Int64)
    thumbnails_kept_from_ns: Mapped[int | None] = mapped_column(Int64)
    keyframes: Mapped[int] = mapped_column(Int64, server_default=text("0"))
    observations: Mapped[int] = mapped_column(Int64, server_default=text("0"))
    warnings: Mapped[str] = mapped_column(Json, server_default=text("'[]'"))

    __table_args__ = (
        CheckConstraint("end_ns >= start_ns", name="span"),
        CheckConstraint(_one_of("status", TRAVERSAL_STATUSES), name="status"),
        STRICT | {"comment": MARK},
    )


class Keyframe(Base):
    """One mapped image: the poses of robot and camera, and a small depth image, which shows the free space.

    `depth_png` is a 16-bit PNG in millimetres, 0 = no return, one pixel for every `depth_step` pixels of the camera.
    `camera` is the camera model as JSON, `camera_id` the camera's name; the cameras of a rig may share stamps.
    """

    __tablename__ = "keyframe"

    id: Mapped[int] = mapped_column(Int64, primary_key=True)
    traversal_id: Mapped[int] = mapped_column(Int64, ForeignKey("traversal.id"))
    stamp_ns: Mapped[int] = mapped_column(Int64)
    detected: Mapped[int] = mapped_column(Int64)
    T_map_base: Mapped[str] = mapped_column(Json)
    T_map_camera: Mapped[str] = mapped_column(Json)
    camera: Mapped[str] = mapped_column(Json)
    depth_step: Mapped[int] = mapped_column(Int64)
    depth_png: Mapped[bytes] = mapped_column(Blob)
    thumbnail_jpeg: Mapped[bytes | None] = mapped_column(Blob)
    camera_id: Mapped[str] = mapped_column(Label)

    __table_args__ = (
        UniqueConstraint("traversal_id", "stamp_ns", "camera_id"),
        CheckConstraint("detected IN (0, 1)", name="detected"),
        CheckConstraint("depth_step >= 1", name="depth_step"),
        STRICT,
    )


class Instance(Base):
    """One object. `number` is its identity in the map, `id` its readable name ("chair-7"); neither ever changes."""

    __tablename__ = "instance"

    number: Mapped[int] = mapped_column(Int64, primary_key=True, autoincrement=False)
    id: Mapped[str] = mapped_column(Label, unique=True)
    label: Mapped[str] = mapped_column(Label, index=True)
    presence: Mapped[str] = mapped_column(Label)
    existence_log_odds: Mapped[float] = mapped_column(Real)
    first_seen_ns: Mapped[int] = mapped_column(Int64)
    last_seen_ns: Mapped[int] = mapped_column(Int64)
    x: Mapped[float] = mapped_column(Real)
    y: Mapped[float] = mapped_column(Real)
    z: Mapped[float] = mapped_column(Real)
    center_x: Mapped[float] = mapped_column(Real)
    center_y: Mapped[float] = mapped_column(Real)
    center_z: Mapped[float] = mapped_column(Real)
    size_x: Mapped[float] = mapped_column(Real)
    size_y: Mapped[float] = mapped_column(Real)
    size_z: Mapped[float] = mapped_column(Real)
    yaw: Mapped[float] = mapped_column(Real)
    observations: Mapped[int] = mapped_column(Int64)
    merged_into: Mapped[int | None] = mapped_column(
        Int64, ForeignKey("instance.number", deferrable=True, initially="DEFERRED")
    )
    traversal_id: Mapped[int] = mapped_column(Int64, ForeignKey("traversal.id"))
    label_belief: Mapped[str] = mapped_column(Json)
    engine_state: Mapped[str] = mapped_column(Json)
    voxels: Mapped[bytes] = mapped_column(Blob)
    embedding: Mapped[bytes | None] = mapped_column(Blob)

    __table_args__ = (
        Index(None, "label", "presence", "last_seen_ns", sqlite_where=NOT_MERGED),
        Index(None, "presence", "last_seen_ns", sqlite_where=NOT_MERGED),
        Index(None, "merged_into", sqlite_where=MERGED),
        CheckConstraint(_one_of("presence", PRESENCES), name="presence"),
        CheckConstraint("last_seen_ns >= first_seen_ns", name="span"),
        CheckConstraint("size_x >= 0 AND size_y >= 0 AND size_z >= 0", name="size"),
        CheckConstraint("observations >= 0", name="observations"),
        CheckConstraint("merged_into <> number", name="merged_into"),
        STRICT,
    )


class Observation(Base):
    """One detection of one instance; immutable. `hypotheses` is a JSON list of [label, score], best first.

    Observations and crops are deleted only below the limits that their traversal declares (`*_kept_from_ns`).
    """

    __tablename__ = "observation"

    id: Mapped[int] = mapped_column(Int64, primary_key=True)
    keyframe_id: Mapped[int] = mapped_column(Int64, ForeignKey("keyframe.id"), index=True)
    instance_number: Mapped[int] = mapped_column(Int64, ForeignKey("instance.number"))
    track_id: Mapped[int] = mapped_column(Int64)
    label: Mapped[str] = mapped_column(Label)
    score: Mapped[float] = mapped_column(Real)
    u_min: Mapped[float] = mapped_column(Real)
    v_min: Mapped[float] = mapped_column(Real)
    u_max: Mapped[float] = mapped_column(Real)
    v_max: Mapped[float] = mapped_column(Real)
    x: Mapped[float] = mapped_column(Real)
    y: Mapped[float] = mapped_column(Real)
    z: Mapped[float] = mapped_column(Real)
    evidence_for: Mapped[int] = mapped_column(Int64)
    evidence_against: Mapped[int] = mapped_column(Int64)
    hypotheses: Mapped[str] = mapped_column(Json)
    crop_jpeg: Mapped[bytes | None] = mapped_column(Blob)

    __table_args__ = (
        Index(None, "instance_number", "keyframe_id", "score"),
        Index(None, "instance_number", sqlite_where=WITH_CROP),
        CheckConstraint("score >= 0 AND score <= 1", name="score"),
        CheckConstraint("evidence_for >= 0 AND evidence_against >= 0", name="evidence"),
        STRICT,
    )


class State(Base):
    """The half-open interval in which an instance was in one place.

    It was observed from `first_seen_ns` to `last_seen_ns`; `gone_ns` is the first contradiction after that,
    `empty_before_ns` the last time that its place was seen empty before. In between its presence is unknown.
    """

    __tablename__ = "state"

    id: Mapped[int] = mapped_column(Int64, primary_key=True)
    instance_number: Mapped[int] = mapped_column(Int64, ForeignKey("instance.number"))
    state_index: Mapped[int] = mapped_column(Int64)
    first_seen_ns: Mapped[int] = mapped_column(Int64)
    last_seen_ns: Mapped[int] = mapped_column(Int64)
    gone_ns: Mapped[int | None] = mapped_column(Int64)
    empty_before_ns: Mapped[int | None] = mapped_column(Int64)
    label: Mapped[str] = mapped_column(Label)
    confidence: Mapped[float] = mapped_column(Real)
    x: Mapped[float] = mapped_column(Real)
    y: Mapped[float] = mapped_column(Real)
    z: Mapped[float] = mapped_column(Real)
    center_x: Mapped[float] = mapped_column(Real)
    center_y: Mapped[float] = mapped_column(Real)
    center_z: Mapped[float] = mapped_column(Real)
    size_x: Mapped[float] = mapped_column(Real)
    size_y: Mapped[float] = mapped_column(Real)
    size_z: Mapped[float] = mapped_column(Real)
    yaw: Mapped[float] = mapped_column(Real)
    traversal_id: Mapped[int] = mapped_column(Int64, ForeignKey("traversal.id"))

    __table_args__ = (
        UniqueConstraint("instance_number", "state_index"),
        Index(None, "label", "instance_number"),
        Index(None, "first_seen_ns", "instance_number"),
        Index(None, "gone_ns", "instance_number", sqlite_where=GONE),
        CheckConstraint("state_index >= 0", name="state_index"),
        CheckConstraint("last_seen_ns >= first_seen_ns", name="support"),
        CheckConstraint("gone_ns > last_seen_ns", name="gone"),
        CheckConstraint("empty_before_ns < first_seen_ns", name="empty_before"),
        CheckConstraint("confidence >= 0 AND confidence <= 1", name="confidence"),
        CheckConstraint("size_x >= 0 AND size_y >= 0 AND size_z >= 0", name="size"),
        STRICT,
    )


class Visit(Base):
    """In how many keyframes of one traversal an instance's place was supported, in view, and contradicted."""

    __tablename__ = "visit"

    traversal_id: Mapped[int] = mapped_column(Int64, ForeignKey("traversal.id"), primary_key=True)
    instance_number: Mapped[int] = mapped_column(Int64, ForeignKey("instance.number"), primary_key=True)
    supported: Mapped[int] = mapped_column(Int64)
    in_view: Mapped[int] = mapped_column(Int64)
    contradicted: Mapped[int] = mapped_column(Int64)
    first_support_ns: Mapped[int | None] = mapped_column(Int64)
    last_support_ns: Mapped[int | None] = mapped_column(Int64)

    __table_args__ = (
        Index(None, "instance_number", "traversal_id"),
        CheckConstraint("supported >= 0 AND in_view >= 0 AND contradicted >= 0", name="counts"),
        CheckConstraint("last_support_ns >= first_support_ns", name="support"),
        STRICT,
    )


class SpatialEdge(Base):
    """`subject` was in `relation` to `object` during [since_ns, until_ns), open while `until_ns` is NULL."""

    __tablename__ = "spatial_edge"

    id: Mapped[int] = mapped_column(Int64, primary_key=True)
    subject_number: Mapped[int] = mapped_column(Int64, ForeignKey("instance.number"))
    relation: Mapped[str] = mapped_column(Label)
    object_number: Mapped[int] = mapped_column(Int64, ForeignKey("instance.number"), index=True)
    since_ns: Mapped[int] = mapped_column(Int64)
    until_ns: Mapped[int | None] = mapped_column(Int64)
    confidence: Mapped[float] = mapped_column(Real)
    traversal_id: Mapped[int] = mapped_column(Int64, ForeignKey("traversal.id"))

    __table_args__ = (
        UniqueConstraint("subject_number", "relation", "object_number", "since_ns"),
        CheckConstraint("subject_number <> object_number", name="two_ends"),
        CheckConstraint("until_ns > since_ns", name="interval"),
        CheckConstraint("confidence >= 0 AND confidence <= 1", name="confidence"),
        STRICT,
    )


class TemporalEdge(Base):
    """A change between two states, within the bounds [not_before_ns, not_after_ns]."""

    __tablename__ = "temporal_edge"

    id: Mapped[int] = mapped_column(Int64, primary_key=True)
    kind: Mapped[str] = mapped_column(Label)
    from_number: Mapped[int] = mapped_column(Int64, ForeignKey("instance.number"))
    from_state: Mapped[int | None] = mapped_column(Int64)
    to_number: Mapped[int] = mapped_column(Int64, ForeignKey("instance.number"))
    to_state: Mapped[int | None] = mapped_column(Int64)
    not_before_ns: Mapped[int | None] = mapped_column(Int64)
    not_after_ns: Mapped[int] = mapped_column(Int64)
    probability: Mapped[float] = mapped_column(Real)
    distance_m: Mapped[float | None] = mapped_column(Real)
    traversal_id: Mapped[int] = mapped_column(Int64, ForeignKey("traversal.id"))

    __table_args__ = (
        ForeignKeyConstraint(
            ["from_number", "from_state"],
            ["state.instance_number", "state.state_index"],
            deferrable=True,
            initially="DEFERRED",
        ),
        ForeignKeyConstraint(
            ["to_number", "to_state"],
            ["state.instance_number", "state.state_index"],
            deferrable=True,
            initially="DEFERRED",
        ),
        Index(None, "from_number", "from_state"),
        Index(None, "to_number", "to_state"),
        Index(None, "not_after_ns"),
        CheckConstraint(_one_of("kind", TEMPORAL_KINDS), name="kind"),
        CheckConstraint("not_before_ns <= not_after_ns", name="bounds"),
        CheckConstraint("probability >= 0 AND probability <= 1", name="probability"),
        CheckConstraint("distance_m >= 0", name="distance"),
        STRICT,
    )


class BeforeImage(Base):
    """A row before an unfinished traversal changed it, so that the traversal can be rolled back.

    `content` is the row as JSON (blobs as {"hex": ...}). Deleted when the build is complete.
    """

    __tablename__ = "before_image"

    traversal_id: Mapped[int] = mapped_column(Int64, ForeignKey("traversal.id"), primary_key=True)
    table_name: Mapped[str] = mapped_column(Label, primary_key=True)
    row_key: Mapped[int] = mapped_column(Int64, primary_key=True)
    content: Mapped[str] = mapped_column(Json)

    __table_args__ = (STRICT,)


class Checkpoint(Base):
    """The state of a build after the keyframe at `stamp_ns`, in parts; deleted when the build is complete.

    The format of `content` is documented in `supermap_cli.memory.blobs`.
    """

    __tablename__ = "checkpoint"

    traversal_id: Mapped[int] = mapped_column(Int64, ForeignKey("traversal.id"), primary_key=True)
    part: Mapped[str] = mapped_column(Label, primary_key=True)
    stamp_ns: Mapped[int] = mapped_column(Int64)
    content: Mapped[bytes] = mapped_column(Blob)

    __table_args__ = (STRICT,)


class Checksum(Base):
    """The checksum of the immutable rows of one table that belong to a complete traversal.

    What is covered, and how, is documented in `supermap_schema.checksums`; `digest` is 32 hexadecimal digits.
    """

    __tablename__ = "checksum"

    traversal_id: Mapped[int] = mapped_column(Int64, ForeignKey("traversal.id"), primary_key=True)
    table_name: Mapped[str] = mapped_column(Label, primary_key=True)
    row_count: Mapped[int] = mapped_column(Int64)
    digest: Mapped[str] = mapped_column(Label)

    __table_args__ = (STRICT,)


def with_postgresql_conditions() -> None:
    """Give the partial indices their conditions for PostgreSQL, too: asked for here, they would load its dialect for
    every map.
    """
    for table in Base.metadata.tables.values():
        for index in table.indexes:
            where = index.dialect_options["sqlite"].get("where")
            if where is not None:
                index.dialect_options["postgresql"]["where"] = where
