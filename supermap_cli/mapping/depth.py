"""One keyframe's depth, prepared once for all the tests that are made against it.

Provides D(u) of the paper's eq. 7. Departs from it: a point is compared with the nearest and farthest depth around its
pixel, since neither poses nor the registration of colour and depth are exact, and sigma grows with the depth.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import inverse
from supermap_cli.mapping import below_lidar_fov, returns
from supermap_cli.mapping.below_lidar_fov import BelowLidarFovParameters, LowestReturns, lowest_returns
from supermap_cli.mapping.returns import Returns, ReturnsParameters, returns_on_image
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.parameters import TUNED, parameter

_NGUYEN = "Nguyen, Izadi, Lovell 2012, eq. 3, axial noise"


@dataclass(frozen=True)
class DepthParameters:
    """A depth camera's noise, the neighbourhood of a pixel, and what a depth edge is.

    Sigma is `sigma_m` + `sigma_per_m2` (z - `sigma_from_m`)^2.
    """

    sigma_m: float = parameter(0.0012, "m", "standard deviation of a near depth", _NGUYEN)
    sigma_per_m2: float = parameter(0.0019, "1/m", "growth of the deviation with the square of the depth", _NGUYEN)
    sigma_from_m: float = parameter(0.4, "m", "depth from which on the deviation grows", _NGUYEN)
    neighbourhood_px: float = parameter(
        2.0, "px", "half width of a pixel's neighbourhood, on an image 640 wide: misregistration and pose", TUNED
    )
    reference_width_px: float = parameter(640.0, "px", "width of the image that pixels are told for", "VGA", at_least=1)
    reference_focal_px: float = parameter(
        360.0, "px", "least focal length of that image, 83 degrees across", "cameras of robots", at_least=1
    )
    edge_sigmas: float = parameter(4.0, "1", "deviations that depths on one surface may differ by", TUNED)
    edge_slant: float = parameter(
        0.03, "1", "range of depth per depth in a neighbourhood on one surface: a slant of 75 degrees", "geometry"
    )
    edge_m: float = parameter(0.02, "m", "range of depth in any neighbourhood on one surface", TUNED)
    curvature_m: float = parameter(0.01, "m", "how far a curved surface bends within a neighbourhood", TUNED)


DEFAULT = DepthParameters()


def depth_sigma_m(depth_m: FloatArray | Float32Array, parameters: DepthParameters = DEFAULT) -> FloatArray:
    """Standard deviation of a structured-light depth at that depth (Nguyen, Izadi, Lovell 2012, eq. 3, axial noise)."""
    sigma: FloatArray = np.maximum(np.asarray(depth_m, np.float64) - parameters.sigma_from_m, 0.0)
    sigma *= sigma
    sigma *= parameters.sigma_per_m2
    sigma += parameters.sigma_m
    return sigma


def edge_step_m(
    depth_m: Float32Array | FloatArray, parameters: DepthParameters = DEFAULT, sigma_m: FloatArray | None = None
) -> FloatArray:
    """The range of depths (n,) within a pixel's neighbourhood above which the pixel lies on a depth edge: noise, of
    which `sigma_m` (n,) may be known, and slant.
    """
    step = parameters.edge_sigmas * (depth_sigma_m(depth_m, parameters) if sigma_m is None else sigma_m)
    step += parameters.edge_slant * np.asarray(depth_m, np.float64)
    step += parameters.edge_m
    return step


def plane_residual_limit_m(depth_m: Float32Array | FloatArray, parameters: DepthParameters = DEFAULT) -> FloatArray:
    """The distance (n,) from the plane through its neighbours above which a pixel lies on a depth edge: noise and
    curvature.
    """
    return parameters.edge_sigmas * depth_sigma_m(depth_m, parameters) + parameters.curvature_m


@dataclass(frozen=True)
class DepthView:
    """Depth with the nearest and farthest return around every pixel, (h, w) float32 each.

    A pixel's neighbourhood spans what colour and depth may be out of register by, and the pose's own error; so a point
    is compared with an interval, which is wide at depth edges and on slanted surfaces and narrow on plain ones.
    `nearest_m` is +inf and `farthest_m` 0 where nothing returned. `far` (h, w) are the pixels whose return came from
    beyond `max_depth_m`: it is too inexact to map, but the ray passed through all that is nearer. Of a LiDAR, `returns`
    are the single ones, and `lowest` says down to where it saw; both are `None` of a depth camera. `floor_z` is the
    floor's height, if known.
    """

    camera: Camera
    T_map_camera: FloatArray
    depth_m: Float32Array
    nearest_m: Float32Array
    farthest_m: Float32Array
    max_depth_m: float
    far: BoolArray
    returns: Returns | None = None
    lowest: LowestReturns | None = None
    floor_z: float | None = None
    parameters: DepthParameters = DEFAULT

    def sigma_m(self, depth_m: FloatArray | Float32Array) -> FloatArray:
        """Standard deviation of the sensor's depth (n,) at depths (n,)."""
        if self.returns is None:
            return depth_sigma_m(depth_m, self.parameters)
        return np.full(np.shape(depth_m), self.returns.parameters.range_sigma_m)

    @property
    def reach_px(self) -> int:
        """How far a pixel's neighbourhood goes on every side."""
        return neighbourhood_px(self.camera, self.parameters)

    @cached_property
    def spacing_px(self) -> float:
        """How far a LiDAR's returns lie apart on the image; a pixel for a depth camera."""
        returns = 0 if self.returns is None else len(self.returns.u)
        return float(np.sqrt(np.count_nonzero(self.depth_m) / returns)) if returns else 1.0

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


def pixel_scale(camera: Camera, parameters: DepthParameters = DEFAULT) -> float:
    """Pixels per pixel of a usual image, 640 wide; by angle, if the image is more than 83 degrees across."""
    return min(camera.width / parameters.reference_width_px, camera.focal_px() / parameters.reference_focal_px)


def neighbourhood_px(camera: Camera, parameters: DepthParameters = DEFAULT) -> int:
    """How far a pixel's neighbourhood goes on every side: 2 pixels of a usual image."""
    return max(1, round(parameters.neighbourhood_px * pixel_scale(camera, parameters)))


def depth_view(
    keyframe: Keyframe,
    max_depth_m: float,
    floor_z: float | None = None,
    *,
    parameters: DepthParameters = DEFAULT,
    returns_parameters: ReturnsParameters = returns.DEFAULT,
    fov_parameters: BelowLidarFovParameters = below_lidar_fov.DEFAULT,
) -> DepthView:
    """Prepare a keyframe's depth; the neighbourhood is 5 pixels of a usual image, and reaches to a LiDAR's next return:
    a ray that went by beside a mug did not go through it.
    """
    camera, points_camera = keyframe.camera, keyframe.returns_camera
    reach = neighbourhood_px(camera, parameters)
    if points_camera is not None and len(points_camera):
        reach = max(reach, round(float(np.sqrt(np.count_nonzero(keyframe.depth_m) / len(points_camera)))))
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
        keyframe.depth_m > max_depth_m,
        None if points_camera is None else returns_on_image(camera, points_camera, max_depth_m, returns_parameters),
        None
        if points_camera is None
        else lowest_returns(keyframe.depth_m, camera, keyframe.T_map_camera, fov_parameters),
        floor_z,
        parameters,
    )
