"""Checkpoints: a build that was killed goes on from the last one, and ends in the memory of an undisturbed build.

Every batch of keyframes is committed; a checkpoint, which holds the state of every stage, comes with some of them. A
build that goes on maps the keyframes between its checkpoint and its last batch once more, without writing them: the
same keyframes change the same state in the same way.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from supermap_cli.building.placing import Placement
from supermap_cli.building.tally import Tally
from supermap_cli.mapping.drift import DriftCorrection, DriftMark
from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.snapshot import drift_snapshot, engine_snapshot
from supermap_cli.memory.values import Checkpoint
from supermap_cli.protocols import Resumable, Tracker
from supermap_cli.types.memory import SpatialEdge
from supermap_cli.types.packing import pack, unpack

CLASSES: Mapping[type, tuple[str, ...]] = dict.fromkeys((Tally, Placement, SpatialEdge), ())

LARGEST_SHARE = 0.02
"""Of a build's time, checkpoints take no more than this."""


@dataclass
class Cadence:
    """When the next checkpoint is due: at once, then after so many seconds, or later where checkpoints are costly."""

    every_s: float
    _next: float = 0.0

    def due(self) -> bool:
        """Whether the time has come."""
        return time.monotonic() >= self._next

    def written(self, began: float) -> None:
        """A checkpoint that was begun at a `time.monotonic` is done."""
        now = time.monotonic()
        self._next = now + max(self.every_s, (now - began) / LARGEST_SHARE)


@dataclass(frozen=True)
class AheadMark:
    """Where the stages that run ahead of mapping were when they had made one keyframe."""

    stamp_ns: int
    drift: DriftMark | None
    without_pose: int
    detections: int
    masks: int


@dataclass
class AheadMarks:
    """The marks of the keyframes under way; one thread adds to them, another takes them."""

    _marks: deque[AheadMark] = field(default_factory=deque)

    def add(self, mark: AheadMark) -> None:
        """A further keyframe was made."""
        self._marks.append(mark)

    def take(self, stamp_ns: int) -> AheadMark:
        """The mark of a keyframe that was mapped; those before it go."""
        while self._marks[0].stamp_ns < stamp_ns:
            self._marks.popleft()
        return self._marks[0]


@dataclass
class BuildState:
    """The state of all stages but those whose state is the memory itself. `spent_s` is seconds by stage."""

    placement: Placement
    tally: Tally
    spent_s: dict[str, float]
    held_edges: list[SpatialEdge]
    tracker: object


def make_checkpoint(
    mark: AheadMark, state: BuildState, engine: MappingEngine, drift: DriftCorrection | None
) -> Checkpoint:
    """The checkpoint after the keyframe of a mark."""
    tally = replace(state.tally, without_pose=mark.without_pose, detections=mark.detections, masks=mark.masks)
    parts = {
        "build": pack((state.placement, tally, state.spent_s), CLASSES),
        "engine": engine_snapshot(engine),
        "graph": pack(state.held_edges, CLASSES),
        "tracker": pack(state.tracker, {}),
    }
    if drift is not None and mark.drift is not None:
        parts["drift"] = drift_snapshot(drift, mark.drift)
    return Checkpoint(mark.stamp_ns, parts)


def read_checkpoint(checkpoint: Checkpoint) -> BuildState:
    """The state of the stages; engine and drift are restored by `mapping.snapshot`.

    Raises `packing.PackingError` where it is damaged.
    """
    placement, tally, spent_s = unpack(checkpoint.parts["build"], CLASSES)
    edges = unpack(checkpoint.parts["graph"], CLASSES)
    return BuildState(placement, tally, spent_s, edges, unpack(checkpoint.parts["tracker"], {}))


def is_resumable(tracker: Tracker) -> bool:
    """Whether builds with this tracker have checkpoints."""
    return isinstance(tracker, Resumable)


def first_difference(before: Any, now: Any, path: str = "") -> str | None:
    """The first entry in which two configurations differ, with both values; `None` if they are the same."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for name in sorted(before.keys() | now.keys()):
            found = first_difference(before.get(name), now.get(name), f"{path}.{name}" if path else name)
            if found is not None:
                return found
        return None
    return None if before == now else f"{path} was {before!r}, now {now!r}"
