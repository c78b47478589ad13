"""A plan of two rooms and a corridor with some obstacles, for tests of motion."""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.building_plan import BuildingPlan, Doorway, Room


def box(x: float, y: float, width: float, depth: float, height: float, yaw: float = 0.0, z: float = 0.0) -> Box3D:
    """An upright box whose foot's centre is (x, y, z)."""
    return Box3D(np.array([x, y, z + height / 2]), np.array([width, depth, height]), yaw)


def two_rooms() -> BuildingPlan:
    """Rooms `left` and `right` (4 x 4 m) above a corridor (8.2 x 1.6 m), doorways 0.9 m wide in walls of 0.2 m."""
    rooms = (
        Room("corridor", np.array([0.0, 0.0]), np.array([8.2, 1.6])),
        Room("left", np.array([0.0, 1.8]), np.array([4.0, 5.8])),
        Room("right", np.array([4.2, 1.8]), np.array([8.2, 5.8])),
    )
    up = np.array([0.0, 1.0])
    doorways = (
        Doorway("corridor", "left", np.array([2.0, 1.7]), up, 0.9),
        Doorway("corridor", "right", np.array([6.2, 1.7]), up, 0.9),
    )
    return BuildingPlan(rooms, doorways, 2.6)


def furniture() -> list[Box3D]:
    """A table in the middle and a shelf at the wall of both rooms."""
    return [
        box(2.0, 3.9, 1.0, 0.7, 0.74, yaw=0.3),
        box(0.2, 4.8, 0.35, 1.2, 1.9),
        box(6.2, 3.9, 1.0, 0.7, 0.74),
        box(8.0, 4.8, 0.35, 1.2, 1.9),
    ]
