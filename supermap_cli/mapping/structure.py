"""Surfaces from depth images: points with normals, which levelling, drift correction and alignment work on.

Stands for the dense reconstruction of the paper's geometric layer (sec. IV-A), which SuperOdometry gives there.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray, check_shape
from supermap_cli.geometry.cameras import Camera, camera_from_json
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.types.memory import KeyframeRecord
from supermap_cli.types.parameters import TUNED, parameter
from supermap_cli.types.sensing import CameraFrame

_MOST_CODES = 2.0**62
"""Cells of a box of voxels whose numbers fit into int64."""

_MAX_TABLE_CELLS = 1 << 22
"""Cells of a lookup table, 16 MB, above which voxels are sorted instead."""


@dataclass(frozen=True)
class StructureParameters:
    """What counts as a surface, in depth images and in point clouds.

    In an image a point lies on a plane if its neighbours do within `plane_m` + `plane_per_m` times its distance
    squared; in a cloud, if its neighbours' scatter along the normal is small and across it not that of a line.
    """

    columns: int = parameter(160, "px", "columns that depth images are thinned to", "bounds the time", at_least=1)
    baseline_share: float = parameter(1 / 60, "1", "span of a normal's differences, as a share of the width", TUNED)
    min_incidence: float = parameter(
        0.1, "1", "sine of the angle between ray and surface below which it is seen edge-on", TUNED
    )
    dense_share: float = parameter(
        0.3, "1", "share of pixels with a return below which a depth image counts as points", TUNED
    )
    camera_reach_m: float = parameter(5.0, "m", "depth up to which a depth camera's surfaces are exact enough", TUNED)
    lidar_reach_m: float = parameter(12.0, "m", "the same of depth drawn from a LiDAR's returns", TUNED)
    min_depth_m: float = parameter(0.1, "m", "depth below which an image's returns are not used", "depth cameras")
    plane_m: float = parameter(0.01, "m", "distance of a pixel from its neighbours' plane, near by", TUNED)
    plane_per_m: float = parameter(0.006, "1/m", "growth of that distance with the square of the distance", TUNED)
    min_range_m: float = parameter(0.3, "m", "range below which points show the robot itself", TUNED)
    max_range_m: float = parameter(30.0, "m", "range above which points are not used", TUNED)
    voxel_m: float = parameter(0.08, "m", "edge of the voxels that points are thinned to", TUNED, at_least=0.005)
    neighbours: int = parameter(12, "1", "points that a normal is found from", TUNED, at_least=3)
    max_flatness: float = parameter(0.05, "1", "scatter along the normal by the next larger, at most", TUNED)
    min_breadth: float = parameter(0.1, "1", "middle scatter by the largest, at least: less is a line", TUNED)
    max_spread_voxels: float = parameter(8.0, "1", "distance of the farthest neighbour in voxels, at most", TUNED)


DEFAULT = StructureParameters()


@dataclass(frozen=True)
class Structure:
    """Surface points (n, 3) in metres with their unit normals (n, 3), which look to the side they were seen from."""

    points: FloatArray
    normals: FloatArray

    def __post_init__(self) -> None:
        check_shape("points", self.points, (None, 3))
        check_shape("normals", self.normals, (len(self.points), 3))

    def __len__(self) -> int:
        return len(self.points)

    def moved(self, T_target_source: FloatArray) -> Structure:
        """The same surfaces in another frame."""
        return Structure(transform_points(T_target_source, self.points), self.normals @ T_target_source[:3, :3].T)

    def take(self, chosen: BoolArray | IntArray) -> Structure:
        """The chosen points."""
        return Structure(self.points[chosen], self.normals[chosen])

    def within(self, center: FloatArray, radius_m: float) -> Structure:
        """Those that come within a distance of a point (3,)."""
        offsets = self.points - center
        return self.take(np.flatnonzero(np.einsum("ij,ij->i", offsets, offsets) < radius_m**2))

    def thinned(self, voxel_m: float) -> Structure:
        """At most one point a voxel: the first of each, so that the number of points measures area."""
        return self.take(first_of_each(self.points, voxel_m))


def first_of_each(points: FloatArray, voxel_m: float) -> IntArray:
    """(m,) which of (n, 3) points are the first of their voxel, in their order."""
    keys = np.floor(np.ascontiguousarray(points.T) / voxel_m).astype(np.int64)
    keys -= keys.min(axis=1, initial=2**62, keepdims=True)
    extent = keys.max(axis=1, initial=0) + 1
    codes = (keys[0] * extent[1] + keys[1]) * extent[2] + keys[2]
    cells = np.prod(extent.astype(float))
    if cells >= _MOST_CODES:  # points so far apart that their voxels cannot be counted
        return np.sort(np.unique(keys, axis=1, return_index=True)[1])
    if cells > _MAX_TABLE_CELLS:
        return np.sort(np.unique(codes, return_index=True)[1])
    first = np.empty(np.prod(extent), np.int32)  # filled only where it is read
    order = np.arange(len(codes), dtype=np.int32)
    first[codes[::-1]] = order[::-1]
    return np.flatnonzero(first[codes] == order)


def join(structures: Iterable[Structure]) -> Structure:
    """All points of several structures."""
    parts: Sequence[Structure] = [Structure(np.zeros((0, 3)), np.zeros((0, 3))), *structures]
    return Structure(np.concatenate([part.points for part in parts]), np.concatenate([part.normals for part in parts]))


@dataclass(frozen=True)
class CoarseDepth:
    """A depth image on a coarse grid, and where it was taken.

    `depth_m` (h, w) float32 in the camera's measure, 0 = no return; its (row, column) is the camera's pixel (v, u) =
    `step_px` * (row, column). `T_frame_camera` places the optical frame in whatever frame is spoken of.
    """

    depth_m: Float32Array
    step_px: int
    camera: Camera
    T_frame_camera: FloatArray
    max_depth_m: float = DEFAULT.camera_reach_m
    parameters: StructureParameters = DEFAULT

    def moved(self, T_target_frame: FloatArray) -> CoarseDepth:
        """The same image in another frame."""
        return replace(self, T_frame_camera=T_target_frame @ self.T_frame_camera)

    def structure(self, max_depth_m: float | None = None) -> Structure:
        """Its surfaces in the frame, up to a depth, by default the sensor's own; a depth image with returns here and
        there, as from a LiDAR, counts as points.
        """
        reach_m = self.max_depth_m if max_depth_m is None else max_depth_m
        rows, columns = np.nonzero((self.depth_m > 0) & (self.depth_m < reach_m))
        parameters = self.parameters
        if len(rows) < parameters.dense_share * self.depth_m.size:
            pixels_uv = np.column_stack([columns, rows]).astype(np.float64) * self.step_px
            points = self.camera.back_project(pixels_uv, self.depth_m[rows, columns].astype(np.float64))
            return structure_of_points(points, parameters=parameters).moved(self.T_frame_camera)
        seen = structure_of_depth(
            self.depth_m, self.camera, pixel_step=self.step_px, max_depth_m=reach_m, parameters=parameters
        )
        return seen.moved(self.T_frame_camera)


def coarse_depth(
    frame: CameraFrame,
    T_frame_base: FloatArray,
    step_px: int | None = None,
    parameters: StructureParameters = DEFAULT,
) -> CoarseDepth | None:
    """A camera frame's depth on a grid of about 160 columns (or every `step_px` pixels); `None` if it has no depth."""
    if frame.depth_m is None:
        return None
    step = step_px or max(1, frame.camera.width // parameters.columns)
    reach_m = parameters.camera_reach_m if frame.returns_camera is None else parameters.lidar_reach_m
    T_frame_camera = T_frame_base @ frame.T_base_camera
    return CoarseDepth(frame.depth_m[::step, ::step], step, frame.camera, T_frame_camera, reach_m, parameters)


def stored_depth(record: KeyframeRecord, parameters: StructureParameters = DEFAULT) -> CoarseDepth:
    """The depth that the memory keeps with a keyframe, in the map frame."""
    from supermap_cli.mapping.free_space import decode_small_depth  # noqa: PLC0415 - cv2

    return CoarseDepth(
        decode_small_depth(record),
        record.depth_step,
        camera_from_json(record.camera),
        record.T_map_camera,
        parameters.camera_reach_m,
        parameters,
    )


def structure_of_depth(
    depth_m: Float32Array,
    camera: Camera,
    *,
    pixel_step: int = 1,
    max_depth_m: float | None = None,
    parameters: StructureParameters = DEFAULT,
) -> Structure:
    """Points and normals of a depth image in the camera's optical frame.

    `depth_m` is (h, w), 0 = no return; its (row, column) is the camera's pixel (v, u) = `pixel_step` * (row, column).
    A normal is the cross product of the central differences across a sixtieth of the image's width, kept where
    all five points have a depth, by default within a depth camera's reach, and lie on one plane that is not seen
    edge-on.
    """
    thin = max(1, camera.width // (parameters.columns * pixel_step))
    step = thin * pixel_step
    depth_m = depth_m[::thin, ::thin]
    k = max(1, round(camera.width * parameters.baseline_share / step / 2))
    if min(depth_m.shape) <= 2 * k:
        return join([])
    rays, visible = _rays(camera, step, depth_m.shape)
    points = rays * depth_m
    reach_m = parameters.camera_reach_m if max_depth_m is None else max_depth_m
    seen = visible & (depth_m > parameters.min_depth_m) & (depth_m < reach_m)
    middle, low, high = slice(k, -k), slice(None, -2 * k), slice(2 * k, None)
    here = points[:, middle, middle]
    left, right = points[:, middle, low] - here, points[:, middle, high] - here
    above, below = points[:, low, middle] - here, points[:, high, middle] - here
    normals = _cross(below - above, right - left)
    with np.errstate(invalid="ignore"):  # nothing is seen at some pixels
        normals /= np.maximum(np.sqrt(_dot(normals, normals)), np.float32(1e-12))
        distance_m = np.sqrt(_dot(here, here))
        facing = _dot(normals, here)
        bend_m = np.maximum(np.abs(_dot(normals, left + right)), np.abs(_dot(normals, above + below)))
        plane_m = parameters.plane_m + parameters.plane_per_m * np.square(distance_m)
        flat = (np.abs(facing) > parameters.min_incidence * distance_m) & (bend_m < plane_m)
    flat &= seen[middle, middle] & seen[middle, low] & seen[middle, high] & seen[low, middle] & seen[high, middle]
    normals *= -np.sign(facing)
    at = np.flatnonzero(flat)
    return Structure(*(part.reshape(3, -1)[:, at].T.astype(np.float64, order="C") for part in (here, normals)))


@lru_cache(maxsize=8)
def _rays(camera: Camera, step_px: int, shape: tuple[int, int]) -> tuple[Float32Array, BoolArray]:
    """The rays (3, h, w) of every `step_px`-th pixel: a point is its ray times its depth; and which see anything."""
    rows, columns = np.indices(shape)
    pixels_uv = np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64) * step_px
    rays = camera.back_project(pixels_uv, np.ones(len(pixels_uv))).T.reshape(3, *shape)
    visible: BoolArray = np.isfinite(rays.sum(axis=0))
    return np.ascontiguousarray(rays, np.float32), visible


def _dot(first: Float32Array, second: Float32Array) -> Float32Array:
    """(h, w) inner products of vectors (3, h, w)."""
    product: Float32Array = first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
    return product


def _cross(first: Float32Array, second: Float32Array) -> Float32Array:
    """(3, h, w) vector products of vectors (3, h, w)."""
    (a, b, c), (x, y, z) = first, second
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x])


