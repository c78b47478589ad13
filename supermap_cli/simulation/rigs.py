"""The two robots: what sensors they carry, where, and how good these are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import EquirectangularCamera, PinholeCamera
from supermap_cli.geometry.se3 import make_transform

RigName = Literal["rgbd", "panorama"]


@dataclass(frozen=True)
class DepthSensor:
    """A depth camera on the colour camera's pixels.

    Noise grows with the square of the depth, sigma = `noise_per_m` z^2 (structured light and stereo; Khoshelham and
    Elberink 2012 give 1.4 to 2.9 mm at 1 m for Kinect v1); nothing is returned nearer than `nearest_m`, farther than
    `farthest_m`, where the surface is more slanted than `steepest_deg`, or, mostly, beside depth edges.
    """

    noise_per_m: float = 0.0015
    nearest_m: float = 0.3
    farthest_m: float = 8.0
    steepest_deg: float = 82.0
    edge_px: int = 1
    lost_share: float = 0.005


@dataclass(frozen=True)
class Lidar:
    """A Livox-Mid-360-like LiDAR: a pattern that does not repeat, 360 degrees round, -7 to 52 degrees up."""

    points_per_scan: int = 20_000
    rate_hz: float = 10.0
    lowest_deg: float = -7.0
    highest_deg: float = 52.0
    noise_m: float = 0.02
    nearest_m: float = 0.1
    farthest_m: float = 40.0


@dataclass(frozen=True)
class Imu:
    """Gravity and motion in the base frame with white noise (per sample) and constant biases (drawn once)."""

    rate_hz: float = 100.0
    gyro_noise: float = 0.002
    gyro_bias: float = 0.002
    accelerometer_noise: float = 0.02
    accelerometer_bias: float = 0.03


@dataclass(frozen=True)
class OdometryDrift:
    """How the robot's own odometry leaves the truth: a scale error and random walks over the way it went.

    `position` metres and `yaw_deg` degrees are the standard deviations of the walks after one metre; `per_turn_deg`
    is that of the heading after one full turn; `scale` that of the constant scale error; `jitter_m` is white noise.
    """

    rate_hz: float = 20.0
    position: float = 0.006
    yaw_deg: float = 0.08
    per_turn_deg: float = 0.25
    scale: float = 0.002
    jitter_m: float = 0.001


@dataclass(frozen=True)
class Rig:
    """A robot. `T_base_*` place the sensors in the base (x forward, z up, origin on the floor)."""

    name: RigName
    camera: PinholeCamera | EquirectangularCamera
    T_base_camera: FloatArray
    image_rate_hz: float
    detection_every: int
    depth: DepthSensor | None
    lidar: Lidar | None
    T_base_lidar: FloatArray | None
    imu: Imu
    T_base_imu: FloatArray
    drift: OdometryDrift


def rgbd_rig() -> Rig:
    """A 640x480 RGB-D camera (69 degrees wide), 1.1 m up, tilted down by 12 degrees; detections at 5 Hz."""
    sin, cos = np.sin(np.radians(12)), np.cos(np.radians(12))
    T_base_camera = make_transform([[0, -sin, cos], [-1, 0, 0], [0, -cos, -sin]], [0.12, 0.0, 1.1])
    return Rig(
        name="rgbd",
        camera=PinholeCamera(640, 480, 465.0, 465.0, 319.5, 239.5),
        T_base_camera=T_base_camera,
        image_rate_hz=10.0,
        detection_every=2,
        depth=DepthSensor(),
        lidar=None,
        T_base_lidar=None,
        imu=Imu(),
        T_base_imu=make_transform(np.eye(3), [0.0, 0.0, 0.3]),
        drift=OdometryDrift(),
    )


def panorama_rig() -> Rig:
    """The paper's rig: a 360-degree panorama above a Livox Mid-360, on a small robot; detections at 5 Hz."""
    return Rig(
        name="panorama",
        camera=EquirectangularCamera(1440, 720),
        T_base_camera=make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0.0, 0.0, 0.95]),
        image_rate_hz=5.0,
        detection_every=1,
        depth=None,
        lidar=Lidar(),
        T_base_lidar=make_transform(np.eye(3), [0.08, 0.0, 0.75]),
        imu=Imu(),
        T_base_imu=make_transform(np.eye(3), [0.08, 0.0, 0.75]),
        drift=OdometryDrift(),
    )
