"""Reads of the whole memory, row by row: what is held at once does not grow with the memory.

What was merged counts for its survivor, as in `MapReader`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from typing import Any, TypeVar

from sqlalchemy import Row, Select, select
from sqlalchemy.orm import aliased

from supermap_cli.memory import blobs, rows
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance, StoredVisit
from supermap_cli.types.memory import StateRecord, VoxelCloud
from supermap_schema.models import Instance, Keyframe, Observation, SpatialEdge, State, TemporalEdge, Visit

Item = TypeVar("Item")
AnyRow = Row[tuple[Any, ...]]

FETCHED = 500
"""Rows read ahead."""


def survivors_of_merged(reader: MapReader) -> dict[int, tuple[int, str]]:
    """The number of every instance that was merged into another -> number and id of the one it is part of today."""
    merged = {
        row.number: row.merged_into
        for row in reader.connection.execute(
            select(Instance.number, Instance.merged_into).where(Instance.merged_into.is_not(None))
        )
    }
    ids: dict[int, str] = {}
    ends = {number: _end(number, merged) for number in merged}
    for end in set(ends.values()):
        ids[end] = reader.connection.execute(select(Instance.id).where(Instance.number == end)).scalar_one()
    return {number: (end, ids[end]) for number, end in ends.items()}


def stream_instances(reader: MapReader) -> Iterator[StoredInstance]:
    """All instances that stand for themselves, with their states and visits, in the order of their numbers."""
    merged = survivors_of_merged(reader)
    parts: dict[int, list[int]] = {}
    for number, (survivor, _) in sorted(merged.items()):
        parts.setdefault(survivor, []).append(number)
    lent = {number: tuple(_visits_of(reader, numbers)) for number, numbers in parts.items()}
    states = _Groups(
        _stream(reader, select(State.__table__).order_by(State.instance_number, State.state_index)),
        lambda row: int(row.instance_number),
    )
    visits = _Groups(
        _stream(reader, select(Visit.__table__).order_by(Visit.instance_number, Visit.traversal_id)),
        lambda row: int(row.instance_number),
    )
    standing = select(*rows.INSTANCE_WITHOUT_GEOMETRY).where(Instance.merged_into.is_(None)).order_by(Instance.number)
    for row in _stream(reader, standing):
        own_states: tuple[StateRecord, ...] = tuple(map(rows.state_record, states.of(row.number)))
        own_visits = [_visit(each) for each in visits.of(row.number)]
        summed = _summed(row.number, [*own_visits, *lent.get(row.number, ())])
        numbers = tuple(sorted((row.number, *parts.get(row.number, ()))))
        yield rows.stored_instance(row, numbers, own_states, summed)


def stream_geometry(reader: MapReader) -> Iterator[tuple[int, VoxelCloud]]:
    """Number and voxels of all instances that stand for themselves, in the order of their numbers."""
    statement = select(Instance.number, Instance.voxels).where(Instance.merged_into.is_(None)).order_by(Instance.number)
    for row in _stream(reader, statement, most=20):
        yield row.number, blobs.decode_voxels(row.voxels)


def stream_observations(reader: MapReader) -> Iterator[AnyRow]:
    """All observations without their crops, each with its keyframe's stamp and traversal and its `instance_id`."""
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
        .order_by(Observation.id)
    )
    return _stream(reader, statement)


def stream_keyframes(reader: MapReader) -> Iterator[AnyRow]:
    """All keyframes without their images, by traversal and time."""
    columns = [column for column in Keyframe.__table__.columns if column.name not in {"depth_png", "thumbnail_jpeg"}]
    return _stream(reader, select(*columns).order_by(Keyframe.traversal_id, Keyframe.stamp_ns))


def stream_spatial_edges(reader: MapReader) -> Iterator[AnyRow]:
    """All spatial edges with the `subject_id` and `object_id` of their ends, in the order of writing."""
    subject, other = aliased(Instance), aliased(Instance)
    statement = (
        select(SpatialEdge.__table__, subject.id.label("subject_id"), other.id.label("object_id"))
        .join(subject, subject.number == SpatialEdge.subject_number)
        .join(other, other.number == SpatialEdge.object_number)
        .order_by(SpatialEdge.id)
    )
    return _stream(reader, statement)


def stream_temporal_edges(reader: MapReader) -> Iterator[AnyRow]:
    """All temporal edges with the `from_id` and `to_id` of their ends, in the order of writing."""
    source, target = aliased(Instance), aliased(Instance)
    statement = (
        select(TemporalEdge.__table__, source.id.label("from_id"), target.id.label("to_id"))
        .join(source, source.number == TemporalEdge.from_number)
        .join(target, target.number == TemporalEdge.to_number)
        .order_by(TemporalEdge.id)
    )
    return _stream(reader, statement)


def _stream(reader: MapReader, statement: Select[*tuple[Any, ...]], *, most: int = 0) -> Iterator[AnyRow]:
    yield from reader.connection.execute(statement.execution_options(yield_per=most or FETCHED))


class _Groups:
    """Rows that come sorted by a number, handed out group by group to a caller who asks in the same order."""

    def __init__(self, found: Iterable[AnyRow], number_of: Callable[[AnyRow], int]) -> None:
        self._groups = groupby(found, number_of)
        self._next = next(self._groups, None)

    def of(self, number: int) -> list[AnyRow]:
        """The rows of a number; those of smaller numbers are passed over."""
        while self._next is not None and self._next[0] < number:
            self._next = next(self._groups, None)
        if self._next is None or self._next[0] != number:
            return []
        found = list(self._next[1])
        self._next = next(self._groups, None)
        return found


def _end(number: int, merged: dict[int, int]) -> int:
    """Where a chain of merges ends; a circle, which `db check` reports, ends where it began."""
    seen = {number}
    end = merged[number]
    while end in merged and end not in seen:
        seen.add(end)
        end = merged[end]
    return end


def _visits_of(reader: MapReader, numbers: Iterable[int]) -> Iterator[StoredVisit]:
    for number in numbers:
        statement = select(Visit.__table__).where(Visit.instance_number == number)
        yield from map(_visit, reader.connection.execute(statement))


def _visit(row: AnyRow) -> StoredVisit:
    return StoredVisit(
        row.traversal_id,
        row.instance_number,
        row.supported,
        row.in_view,
        row.contradicted,
        row.first_support_ns,
        row.last_support_ns,
    )


def _summed(number: int, visits: list[StoredVisit]) -> tuple[StoredVisit, ...]:
    """One visit for each traversal, over an instance and those merged into it."""
    by_traversal: dict[int, list[StoredVisit]] = {}
    for visit in visits:
        by_traversal.setdefault(visit.traversal_id, []).append(visit)
    return tuple(_sum(number, traversal_id, by_traversal[traversal_id]) for traversal_id in sorted(by_traversal))


def _sum(number: int, traversal_id: int, visits: list[StoredVisit]) -> StoredVisit:
    first = [each.first_support_ns for each in visits if each.first_support_ns is not None]
    last = [each.last_support_ns for each in visits if each.last_support_ns is not None]
    return StoredVisit(
        traversal_id=traversal_id,
        instance_number=number,
        supported=sum(each.supported for each in visits),
        in_view=sum(each.in_view for each in visits),
        contradicted=sum(each.contradicted for each in visits),
        first_support_ns=min(first, default=None),
        last_support_ns=max(last, default=None),
    )
