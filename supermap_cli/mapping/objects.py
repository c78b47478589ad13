"""The objects of the map while it is being built."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.geometry.voxels import NearVoxels, distinct_keys, near_voxels, voxel_keys
from supermap_cli.mapping.absence import EmptyRun
from supermap_cli.mapping.belief import LabelBelief, Viewpoints
from supermap_cli.mapping.bounds import BoundsIndex
from supermap_cli.mapping.motion import MotionState
from supermap_cli.mapping.voxel_map import VoxelMap
from supermap_cli.types.labels import ANIMATE
from supermap_cli.types.memory import Observation

TRIM = (1.5, 98.5)
"""A box leaves out what lies beyond these percentiles along each of its axes: strays."""

YAWS = np.radians(np.arange(0.0, 90.0, 2.0))
COS_YAWS, SIN_YAWS = np.cos(YAWS).astype(np.float32)[:, None], np.sin(YAWS).astype(np.float32)[:, None]
MOST_COLUMNS = 400
CLOSEST_M = 0.03
"""Headings tried for a box, on no more columns than this; nearer to a side than this is on it."""


@dataclass
class OpenState:
    """The state an object is in now: since when, and when its place was last seen empty before."""

    index: int
    first_seen_ns: int
    empty_before_ns: int | None = None


@dataclass
class VisitCount:
    """How often the running traversal supported an object, had its place in view, and saw its place empty.

    `in_view_then` is how often it had been in view when it was last supported.
    """

    supported: int = 0
    in_view: int = 0
    contradicted: int = 0
    in_view_then: int = 0
    first_support_ns: int | None = None
    last_support_ns: int | None = None

    def support(self, stamp_ns: int) -> None:
        """Count a keyframe that supports the object, once however many detections it holds of it."""
        if self.last_support_ns == stamp_ns:
            return
        self.supported += 1
        self.in_view += 1
        self.in_view_then = self.in_view
        self.first_support_ns = stamp_ns if self.first_support_ns is None else self.first_support_ns
        self.last_support_ns = stamp_ns


@dataclass
class MapObject:
    """One thing the map believes in, or is about to (`confirmed` False: tentative, not in the map yet).

    `existence` is the log-odds that it is real, `doubted` that it was confirmed once but is believed in no more;
    `present` False: its place was seen empty, in `absent_looks` looks in a row, the first at `first_absent_ns`, or in
    the looks at parts of it of `empty_run`; so many `shifted_looks` in a row, the first at `first_shifted_ns`, showed
    it beside its place, the last by the shift `shifted_to` (3,), if that is known, all together by `shifted_gain`.
    `silence` is what the looks since it was last seen say against it (log-odds), the first at `first_silent_ns`, from
    `silent_views`; `unsettled` are those of them (visible share of the image, truncated) that were misses only if it is
    still there.
    `before_visit_ns` is when an earlier traversal saw it last; `best_crop` how good the best picture is that was kept
    of it in this traversal and place.
    `pending` are the observations made before it was confirmed; `entered` says that it is known to the memory.
    """

    number: int
    voxels: VoxelMap
    labels: LabelBelief
    first_seen_ns: int
    last_seen_ns: int
    existence: float
    state: OpenState
    pending: list[Observation] = field(default_factory=list)
    confirmed: bool = False
    entered: bool = False
    present: bool = True
    doubted: bool = False
    gone_ns: int | None = None
    observations: int = 0
    track_id: int = -1
    absent_looks: int = 0
    first_absent_ns: int = 0
    empty_run: EmptyRun = field(default_factory=EmptyRun)
    shifted_looks: int = 0
    first_shifted_ns: int = 0
    shifted_to: FloatArray | None = None
    shifted_gain: float = 0.0
    silence: float = 0.0
    silent_views: Viewpoints = field(default_factory=Viewpoints)
    first_silent_ns: int = 0
    unsettled: list[tuple[float, bool]] = field(default_factory=list)
    viewpoints: Viewpoints = field(default_factory=Viewpoints)
    motion: MotionState = field(default_factory=MotionState)
    visit: VisitCount = field(default_factory=VisitCount)
    before_visit_ns: int | None = None
    best_crop: float = 0.0
    _shape: ObjectShape | None = field(default=None, repr=False)
    _changed: set[int] = field(default_factory=set, repr=False)

    @property
    def label(self) -> str:
        """The most likely label."""
        return self.labels.best

    @property
    def on_the_move(self) -> bool:
        """Whether it is moving now, carried or by itself."""
        walking = self.motion.course is not None and self.motion.course.walking
        return self.motion.moving or (walking and self.label in ANIMATE)

    @property
    def shape(self) -> ObjectShape:
        """Box, centroid and coarse occupancy, worked out anew when the voxels have changed."""
        if self._shape is None:
            self._shape = measure_shape(self.voxels)
        return self._shape

    @property
    def solid(self) -> BoolArray:
        """(n,) which voxels are believed to be the object's, as of when its shape was measured."""
        return self.shape.solid

    def in_place(self) -> None:
        """It has been seen where it is believed to stand: what spoke for its having gone before is void."""
        self.absent_looks, self.empty_run = 0, EmptyRun()
        self.silence, self.silent_views, self.unsettled = 0.0, Viewpoints(), []

    def touched(self) -> None:
        """Say that the voxels have changed."""
        self._shape = None
        self._changed.add(self.number)

    def tell(self, changed: set[int]) -> None:
        """From now on, enter the object's number there whenever its voxels have changed."""
        self._changed = changed


