"""A LiDAR's single returns under a mask: more exact than the depth image that is drawn of them, and sparse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray, check_shape
from supermap_cli.geometry.cameras import Camera
from supermap_cli.types.detections import RegionMask

LIDAR_SIGMA_M = 0.02
"""Standard deviation of a LiDAR's range, whatever the range (Livox Mid-360, Ouster, Velodyne: 1 to 3 cm)."""

_NEIGHBOURS = 8
_SAME_SURFACE_SIGMAS = 3.0


@dataclass(frozen=True)
class Returns:
    """n returns on an image: pixels `u`, `v` (n,), `points_camera` (n, 3), `depth_m` (n,) in the camera's measure."""

    u: IntArray
    v: IntArray
    points_camera: FloatArray
    depth_m: FloatArray

    def __post_init__(self) -> None:
        check_shape("points_camera", self.points_camera, (len(self.u), 3))

    def under(self, mask: RegionMask, region: BoolArray) -> IntArray:
        """Which returns (k,) fall on the set pixels of a region (h, w) laid out like the mask."""
        h, w = region.shape
        u, v = self.u - mask.u0, self.v - mask.v0
        near = np.flatnonzero((u >= 0) & (u < w) & (v >= 0) & (v < h))
        return near[region[v[near], u[near]]]

    def smoothed(self, chosen: IntArray) -> FloatArray:
        """The chosen returns (k, 3), each at the mean range of those around it that lie on its surface.

        What is left of the noise is a third of it; edges stay, for a return beyond three sigma is on another surface.
        """
        from scipy.spatial import cKDTree  # noqa: PLC0415 - heavy

        points, range_m = self.points_camera[chosen], self.depth_m[chosen]
        if len(chosen) <= _NEIGHBOURS:
            return points
        pixels = np.column_stack([self.u[chosen], self.v[chosen]])
        _, nearest = cKDTree(pixels).query(pixels, k=_NEIGHBOURS)
        step_m = range_m[nearest] - range_m[:, None]
        same = np.abs(step_m) < _SAME_SURFACE_SIGMAS * np.sqrt(2) * LIDAR_SIGMA_M
        mean_m = (step_m * same).sum(axis=1) / np.maximum(same.sum(axis=1), 1)  # of many on one pixel, own may miss
        smoothed: FloatArray = points * (1 + mean_m / range_m)[:, None]
        return smoothed


def returns_on_image(camera: Camera, points_camera: FloatArray, max_range_m: float) -> Returns:
    """The returns within range that fall on the image."""
    pixels, on_image = camera.project(points_camera)
    depth_m = camera.depth_of(points_camera)
    on_image &= depth_m <= max_range_m
    u, v = np.rint(pixels[on_image]).astype(np.int64).T
    return Returns(
        u.clip(0, camera.width - 1), v.clip(0, camera.height - 1), points_camera[on_image], depth_m[on_image]
    )


def spacing_m(count: int, area_px: int, depth_m: float, focal_px: float) -> float:
    """How far `count` returns lie apart that fall on `area_px` pixels at a depth."""
    return depth_m * float(np.sqrt(area_px / max(count, 1))) / focal_px
