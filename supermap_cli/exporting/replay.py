"""A finished map told to an observer once more, keyframe by keyframe, as a build would tell it.

What a memory does not keep is missing: full images, masks, and how things looked before what is known of them today.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np

from supermap_cli.exporting.selection import ExportSource
from supermap_cli.memory.images import thumbnails_of
from supermap_cli.memory.keyframe_views import keyframe_views
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.stored_values import parsed
from supermap_cli.memory.streaming import stream_keyframes, stream_observations
from supermap_cli.memory.values import StoredInstance, StoredTraversal
from supermap_cli.protocols import Observer
from supermap_cli.types.detections import Hypothesis
from supermap_cli.types.memory import (
    InstanceRecord,
    KeyframeRecord,
    MapDelta,
    Observation,
    SpatialEdge,
    StateRecord,
    TemporalEdge,
    VoxelCloud,
)
from supermap_cli.types.session import SessionContext, SessionSummary


@dataclass(frozen=True)
class _Event:
    """A change of the map at a time: one of an instance's states begins or ends, or an edge does, or a change is
    known.
    """

    stamp_ns: int
    instance: StoredInstance | None = None
    state: StateRecord | None = None
    begins: bool = True
    spatial: SpatialEdge | None = None
    temporal: TemporalEdge | None = None


def replay(source: ExportSource, observer: Observer, viewers: dict[str, str]) -> int:
    """Tell all selected traversals in the order of time; returns the number of keyframes.

    As of a time, up to that time.
    """
    events = sorted(_events(source), key=attrgetter("stamp_ns"))
    keyframes = 0
    told = 0
    for traversal in sorted(source.traversals, key=attrgetter("start_ns")):
        observer.started(_context(source, traversal, viewers))
        observations = _observations(source, traversal)
        seen = 0
        for keyframe_id, record in source.with_progress("keyframes", _keyframes(source, traversal)):
            until = told
            while until < len(events) and events[until].stamp_ns <= record.stamp_ns:
                until += 1
            found = tuple(replace(each, camera_id=record.camera_id) for each in observations.pop(keyframe_id, ()))
            observer.mapped(record, replace(_delta(source, events[told:until]), observations=found))
            told, seen, keyframes = until, seen + len(found), keyframes + 1
        until = told
        while until < len(events) and events[until].stamp_ns <= traversal.end_ns:
            until += 1
        observer.mapped(None, _delta(source, events[told:until]))
        told = until
        complete, objects = traversal.status == "complete", _standing(events[:told])
        observer.ended(SessionSummary(complete, traversal.keyframes, seen, objects))
    return keyframes


def names(source: ExportSource) -> dict[int, str]:
    """The text ids of the selected instances by their numbers."""
    return {instance.number: instance.id for instance in _instances(source)}


def _context(source: ExportSource, traversal: StoredTraversal, viewers: dict[str, str]) -> SessionContext:
    where, shift_ns = source.reader.where, traversal.clock_shift_ns
    return SessionContext(
        traversal.recording, where, traversal.name, (), {}, traversal.T_map_odom, shift_ns, viewers=viewers
    )


def _standing(events: Sequence[_Event]) -> int:
    standing: dict[int, bool] = {}
    for event in events:
        if event.instance is not None:
            standing[event.instance.number] = event.begins
    return sum(standing.values())


def _instances(source: ExportSource) -> Iterator[StoredInstance]:
    for instance in source.reader.iter_instances(visits=False):
        if instance.presence != "doubted" and source.selection.has_label(instance.label):
            yield instance


def _events(source: ExportSource) -> Iterator[_Event]:
    until_ns = source.selection.at_ns
    numbers = set()
    for instance in _instances(source):
        numbers.add(instance.number)
        for state in instance.states:
            gone = state.gone_ns is not None and (until_ns is None or state.gone_ns <= until_ns)
            if until_ns is None or state.first_seen_ns <= until_ns:
                begun = state if gone else replace(state, gone_ns=None)
                yield _Event(state.first_seen_ns, instance, begun)
            if gone and state.gone_ns is not None:
                yield _Event(state.gone_ns, instance, state, begins=False)
    for edge in source.reader.edges_of(numbers):
        if not {edge.subject, edge.object} <= numbers or (until_ns is not None and edge.since_ns > until_ns):
            continue
        yield _Event(edge.since_ns, spatial=replace(edge, until_ns=None))
        if edge.until_ns is not None and (until_ns is None or edge.until_ns <= until_ns):
            yield _Event(edge.until_ns, spatial=edge)
    for change in source.reader.temporal_edges(numbers):
        if until_ns is None or change.not_after_ns <= until_ns:
            yield _Event(change.not_after_ns, temporal=change)


def _delta(source: ExportSource, events: Sequence[_Event]) -> MapDelta:
    """Of an instance whose states change, its newest shape, moved to where it stood."""
    changed = {event.instance.number: event for event in events if event.instance is not None}
    voxels = source.reader.voxels_of(changed)
    return MapDelta(
        instances=tuple(_record(event, voxels[number]) for number, event in changed.items()),
        states=tuple(event.state for event in events if event.state is not None),
        spatial_edges=tuple(event.spatial for event in events if event.spatial is not None),
        temporal_edges=tuple(event.temporal for event in events if event.temporal is not None),
    )


def _record(event: _Event, voxels: VoxelCloud) -> InstanceRecord:
    instance, state = event.instance, event.state
    assert instance is not None  # noqa: S101 - only those are asked for
    assert state is not None  # noqa: S101
    shift = np.round((state.centroid_map - instance.states[-1].centroid_map) / voxels.voxel_m).astype(np.int32)
    return InstanceRecord(
        number=instance.number,
        label=instance.label,
        label_belief=instance.label_belief,
        existence_log_odds=instance.existence_log_odds,
        presence="present" if event.begins else "absent",
        first_seen_ns=instance.first_seen_ns,
        last_seen_ns=state.last_seen_ns,
        centroid_map=state.centroid_map,
        box=state.box,
        voxels=replace(voxels, keys=voxels.keys + shift),
        observations=instance.observations,
    )


def _keyframes(source: ExportSource, traversal: StoredTraversal) -> Iterator[tuple[int, KeyframeRecord]]:
    """The keyframes with their thumbnails, in the order of time."""
    ids = [row.id for row in stream_keyframes(source.reader, traversal.id, source.selection.at_ns)]
    for batch in batches(ids):
        views = dict(zip(sorted(batch), keyframe_views(source.reader.connection, batch), strict=True))
        images = {
            image.keyframe_id: image.jpeg
            for of_stamp in thumbnails_of(source.reader, {view.stamp_ns for view in views.values()}).values()
            for image in of_stamp
        }
        for keyframe_id in batch:
            yield keyframe_id, replace(views[keyframe_id], thumbnail_jpeg=images.get(keyframe_id))


def _observations(source: ExportSource, traversal: StoredTraversal) -> dict[int, list[Observation]]:
    """Those of selected instances, by keyframe."""
    selected = {instance.number for instance in _instances(source)}
    survivors = source.reader.survivors
    found: dict[int, list[Observation]] = defaultdict(list)
    for row in stream_observations(source.reader, traversal.id, source.selection.at_ns):
        number = survivors.of([row.instance_number])[row.instance_number]
        if number in selected:
            found[row.keyframe_id].append(_observation(row, number))
    return found


def _observation(row: Any, number: int) -> Observation:
    hypotheses = parsed(row.hypotheses, f"the hypotheses of observation {row.id}")
    return Observation(
        stamp_ns=row.stamp_ns,
        object_number=number,
        box_xyxy=np.array([row.u_min, row.v_min, row.u_max, row.v_max], np.float32),
        score=row.score,
        hypotheses=tuple(Hypothesis(label, score) for label, score in hypotheses),
        centroid_map=np.array([row.x, row.y, row.z]),
        crop_jpeg=None,
        evidence_for=row.evidence_for,
        evidence_against=row.evidence_against,
        track_id=row.track_id,
    )
