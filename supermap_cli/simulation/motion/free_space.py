"""Where one can stand and go: the floor of all rooms and doorways, less what stands on it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.building_plan import BuildingPlan, Doorway

CELL_M = 0.05
"""m, edge of a grid cell; chosen to be a fifth of the radius of robots and people."""
_OVERHEAD_M = 1.3
"""m, robots and people pass under what begins above it; chosen above the cameras of all rigs."""
_UNDERFOOT_M = 0.05
"""m, what ends below it is driven and walked over; chosen above the thickness of a rug."""
_EYE_M = 1.05
"""m, height of the cameras: between those of the rigs, 0.95 m and 1.1 m."""
_KEEP_OFF_M = 0.5
"""m beyond the clearance within which paths are dearer; chosen wider than half a doorway: its middle is cheapest."""
_FARTHEST_SNAP_M = 1.6
"""m to the nearest free place: as far as a person reaches with a step."""


class FreeSpace:
    """An occupancy grid of a building's floor for a body of radius `clearance_m`, and the ways on it.

    An obstacle blocks the floor below it unless it begins above 1.3 m or lies flat on the floor (a rug); what stands
    on something else blocks no more than that does. Points are (2,) metres in the world.
    """

    def __init__(self, plan: BuildingPlan, obstacles: Sequence[Box3D], *, clearance_m: float) -> None:
        self.clearance_m = clearance_m
        self.origin_xy = np.min([room.low for room in plan.rooms], axis=0) - 4 * CELL_M
        extent = np.max([room.high for room in plan.rooms], axis=0) + 4 * CELL_M - self.origin_xy
        self._shape = (int(np.ceil(extent[0] / CELL_M)), int(np.ceil(extent[1] / CELL_M)))
        floor = np.zeros(self._shape, bool)
        for room in plan.rooms:
            floor |= self._inside(
                np.array([[*room.low], [room.high[0], room.low[1]], [*room.high], [room.low[0], room.high[1]]])
            )
        for doorway in plan.doorways:
            floor |= self._inside(_doorway_floor(plan, doorway))
        self._floor = floor
        blocking = [box for box in obstacles if box.z_min <= _OVERHEAD_M and box.z_max > _UNDERFOOT_M]
        self._standable = floor & ~self._covered([box for box in blocking if not _rests_on_another(box, blocking)])
        self._see_through = floor & ~self._covered([box for box in obstacles if box.z_min < _EYE_M < box.z_max])

    def is_free(self, xy: FloatArray) -> bool:
        """Whether the body can stand there: nothing is nearer than `clearance_m`."""
        return bool(self.are_free(np.asarray(xy)[None])[0])

    def are_free(self, points_xy: FloatArray) -> BoolArray:
        """(n,) for points (n, 2), as `is_free`."""
        free: BoolArray = self.room_to_move_m(points_xy) >= self.clearance_m
        return free

    def are_reachable(self, points_xy: FloatArray) -> BoolArray:
        """(n,) whether the body can get to points (n, 2)."""
        return self._looked_up(self.reachable, points_xy).astype(bool)

    def room_to_move_m(self, points_xy: FloatArray) -> FloatArray:
        """(n,) distances from points (n, 2) to the nearest wall or obstacle, as the grid knows them; 0 outside."""
        return self._looked_up(self._distance_m, points_xy)

    def nearest_free(self, xy: FloatArray, *, within_m: float = _FARTHEST_SNAP_M) -> FloatArray:
        """The point itself where it is free and reachable, else the centre of the nearest such cell.

        Raises `ValueError` when there is none within `within_m`.
        """
        xy = np.asarray(xy, np.float64)
        cell = self._cells(xy[None])[0]
        if self._on_grid(cell[None])[0] and self.reachable[tuple(cell)]:
            return xy
        centers = self.cell_centers(self._reachable_cells)
        distance_m = np.linalg.norm(centers - xy, axis=1)
        if not len(distance_m) or distance_m.min() > within_m:
            raise ValueError(f"no free place within {within_m} m of {xy.round(2).tolist()}")
        nearest: FloatArray = centers[int(distance_m.argmin())]
        return nearest

    def path(self, start_xy: FloatArray, goal_xy: FloatArray) -> FloatArray:
        """A short way (k, 2) that keeps off obstacles, straightened where nothing is in between, k >= 2.

        Dijkstra's algorithm on the grid, cells near obstacles being dearer. Both ends are moved to the nearest free
        place. Raises `ValueError` when there is no way.
        """
        start, goal = self.nearest_free(start_xy), self.nearest_free(goal_xy)
        cells = self._cell_path(tuple(self._cells(start[None])[0]), tuple(self._cells(goal[None])[0]))
        points = np.vstack([start, self.cell_centers(cells)[1:-1], goal])
        return self._shortcut(points)

    def ways_m(self, places_xy: FloatArray) -> FloatArray:
        """(n, n) how long the ways between places (n, 2) are, longer where they are narrow; inf where there is none."""
        from scipy.sparse.csgraph import dijkstra  # noqa: PLC0415

        cells = self._cells(np.array([self.nearest_free(xy) for xy in places_xy]))
        nodes = np.ravel_multi_index(tuple(cells.T), self._shape)
        lengths: FloatArray = dijkstra(self._graph, directed=False, indices=nodes)[:, nodes]
        return lengths

    def sees(self, eye_xy: FloatArray, targets_xy: FloatArray) -> BoolArray:
        """(n,) whether no wall and nothing taller than the robot's camera stands between an eye (2,) and targets
        (n, 2); the target's own surroundings (0.45 m) do not count.
        """
        offsets = np.asarray(targets_xy) - eye_xy
        length = np.linalg.norm(offsets, axis=1)
        shares = np.linspace(0, 1, 60)
        reach = np.maximum(length - 0.45, 0.0) / np.maximum(length, 1e-9)
        samples = eye_xy + offsets[:, None] * (shares[None, :, None] * reach[:, None, None])
        open_here = self._looked_up(self._see_through, samples.reshape(-1, 2)).reshape(len(offsets), -1)
        clear: BoolArray = np.asarray(open_here.astype(bool).all(axis=1))
        return clear

    def cell_centers(self, cells: IntArray) -> FloatArray:
        """Centres (n, 2) of cells (n, 2)."""
        centers: FloatArray = self.origin_xy + (cells + 0.5) * CELL_M
        return centers

    @cached_property
    def _distance_m(self) -> FloatArray:
        from scipy.ndimage import distance_transform_edt  # noqa: PLC0415 - keeps start-up light

        distance: FloatArray = distance_transform_edt(np.pad(self._standable, 1))[1:-1, 1:-1] * CELL_M - CELL_M / 2
        return distance

    @cached_property
    def reachable(self) -> BoolArray:
        """(nx, ny) cells of `CELL_M` that are free and belong to the largest connected part."""
        from scipy.ndimage import label  # noqa: PLC0415

        parts, count = label(self._distance_m >= self.clearance_m)
        if not count:
            return np.zeros(self._shape, bool)
        largest: BoolArray = parts == 1 + int(np.argmax(np.bincount(parts.ravel())[1:]))
        return largest

    @cached_property
    def _reachable_cells(self) -> IntArray:
        return np.argwhere(self.reachable)

    @cached_property
    def _graph(self) -> Any:
        """The reachable cells' eight-neighbour graph, (nx ny, nx ny) sparse; edges weigh their length and nearness."""
        from scipy.sparse import coo_array  # noqa: PLC0415

        number = np.arange(self.reachable.size).reshape(self._shape)
        slack = np.clip(self._distance_m - self.clearance_m, 0.0, _KEEP_OFF_M) / _KEEP_OFF_M
        dearness = 1 + 2 * (1 - slack) ** 2
        starts, ends, costs = [], [], []
        nx, ny = self._shape
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            a = (slice(0, nx - dx), slice(max(-dy, 0), ny - max(dy, 0)))
            b = (slice(dx, nx), slice(max(dy, 0), ny + min(dy, 0)))
            both = self.reachable[a] & self.reachable[b]
            starts.append(number[a][both])
            ends.append(number[b][both])
            costs.append(np.hypot(dx, dy) * CELL_M * (dearness[a] + dearness[b])[both] / 2)
        edges = (np.concatenate(costs), (np.concatenate(starts), np.concatenate(ends)))
        return coo_array(edges, shape=(number.size, number.size)).tocsr()

    def _cell_path(self, start: tuple[int, ...], goal: tuple[int, ...]) -> IntArray:
        from scipy.sparse.csgraph import dijkstra  # noqa: PLC0415

        first, last = (int(np.ravel_multi_index(cell, self._shape)) for cell in (start, goal))
        _, previous = dijkstra(self._graph, directed=False, indices=first, return_predecessors=True)
        steps = [last]
        while steps[-1] != first:
            if previous[steps[-1]] < 0:
                raise ValueError(f"there is no way between the cells {start} and {goal}")
            steps.append(int(previous[steps[-1]]))
        return np.column_stack(np.unravel_index(steps[::-1], self._shape)).astype(np.int64)

    def _shortcut(self, points: FloatArray) -> FloatArray:
        """Leave points out wherever the straight line keeps as far from obstacles as the way it replaces, or 0.15 m
        more than it must.
        """
        slack_m = self.room_to_move_m(points)
        kept = [0]
        while kept[-1] < len(points) - 1:
            at = kept[-1]
            reach = len(points) - 1
            while reach > at + 1 and not self._straight(
                points[at], points[reach], float(slack_m[at : reach + 1].min())
            ):
                reach = at + max(1, (reach - at) // 2) if reach - at > 8 else reach - 1
            kept.append(reach)
        if len(kept) == 1:
            kept.append(0)
        return points[kept]

    def _straight(self, a_xy: FloatArray, b_xy: FloatArray, slack_m: float) -> bool:
        count = 2 + int(np.linalg.norm(b_xy - a_xy) / (CELL_M / 2))
        line = a_xy + (b_xy - a_xy) * np.linspace(0, 1, count)[:, None]
        wanted_m = max(min(slack_m, self.clearance_m + 0.15), self.clearance_m)
        return bool((self.room_to_move_m(line) >= wanted_m - 1e-9).all())

    def _cells(self, points_xy: FloatArray) -> IntArray:
        cells: IntArray = np.floor((points_xy - self.origin_xy) / CELL_M).astype(np.int64)
        return cells

    def _on_grid(self, cells: IntArray) -> BoolArray:
        within: BoolArray = np.asarray(((cells >= 0) & (cells < self._shape)).all(axis=1))
        return within

    def _looked_up(self, grid: FloatArray | BoolArray, points_xy: FloatArray) -> FloatArray:
        cells = self._cells(points_xy)
        found = np.zeros(len(cells))
        within = self._on_grid(cells)
        found[within] = grid[tuple(cells[within].T)]
        return found

    def _covered(self, boxes: Sequence[Box3D]) -> BoolArray:
        covered = np.zeros(self._shape, bool)
        for box in boxes:
            covered |= self._inside(box.footprint())
        return covered

    def _inside(self, polygon: FloatArray) -> BoolArray:
        """(nx, ny) cells whose centre lies in a convex, counter-clockwise polygon (n, 2)."""
        inside = np.zeros(self._shape, bool)
        low = np.clip(self._cells(polygon.min(axis=0)[None])[0] - 1, 0, self._shape)
        high = np.clip(self._cells(polygon.max(axis=0)[None])[0] + 2, 0, self._shape)
        x, y = (self.origin_xy[k] + (np.arange(low[k], high[k]) + 0.5) * CELL_M for k in (0, 1))
        part = np.ones((len(x), len(y)), bool)
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            part &= (b[0] - a[0]) * (y[None, :] - a[1]) - (b[1] - a[1]) * (x[:, None] - a[0]) >= 0
        inside[low[0] : high[0], low[1] : high[1]] = part
        return inside


def _doorway_floor(plan: BuildingPlan, doorway: Doorway) -> FloatArray:
    """The doorway's floor (4, 2), counter-clockwise, through the whole wall and a little into both rooms."""
    through = doorway.through / np.linalg.norm(doorway.through)
    across = np.array([-through[1], through[0]]) * doorway.width_m / 2
    axis = int(np.argmax(np.abs(through)))
    sides = [np.clip(doorway.center[axis], *_span(plan, name, axis)) for name in (doorway.first, doorway.second)]
    half_m = max(abs(side - doorway.center[axis]) for side in sides) + 2 * CELL_M
    ahead = through * half_m
    center = doorway.center
    return np.array(
        [center - ahead - across, center + ahead - across, center + ahead + across, center - ahead + across]
    )


def _span(plan: BuildingPlan, name: str, axis: int) -> tuple[float, float]:
    room = plan.room(name)
    return float(room.low[axis]), float(room.high[axis])


def _rests_on_another(box: Box3D, others: Sequence[Box3D]) -> bool:
    """Whether its foot is lifted off the floor and its middle lies over (or in) another, lower thing."""
    if box.z_min < 2 * _UNDERFOOT_M:
        return False
    return any(
        other is not box and other.z_min < box.z_min - 0.02 and _holds(other, box.center[:2]) for other in others
    )


def _holds(box: Box3D, xy: FloatArray) -> bool:
    c, s = np.cos(box.yaw), np.sin(box.yaw)
    dx, dy = xy - box.center[:2]
    return bool(abs(c * dx + s * dy) <= box.size[0] / 2 and abs(c * dy - s * dx) <= box.size[1] / 2)
