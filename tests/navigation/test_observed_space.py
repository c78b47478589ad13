"""The occupancy grid of a room that is known exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import QueryError
from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.navigation.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from supermap_cli.navigation.observed_space import occupancy_grid
from supermap_cli.types.memory import MapDelta
from support import driven_room, simulated
from support import memories as m


def heights_clear_m(grid: OccupancyGrid, cells: np.ndarray) -> np.ndarray:
    """(n,) the least distance from the column above each cell's centre to a surface that is no floor."""
    xy = grid.centers(cells)
    heights = np.arange(0.15, grid.robot_height_m, 0.1)
    columns = [np.column_stack([xy, np.full(len(xy), z)]) for z in heights]
    now_ns = simulated.CUP_LEAVES_NS + 1
    distances = [
        np.where(points[:, 2] < d + 1e-6, np.inf, d)  # the floor is as near as the point is high
        for points in columns
        for d in [simulated.distance_to_surfaces(driven_room.world(), points, now_ns)]
    ]
    return np.min(distances, axis=0)


def test_free_cells_are_free_in_the_true_world(grid: OccupancyGrid) -> None:
    free = np.argwhere(grid.cells == FREE)
    assert len(free) * grid.cell_m**2 > 10  # of 30 square metres
    clear_m = heights_clear_m(grid, free)
    assert (clear_m > grid.cell_m / 4).mean() > 0.99
    assert clear_m.min() >= 0


def test_occupied_cells_lie_at_surfaces(grid: OccupancyGrid) -> None:
    occupied = np.argwhere(grid.cells == OCCUPIED)
    near = heights_clear_m(grid, occupied) < 0.15
    assert near.mean() > 0.95


def test_what_nobody_saw_is_unknown(grid: OccupancyGrid) -> None:
    outside = np.array([[-3.6, 0.0], [3.6, 0.0], [0.0, 3.2]])
    cells = grid.indices(outside)
    inside = grid.inside(cells)
    assert (grid.cells[tuple(cells[inside].T)] == UNKNOWN).all()


def test_a_table_is_in_the_way_of_a_tall_robot_only(reader: MapReader, grid: OccupancyGrid) -> None:
    under_the_table = np.array([[0.0, 0.0]])
    low = occupancy_grid(reader, 0.4)
    assert low.cells[tuple(low.indices(under_the_table)[0])] != OCCUPIED
    assert grid.cells[tuple(grid.indices(under_the_table)[0])] == OCCUPIED


def test_the_areas_of_all_kinds_make_the_grid(grid: OccupancyGrid) -> None:
    assert sum(grid.counts().values()) == pytest.approx(grid.cells.size * grid.cell_m**2)


def test_a_map_without_a_keyframe_is_refused_with_the_cure(tmp_path: Path) -> None:
    m.make_memory(tmp_path / "empty.db", ("run", (0, 10), MapDelta()))
    with (
        open_store(str(tmp_path / "empty.db"), read_only=True) as store,
        store.reader() as empty,
        pytest.raises(QueryError, match=r"no keyframe.*supermap build"),
    ):
        occupancy_grid(empty)
