"""Sensor messages: camera frames, LiDAR sweeps, IMU samples, poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray, IntArray, UInt8Array, check_shape
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import check_transform

MAIN_CAMERA = "camera"
"""The `camera_id` of a rig's only camera."""


@dataclass(frozen=True)
class CameraFrame:
    """One colour image with the depth that belongs to it.

    `rgb` is (h, w, 3) uint8. `depth_m` is (h, w) float32 metres on the colour camera's own pixels, in the measure of
    `Camera.depth_of` (z for a pinhole, range for a panorama), 0 = no return; `None` where the rig has a LiDAR instead.
    `T_base_camera` places the optical frame (z forward) in the robot's base at the stamp. `returns_camera` (n, 3) are
    the LiDAR's returns that `depth_m` was rendered from, in the optical frame; `None` where the depth is a camera's
    own. `camera_id` names the camera among those of the rig. `depth_stamp_ns` is when the depth was taken, with the
    camera where it stood then; `None`: at the same moment.
    """

    stamp_ns: int
    frame_id: str
    rgb: UInt8Array
    depth_m: Float32Array | None
    camera: Camera
    T_base_camera: FloatArray
    returns_camera: FloatArray | None = None
    camera_id: str = MAIN_CAMERA
    depth_stamp_ns: int | None = None

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
    """Angular rate (rad/s) and specific force (m/s^2), (3,) float64 in the IMU's frame; `T_base_imu` (4, 4) is the
    mounting, with its lever arm.
    """

    stamp_ns: int
    angular_rate_imu: FloatArray
    specific_force_imu: FloatArray
    T_base_imu: FloatArray

    def __post_init__(self) -> None:
        check_shape("angular_rate_imu", self.angular_rate_imu, (3,))
        check_shape("specific_force_imu", self.specific_force_imu, (3,))
        check_transform("T_base_imu", self.T_base_imu)

    @property
    def angular_rate_base(self) -> FloatArray:
        """(3,) rad/s about the base's axes."""
        return np.asarray(self.T_base_imu[:3, :3] @ self.angular_rate_imu, np.float64)

    @property
    def specific_force_base(self) -> FloatArray:
        """(3,) m/s^2 along the base's axes, as felt where the IMU sits."""
        return np.asarray(self.T_base_imu[:3, :3] @ self.specific_force_imu, np.float64)


@dataclass(frozen=True)
class StampedPose:
    """`T_odom_base` (4, 4) float64 at a sensor time, with its covariance (6, 6) where it is known: x, y, z in metres,
    rotations about these axes in radians, as in ROS's `geometry_msgs/PoseWithCovariance`.
    """

    stamp_ns: int
    T_odom_base: FloatArray
    covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        check_transform("T_odom_base", self.T_odom_base)
        if self.covariance is not None:
            check_shape("covariance", self.covariance, (6, 6))
