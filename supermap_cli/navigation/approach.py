"""Where to stand before a thing: on free floor, reachable, the thing in sight, on a side that it was seen from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.navigation.grid import OccupancyGrid
from supermap_cli.navigation.parameters import NavigationParameters
from supermap_cli.navigation.ways import Reachable, Way

_TRIED = 400
"""Places that are looked from, best first; bounds the time."""
_TRIED_TOGETHER = 20


@dataclass(frozen=True)
class Target:
    """A thing to stand before: its box, points (n, 3) of its surface, and camera positions (k, 3) that it was seen
    from, in the map.
    """

    box: Box3D
    points_map: FloatArray
    seen_from: FloatArray


@dataclass(frozen=True)
class Approach:
    """A place (x, y) in the map with the heading to the thing; `gap_m` to its box, `in_sight` the share of its points
    that can be seen from there.
    """

    xy: FloatArray
    yaw_rad: float
    gap_m: float
    in_sight: float
    way: Way


@dataclass(frozen=True)
class NoApproach:
    """Why there is none, and the nearest free place that the robot can reach (`None`: there is no such place)."""

    reason: str
    nearest: Approach | None


def find_approach(reachable: Reachable, target: Target, standoff_m: float) -> Approach | NoApproach:
    """The best place before a thing, about `standoff_m` from it."""
    floor, parameters = reachable.floor, reachable.floor.parameters
    reached = np.flatnonzero(np.isfinite(reachable.cost_m))
    places = floor.grid.centers(floor.cells[reached])
    gaps = gaps_to_box_m(places, target.box)
    farthest_m = max(parameters.farthest_standoff_m, standoff_m)
    cost = np.abs(gaps - standoff_m) + parameters.way_cost * reachable.cost_m[reached]
    turns = _turns_rad(places, target)
    cost += parameters.turn_cost_m * turns
    best: tuple[float, int] | None = None
    near = np.flatnonzero((gaps <= farthest_m) & (turns <= np.radians(parameters.most_turn_deg)))
    near = near[_on_seen_side(places[near], target, parameters)]
    ordered = near[np.argsort(cost[near])]
    for batch in _spread(places, ordered, floor.grid.cell_m):
        shares = in_sight(floor.grid, places[batch], target, parameters.own_m)
        for place, share in zip(batch.tolist(), shares.tolist(), strict=True):
            if share >= parameters.seen_share:
                return _approach(reachable, int(reached[place]), places[place], target, share)
            if best is None or share > best[0]:
                best = share, place
    if not len(reached):
        return NoApproach("no free floor can be reached", None)
    place = int(gaps.argmin()) if best is None or not best[0] else best[1]
    share = float(in_sight(floor.grid, places[[place]], target, parameters.own_m)[0])
    nearest = _approach(reachable, int(reached[place]), places[place], target, share)
    if best is None:
        return NoApproach(
            f"no free floor within {farthest_m:g} m of it can be reached on a side that it was seen from", nearest
        )
    return NoApproach("it is out of sight from all free floor near it that was seen", nearest)


def gaps_to_box_m(points_xy: FloatArray, box: Box3D) -> FloatArray:
    """(n,) distances on the floor from points (n, 2) to a box's outline; 0 inside."""
    c, s = np.cos(box.yaw), np.sin(box.yaw)
    own = (points_xy - box.center[:2]) @ np.array([[c, -s], [s, c]])
    gaps: FloatArray = np.linalg.norm(np.maximum(np.abs(own) - box.size[:2] / 2, 0), axis=1)
    return gaps


def in_sight(grid: OccupancyGrid, places_xy: FloatArray, target: Target, own_m: float) -> FloatArray:
    """(n,) the share of a thing's points that a camera at places (n, 2) sees: no voxel is in between, but those within
    `own_m` of the point and of its box.
    """
    eyes = np.column_stack([places_xy, np.full(len(places_xy), grid.camera_height_m)])
    rays = target.points_map[None] - eyes[:, None]
    lengths = np.linalg.norm(rays, axis=2)
    steps = max(2, int(np.ceil(lengths.max() / (grid.cell_m / 2))))
    along = np.linspace(0, 1, steps)[1:-1]
    hidden = np.zeros(lengths.shape, bool)
    for share in along:
        points = eyes[:, None] + share * rays
        far = (1 - share) * lengths > own_m
        hidden |= far & _is_blocked(grid, points) & ~_in_box(points, target.box, own_m)
    seen: FloatArray = 1 - hidden.mean(axis=1)
    return seen


