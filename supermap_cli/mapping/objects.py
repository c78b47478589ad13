"""The objects of the map while it is being built: the paper's O, with voxels in the place of points."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.geometry.voxels import NearVoxels, distinct_keys, near_voxels, voxel_keys
from supermap_cli.mapping import belief, class_sizes, motion, voxel_map
from supermap_cli.mapping.absence import AbsenceEvidence
from supermap_cli.mapping.belief import BeliefParameters, Existence, LabelBelief, ViewpointHistory
from supermap_cli.mapping.bounds import BoundsIndex
from supermap_cli.mapping.class_sizes import ClassSizeParameters
from supermap_cli.mapping.motion import MotionParameters, MotionState
from supermap_cli.mapping.voxel_map import VoxelMap, VoxelMapParameters
from supermap_cli.types.labels import DYNAMIC_CLASSES
from supermap_cli.types.memory import Observation
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class ObjectParameters:
    """How an object's shape is measured from its voxels."""

    box_percentiles: tuple[float, float] = parameter(
        (1.5, 98.5), "%", "a box leaves out what lies beyond these along each of its axes: strays", TUNED, at_most=100.0
    )
    bounds_percentiles: tuple[float, float] = parameter(
        (1.0, 99.0), "%", "the same for bounds along the map's axes", TUNED, at_most=100.0
    )
    yaw_step_deg: float = parameter(2.0, "deg", "step of the headings tried for a box", "bounds the time", at_least=0.1)
    max_columns: int = parameter(
        400, "1", "columns of voxels that headings are tried on", "bounds the time", at_least=3
    )
    closest_m: float = parameter(
        0.03, "m", "a column nearer to a side of a box than this is on it", "pose and depth noise", at_least=1e-3
    )
    coarse_share: float = parameter(
        0.2, "1", "edge of the coarse voxels by which clouds are compared, as a share of a small object's size", TUNED
    )
    min_coarse_m: float = parameter(0.02, "m", "least such edge", TUNED, at_least=1e-3)
    max_coarse_m: float = parameter(0.05, "m", "greatest such edge: the pose's error", TUNED, at_least=1e-3)


DEFAULT = ObjectParameters()


@dataclass(frozen=True)
class ObjectParameterSets:
    """The parameters of all that an object holds."""

    objects: ObjectParameters = DEFAULT
    belief: BeliefParameters = belief.DEFAULT
    class_sizes: ClassSizeParameters = class_sizes.DEFAULT
    motion: MotionParameters = motion.DEFAULT
    voxel_map: VoxelMapParameters = voxel_map.DEFAULT


DEFAULT_SETS = ObjectParameterSets()


@dataclass
class OpenState:
    """The state an object is in now: since when, and when its place was last seen empty before."""

    index: int
    first_seen_ns: int
    empty_before_ns: int | None = None


@dataclass(frozen=True)
class ObjectStatus:
    """How far an object has come: `confirmed` (in the map, else tentative), `stored` (known to the memory), `demoted`
    (confirmed once, but believed in no more), `present`, or absent since `gone_ns`.
    """

    confirmed: bool = False
    stored: bool = False
    demoted: bool = False
    present: bool = True
    gone_ns: int | None = None


@dataclass
class VisitCount:
    """In how many keyframes the running traversal supported an object, had its place in view, and saw its place empty.

    `in_view_at_support` is how often it had been in view when it was last supported; `earlier_ns` when an earlier
    traversal saw it last.
    """

    supported: int = 0
    in_view: int = 0
    contradicted: int = 0
    in_view_at_support: int = 0
    first_support_ns: int | None = None
    last_support_ns: int | None = None
    last_support_camera: str | None = None
    earlier_ns: int | None = None

    def add_support(self, stamp_ns: int, camera_id: str) -> None:
        """Count a keyframe that supports the object, once however many detections it holds of it; the keyframes of
        several cameras at one moment are several.
        """
        if (self.last_support_ns, self.last_support_camera) == (stamp_ns, camera_id):
            return
        self.supported += 1
        self.in_view += 1
        self.in_view_at_support = self.in_view
        self.first_support_ns = stamp_ns if self.first_support_ns is None else self.first_support_ns
        self.last_support_ns, self.last_support_camera = stamp_ns, camera_id


