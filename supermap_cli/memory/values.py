"""What the store hands out beyond `types.memory`: traversals, and instances as questions need them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import check_transform
from supermap_cli.types.memory import Presence, StateRecord

TraversalStatus = Literal["building", "complete"]


@dataclass(frozen=True)
class TraversalStart:
    """What is known of a traversal when its build begins.

    `recording` is its path, `fingerprint` tells it from others, `T_map_odom` (4, 4) places its odometry in the map.
    `config` and `versions` are stored as JSON. Without a `name` it gets the recording's, made unique. Times are the
    recording's plus `clock_shift_ns`.
    """

    recording: str
    fingerprint: str
    start_ns: int
    end_ns: int
    T_map_odom: FloatArray
    config: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    name: str | None = None
    clock_shift_ns: int = 0

    def __post_init__(self) -> None:
        check_transform("T_map_odom", self.T_map_odom)
        if self.end_ns < self.start_ns:
            raise ValueError(f"a traversal ends before it starts: {self.start_ns} .. {self.end_ns}")


@dataclass(frozen=True)
class StoredTraversal:
    """A traversal in the map. `number` counts from 1 in the order of building; `timings` is seconds per stage;
    `keyframes` and `observations` are how many it has; `warnings` are what its recording, its odometry and its build
    warned with.

    Its times are its recording's plus `clock_shift_ns`. Most crops, observations and thumbnails of keyframes before
    `crops_kept_from_ns`, `observations_kept_from_ns` and `thumbnails_kept_from_ns` were given up.
    """

    id: int
    number: int
    name: str
    recording: str
    fingerprint: str
    start_ns: int
    end_ns: int
    T_map_odom: FloatArray
    config: Mapping[str, object]
    versions: Mapping[str, str]
    status: TraversalStatus
    mapped_ns: int | None
    timings: Mapping[str, float]
    keyframes: int
    clock_shift_ns: int = 0
    crops_kept_from_ns: int | None = None
    observations_kept_from_ns: int | None = None
    thumbnails_kept_from_ns: int | None = None
    observations: int = 0
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Checkpoint:
    """What a build needs to go on after the keyframe at `stamp_ns`: parts by name, as `types.packing` packs them."""

    stamp_ns: int
    parts: Mapping[str, bytes]


@dataclass(frozen=True)
class StoredVisit:
    """How often one traversal looked at one instance's place (see `types.memory.Visit`)."""

    traversal_id: int
    instance_number: int
    supported: int
    in_view: int
    contradicted: int
    first_support_ns: int | None
    last_support_ns: int | None


@dataclass(frozen=True)
class StoredInstance:
    """An instance without its geometry, with all its states and visits.

    Those merged into it are part of it: `numbers` holds its own number and theirs, visits are summed over them.
    """

    number: int
    id: str
    label: str
    label_belief: Mapping[str, float]
    presence: Presence
    existence_log_odds: float
    first_seen_ns: int
    last_seen_ns: int
    centroid_map: FloatArray
    box: Box3D
    observations: int
    traversal_id: int
    numbers: tuple[int, ...]
    states: tuple[StateRecord, ...]
    visits: tuple[StoredVisit, ...]

    def visit(self, traversal_id: int) -> StoredVisit:
        """How one traversal looked at it; all zero where it never did."""
        for visit in self.visits:
            if visit.traversal_id == traversal_id:
                return visit
        return StoredVisit(traversal_id, self.number, 0, 0, 0, None, None)


@dataclass(frozen=True)
class ObservationRef:
    """Where to find one observation, and what it said. `instance_number` is the instance it counts for today;
    `centroid_map` (3,) is where it saw it.
    """

    id: int
    traversal_id: int
    keyframe_id: int
    stamp_ns: int
    instance_number: int
    label: str
    score: float
    evidence_for: int
    evidence_against: int
    centroid_map: FloatArray


@dataclass(frozen=True, slots=True)
class Sighting:
    """One observation without what it said: which, in which traversal, when, and how surely."""

    id: int
    traversal_id: int
    stamp_ns: int
    score: float


@dataclass(frozen=True, slots=True)
class Said:
    """One observation without its place: which, in which traversal, when, what it called the thing and how surely, and
    whether there is a crop of it.
    """

    id: int
    traversal_id: int
    stamp_ns: int
    label: str
    score: float
    cropped: bool


@dataclass(frozen=True)
class Invariant:
    """A rule; `violations` is SQL that gives one column, the name of every row that breaks it."""

    table: str
    rule: str
    violations: str


@dataclass(frozen=True)
class Problem:
    """One broken invariant: in which table, at which row, and what is wrong."""

    table: str
    row: str
    what: str
