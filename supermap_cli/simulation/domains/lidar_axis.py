"""Which LiDAR the robot has; one with a LiDAR has a panoramic camera above it."""

from __future__ import annotations

from dataclasses import replace

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.simulation.domains.domain import Axis, Level, usual_level
from supermap_cli.simulation.domains.rig_levels import rig_level
from supermap_cli.simulation.rigs import Lidar, SimulatedRig, panorama_rig

_PANORAMA = EquirectangularCamera(960, 480)  # 0.375 degrees a pixel: quicker to simulate than the 1440 of the rig
_AZIMUTHS = 1024  # a turn, 0.35 degrees: what OS1 offers at 10 Hz; VLP-16 takes 1800

VLP_16 = Lidar(
    points_per_scan=16 * _AZIMUTHS,
    rings=16,
    lowest_deg=-15.0,
    highest_deg=15.0,
    noise_m=0.015,
    nearest_m=0.4,
    farthest_m=100.0,
)
"""Data sheet: 16 beams from -15 to 15 degrees, 100 m, typically within 3 cm (taken as two standard deviations)."""

HDL_32 = Lidar(
    points_per_scan=32 * _AZIMUTHS,
    rings=32,
    lowest_deg=-30.67,
    highest_deg=10.67,
    noise_m=0.01,
    nearest_m=0.4,
    farthest_m=100.0,
)
"""Data sheet of HDL-32E: 32 beams from -30.67 to 10.67 degrees, 100 m, typically within 2 cm."""

OS1_64 = Lidar(
    points_per_scan=64 * _AZIMUTHS,
    rings=64,
    lowest_deg=-22.5,
    highest_deg=22.5,
    noise_m=0.01,
    nearest_m=0.5,
    farthest_m=100.0,
)
"""Data sheet: 64 beams from -22.5 to 22.5 degrees, from 0.5 m on, 0.7 to 5 cm (one standard deviation)."""

OS1_128 = replace(OS1_64, points_per_scan=128 * _AZIMUTHS, rings=128)
"""As `OS1_64` with twice the beams."""


def _rig(lidar: Lidar) -> SimulatedRig:
    rig = panorama_rig()
    return replace(rig, lidar=lidar, cameras=tuple(replace(camera, model=_PANORAMA) for camera in rig.cameras))


def _level(text: str, lidar: Lidar, lidar_m: float | None = None) -> Level:
    """The panorama rig with this LiDAR, with its sensors raised or lowered so that the LiDAR is at a height."""

    def change(_: SimulatedRig) -> SimulatedRig:
        rig = _rig(lidar)
        if lidar_m is None or rig.T_base_lidar is None:
            return rig
        up_m = lidar_m - float(rig.T_base_lidar[2, 3])
        cameras = tuple(replace(camera, T_base_camera=_raised(camera.T_base_camera, up_m)) for camera in rig.cameras)
        T_base_imu, T_base_lidar = _raised(rig.T_base_imu, up_m), _raised(rig.T_base_lidar, up_m)
        return replace(rig, cameras=cameras, T_base_imu=T_base_imu, T_base_lidar=T_base_lidar)

    return rig_level(text, change)


def _raised(T: FloatArray, up_m: float) -> FloatArray:
    raised = T.copy()
    raised[2, 3] += up_m
    return raised


LIDAR = Axis(
    "lidar",
    "the LiDAR, under a panoramic camera of 960 x 480 pixels",
    "usual",
    {
        "usual": usual_level("the rig's own: none beside an RGB-D camera"),
        "livox": _level("Livox Mid-360, 0.75 m up", Lidar()),
        "beams-16": _level("16 rings from -15 to 15 degrees (VLP-16)", VLP_16),
        "beams-32": _level("32 rings from -31 to 11 degrees (HDL-32E)", HDL_32),
        "beams-64": _level("64 rings from -22.5 to 22.5 degrees (OS1-64)", OS1_64),
        "beams-128": _level("128 rings from -22.5 to 22.5 degrees", OS1_128),
        "low": _level("Livox Mid-360, 0.3 m up, the camera 0.2 m above it", Lidar(), 0.3),
        "high": _level("Livox Mid-360, 1.5 m up, the camera 0.2 m above it", Lidar(), 1.5),
        "blind": _level("Livox Mid-360 that returns nothing nearer than 0.7 m", Lidar(nearest_m=0.7)),
    },
)
