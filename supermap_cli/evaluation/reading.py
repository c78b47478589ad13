"""Reads a map for evaluation: objects, changes and answers, in the truth's world frame and time."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from supermap_cli.errors import EvaluationError, QueryError
from supermap_cli.evaluation.estimate import (
    EstimatedAnswer,
    EstimatedChange,
    EstimatedEvent,
    EstimatedMap,
    EstimatedObject,
    EstimatedObservation,
    EstimatedState,
)
from supermap_cli.evaluation.truth_alignment import align_to_truth
from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.mapping.voxel_map import voxel_map_from_cloud
from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.answers import answer
from supermap_cli.query.candidates import label_in_state
from supermap_cli.query.diff import diff
from supermap_cli.query.traversal_spans import TraversalSpan, recording_stamp_ns, traversal_spans
from supermap_cli.query.views import Vector
from supermap_cli.truth_file import read_truth
from supermap_cli.types.memory import StateRecord
from supermap_cli.types.truth import GroundTruth

CHANGE_KINDS = ("appeared", "disappeared", "moved")
"""Kinds of a diff's rows that are changes; the others are unchanged or unknown."""
EVENT_KINDS = (*CHANGE_KINDS, "reappeared")
"""Kinds of temporal edges that say that something changed."""


def read_map(db: str, truth_path: Path) -> tuple[EstimatedMap, GroundTruth]:
    """Read a map database and its truth, and align the two.

    Raises `TruthError` or `MemoryStoreError` for what cannot be read, `EvaluationError` where the two do not match.
    """
    truth = read_truth(truth_path)
    with open_store(db, read_only=True) as store, store.reader() as reader:
        return read_estimate(reader, truth), truth


def read_estimate(reader: MapReader, truth: GroundTruth) -> EstimatedMap:
    """All that the metrics need of a map, in the truth's world frame; answers and changes are those of `supermap query`
    and `supermap diff`.

    Raises `EvaluationError` where map and truth do not belong together.
    """
    alignment = align_to_truth(reader, truth)
    to_world = WorldTransform(alignment.T_world_map, _spans_in_recorded_order(reader))
    keyframes_ns, cameras = _keyframes(reader)
    known_cameras = {camera for traversal in truth.traversals for camera in traversal.camera_ids}
    return EstimatedMap(
        objects=tuple(_object(reader, instance, to_world) for instance in reader.believed),
        changes=_changes(reader, to_world),
        answers=tuple(_answer(reader, question.text) for question in truth.questions),
        keyframes_ns=keyframes_ns,
        events=tuple(_events(reader, to_world)),
        keyframe_cameras=cameras if set(cameras) <= known_cameras else (),
        T_world_map=alignment.T_world_map,
        alignment_rmse_m=alignment.rmse_m,
        doubted=tuple(
            _object(reader, instance, to_world) for instance in reader.instances if instance.presence == "doubted"
        ),
    )


def _spans_in_recorded_order(reader: MapReader) -> tuple[TraversalSpan, ...]:
    """The traversals of the map with their clock shifts.

    Raises `EvaluationError` where they were built in another order than recorded: what appeared in one order
    disappeared in the other.
    """
    stretches = traversal_spans(reader.traversals)
    for before, after in pairwise(stretches):
        if after.recording_start_ns < before.recording_start_ns:
            raise EvaluationError(
                f"{after.name} was recorded before {before.name} and built after it: their changes cannot be judged",
                where=reader.where,
                cure="build them in the order in which they were recorded, into a new --db",
            )
    return stretches


@dataclass(frozen=True)
class WorldTransform:
    """Transforms positions from the map frame to the world, and stamps from the map's time to the recordings' own.

    The frames differ by a rotation about z and a translation.
    """

    T_world_map: FloatArray
    stretches: tuple[TraversalSpan, ...]

    def time(self, stamp_ns: int) -> int:
        """A stamp by the clock of its recording."""
        return recording_stamp_ns(self.stretches, stamp_ns)

    def times(self, *stamps_ns: int | None) -> Iterator[int | None]:
        """Several stamps, `None` staying `None`."""
        return (None if stamp_ns is None else self.time(stamp_ns) for stamp_ns in stamps_ns)

    def points(self, points_map: FloatArray) -> FloatArray:
        """Points (n, 3)."""
        return transform_points(self.T_world_map, points_map)

    def point(self, point_map: FloatArray) -> FloatArray:
        """One point (3,)."""
        return self.points(point_map[None]).reshape(3)

    def box(self, box_map: Box3D) -> Box3D:
        """An upright box."""
        turn = float(np.arctan2(self.T_world_map[1, 0], self.T_world_map[0, 0]))
        return Box3D(self.point(box_map.center), box_map.size, box_map.yaw + turn)


