"""Axes of the robot: odometry, depth, clocks, camera, image rate, LiDAR."""

from __future__ import annotations

from supermap_cli.simulation.domains.domain import Axis

RIG_AXES: tuple[Axis, ...] = ()
