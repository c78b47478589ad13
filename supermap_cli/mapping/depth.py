"""One keyframe's depth, prepared once for all the tests that are made against it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.types.keyframe import Keyframe


def depth_sigma_m(depth_m: FloatArray | Float32Array) -> FloatArray:
    """Standard deviation of a structured-light depth at that depth (Nguyen, Izadi, Lovell 2012, eq. 3, axial noise)."""
    sigma: FloatArray = 0.0012 + 0.0019 * np.square(np.maximum(np.asarray(depth_m, np.float64), 0.4) - 0.4)
    return sigma


@dataclass(frozen=True)
class DepthView:
    """Depth with the nearest and farthest return around every pixel, (h, w) float32 each.

    A pixel's neighbourhood spans what colour and depth may be out of register by, and the pose's own error; so a point
    is compared with an interval, which is wide at depth edges and on slanted surfaces and narrow on plain ones.
    `nearest_m` is +inf and `farthest_m` 0 where nothing returned.
    """

    camera: Camera
    T_map_camera: FloatArray
    depth_m: Float32Array
    nearest_m: Float32Array
    farthest_m: Float32Array
    max_depth_m: float

    @property
    def reach_px(self) -> int:
        """How far a pixel's neighbourhood goes on every side."""
        return neighbourhood_px(self.camera.width)

    def project(self, points_map: FloatArray) -> tuple[IntArray, IntArray, FloatArray, BoolArray]:
        """(n, 3) map points -> (n,) pixel u and v (0 where not on the image), (n,) depth, (n,) on the image."""
        points_camera = transform_points(inverse(self.T_map_camera), points_map)
        pixels, seen = self.camera.project(points_camera)
        depth = self.camera.depth_of(points_camera)
        u = np.where(seen, pixels[:, 0] + 0.5, 0).astype(np.int64).clip(0, self.camera.width - 1)
        v = np.where(seen, pixels[:, 1] + 0.5, 0).astype(np.int64).clip(0, self.camera.height - 1)
        return u, v, depth, seen & (depth > 0)


def neighbourhood_px(image_width: int) -> int:
    """How far a pixel's neighbourhood goes on every side: 2 pixels at a width of 640."""
    return max(1, round(image_width / 320))


def depth_view(keyframe: Keyframe, max_depth_m: float) -> DepthView:
    """Prepare a keyframe's depth; the neighbourhood is 5 pixels at a width of 640 and grows with the image."""
    reach = neighbourhood_px(keyframe.camera.width)
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    depth = np.where((keyframe.depth_m > 0) & (keyframe.depth_m <= max_depth_m), keyframe.depth_m, np.float32(0))
    nearest = cv2.erode(np.where(depth > 0, depth, np.float32(np.inf)), kernel, borderType=cv2.BORDER_REPLICATE)
    farthest = cv2.dilate(depth, kernel)
    return DepthView(
        keyframe.camera,
        keyframe.T_map_camera,
        depth,
        np.asarray(nearest, np.float32),
        np.asarray(farthest, np.float32),
        max_depth_m,
    )