@dataclass
class DisplacementEvidence:
    """What the last detections say of an object that stands beside its place.

    Those at `views` moments in a row, of so many `keyframes`, showed it there, from `first_ns` to `last_ns`, the last
    by the shift `shift_m` (3,), if that is known, all together with `gain` (`displacement.agreement`).
    """

    views: int = 0
    keyframes: int = 0
    first_ns: int = 0
    last_ns: int = 0
    shift_m: FloatArray | None = None
    gain: float = 0.0

    def interrupt(self) -> None:
        """What is counted in a row begins anew."""
        self.views = self.keyframes = 0


@dataclass
class MissEvidence:
    """What the views since an object was last detected say against it (`log_odds`), the first at `first_ns`.

    `unsettled` are those of them (visible share of the image, truncated) that were misses only if it is still there.
    """

    log_odds: float = 0.0
    first_ns: int = 0
    viewpoints: ViewpointHistory = field(default_factory=ViewpointHistory)
    unsettled: list[tuple[float, bool]] = field(default_factory=list)


@dataclass
class MapObject:
    """One thing the map believes in, or is about to.

    It was seen from `first_seen_ns` to `last_seen_ns`, `observations` times; `pending` are the observations made before
    it was confirmed. `track_ids` are its tracks by camera, for each camera has a tracker of its own. `best_crop` is how
    good the best picture is that was kept of it in this traversal and place.
    """

    number: int
    voxels: VoxelMap
    labels: LabelBelief
    existence: Existence
    state: OpenState
    first_seen_ns: int
    last_seen_ns: int
    observations: int = 0
    status: ObjectStatus = field(default_factory=ObjectStatus)
    pending: list[Observation] = field(default_factory=list)
    track_ids: dict[str, int] = field(default_factory=dict)
    absence: AbsenceEvidence = field(default_factory=AbsenceEvidence)
    displacement: DisplacementEvidence = field(default_factory=DisplacementEvidence)
    misses: MissEvidence = field(default_factory=MissEvidence)
    motion: MotionState = field(default_factory=MotionState)
    visit: VisitCount = field(default_factory=VisitCount)
    best_crop: float = 0.0
    parameters: ObjectParameterSets = field(default=DEFAULT_SETS, repr=False)
    _shape: ObjectShape | None = field(default=None, repr=False)
    _changed: set[int] = field(default_factory=set, repr=False)

    @property
    def label(self) -> str:
        """The most likely label."""
        return self.labels.best

    @property
    def is_dynamic(self) -> bool:
        """Whether it moves by itself."""
        return self.label in DYNAMIC_CLASSES

    @property
    def is_moving(self) -> bool:
        """Whether it is moving now, carried or by itself."""
        walking = self.motion.course is not None and self.motion.course.walking
        return self.motion.moving or (walking and self.is_dynamic)

    @property
    def confirmed(self) -> bool:
        """Whether it is in the map; else it is tentative."""
        return self.status.confirmed

    @property
    def present(self) -> bool:
        """Whether it stands in its place, as far as is known."""
        return self.status.present

    @property
    def demoted(self) -> bool:
        """Whether it was confirmed once, but is believed in no more."""
        return self.status.demoted

    @property
    def gone_ns(self) -> int | None:
        """Since when it has been seen to be gone."""
        return self.status.gone_ns

    @property
    def shape(self) -> ObjectShape:
        """Box, centroid and coarse occupancy, worked out anew when the voxels have changed."""
        if self._shape is None:
            self._shape = measure_shape(self.voxels, self.parameters.objects, self.parameters.voxel_map)
        return self._shape

    @property
    def solid(self) -> BoolArray:
        """(n,) which voxels are believed to be the object's, as of when its shape was measured."""
        return self.shape.solid

    def set_status(
        self, *, confirmed: bool | None = None, stored: bool | None = None, demoted: bool | None = None
    ) -> None:
        """Change parts of the status; `None` leaves one as it is."""
        given = {"confirmed": confirmed, "stored": stored, "demoted": demoted}
        self.status = replace(self.status, **{name: value for name, value in given.items() if value is not None})

    def mark_absent(self, gone_ns: int | None) -> None:
        """It is gone since then, and no camera tracks it any more."""
        self.status = replace(self.status, present=False, gone_ns=gone_ns)
        self.track_ids = {}

    def mark_present(self) -> None:
        """It stands somewhere; what spoke for its having gone is void."""
        self.status = replace(self.status, present=True, gone_ns=None)
        self.clear_negative_evidence()

    def clear_negative_evidence(self) -> None:
        """It has been seen where it is believed to stand: what spoke for its having gone before is void."""
        self.absence = AbsenceEvidence()
        self.misses = MissEvidence(viewpoints=ViewpointHistory(parameters=self.parameters.belief))

    def voxels_changed(self) -> None:
        """Measure the shape anew when it is next needed, and notify the map."""
        self._shape = None
        self._changed.add(self.number)

    def report_changes_to(self, changed: set[int]) -> None:
        """From now on, enter the object's number there whenever its voxels have changed."""
        self._changed = changed

    def use(self, parameters: ObjectParameterSets) -> None:
        """Set the parameters of all that the object holds."""
        if self.parameters is parameters:
            return
        self.parameters = parameters
        self.labels.parameters, self.labels.size_parameters = parameters.belief, parameters.class_sizes
        for viewpoints in (self.existence.viewpoints, self.misses.viewpoints):
            viewpoints.parameters = parameters.belief
        self.motion.parameters = parameters.motion
        if self.motion.course is not None:
            self.motion.course = replace(self.motion.course, parameters=parameters.motion)
        if self._shape is not None:
            self._shape = replace(self._shape, parameters=parameters.objects)


