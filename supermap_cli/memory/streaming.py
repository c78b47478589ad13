"""Streams whole tables row by row, so that memory does not grow with the map.

Instances are read by `MapReader.iter_instances`; rows here keep the numbers of merged instances.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sqlalchemy import ColumnElement, Row, Select, select
from sqlalchemy.orm import aliased

from supermap_cli.memory import blobs
from supermap_cli.memory.reading import MapReader
from supermap_cli.types.memory import VoxelCloud
from supermap_schema.models import Instance, Keyframe, Observation, SpatialEdge, TemporalEdge

AnyRow = Row[tuple[Any, ...]]

FETCHED = 500
"""Rows fetched together."""


def survivors_of_merged(reader: MapReader) -> dict[int, tuple[int, str]]:
    """The number of every instance that was merged into another -> number and text id of the surviving instance."""
    merged = reader.connection.execute(select(Instance.number).where(Instance.merged_into.is_not(None))).scalars()
    survivors = reader.survivors.of(merged.all())
    ids = reader.text_ids.of(survivors.values())
    return {number: (survivor, ids[survivor]) for number, survivor in survivors.items()}


def stream_geometry(reader: MapReader) -> Iterator[tuple[int, VoxelCloud]]:
    """Number and voxels of all surviving instances in the order of their numbers."""
    statement = select(Instance.number, Instance.voxels).where(Instance.merged_into.is_(None)).order_by(Instance.number)
    for row in _stream(reader, statement, fetched=20):
        yield row.number, blobs.decode_voxels(row.voxels)


def stream_present_geometry(reader: MapReader) -> Iterator[tuple[int, VoxelCloud]]:
    """Number and voxels of all instances that are present now, in the order of their numbers."""
    present = (Instance.merged_into.is_(None)) & (Instance.presence == "present")
    statement = select(Instance.number, Instance.voxels).where(present).order_by(Instance.number)
    for row in _stream(reader, statement, fetched=20):
        yield row.number, blobs.decode_voxels(row.voxels)


def stream_observations(
    reader: MapReader, traversal_id: int | None = None, until_ns: int | None = None
) -> Iterator[AnyRow]:
    """Observations without their crops, with stamp and traversal of the keyframe and their `instance_id`.

    Only those of one traversal and until a time, if given.
    """
    columns = [column for column in Observation.__table__.columns if column.name != "crop_jpeg"]
    statement = (
        select(
            *columns,
            Observation.crop_jpeg.is_not(None).label("has_crop"),
            Keyframe.stamp_ns,
            Keyframe.traversal_id,
            Instance.id.label("instance_id"),
        )
        .join(Keyframe, Keyframe.id == Observation.keyframe_id)
        .join(Instance, Instance.number == Observation.instance_number)
        .where(*_within(traversal_id, until_ns))
        .order_by(Observation.id)
    )
    return _stream(reader, statement)


def stream_keyframes(
    reader: MapReader, traversal_id: int | None = None, until_ns: int | None = None
) -> Iterator[AnyRow]:
    """Keyframes without their images by traversal and time; only those of one and until a time, if given."""
    columns = [column for column in Keyframe.__table__.columns if column.name not in {"depth_png", "thumbnail_jpeg"}]
    statement = select(*columns).where(*_within(traversal_id, until_ns))
    return _stream(reader, statement.order_by(Keyframe.traversal_id, Keyframe.stamp_ns, Keyframe.id))


def stream_spatial_edges(reader: MapReader) -> Iterator[AnyRow]:
    """All spatial edges with the text ids `subject_id` and `object_id`, in the order of their row ids."""
    subject, other = aliased(Instance), aliased(Instance)
    statement = (
        select(SpatialEdge.__table__, subject.id.label("subject_id"), other.id.label("object_id"))
        .join(subject, subject.number == SpatialEdge.subject_number)
        .join(other, other.number == SpatialEdge.object_number)
        .order_by(SpatialEdge.id)
    )
    return _stream(reader, statement)


def stream_temporal_edges(reader: MapReader) -> Iterator[AnyRow]:
    """All temporal edges with the text ids `from_id` and `to_id`, in the order of their row ids."""
    source, target = aliased(Instance), aliased(Instance)
    statement = (
        select(TemporalEdge.__table__, source.id.label("from_id"), target.id.label("to_id"))
        .join(source, source.number == TemporalEdge.from_number)
        .join(target, target.number == TemporalEdge.to_number)
        .order_by(TemporalEdge.id)
    )
    return _stream(reader, statement)


def _stream(reader: MapReader, statement: Select[*tuple[Any, ...]], *, fetched: int = FETCHED) -> Iterator[AnyRow]:
    yield from reader.connection.execute(statement.execution_options(yield_per=fetched))


def _within(traversal_id: int | None, until_ns: int | None) -> Iterator[ColumnElement[bool]]:
    """Conditions on a keyframe."""
    if traversal_id is not None:
        yield Keyframe.traversal_id == traversal_id
    if until_ns is not None:
        yield Keyframe.stamp_ns <= until_ns