def coarse_edge_m(extent_m: float) -> float:
    """Edge of the coarse voxels by which clouds are compared: a fifth of a small thing, the pose's error for others."""
    return float(np.clip(0.2 * extent_m, 0.02, 0.05))


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
        return upright_box(self.points, self.voxel_m)

    @cached_property
    def coarse_m(self) -> float:
        """Edge of the coarse voxels by which it is compared with other clouds."""
        return coarse_edge_m(self.extent_m)

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


def measure_shape(voxels: VoxelMap) -> ObjectShape:
    """Bounds and centroid of the solid voxels; what else there is to know of them is worked out when it is asked."""
    solid = voxels.solid()
    if not solid.any():
        solid = np.ones(len(voxels), dtype=bool)
    points = voxels.centers().T[:, solid].T
    half = voxels.voxel_m / 2
    low, high = percentiles(points, (1, 99)) + np.array([[-half], [half]])
    return ObjectShape(points.mean(axis=0), low, high, points, voxels.voxel_m, solid)


def upright_box(points_map: FloatArray, voxel_m: float) -> Box3D:
    """The upright box (yaw only) that fits (n, 3) voxel centres best, less what sticks out.

    For its heading only heights are trimmed: trimmed along the map's axes, a thing that stands askew would get sides
    along them.
    """
    low, high = percentiles(points_map, TRIM)
    columns = points_map.T
    inner = (low[2] <= columns[2]) & (columns[2] <= high[2])
    yaw = best_yaw((columns[:2, inner] if np.count_nonzero(inner) >= 3 else columns[:2]).T, voxel_m)
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    nearest, farthest = percentiles(points_map[:, :2] @ axes.T, TRIM)
    (w, h), (cx, cy) = farthest - nearest, (nearest + farthest) / 2 @ axes
    if h > w:
        w, h, yaw = h, w, yaw + np.pi / 2
    yaw = (yaw + np.pi / 2) % np.pi - np.pi / 2
    center = np.array([cx, cy, (low[2] + high[2]) / 2])
    return Box3D(center, np.maximum(np.array([w, h, high[2] - low[2]]), voxel_m), float(yaw))


def best_yaw(points_xy: FloatArray, voxel_m: float) -> float:
    """The heading in [0, pi/2) of the rectangle whose sides (n, 2) points lie closest to, as seen from above.

    Of a thing in a corner two sides are seen, an L, and the smallest rectangle around an L lies across it. What is
    maximised instead is the mean of 1 / distance to the nearest side (Zhang et al., "Efficient L-shape fitting for
    vehicle detection using laser scanners", IV 2017, the closeness criterion), over columns of voxels.
    """
    keys = distinct_keys(voxel_keys(points_xy, voxel_m))
    columns = ((keys - keys[0])[:: len(keys) // MOST_COLUMNS + 1] * voxel_m).astype(np.float32)
    x, y = columns[:, 0], columns[:, 1]
    own = np.concatenate([COS_YAWS * x + SIN_YAWS * y, COS_YAWS * y - SIN_YAWS * x])
    sides = np.minimum(own - own.min(axis=1, keepdims=True), own.max(axis=1, keepdims=True) - own)
    nearest = np.maximum(np.minimum(sides[: len(YAWS)], sides[len(YAWS) :]), np.float32(max(voxel_m, CLOSEST_M)))
    return float(YAWS[int(np.argmax((1 / nearest).mean(axis=1)))])


@dataclass
class ObjectMap:
    """All objects, tentative ones too, by number; numbers are never used twice."""

    next_number: int = 1
    by_number: dict[int, MapObject] = field(default_factory=dict)
    _bounds: BoundsIndex = field(default_factory=BoundsIndex, repr=False)

    def __iter__(self) -> Iterator[MapObject]:
        return iter(self.by_number.values())

    def __len__(self) -> int:
        return len(self.by_number)

    def __getitem__(self, number: int) -> MapObject:
        return self.by_number[number]

    def new_number(self) -> int:
        """The number of the next object."""
        self.next_number += 1
        return self.next_number - 1

    def add(self, added: MapObject) -> None:
        """Enter an object."""
        self.by_number[added.number] = added
        self._bounds.add(added.number)
        added.tell(self._bounds.changed)

    def remove(self, number: int) -> None:
        """Forget an object."""
        self.by_number.pop(number).tell(set())
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
