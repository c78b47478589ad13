"""What a recording gives: camera frames, LiDAR sweeps, IMU samples, poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray, IntArray, UInt8Array, check_shape
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import check_transform


@dataclass(frozen=True)
class CameraFrame:
    """One colour image with the depth that belongs to it.

    `rgb` is (h, w, 3) uint8. `depth_m` is (h, w) float32 metres on the colour camera's own pixels, in the measure of
    `Camera.depth_of` (z for a pinhole, range for a panorama), 0 = no return; `None` where the rig has a LiDAR instead.
    `T_base_camera` places the optical frame (z forward) in the robot's base at the stamp. `returns_camera` (n, 3) are
    the LiDAR's returns that `depth_m` was drawn of, in the optical frame; `None` where the depth is a camera's own.
    """

    stamp_ns: int
    frame_id: str
    rgb: UInt8Array
    depth_m: Float32Array | None
    camera: Camera
    T_base_camera: FloatArray
    returns_camera: FloatArray | None = None

    def __post_init__(self) -> None:
        check_shape("rgb", self.rgb, (self.camera.height, self.camera.width, 3))
        if self.returns_camera is not None:
            check_shape("returns_camera", self.returns_camera, (None, 3))
        if self.depth_m is not None:
            check_shape("depth_m", self.depth_m, (self.camera.height, self.camera.width))
        check_transform("T_base_camera", self.T_base_camera)


@dataclass(frozen=True)
class Sweep:
    """One LiDAR scan, not yet deskewed.

    `points_lidar` is (n, 3) float64 metres in the LiDAR's frame, finite; `point_stamps_ns` is (n,) int64, each point's
    own time (all equal to `stamp_ns` where the sensor gives none); `T_base_lidar` is the mounting.
    """

    stamp_ns: int
    frame_id: str
    points_lidar: FloatArray
    point_stamps_ns: IntArray
    T_base_lidar: FloatArray

    def __post_init__(self) -> None:
        check_shape("points_lidar", self.points_lidar, (None, 3))
        check_shape("point_stamps_ns", self.point_stamps_ns, (len(self.points_lidar),))
        check_transform("T_base_lidar", self.T_base_lidar)
        if not np.isfinite(self.points_lidar).all():
            raise ValueError("points_lidar: holds NaN or infinity")


@dataclass(frozen=True)
class ImuSample:
    """Angular rate (rad/s) and specific force (m/s^2), both (3,) float64, in the robot's base frame."""

    stamp_ns: int
    angular_rate_base: FloatArray
    specific_force_base: FloatArray


@dataclass(frozen=True)
class StampedPose:
    """`T_odom_base` (4, 4) float64 at a sensor time."""

    stamp_ns: int
    T_odom_base: FloatArray

    def __post_init__(self) -> None:
        check_transform("T_odom_base", self.T_odom_base)