def coarse_edge_m(extent_m: float, parameters: ObjectParameters = DEFAULT) -> float:
    """Edge of the coarse voxels by which clouds are compared: a fifth of a small thing, the pose's error for others."""
    return float(np.clip(parameters.coarse_share * extent_m, parameters.min_coarse_m, parameters.max_coarse_m))


@dataclass(frozen=True)
class ObjectShape:
    """What association and the graph need of an object's voxels.

    `low`, `high` (3,) bound the solid voxels in the map frame; `points` (n, 3) are their centres, `voxel_m` wide;
    `solid` says which of the object's voxels they are.
    """

    centroid: FloatArray
    low: FloatArray
    high: FloatArray
    points: FloatArray
    voxel_m: float
    solid: BoolArray
    parameters: ObjectParameters = field(default=DEFAULT, repr=False)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """`low` and `high`."""
        return self.low, self.high

    @property
    def extent_m(self) -> float:
        """Length of the longest side."""
        return float((self.high - self.low).max())

    @cached_property
    def box(self) -> Box3D:
        """The upright box that fits them best."""
        return upright_box(self.points, self.voxel_m, self.parameters)

    @cached_property
    def coarse_m(self) -> float:
        """Edge of the coarse voxels by which it is compared with other clouds."""
        return coarse_edge_m(self.extent_m, self.parameters)

    @cached_property
    def near_voxels(self) -> NearVoxels:
        """The coarse voxels that the points occupy or touch."""
        return near_voxels(voxel_keys(self.points, self.coarse_m))

    def share_near(self, points_map: FloatArray) -> float:
        """Share of (n, 3) points that lie in or beside the object's coarse voxels."""
        if not len(points_map):
            return 0.0
        return float(self.near(points_map).mean())

    def near(self, points_map: FloatArray) -> BoolArray:
        """(n,) which points lie in or beside the object's coarse voxels."""
        return self.near_voxels.hold(voxel_keys(points_map, self.coarse_m))


def measure_shape(
    voxels: VoxelMap,
    parameters: ObjectParameters = DEFAULT,
    voxel_parameters: VoxelMapParameters = voxel_map.DEFAULT,
) -> ObjectShape:
    """Bounds and centroid of the solid voxels; what else there is to know of them is worked out when it is asked."""
    solid = voxels.solid(voxel_parameters)
    if not solid.any():
        solid = np.ones(len(voxels), dtype=bool)
    points = voxels.centers().T[:, solid].T
    half = voxels.voxel_m / 2
    low, high = percentiles(points, parameters.bounds_percentiles) + np.array([[-half], [half]])
    return ObjectShape(points.mean(axis=0), low, high, points, voxels.voxel_m, solid, parameters)


def upright_box(points_map: FloatArray, voxel_m: float, parameters: ObjectParameters = DEFAULT) -> Box3D:
    """The upright box (yaw only) that fits (n, 3) voxel centres best, less what sticks out.

    For its heading only heights are trimmed: trimmed along the map's axes, a thing that stands askew would get sides
    along them.
    """
    low, high = percentiles(points_map, parameters.box_percentiles)
    columns = points_map.T
    inner = (low[2] <= columns[2]) & (columns[2] <= high[2])
    yaw = best_yaw((columns[:2, inner] if np.count_nonzero(inner) >= 3 else columns[:2]).T, voxel_m, parameters)
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    nearest, farthest = percentiles(points_map[:, :2] @ axes.T, parameters.box_percentiles)
    (w, h), (cx, cy) = farthest - nearest, (nearest + farthest) / 2 @ axes
    if h > w:
        w, h, yaw = h, w, yaw + np.pi / 2
    yaw = (yaw + np.pi / 2) % np.pi - np.pi / 2
    center = np.array([cx, cy, (low[2] + high[2]) / 2])
    return Box3D(center, np.maximum(np.array([w, h, high[2] - low[2]]), voxel_m), float(yaw))


