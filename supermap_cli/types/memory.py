"""The contents of the 4D memory as values. Row ids belong to the store; `number` is an object's identity in the map."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from supermap_cli.geometry.arrays import Float32Array, FloatArray, Int32Array, UInt8Array, check_shape
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.types.detections import Hypothesis
from supermap_cli.types.sensing import MAIN_CAMERA

Presence = Literal["present", "absent", "doubted"]
"""Absent: its place was seen empty. Doubted: demoted, because the evidence for its existence was outweighed later."""

TemporalKind = Literal["appeared", "persisted", "moved", "disappeared", "reappeared", "merged", "split", "candidate"]


@dataclass(frozen=True)
class KeyframeRecord:
    """One keyframe as stored.

    `depth_png` is a small 16-bit millimetre PNG (0 = no return) in the measure of the camera, `depth_step` pixels of
    the camera apart in u and v: with the pose it tells later which space was seen empty then. `camera` is the
    camera's JSON form (`geometry.cameras.camera_to_json`), `camera_id` its name among those of the rig.
    """

    stamp_ns: int
    T_map_base: FloatArray
    T_map_camera: FloatArray
    camera: str
    depth_png: bytes
    depth_step: int
    thumbnail_jpeg: bytes | None
    detected: bool
    camera_id: str = MAIN_CAMERA


@dataclass(frozen=True)
class Observation:
    """One detection assigned to one instance; never changed once written.

    `centroid_map` is (3,) metres; `evidence_for` and `evidence_against` count the object's points that the keyframe
    supported and contradicted; `camera_id` names the keyframe's camera.
    """

    stamp_ns: int
    object_number: int
    box_xyxy: Float32Array
    score: float
    hypotheses: tuple[Hypothesis, ...]
    centroid_map: FloatArray
    crop_jpeg: bytes | None
    evidence_for: int
    evidence_against: int
    track_id: int
    camera_id: str = MAIN_CAMERA


@dataclass(frozen=True)
class VoxelCloud:
    """An object's geometry in packed arrays, n voxels of edge `voxel_m` in the map frame.

    `keys` (n, 3) int32: the voxel's index, its centre lies at (key + 0.5) * voxel_m. `log_odds` (n,) float32 occupancy;
    `inside` and `outside` (n,) float32 how often it was seen within and beside the object's masks; `rgb` (n, 3) uint8.
    """

    voxel_m: float
    keys: Int32Array
    log_odds: Float32Array
    inside: Float32Array
    outside: Float32Array
    rgb: UInt8Array

    def __post_init__(self) -> None:
        n = len(self.keys)
        check_shape("keys", self.keys, (n, 3))
        for name in ("log_odds", "inside", "outside"):
            check_shape(name, getattr(self, name), (n,))
        check_shape("rgb", self.rgb, (n, 3))

    def __len__(self) -> int:
        return len(self.keys)


@dataclass(frozen=True)
class StateRecord:
    """The half-open interval of sensor time in which an instance stood in one place.

    It was supported from `first_seen_ns` to `last_seen_ns`; `gone_ns` is the first contradiction after it (`None`: none
    seen) and the truth between the two is unknown. `empty_before_ns` is the last time its place was seen empty
    before it came (`None`: the place had not been looked at). `index` counts the states of one instance from 0.
    `centroid_map` is the centre of `box`: the mean of what was seen would depend on the side it was seen from.
    """

    object_number: int
    index: int
    first_seen_ns: int
    last_seen_ns: int
    gone_ns: int | None
    empty_before_ns: int | None
    centroid_map: FloatArray
    box: Box3D
    label: str
    confidence: float


@dataclass(frozen=True)
class Visit:
    """Keyframes of one traversal in which an instance was supported, in which its place was in view and not occluded,
    and in which its place was seen empty.
    """

    object_number: int
    supported: int
    in_view: int
    contradicted: int
    first_support_ns: int | None
    last_support_ns: int | None


@dataclass(frozen=True)
class InstanceRecord:
    """One confirmed object as the map has it now.

    `centroid_map` is the centre of `box`; `label_belief` sums to 1; `existence_log_odds` > 0 means present; `embedding`
    (d,) float32 unit length or `None`; `engine_state` is for the mapping engine, as JSON numbers and strings
    (`types.engine_state`).
    """

    number: int
    label: str
    label_belief: Mapping[str, float]
    existence_log_odds: float
    presence: Presence
    first_seen_ns: int
    last_seen_ns: int
    centroid_map: FloatArray
    box: Box3D
    voxels: VoxelCloud
    observations: int
    embedding: Float32Array | None = None
    merged_into: int | None = None
    engine_state: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class SpatialEdge:
    """`subject` stands in `relation` to `object` during the half-open interval [since_ns, until_ns), open if `None`."""

    subject: int
    relation: str
    object: int
    since_ns: int
    until_ns: int | None
    confidence: float


@dataclass(frozen=True)
class TemporalEdge:
    """A change between two states, within the bounds [not_before_ns, not_after_ns].

    `from_number` and `to_number` differ for merges, splits and identity candidates; `distance_m` is for moves.
    """

    kind: TemporalKind
    from_number: int
    from_state: int | None
    to_number: int
    to_state: int | None
    not_before_ns: int | None
    not_after_ns: int
    probability: float
    distance_m: float | None = None


@dataclass(frozen=True)
class MapDelta:
    """All changes of a batch of whole keyframes: written in one transaction.

    Instances, states, visits and spatial edges replace what is stored under the same key (number; number and index;
    number; subject, relation, object and since_ns); keyframes, observations and temporal edges are only ever added.
    """

    keyframes: tuple[KeyframeRecord, ...] = ()
    observations: tuple[Observation, ...] = ()
    instances: tuple[InstanceRecord, ...] = ()
    states: tuple[StateRecord, ...] = ()
    visits: tuple[Visit, ...] = ()
    spatial_edges: tuple[SpatialEdge, ...] = ()
    temporal_edges: tuple[TemporalEdge, ...] = ()


def coalesce(deltas: Iterable[MapDelta]) -> MapDelta:
    """What several deltas, one after the other, changed all together: of a row written twice the last one counts."""
    merged = list(deltas)
    instances = {instance.number: instance for delta in merged for instance in delta.instances}
    retired = {
        instance.number: None for delta in merged for instance in delta.instances if instance.merged_into is not None
    }
    states = {(state.object_number, state.index): state for delta in merged for state in delta.states}
    visits = {visit.object_number: visit for delta in merged for visit in delta.visits}
    edges = {
        (edge.subject, edge.relation, edge.object, edge.since_ns): edge
        for delta in merged
        for edge in delta.spatial_edges
    }
    return MapDelta(
        keyframes=tuple(keyframe for delta in merged for keyframe in delta.keyframes),
        observations=tuple(observation for delta in merged for observation in delta.observations),
        instances=tuple(instances[number] for number in (*sorted(instances.keys() - retired.keys()), *retired)),
        states=tuple(states[key] for key in sorted(states)),
        visits=tuple(visits[number] for number in sorted(visits.keys() - retired.keys())),
        spatial_edges=tuple(edges.values()),
        temporal_edges=tuple(edge for delta in merged for edge in delta.temporal_edges),
    )