def _is_blocked(grid: OccupancyGrid, points: FloatArray) -> BoolArray:
    """Which of the points (n, k, 3) lie in a voxel that hides things."""
    flat = points.reshape(-1, 3)
    cells = np.column_stack([grid.indices(flat[:, :2]), np.floor(flat[:, 2] / grid.level_m).astype(np.int64)])
    inside = ((cells >= 0) & (cells < np.array(grid.blocked.shape))).all(axis=1)
    blocked = np.zeros(len(flat), bool)
    blocked[inside] = grid.blocked[tuple(cells[inside].T)]
    return blocked.reshape(points.shape[:2])


def _in_box(points: FloatArray, box: Box3D, margin_m: float) -> BoolArray:
    flat = points.reshape(-1, 3)
    level = np.abs(flat[:, 2] - box.center[2]) <= box.size[2] / 2 + margin_m
    inside: BoolArray = (level & (gaps_to_box_m(flat[:, :2], box) <= margin_m)).reshape(points.shape[:2])
    return inside


def _on_seen_side(places_xy: FloatArray, target: Target, parameters: NavigationParameters) -> BoolArray:
    """(n,) which of the places (n, 2) lie on the side of a flat thing (a picture on a wall) that it was seen from; all
    where it is not flat.
    """
    width, depth = target.box.size[:2]
    thin, broad = min(width, depth), max(width, depth)
    if thin > parameters.flat_share * broad or not len(target.seen_from):
        return np.ones(len(places_xy), bool)
    yaw = target.box.yaw + (0 if width < depth else np.pi / 2)
    normal = np.array([np.cos(yaw), np.sin(yaw)])
    seen = np.sign((target.seen_from[:, :2] - target.box.center[:2]) @ normal).sum()
    if seen == 0:
        return np.ones(len(places_xy), bool)
    offsets = places_xy - target.box.center[:2]
    slant = offsets @ normal * np.sign(seen) / np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)
    on_side: BoolArray = slant >= np.sin(np.radians(parameters.least_slant_deg))
    return on_side


def _turns_rad(places_xy: FloatArray, target: Target) -> FloatArray:
    """(n,) angles between where places (n, 2) lie from a thing and the nearest direction that it was seen from."""
    if not len(target.seen_from):
        return np.zeros(len(places_xy))
    center = target.box.center[:2]
    here = np.arctan2(*(places_xy - center).T[::-1])
    seen = np.unique(np.round(np.arctan2(*(target.seen_from[:, :2] - center).T[::-1]), 2))
    turns = np.full(len(places_xy), np.inf)
    for angle in seen:
        turns = np.minimum(turns, np.abs((here - angle + np.pi) % (2 * np.pi) - np.pi))
    return turns


def _spread(places_xy: FloatArray, ordered: IntArray, cell_m: float) -> Iterator[IntArray]:
    """The places in their order, in batches; of neighbours within two cells the best one only."""
    _, first = np.unique(np.floor(places_xy[ordered] / (2 * cell_m)).astype(np.int64), axis=0, return_index=True)
    kept = ordered[np.sort(first)][:_TRIED]
    for begin in range(0, len(kept), _TRIED_TOGETHER):
        yield kept[begin : begin + _TRIED_TOGETHER]


def _approach(reachable: Reachable, node: int, xy: FloatArray, target: Target, share: float) -> Approach:
    ahead = target.box.center[:2] - xy
    gap_m = float(gaps_to_box_m(xy[None], target.box)[0])
    return Approach(xy, float(np.arctan2(ahead[1], ahead[0])), gap_m, share, reachable.way_to(node))
