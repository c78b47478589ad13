"""Where a camera sits, how wide it sees, who carries it, and how often it takes an image."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.simulation.domains.domain import Axis, Level, usual_level
from supermap_cli.simulation.domains.rig_levels import rig_level
from supermap_cli.simulation.rigs import SimulatedCamera, SimulatedRig

_CARRIED_M = 1.4  # m, before the chest of a standing adult
_CARRIED_DOWN_DEG = 10.0  # degrees that one tilts a camera to see the furniture
_LIDAR_BELOW_M = 0.2  # m from a panoramic camera down to the LiDAR, as on the usual rig
_DETECTOR_HZ = 5.0  # Hz, of a detector that cannot keep up with the images


def _mounted(camera: SimulatedCamera, height_m: float, down_deg: float) -> SimulatedCamera:
    """The camera at a height above the floor, tilted down where it looks; a panoramic one stays upright."""
    T = camera.T_base_camera.copy()
    if isinstance(camera.model, PinholeCamera):
        T = _looking(np.arctan2(T[1, 2], T[0, 2]), np.radians(down_deg), T[:3, 3])
    T[2, 3] = height_m
    return replace(camera, T_base_camera=T)


def _looking(yaw: float, down: float, at: FloatArray) -> FloatArray:
    """An optical frame (4, 4) at a place (3,) of the base, turned to the left and tilted down by angles in radians."""
    forward = np.array([np.cos(yaw) * np.cos(down), np.sin(yaw) * np.cos(down), -np.sin(down)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    return make_transform(np.column_stack([right, np.cross(forward, right), forward]), at)


def _as_wide_as(camera: SimulatedCamera, width_deg: float) -> SimulatedCamera:
    """The camera with another lens before its pixels; a panoramic one as it is."""
    if not isinstance(camera.model, PinholeCamera):
        return camera
    focal_px = camera.model.width / 2 / np.tan(np.radians(width_deg) / 2)
    return replace(camera, model=replace(camera.model, fx=float(focal_px), fy=float(focal_px)))


def _cameras(text: str, change: Callable[[SimulatedCamera], SimulatedCamera]) -> Level:
    return rig_level(text, lambda rig: replace(rig, cameras=tuple(map(change, rig.cameras))))


def _carried(rig: SimulatedRig) -> SimulatedRig:
    cameras = tuple(_mounted(camera, _CARRIED_M, _CARRIED_DOWN_DEG) for camera in rig.cameras)
    T_base_lidar = rig.T_base_lidar
    if T_base_lidar is not None:
        T_base_lidar = T_base_lidar.copy()
        T_base_lidar[2, 3] = _CARRIED_M - _LIDAR_BELOW_M
    return replace(rig, cameras=cameras, T_base_lidar=T_base_lidar, imu=None, carried_m=_CARRIED_M)


def _rate(rate_hz: float, detected_hz: float, text: str) -> Level:
    every = round(rate_hz / detected_hz)
    return rig_level(text, lambda rig: replace(rig, image_rate_hz=rate_hz, detection_every=every))


CAMERA = Axis(
    "camera",
    "where the cameras sit, and how wide they see",
    "usual",
    {
        "usual": usual_level("1.1 m up, tilted down by 12 degrees, 69 degrees wide"),
        "low": _cameras("0.35 m up, level, as on vacuum cleaners", lambda camera: _mounted(camera, 0.35, 0.0)),
        "high": _cameras("1.6 m up, tilted down by 35 degrees", lambda camera: _mounted(camera, 1.6, 35.0)),
        "up": _cameras(
            "0.6 m up, tilted up by 20 degrees, as on small robots", lambda camera: _mounted(camera, 0.6, -20.0)
        ),
        "narrow": _cameras("55 degrees wide", lambda camera: _as_wide_as(camera, 55.0)),
        "wide": _cameras("110 degrees wide", lambda camera: _as_wide_as(camera, 110.0)),
        "hand-held": rig_level("carried 1.4 m up by a person who walks: it sways; no IMU", _carried),
    },
)
"""Widths are those across the image: 55 degrees has a phone's main camera (26 mm) that is held upright, 110 lies
between RealSense D455 (90) and Azure Kinect's wide mode (120). A panoramic camera takes the heights alone.
"""

IMAGE_RATE = Axis(
    "image-rate",
    "images and detections a second",
    "usual",
    {
        "1hz": _rate(1.0, 1.0, "1 image a second, detected"),
        "2hz": _rate(2.0, 2.0, "2 images a second, detected"),
        "usual": usual_level("the rig's own: of the scenario room 5 images a second, detected"),
        "15hz": _rate(15.0, _DETECTOR_HZ, "15 images a second, every third detected"),
        "15hz-all": _rate(15.0, 15.0, "15 images a second, all detected"),
        "30hz": _rate(30.0, _DETECTOR_HZ, "30 images a second, every sixth detected"),
    },
)