def best_yaw(points_xy: FloatArray, voxel_m: float, parameters: ObjectParameters = DEFAULT) -> float:
    """The heading in [0, pi/2) of the rectangle whose sides (n, 2) points lie closest to, as seen from above.

    Of a thing in a corner two sides are seen, an L, and the smallest rectangle around an L lies across it. What is
    maximised instead is the mean of 1 / distance to the nearest side (Zhang et al., "Efficient L-shape fitting for
    vehicle detection using laser scanners", IV 2017, the closeness criterion), over columns of voxels.
    """
    yaws, cosines, sines = _headings(parameters.yaw_step_deg)
    keys = distinct_keys(voxel_keys(points_xy, voxel_m))
    columns = ((keys - keys[0])[:: len(keys) // parameters.max_columns + 1] * voxel_m).astype(np.float32)
    x, y = columns[:, 0], columns[:, 1]
    own = np.concatenate([cosines * x + sines * y, cosines * y - sines * x])
    sides = np.minimum(own - own.min(axis=1, keepdims=True), own.max(axis=1, keepdims=True) - own)
    least_m = np.float32(max(voxel_m, parameters.closest_m))
    nearest = np.maximum(np.minimum(sides[: len(yaws)], sides[len(yaws) :]), least_m)
    return float(yaws[int(np.argmax((1 / nearest).mean(axis=1)))])


@lru_cache(maxsize=4)
def _headings(step_deg: float) -> tuple[FloatArray, Float32Array, Float32Array]:
    """Headings (k,) in [0, pi/2), radians, with cosines and sines (k, 1)."""
    yaws = np.radians(np.arange(0.0, 90.0, step_deg))
    return yaws, np.cos(yaws).astype(np.float32)[:, None], np.sin(yaws).astype(np.float32)[:, None]


@dataclass
class ObjectMap:
    """All objects, tentative ones too, by number; numbers are never used twice."""

    next_number: int = 1
    by_number: dict[int, MapObject] = field(default_factory=dict)
    parameters: ObjectParameterSets = field(default=DEFAULT_SETS, repr=False)
    _bounds: BoundsIndex = field(default_factory=BoundsIndex, repr=False)

    def __iter__(self) -> Iterator[MapObject]:
        return iter(self.by_number.values())

    def __len__(self) -> int:
        return len(self.by_number)

    def __getitem__(self, number: int) -> MapObject:
        return self.by_number[number]

    def use(self, parameters: ObjectParameterSets) -> None:
        """Set the parameters of all objects, also of those that are added later."""
        self.parameters = parameters
        for obj in self:
            obj.use(parameters)

    def new_number(self) -> int:
        """The number of the next object."""
        self.next_number += 1
        return self.next_number - 1

    def add(self, added: MapObject) -> None:
        """Enter an object; it follows the map's parameters from now on."""
        added.use(self.parameters)
        self.by_number[added.number] = added
        self._bounds.add(added.number)
        added.report_changes_to(self._bounds.changed)

    def remove(self, number: int) -> None:
        """Forget an object."""
        self.by_number.pop(number).report_changes_to(set())
        self._bounds.remove(number)

    def bounds(self) -> BoundsIndex:
        """Where all objects are now."""
        self._bounds.refresh(lambda number: self.by_number[number].shape.bounds)
        return self._bounds

    def within(self, center: FloatArray, radius_m: float) -> list[MapObject]:
        """Objects whose bounds come within a distance of a point."""
        return [self.by_number[number] for number in self.bounds().within(center, radius_m)]

    def beside(self, numbers: Iterable[int], gap_m: float) -> list[tuple[MapObject, MapObject]]:
        """Pairs of objects, one of them among `numbers`, whose bounds lie closer than `gap_m` along every axis."""
        pairs = self.bounds().beside(numbers, gap_m)
        return [(self.by_number[first], self.by_number[second]) for first, second in pairs]
