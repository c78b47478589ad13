"""One keyframe's depth, prepared once for all the tests that are made against it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import inverse
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
        T_camera_map = inverse(self.T_map_camera)
        points_camera = (T_camera_map[:3, :3] @ points_map.T + T_camera_map[:3, 3, None]).T
        pixels, seen = self.camera.project(points_camera)
        depth = self.camera.depth_of(points_camera)
        on_image: BoolArray = seen & (depth > 0)
        at = np.flatnonzero(on_image)
        u, v = np.zeros(len(depth), np.int64), np.zeros(len(depth), np.int64)
        u[at] = np.minimum(pixels[at, 0] + 0.5, self.camera.width - 1)
        v[at] = np.minimum(pixels[at, 1] + 0.5, self.camera.height - 1)
        return u, v, depth, on_image

    def may_show(self, centers_map: FloatArray, radii_m: FloatArray) -> BoolArray:
        """(n,) which of n spheres, (n, 3) centres and (n,) radii, may reach into what the camera sees; most do not."""
        rays = centers_map - self.T_map_camera[:3, 3]
        distances = np.linalg.norm(rays, axis=1)
        inside = distances <= radii_m
        far = np.where(inside, 1.0, distances)
        off_axis = np.arccos(np.clip(rays @ self.T_map_camera[:3, 2] / far, -1, 1))
        may: BoolArray = inside | (off_axis <= self.camera.widest_angle() + np.arcsin(np.clip(radii_m / far, 0, 1)))
        return may


def neighbourhood_px(image_width: int) -> int:
    """How far a pixel's neighbourhood goes on every side: 2 pixels at a width of 640."""
    return max(1, round(image_width / 320))


def depth_view(keyframe: Keyframe, max_depth_m: float) -> DepthView:
    """Prepare a keyframe's depth; the neighbourhood is 5 pixels at a width of 640 and grows with the image."""
    reach = neighbourhood_px(keyframe.camera.width)
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    _, within = cv2.threshold(keyframe.depth_m, max_depth_m, 0, cv2.THRESH_TOZERO_INV)
    depth = np.asarray(within, np.float32)
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
