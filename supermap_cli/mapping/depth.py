"""One keyframe's depth, prepared once for all the tests that are made against it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import inverse
from supermap_cli.mapping.beneath import LowestReturns, lowest_returns
from supermap_cli.mapping.returns import LIDAR_SIGMA_M, Returns, returns_on_image
from supermap_cli.types.keyframe import Keyframe

_NEIGHBOURHOOD_PX, _USUAL_WIDTH_PX, _LEAST_FOCAL_PX = 2, 640, 360


def depth_sigma_m(depth_m: FloatArray | Float32Array) -> FloatArray:
    """Standard deviation of a structured-light depth at that depth (Nguyen, Izadi, Lovell 2012, eq. 3, axial noise)."""
    sigma: FloatArray = 0.0012 + 0.0019 * np.square(np.maximum(np.asarray(depth_m, np.float64), 0.4) - 0.4)
    return sigma


@dataclass(frozen=True)
class DepthView:
    """Depth with the nearest and farthest return around every pixel, (h, w) float32 each.

    A pixel's neighbourhood spans what colour and depth may be out of register by, and the pose's own error; so a point
    is compared with an interval, which is wide at depth edges and on slanted surfaces and narrow on plain ones.
    `nearest_m` is +inf and `farthest_m` 0 where nothing returned. Of a LiDAR, `returns` are the single ones, and
    `lowest` says down to where it saw; both are `None` of a depth camera. `floor_z` is the floor's height, if known.
    """

    camera: Camera
    T_map_camera: FloatArray
    depth_m: Float32Array
    nearest_m: Float32Array
    farthest_m: Float32Array
    max_depth_m: float
    returns: Returns | None = None
    lowest: LowestReturns | None = None
    floor_z: float | None = None

    def sigma_m(self, depth_m: FloatArray | Float32Array) -> FloatArray:
        """Standard deviation of the sensor's depth (n,) at depths (n,)."""
        if self.returns is None:
            return depth_sigma_m(depth_m)
        return np.full(np.shape(depth_m), LIDAR_SIGMA_M)

    @property
    def reach_px(self) -> int:
        """How far a pixel's neighbourhood goes on every side."""
        return neighbourhood_px(self.camera)

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


def pixel_scale(camera: Camera) -> float:
    """Pixels per pixel of a usual image, 640 wide; by angle, if the image is more than 83 degrees across."""
    return min(camera.width / _USUAL_WIDTH_PX, camera.focal_px() / _LEAST_FOCAL_PX)


def neighbourhood_px(camera: Camera) -> int:
    """How far a pixel's neighbourhood goes on every side: 2 pixels of a usual image."""
    return max(1, round(_NEIGHBOURHOOD_PX * pixel_scale(camera)))


def depth_view(keyframe: Keyframe, max_depth_m: float, floor_z: float | None = None) -> DepthView:
    """Prepare a keyframe's depth; the neighbourhood is 5 pixels of a usual image, and reaches to a LiDAR's next return:
    a ray that went by beside a mug did not go through it.
    """
    camera, returns = keyframe.camera, keyframe.returns_camera
    reach = neighbourhood_px(camera)
    if returns is not None and len(returns):
        reach = max(reach, round(float(np.sqrt(np.count_nonzero(keyframe.depth_m) / len(returns)))))
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
        None if returns is None else returns_on_image(camera, returns, max_depth_m),
        None if returns is None else lowest_returns(keyframe.depth_m, camera, keyframe.T_map_camera),
        floor_z,
    )
