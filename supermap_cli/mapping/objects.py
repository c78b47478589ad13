"""The objects of the map while it is being built."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.voxels import dilate_codes, is_member, pack_keys, unpack_codes, voxel_keys
from supermap_cli.mapping.belief import LabelBelief, Viewpoints
from supermap_cli.mapping.motion import MotionState
from supermap_cli.mapping.voxel_map import VoxelMap
from supermap_cli.types.memory import Observation

TRIM = (1.5, 98.5)
"""A box leaves out what lies beyond these percentiles along each of its axes: strays."""

YAWS = np.radians(np.arange(0.0, 90.0, 2.0))
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
    """How often the running traversal supported an object, had its place in view, and saw its place empty."""

    supported: int = 0
    in_view: int = 0
    contradicted: int = 0
    first_support_ns: int | None = None
    last_support_ns: int | None = None

    def support(self, stamp_ns: int) -> None:
        """Count a keyframe that supports the object, once however many detections it holds of it."""
        if self.last_support_ns == stamp_ns:
            return
        self.supported += 1
        self.in_view += 1
        self.first_support_ns = stamp_ns if self.first_support_ns is None else self.first_support_ns
        self.last_support_ns = stamp_ns


@dataclass
class MapObject:
    """One thing the map believes in, or is about to (`confirmed` False: tentative, not in the map yet).

    `existence` is the log-odds that it is real, `doubted` that it was confirmed once but is believed in no more;
    `present` False: its place was seen empty in `absent_looks` looks in a row, the first at `first_absent_ns`.
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
    shifted_looks: int = 0
    viewpoints: Viewpoints = field(default_factory=Viewpoints)
    motion: MotionState = field(default_factory=MotionState)
    visit: VisitCount = field(default_factory=VisitCount)
    best_crop: float = 0.0
    _shape: ObjectShape | None = field(default=None, repr=False)

    @property
    def label(self) -> str:
        """The most likely label."""
        return self.labels.best

    @property
    def shape(self) -> ObjectShape:
        """Box, centroid and coarse occupancy, worked out anew when the voxels have changed."""
        if self._shape is None:
            self._shape = measure_shape(self.voxels)
        return self._shape

    def touched(self) -> None:
        """Say that the voxels have changed."""
        self._shape = None


def coarse_edge_m(extent_m: float) -> float:
    """Edge of the coarse voxels by which clouds are compared: a fifth of a small thing, the pose's error for others."""
    return float(np.clip(0.2 * extent_m, 0.02, 0.05))


@dataclass(frozen=True)
class ObjectShape:
    """What association and the graph need of an object's voxels.

    `low`, `high` (3,) bound the solid voxels in the map frame; `points` (n, 3) are their centres; `near_codes` the
    sorted codes of the voxels of edge `coarse_m` that they occupy or touch.
    """

    centroid: FloatArray
    low: FloatArray
    high: FloatArray
    box: Box3D
    points: FloatArray
    coarse_m: float
    near_codes: IntArray

    @property
    def extent_m(self) -> float:
        """Length of the longest side."""
        return float((self.high - self.low).max())

    def share_near(self, points_map: FloatArray) -> float:
        """Share of (n, 3) points that lie in or beside the object's coarse voxels."""
        if not len(points_map):
            return 0.0
        return float(self.near(points_map).mean())

    def near(self, points_map: FloatArray) -> BoolArray:
        """(n,) which points lie in or beside the object's coarse voxels."""
        return is_member(pack_keys(voxel_keys(points_map, self.coarse_m)), self.near_codes)


def measure_shape(voxels: VoxelMap) -> ObjectShape:
    """Box, centroid and coarse occupancy of the solid voxels."""
    solid = voxels.solid()
    points = voxels.centers()[solid] if solid.any() else voxels.centers()
    half = voxels.voxel_m / 2
    low, high = np.percentile(points, (1, 99), axis=0) + np.array([[-half], [half]])
    coarse_m = coarse_edge_m(float((high - low).max()))
    coarse = np.unique(pack_keys(voxel_keys(points, coarse_m)))
    return ObjectShape(
        centroid=points.mean(axis=0),
        low=low,
        high=high,
        box=upright_box(points, voxels.voxel_m),
        points=points,
        coarse_m=coarse_m,
        near_codes=dilate_codes(coarse),
    )


def upright_box(points_map: FloatArray, voxel_m: float) -> Box3D:
    """The upright box (yaw only) that fits (n, 3) voxel centres best, less what sticks out."""
    low, high = np.percentile(points_map, TRIM, axis=0)
    inner = ((points_map >= low) & (points_map <= high)).all(axis=1)
    yaw = best_yaw(points_map[inner, :2] if inner.sum() >= 3 else points_map[:, :2], voxel_m)
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    nearest, farthest = np.percentile(points_map[:, :2] @ axes.T, TRIM, axis=0)
    (w, h), (cx, cy) = farthest - nearest, (nearest + farthest) / 2 @ axes
    if h > w:
        w, h, yaw = h, w, yaw + np.pi / 2
    yaw = (yaw + np.pi / 2) % np.pi - np.pi / 2
    center = np.array([cx, cy, (low[2] + high[2]) / 2])
    return Box3D(center, np.array([w, h, high[2] - low[2]]) + voxel_m, float(yaw))


def best_yaw(points_xy: FloatArray, voxel_m: float) -> float:
    """The heading in [0, pi/2) of the rectangle whose sides (n, 2) points lie closest to, as seen from above.

    Of a thing in a corner two sides are seen, an L, and the smallest rectangle around an L lies across it. What is
    maximised instead is the mean of 1 / distance to the nearest side (Zhang et al., "Efficient L-shape fitting for
    vehicle detection using laser scanners", IV 2017, the closeness criterion), over columns of voxels.
    """
    keys = np.zeros((len(points_xy), 3))
    keys[:, :2] = points_xy
    codes = np.unique(pack_keys(voxel_keys(keys, voxel_m)))
    columns = unpack_codes(codes[:: len(codes) // MOST_COLUMNS + 1])[:, :2] * voxel_m
    cos, sin = np.cos(YAWS)[:, None], np.sin(YAWS)[:, None]
    sides = []
    for own in (cos * columns[:, 0] + sin * columns[:, 1], cos * columns[:, 1] - sin * columns[:, 0]):
        low, high = own.min(axis=1, keepdims=True), own.max(axis=1, keepdims=True)
        sides.append(np.minimum(own - low, high - own))
    nearest = np.maximum(np.minimum(*sides), max(voxel_m, CLOSEST_M))
    return float(YAWS[int(np.argmax((1 / nearest).mean(axis=1)))])


@dataclass
class ObjectMap:
    """All objects, tentative ones too, by number; numbers are never used twice."""

    next_number: int = 1
    by_number: dict[int, MapObject] = field(default_factory=dict)

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

    def remove(self, number: int) -> None:
        """Forget an object."""
        del self.by_number[number]

    def within(self, center: FloatArray, radius_m: float) -> list[MapObject]:
        """Objects whose bounds come within a distance of a point."""
        objects = list(self.by_number.values())
        if not objects:
            return []
        low = np.array([each.shape.low for each in objects])
        high = np.array([each.shape.high for each in objects])
        gap = np.maximum(np.maximum(low - center, center - high), 0)
        return [objects[i] for i in np.flatnonzero(np.linalg.norm(gap, axis=1) <= radius_m)]
