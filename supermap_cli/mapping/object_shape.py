"""An object's shape, worked out of its voxels: bounds, the upright box, and what lies on it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.geometry.voxels import NearVoxels, distinct_keys, near_voxels, voxel_keys
from supermap_cli.mapping import voxel_map
from supermap_cli.mapping.voxel_map import VoxelMap, VoxelMapParameters
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class ObjectShapeParameters:
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


DEFAULT = ObjectShapeParameters()


def coarse_edge_m(extent_m: float, parameters: ObjectShapeParameters = DEFAULT) -> float:
    """Edge of the coarse voxels by which clouds are compared: a fifth of a small thing, the pose's error for others."""
    return min(max(parameters.coarse_share * extent_m, parameters.min_coarse_m), parameters.max_coarse_m)


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
    parameters: ObjectShapeParameters = field(default=DEFAULT, repr=False)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """`low` and `high`."""
        return self.low, self.high

    @cached_property
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
        return float(np.count_nonzero(self.near(points_map)) / len(points_map))

    def near(self, points_map: FloatArray) -> BoolArray:
        """(n,) which points lie in or beside the object's coarse voxels."""
        return self.near_voxels.hold(voxel_keys(points_map, self.coarse_m))


def measure_shape(
    voxels: VoxelMap,
    parameters: ObjectShapeParameters = DEFAULT,
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


def upright_box(points_map: FloatArray, voxel_m: float, parameters: ObjectShapeParameters = DEFAULT) -> Box3D:
    """The upright box (yaw only) that fits (n, 3) voxel centres best, less what sticks out.

    For its heading only heights are trimmed: trimmed along the map's axes, a thing that stands askew would get sides
    along them.
    """
    columns = points_map.T
    bottom, top = percentiles(columns[2], parameters.box_percentiles)
    inner = (bottom <= columns[2]) & (columns[2] <= top)
    yaw = best_yaw((columns[:2, inner] if np.count_nonzero(inner) >= 3 else columns[:2]).T, voxel_m, parameters)
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    nearest, farthest = percentiles(points_map[:, :2] @ axes.T, parameters.box_percentiles)
    (w, h), (cx, cy) = farthest - nearest, (nearest + farthest) / 2 @ axes
    if h > w:
        w, h, yaw = h, w, yaw + np.pi / 2
    yaw = (yaw + np.pi / 2) % np.pi - np.pi / 2
    center = np.array([cx, cy, (bottom + top) / 2])
    return Box3D(center, np.maximum(np.array([w, h, top - bottom]), voxel_m), float(yaw))


def best_yaw(points_xy: FloatArray, voxel_m: float, parameters: ObjectShapeParameters = DEFAULT) -> float:
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
    sides = own.max(axis=1, keepdims=True) - own
    own -= own.min(axis=1, keepdims=True)
    np.minimum(sides, own, out=sides)
    least_m = np.float32(max(voxel_m, parameters.closest_m))
    nearest = np.maximum(np.minimum(sides[: len(yaws)], sides[len(yaws) :]), least_m)
    return float(yaws[int(np.argmax((1 / nearest).mean(axis=1)))])


@lru_cache(maxsize=4)
def _headings(step_deg: float) -> tuple[FloatArray, Float32Array, Float32Array]:
    """Headings (k,) in [0, pi/2), radians, with cosines and sines (k, 1)."""
    yaws = np.radians(np.arange(0.0, 90.0, step_deg))
    return yaws, np.cos(yaws).astype(np.float32)[:, None], np.sin(yaws).astype(np.float32)[:, None]
