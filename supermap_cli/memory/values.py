"""Values that the store returns beside those of `types.memory`: traversals, and instances as queries need them."""

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
    """A traversal when its build begins.

    `recording` is a path, `fingerprint` identifies the recording, `T_map_odom` (4, 4) registers its odometry frame in
    the map. `config` and `versions` are stored as JSON. The default `name` is the recording's, made unique. Times are
    the recording's plus `clock_shift_ns`.
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
    """A traversal in the map.

    `number` counts from 1 in the order of building; `timings` is seconds per stage; `keyframes` and `observations` are
    its numbers of rows; `warnings` are those of its recording, its odometry and its build. Its times are its
    recording's plus `clock_shift_ns`. Most crops, observations and thumbnails of keyframes before `crops_kept_from_ns`,
    `observations_kept_from_ns` and `thumbnails_kept_from_ns` were pruned.
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
    """The state of a build after the keyframe at `stamp_ns`, in named parts that `types.packing` packed."""

    stamp_ns: int
    parts: Mapping[str, bytes]


@dataclass(frozen=True)
class StoredVisit:
    """How often one traversal viewed one instance's place (see `types.memory.Visit`)."""

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

    It includes the instances that were merged into it: `numbers` holds its own number and theirs, visits are summed.
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
        """The visit of one traversal; all counts are zero if there is none."""
        for visit in self.visits:
            if visit.traversal_id == traversal_id:
                return visit
        return StoredVisit(traversal_id, self.number, 0, 0, 0, None, None)


@dataclass(frozen=True)
class ObservationRef:
    """One observation without its crop and its box in the image.

    `instance_number` is the surviving instance; `centroid_map` (3,) is the observed position.
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
class ScoredObservation:
    """One observation with its score only."""

    id: int
    traversal_id: int
    stamp_ns: int
    score: float


@dataclass(frozen=True, slots=True)
class LabelledObservation:
    """One observation with its label and score, without its position."""

    id: int
    traversal_id: int
    stamp_ns: int
    label: str
    score: float
    has_crop: bool


@dataclass(frozen=True)
class Invariant:
    """A rule; `violations` is SQL with one result column, the name of every row that breaks it."""

    table: str
    rule: str
    violations: str


@dataclass(frozen=True)
class Problem:
    """A broken invariant: the table, the row, and what is wrong."""

    table: str
    row: str
    what: str
