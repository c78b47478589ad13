"""Checkpoints: a build that was killed goes on from the last one, and ends in the memory of an undisturbed build.

Every batch of keyframes is committed; a checkpoint, which holds the state of the session, comes with some of them. A
build that goes on maps the keyframes between its checkpoint and its last batch once more, without writing them: the
same keyframes change the same state in the same way.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.bag import Position
from supermap_cli.mapping.free_space import FreeSpaceMemory
from supermap_cli.mapping.snapshot import drift_snapshot, engine_snapshot, restore_drift, restore_engine
from supermap_cli.mapping.walls import WallMap
from supermap_cli.memory.values import Checkpoint
from supermap_cli.parameters import MethodParameters
from supermap_cli.session import MappingSession
from supermap_cli.stages.map_registration import Placement
from supermap_cli.stages.session_state import SessionState
from supermap_cli.stages.statistics import BuildStatistics
from supermap_cli.types.memory import KeyframeRecord, SpatialEdge
from supermap_cli.types.packing import pack, unpack

CLASSES: Mapping[type, tuple[str, ...]] = dict.fromkeys((BuildStatistics, Placement, SpatialEdge), ())

MAX_TIME_SHARE = 0.02
"""Of a build's time, checkpoints take no more than this."""


@dataclass
class CheckpointSchedule:
    """When the next checkpoint is due: at once, then after so many seconds, or later where checkpoints are costly."""

    every_s: float
    _next: float = 0.0

    def due(self) -> bool:
        """Whether the time has come."""
        return time.monotonic() >= self._next

    def written(self, began: float) -> None:
        """A checkpoint that was begun at a `time.monotonic` is done."""
        now = time.monotonic()
        self._next = now + max(self.every_s, (now - began) / MAX_TIME_SHARE)


@dataclass
class StoppedBuild:
    """What a checkpoint holds besides engine and drift. `spent_s` is seconds by stage; `position` is that of the
    keyframe mapped last.
    """

    placement: Placement
    statistics: BuildStatistics
    spent_s: dict[str, float]
    spatial_edges: list[SpatialEdge]
    across_walls: dict[tuple[int, int], tuple[float, ...]]
    trackers: dict[str, object]
    position: Position


def make_checkpoint(session: MappingSession, spent_s: Mapping[str, float]) -> Checkpoint:
    """The state of a session after the keyframe it has mapped last."""
    newest, placement = session.newest, session.placement
    if newest is None or placement is None:
        raise ValueError("nothing was mapped yet")
    position = (newest.frame.stamp_ns, newest.frame.camera_id)
    parts = {
        "build": pack((placement, replace(session.statistics), dict(spent_s), position), CLASSES),
        "engine": engine_snapshot(session.engine),
        "graph": pack((list(session.graph.held.values()), session.graph.across_walls), CLASSES),
        "tracker": pack(session.trackers.state(), {}),
    }
    if session.localizer.drift is not None and newest.mark.drift is not None:
        parts["drift"] = drift_snapshot(session.localizer.drift, newest.mark.drift)
    return Checkpoint(newest.keyframe.stamp_ns, parts)


def read_checkpoint(checkpoint: Checkpoint) -> StoppedBuild:
    """What a checkpoint holds, but for engine and drift. Raises `packing.PackingError` where it is damaged."""
    placement, statistics, spent_s, position = unpack(checkpoint.parts["build"], CLASSES)
    edges, across_walls = unpack(checkpoint.parts["graph"], CLASSES)
    trackers = unpack(checkpoint.parts["tracker"], {})
    return StoppedBuild(placement, statistics, spent_s, edges, across_walls, trackers, position)


def restore_session(
    config: BuildConfig,
    checkpoint: Checkpoint,
    stopped: StoppedBuild,
    traversal_number: int,
    keyframes: Iterable[tuple[int, KeyframeRecord]],
) -> SessionState:
    """The state of a session at a checkpoint. `keyframes` are all that were mapped up to there, with the number of
    their traversal. Raises `packing.PackingError` where the checkpoint is damaged.
    """
    parameters = MethodParameters.from_overrides(config.parameters)
    mapping = parameters.mapping
    free_space = FreeSpaceMemory(mapping.free_space)
    walls = WallMap(mapping.walls)
    for number, record in keyframes:
        free_space.add_record(number, record)
        walls.add_record(record, mapping.structure)
    parts = checkpoint.parts
    return SessionState(
        restore_engine(parts["engine"], config.mapping, frozenset(config.ablate), free_space, mapping),
        restore_drift(parts["drift"], mapping) if "drift" in parts else None,
        parameters,
        tuple(stopped.spatial_edges),
        stopped.placement,
        traversal_number=traversal_number,
        statistics=stopped.statistics,
        newest_ns=checkpoint.stamp_ns,
        trackers=stopped.trackers,
        walls=walls,
        across_walls=stopped.across_walls,
    )
