"""Where nothing stands: before doorways and windows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.simulation.building_plan import BuildingPlan, Doorway, Room
from supermap_cli.simulation.world import Fixture
from supermap_cli.simulation.worlds.pieces import Solids

_DOOR_DEPTH_M = 0.95
"""Depth of the zone kept free before a doorway, m: a leaf's width."""
_WINDOW_DEPTH_M = 0.25
"""Depth of the zone kept free before a window, m."""


def step_inside(doorway: Doorway, room: Room) -> FloatArray:
    """A point (2,) just within a room, before its doorway."""
    inwards = -doorway.through if room.name == doorway.first else doorway.through
    return doorway.center + 0.65 * inwards


def door_zones(plan: BuildingPlan) -> Iterator[Solids]:
    """Where nothing stands or hangs: the way through every doorway."""
    for doorway in plan.doorways:
        along = np.abs(doorway.through)
        size = 2 * _DOOR_DEPTH_M * along + (doorway.width_m + 0.1) * (1 - along)
        yield Solids(np.array([[*doorway.center, 1.1]]), np.array([[*size, 2.2]]))


def window_zones(fixtures: Sequence[Fixture]) -> Iterator[Solids]:
    """Where nothing hangs or towers: before windows."""
    for fixture in fixtures:
        if fixture.label == "window":
            low, high = fixture.shape.bounds
            margin = np.array([_WINDOW_DEPTH_M, _WINDOW_DEPTH_M, 0.0])
            yield Solids(((low + high) / 2)[None], (high - low + 2 * margin)[None])
