"""A LiDAR's single returns under a mask: more exact than the depth image that is drawn of them, and sparse.

Belongs to `Unproject` of the paper's algorithm 1, step (4), which takes any depth for a dense image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray, check_shape
from supermap_cli.geometry.cameras import Camera
from supermap_cli.types.detections import RegionMask
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class ReturnsParameters:
    """How exact a LiDAR is, and how its noise is smoothed."""

    range_sigma_m: float = parameter(
        0.02,
        "m",
        "standard deviation of a LiDAR's range, whatever the range; also the edge of the voxels of what it sees",
        "data sheets of Livox Mid-360, Ouster and Velodyne: 1 to 3 cm",
    )
    smoothing_neighbours: int = parameter(8, "1", "returns that one return's range is averaged over", TUNED, at_least=1)
    same_surface_sigmas: float = parameter(
        3.0, "1", "deviations of a difference of ranges up to which two returns lie on one surface", "three-sigma rule"
    )


DEFAULT = ReturnsParameters()


@dataclass(frozen=True)
class Returns:
    """n returns on an image: pixels `u`, `v` (n,), `points_camera` (n, 3), `depth_m` (n,) in the camera's measure."""

    u: IntArray
    v: IntArray
    points_camera: FloatArray
    depth_m: FloatArray
    parameters: ReturnsParameters = DEFAULT

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

        parameters = self.parameters
        points, range_m = self.points_camera[chosen], self.depth_m[chosen]
        if len(chosen) <= parameters.smoothing_neighbours:
            return points
        pixels = np.column_stack([self.u[chosen], self.v[chosen]])
        _, nearest = cKDTree(pixels).query(pixels, k=parameters.smoothing_neighbours)
        step_m = range_m[nearest] - range_m[:, None]
        same = np.abs(step_m) < parameters.same_surface_sigmas * np.sqrt(2) * parameters.range_sigma_m
        mean_m = (step_m * same).sum(axis=1) / np.maximum(same.sum(axis=1), 1)  # of many on one pixel, own may miss
        smoothed: FloatArray = points * (1 + mean_m / range_m)[:, None]
        return smoothed


def returns_on_image(
    camera: Camera, points_camera: FloatArray, max_range_m: float, parameters: ReturnsParameters = DEFAULT
) -> Returns:
    """The returns within range that fall on the image."""
    pixels, on_image = camera.project(points_camera)
    depth_m = camera.depth_of(points_camera)
    on_image &= depth_m <= max_range_m
    u, v = np.rint(pixels[on_image]).astype(np.int64).T
    u, v = u.clip(0, camera.width - 1), v.clip(0, camera.height - 1)
    return Returns(u, v, points_camera[on_image], depth_m[on_image], parameters)


def spacing_m(count: int, area_px: int, depth_m: float, focal_px: float) -> float:
    """How far `count` returns lie apart that fall on `area_px` pixels at a depth."""
    return depth_m * float(np.sqrt(area_px / max(count, 1))) / focal_px