def _object(reader: MapReader, instance: StoredInstance, to_world: WorldTransform) -> EstimatedObject:
    return EstimatedObject(
        id=instance.id,
        label=instance.label,
        presence=instance.presence,
        confidence=instance.states[-1].confidence,
        label_probability=instance.label_belief.get(instance.label, 0.0),
        centroid=to_world.point(instance.box.center),
        box=to_world.box(instance.box),
        points=to_world.points(_solid_points(reader, instance)),
        states=tuple(_state(state, label_in_state(instance, state), to_world) for state in instance.states),
        observations=tuple(
            EstimatedObservation(to_world.time(observation.stamp_ns), to_world.point(observation.centroid_map))
            for observation in reader.observations(instance)
        ),
    )


def _solid_points(reader: MapReader, instance: StoredInstance) -> FloatArray:
    """(n, 3) centres of the object's occupied voxels, in the map frame."""
    voxels = voxel_map_from_cloud(reader.voxels(instance))
    solid = voxels.solid()
    return voxels.centers()[solid] if solid.any() else voxels.centers()


def _state(state: StateRecord, label: str, to_world: WorldTransform) -> EstimatedState:
    gone_ns, empty_before_ns = to_world.times(state.gone_ns, state.empty_before_ns)
    return EstimatedState(
        first_seen_ns=to_world.time(state.first_seen_ns),
        last_seen_ns=to_world.time(state.last_seen_ns),
        gone_ns=gone_ns,
        empty_before_ns=empty_before_ns,
        centroid=to_world.point(state.box.center),
        box=to_world.box(state.box),
        label=label,
    )


def _changes(reader: MapReader, to_world: WorldTransform) -> tuple[EstimatedChange, ...]:
    """The changes that the map reports between its last two traversals."""
    if len(reader.traversals) < 2:
        return ()

    def place(position: Vector | None) -> FloatArray | None:
        return None if position is None else to_world.point(np.array(position))

    return tuple(
        EstimatedChange(
            kind=change.kind,
            object_id=change.id,
            label=change.label,
            position_before=place(change.position_before),
            position_after=place(change.position_after),
            distance_m=change.distance_m if change.kind == "moved" else None,
        )
        for change in diff(reader).changes
        if change.kind in CHANGE_KINDS
    )


def _events(reader: MapReader, to_world: WorldTransform) -> Iterator[EstimatedEvent]:
    """The changes that the map dates, of instances that it believes in."""
    labels = {instance.number: (instance.id, instance.label) for instance in reader.believed}
    for edge in reader.temporal_edges():
        if edge.kind in EVENT_KINDS and edge.to_number in labels:
            yield EstimatedEvent(edge.kind, *labels[edge.to_number], to_world.time(edge.not_after_ns))


def _answer(reader: MapReader, text: str) -> EstimatedAnswer:
    try:
        found = answer(text, reader, limit=sys.maxsize)
    except QueryError as error:
        return EstimatedAnswer(text, (), str(error))
    return EstimatedAnswer(text, tuple(instance.id for instance in found.instances))


def _keyframes(reader: MapReader) -> tuple[IntArray, tuple[str, ...]]:
    """(n,) stamps of all keyframes, ascending, each in the time of its recording, and their cameras."""
    found = [
        (stamp_ns - traversal.clock_shift_ns, camera_id)
        for traversal in reader.traversals
        for stamp_ns, camera_id in reader.keyframe_cameras(traversal.id)
    ]
    return np.array([stamp_ns for stamp_ns, _ in sorted(found)], np.int64), tuple(camera for _, camera in sorted(found))
