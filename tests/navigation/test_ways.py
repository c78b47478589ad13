"""Ways on random grids against a search written another way."""

from __future__ import annotations

import heapq
import math
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.navigation.grid import FREE, OCCUPIED, OccupancyGrid
from supermap_cli.navigation.ways import FreeFloor

CELL_M = 0.1


def grid_of(free: np.ndarray) -> OccupancyGrid:
    cells = np.where(free, FREE, OCCUPIED).astype(np.uint8)
    nothing = np.zeros((*free.shape, 1), bool)
    return OccupancyGrid(cells, np.zeros(2), CELL_M, nothing, nothing[..., 0], 0.1, 1.0, 1.0)


def costs_by_heap(floor: FreeFloor, start: tuple[int, int]) -> dict[tuple[int, int], float]:
    """Dijkstra by a heap over the same costs."""
    spare = np.clip(floor.grid.clearance_m - floor.needed_m, 0, floor.parameters.comfort_m)
    dear = 1 + floor.parameters.comfort_cost * (1 - spare / floor.parameters.comfort_m)
    done: dict[tuple[int, int], float] = {}
    heap = [(0.0, start)]
    while heap:
        cost, cell = heapq.heappop(heap)
        if cell in done:
            continue
        done[cell] = cost
        for di in (-1, 0, 1):
            for dj in (-1, 0, 1):
                i, j = cell[0] + di, cell[1] + dj
                inside = 0 <= i < dear.shape[0] and 0 <= j < dear.shape[1]
                if (di or dj) and inside and floor.standable[i, j] and (i, j) not in done:
                    heapq.heappush(heap, (cost + math.hypot(di, dj) * CELL_M * (dear[cell] + dear[i, j]) / 2, (i, j)))
    return done


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.floats(0.02, 0.12), st.sampled_from([0.01, 0.05, 0.12]))
def test_ways_are_the_cheapest_and_keep_their_clearance(seed: int, blocked: float, radius_m: float) -> None:
    rng = np.random.default_rng(seed)
    floor = FreeFloor(grid_of(rng.random((24, 20)) > blocked), radius_m)
    if not len(floor.cells):
        return
    start = floor.cells[rng.integers(len(floor.cells))]
    reachable = floor.from_place(floor.grid.centers(start), 0.01)
    assert reachable is not None
    expected = costs_by_heap(floor, (int(start[0]), int(start[1])))
    found = {tuple(cell): cost for cell, cost in zip(floor.cells.tolist(), reachable.cost_m, strict=True)}
    assert {cell for cell, cost in found.items() if np.isfinite(cost)} == expected.keys()
    assert all(abs(found[cell] - cost) < 1e-9 for cell, cost in expected.items())
    end = max(expected, key=lambda cell: expected[cell])
    way = reachable.way_to(floor.cells.tolist().index(list(end)))
    assert np.allclose(way.points_xy[[0, -1]], floor.grid.centers(np.array([start, end])))
    for before, after in pairwise(way.points_xy):
        step = np.abs(after - before)
        assert floor.is_clear(before, after) or step.max() <= CELL_M + 1e-9


def test_a_place_that_is_walled_off_is_not_reached() -> None:
    free = np.ones((20, 20), bool)
    free[10] = False
    floor = FreeFloor(grid_of(free), 0.01)
    reachable = floor.from_place(np.array([0.5, 0.5]), 0.5)
    assert reachable is not None
    beyond = floor.nearest(np.array([1.7, 0.5]), 0.5)
    assert beyond is not None
    assert np.isinf(reachable.cost_m[beyond])


def test_where_the_robot_has_driven_it_may_drive_though_no_camera_saw_the_floor() -> None:
    unseen = np.zeros((20, 20), np.uint8)
    driven = np.zeros((20, 20), bool)
    driven[5:15, 10] = True
    nothing = np.zeros((20, 20, 1), bool)
    grid = OccupancyGrid(unseen, np.zeros(2), CELL_M, nothing, driven, 0.1, 1.0, 1.0)
    assert FreeFloor(grid, 0.2).standable.sum() == 10
    blocked = unseen.copy()
    blocked[14, 11] = OCCUPIED  # something has come since
    standable = FreeFloor(OccupancyGrid(blocked, np.zeros(2), CELL_M, nothing, driven, 0.1, 1.0, 1.0), 0.2).standable
    assert not standable[14, 10]
    assert standable[5, 10]
