"""Shortest ways over the free floor: Dijkstra over cells with clearance as cost, then drawn tight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.navigation.grid import OccupancyGrid
from supermap_cli.navigation.parameters import DEFAULT, NavigationParameters

_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Half of the eight neighbours of a cell; the graph is undirected."""
_NONE = -9999
"""What scipy gives as the predecessor of a node that has none."""


@dataclass(frozen=True)
class Way:
    """Points (n, 2) in the map, metres, from the start to the end; `cost_m` counts metres near obstacles as more."""

    points_xy: FloatArray
    cost_m: float

    @property
    def length_m(self) -> float:
        """Metres along the points."""
        return float(np.linalg.norm(np.diff(self.points_xy, axis=0), axis=1).sum())


class FreeFloor:
    """Where the centre of a robot of a radius may be, and the ways between such places."""

    def __init__(self, grid: OccupancyGrid, radius_m: float, parameters: NavigationParameters = DEFAULT) -> None:
        self.grid = grid
        self.radius_m = radius_m
        self.parameters = parameters
        self.needed_m = radius_m + parameters.margin_m

    @cached_property
    def standable(self) -> BoolArray:
        """(nx, ny) whether a robot may stand with its centre in a cell: all around is free, or it has stood there
        before (no camera sees the floor beneath itself) and nothing has come since.
        """
        grid = self.grid
        may: BoolArray = grid.clearance_m >= self.needed_m
        return may | (grid.driven & (grid.from_occupied_m >= self.radius_m))

    @cached_property
    def cells(self) -> IntArray:
        """(n, 2) the cells where a robot may stand."""
        return np.argwhere(self.standable)

    def nearest(self, xy: FloatArray, within_m: float) -> int | None:
        """The node of the standable cell nearest to a point; `None` if there is none within so many metres."""
        if not len(self.cells):
            return None
        distances = np.linalg.norm(self.grid.centers(self.cells) - xy, axis=1)
        node = int(distances.argmin())
        return node if distances[node] <= within_m else None

    def from_place(self, xy: FloatArray, within_m: float) -> Reachable | None:
        """The ways from a place to everywhere; `None` where no robot may stand within so many metres of it."""
        start = self.nearest(xy, within_m)
        if start is None:
            return None
        cost_m, before = dijkstra(self._graph, directed=False, indices=start, return_predecessors=True)
        return Reachable(self, np.asarray(xy, np.float64), cost_m, before)

    @cached_property
    def _graph(self) -> csr_matrix:
        """Cells as nodes, steps to neighbours as edges: metres, more where clearance is little."""
        standable, parameters = self.standable, self.parameters
        node = np.full(standable.shape, -1)
        node[standable] = np.arange(len(self.cells))
        spare_m = np.clip(self.grid.clearance_m - self.needed_m, 0, parameters.comfort_m)
        dearness = 1 + parameters.comfort_cost * (1 - spare_m / parameters.comfort_m)
        starts, ends, costs = [], [], []
        for di, dj in _STEPS:
            a = _shifted(node, -di, -dj)
            joined = (a >= 0) & (node >= 0)
            step_m = math.hypot(di, dj) * self.grid.cell_m
            starts.append(node[joined])
            ends.append(a[joined])
            costs.append(step_m * (dearness + _shifted(dearness, -di, -dj))[joined] / 2)
        n = len(self.cells)
        parts = (np.concatenate(costs), (np.concatenate(starts), np.concatenate(ends)))
        return csr_matrix(parts, shape=(n, n))

    def is_clear(self, start_xy: FloatArray, end_xy: FloatArray) -> bool:
        """Whether a robot may drive straight from one point to another."""
        steps = max(2, math.ceil(2 * float(np.linalg.norm(end_xy - start_xy)) / self.grid.cell_m) + 1)
        points = start_xy + np.linspace(0, 1, steps)[:, None] * (end_xy - start_xy)
        cells = self.grid.indices(points)
        return bool(self.standable[cells[:, 0], cells[:, 1]].all())


@dataclass(frozen=True)
class Reachable:
    """What can be reached from a place `from_xy`: `cost_m` (n,) of the floor's standable cells, infinite where not."""

    floor: FreeFloor
    from_xy: FloatArray
    cost_m: FloatArray
    before: IntArray

    def way_to(self, node: int) -> Way:
        """The way to a node that can be reached. Begins at the first place where the robot may stand."""
        nodes = [node]
        while (previous := int(self.before[nodes[-1]])) != _NONE:
            nodes.append(previous)
        points = self.floor.grid.centers(self.floor.cells[nodes[::-1]])
        return Way(_tightened(self.floor, points), float(self.cost_m[node]))


def _tightened(floor: FreeFloor, points: FloatArray) -> FloatArray:
    """The way with straight parts where these are as clear as its cells: corners only, at most 1 m apart."""
    kept, at = [0], 0
    reach = math.ceil(1.0 / floor.grid.cell_m)
    while at < len(points) - 1:
        at = next(
            further
            for further in range(min(at + reach, len(points) - 1), at, -1)
            if further == at + 1 or floor.is_clear(points[at], points[further])
        )
        kept.append(at)
    return points[kept]


def _shifted(values: FloatArray | IntArray, di: int, dj: int) -> FloatArray:
    """Each cell's value from the neighbour at (-di, -dj); -1 outside."""
    shifted = np.full(values.shape, -1.0)
    nx, ny = values.shape
    target = slice(max(di, 0), nx + min(di, 0)), slice(max(dj, 0), ny + min(dj, 0))
    source = slice(max(-di, 0), nx + min(-di, 0)), slice(max(-dj, 0), ny + min(-dj, 0))
    shifted[target] = values[source]
    return shifted
