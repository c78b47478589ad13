"""Where to stand before a thing, on grids made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.navigation.approach import Approach, NoApproach, Target, find_approach, gaps_to_box_m
from supermap_cli.navigation.grid import FREE, OCCUPIED, OccupancyGrid
from supermap_cli.navigation.ways import FreeFloor, Reachable

CELL_M, LEVELS = 0.1, 20


def walled_room() -> OccupancyGrid:
    """6 x 6 m, with a wall at x = 3 m from y = 0 to y = 5 m."""
    cells = np.full((60, 60), FREE, np.uint8)
    cells[30, :50] = OCCUPIED
    blocked = np.zeros((60, 60, LEVELS), bool)
    blocked[30, :50] = True
    return OccupancyGrid(cells, np.zeros(2), CELL_M, blocked, np.zeros((60, 60), bool), 0.1, 1.0, 1.0)


def board(seen_from_x: float) -> Target:
    """A picture on the wall at y = 2.5 m, seen from one side of it."""
    y, z = np.meshgrid(np.linspace(2.1, 2.9, 6), np.linspace(1.2, 1.8, 4))
    points = np.column_stack([np.full(y.size, 3.05), y.ravel(), z.ravel()])
    box = Box3D(np.array([3.05, 2.5, 1.5]), np.array([0.1, 0.8, 0.6]), 0.0)
    return Target(box, points, np.array([[seen_from_x, y, 1.0] for y in (1.0, 2.5, 4.0)]))


def reachable(grid: OccupancyGrid, radius_m: float = 0.2) -> Reachable:
    found = FreeFloor(grid, radius_m).from_place(np.array([1.0, 1.0]), 0.2)
    assert found is not None
    return found


@pytest.mark.parametrize("seen_from_x", [1.5, 4.5])
def test_a_picture_is_faced_from_the_side_that_it_was_seen_from(seen_from_x: float) -> None:
    found = find_approach(reachable(walled_room()), board(seen_from_x), 0.8)
    assert isinstance(found, Approach)
    assert (found.xy[0] < 3.0) == (seen_from_x < 3.0)
    assert found.gap_m == pytest.approx(0.8, abs=0.15)
    assert found.in_sight > 0.9


def test_a_side_that_is_not_reached_is_told() -> None:
    grid = walled_room()
    cells = grid.cells.copy()
    cells[30] = OCCUPIED  # no way around the wall
    closed = OccupancyGrid(cells, grid.origin_xy, CELL_M, grid.blocked, grid.driven, 0.1, 1.0, 1.0)
    found = find_approach(reachable(closed), board(4.5), 0.8)
    assert isinstance(found, NoApproach)
    assert found.nearest is not None
    assert found.nearest.xy[0] < 3.0


def test_gaps_are_those_to_the_outline() -> None:
    box = Box3D(np.array([1.0, 1.0, 0.5]), np.array([2.0, 1.0, 1.0]), np.pi / 2)
    points = np.array([[1.0, 1.0], [1.0, 2.5], [2.5, 1.0], [2.0, 3.0]])
    assert gaps_to_box_m(points, box) == pytest.approx([0, 0.5, 1.0, np.hypot(0.5, 1.0)])
