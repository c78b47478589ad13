"""The map under evaluation as values in the truth's world frame: the only input of the metrics besides the truth."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.geometry.arrays import FloatArray, IntArray, check_shape
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.types.memory import Presence


@dataclass(frozen=True)
class EstimatedState:
    """A state of an instance: in the map it stands in one place from `first_seen_ns` until `gone_ns`."""

    first_seen_ns: int
    last_seen_ns: int
    gone_ns: int | None
    empty_before_ns: int | None
    centroid: FloatArray
    box: Box3D
    label: str

    def believed_at(self, stamp_ns: int) -> bool:
        """Whether the finished map has it there at that time."""
        return self.first_seen_ns <= stamp_ns and (self.gone_ns is None or stamp_ns < self.gone_ns)


@dataclass(frozen=True)
class EstimatedObservation:
    """One detection that the map assigned to an instance: its stamp and centroid (3,)."""

    stamp_ns: int
    centroid: FloatArray


@dataclass(frozen=True)
class EstimatedObject:
    """One instance of the map. `confidence` in [0, 1] is the map's own, in its present or last state, and
    `label_probability` that of its label if it is real; `points` (n, 3) are the centres of its occupied voxels, in its
    present or last place; `states` and `observations` are in the order of time.
    """

    id: str
    label: str
    presence: Presence
    confidence: float
    label_probability: float
    centroid: FloatArray
    box: Box3D
    points: FloatArray
    states: tuple[EstimatedState, ...]
    observations: tuple[EstimatedObservation, ...]

    def __post_init__(self) -> None:
        check_shape("centroid", self.centroid, (3,))
        check_shape("points", self.points, (None, 3))

    @property
    def rank(self) -> float:
        """What instances of one label are ranked by (AP needs an order): sure ones of an undisputed label first."""
        return self.confidence * self.label_probability

    def state_at(self, stamp_ns: int) -> EstimatedState | None:
        """The state at a time in the finished map; the newest one where two overlap."""
        return next((state for state in reversed(self.states) if state.believed_at(stamp_ns)), None)


@dataclass(frozen=True)
class EstimatedChange:
    """A change that the map reports between two traversals: kind appeared, disappeared or moved."""

    kind: str
    object_id: str
    label: str
    position_before: FloatArray | None
    position_after: FloatArray | None
    distance_m: float | None


@dataclass(frozen=True)
class EstimatedEvent:
    """A change that the map dates to a time within a traversal: appeared, disappeared, reappeared or moved.

    `at_ns` is the latest time at which it can have happened, in the time of the recording.
    """

    kind: str
    object_id: str
    label: str
    at_ns: int


@dataclass(frozen=True)
class EstimatedAnswer:
    """What the map answers to one of the truth's questions: instance ids; none, and why, where it is not understood."""

    text: str
    ids: tuple[str, ...]
    error: str | None = None


@dataclass(frozen=True)
class EstimatedMap:
    """All that the metrics need of a map, aligned with the truth.

    `objects` are all believed instances, present or absent (doubted ones are left out). `keyframes_ns` (k,) are the
    stamps of all mapped images, of all traversals; `alignment_rmse_m` is the error of the robot's trajectory in the map
    against the true one after the alignment, by traversal. `doubted` are the demoted instances, people who walked by
    among them: only the scores of person passages use them. `keyframe_cameras` (k,) are the `camera_id`s of the
    keyframes, () where they are not known. `events` are all changes of all traversals, in the order of time.
    """

    objects: tuple[EstimatedObject, ...]
    changes: tuple[EstimatedChange, ...]
    answers: tuple[EstimatedAnswer, ...]
    keyframes_ns: IntArray
    T_world_map: FloatArray
    alignment_rmse_m: dict[str, float]
    doubted: tuple[EstimatedObject, ...] = ()
    keyframe_cameras: tuple[str, ...] = ()
    events: tuple[EstimatedEvent, ...] = ()