def structure_of_points(
    points_sensor: FloatArray,
    *,
    voxel_m: float | None = None,
    max_range_m: float | None = None,
    parameters: StructureParameters = DEFAULT,
) -> Structure:
    """Points and normals of a LiDAR sweep, or of several joined if they are sparse, (n, 3) in the sensor's frame.

    A normal is the direction of least scatter among a point's neighbours, kept where they lie on one plane.
    `voxel_m` and `max_range_m` take the place of those among the parameters.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415 - heavy

    distance_m = np.linalg.norm(points_sensor, axis=1)
    voxel_m = parameters.voxel_m if voxel_m is None else voxel_m
    max_range_m = parameters.max_range_m if max_range_m is None else max_range_m
    near = points_sensor[np.isfinite(distance_m) & (distance_m > parameters.min_range_m) & (distance_m < max_range_m)]
    points = Structure(near, np.zeros_like(near)).thinned(voxel_m).points
    if len(points) < parameters.neighbours:
        return join([])
    reach_m, nearest = cKDTree(points).query(points, k=parameters.neighbours)
    around = points[nearest] - points[nearest].mean(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))
    normals = vectors[:, :, 0]
    normals *= -np.sign(np.einsum("ij,ij->i", normals, points))[:, None]
    flat = (
        (values[:, 0] < parameters.max_flatness * values[:, 1])
        & (values[:, 1] > parameters.min_breadth * values[:, 2])
        & (reach_m[:, -1] < parameters.max_spread_voxels * voxel_m)
    )
    return Structure(points[flat], normals[flat])
