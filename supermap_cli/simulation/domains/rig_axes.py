"""Axes of the robot: LiDAR, camera, depth, clocks, image rate, odometry.

The LiDAR comes first, as it chooses the rig; every later axis acts on what it finds there, and leaves alone what is
not.
"""

from __future__ import annotations

from supermap_cli.simulation.domains.camera_axes import CAMERA, IMAGE_RATE
from supermap_cli.simulation.domains.depth_axes import DEPTH, SYNC
from supermap_cli.simulation.domains.domain import Axis
from supermap_cli.simulation.domains.lidar_axis import LIDAR
from supermap_cli.simulation.domains.odometry_axis import ODOMETRY

RIG_AXES: tuple[Axis, ...] = (LIDAR, CAMERA, DEPTH, SYNC, IMAGE_RATE, ODOMETRY)
