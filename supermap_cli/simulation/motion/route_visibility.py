"""What the robot sees of a place from its route and when: events are timed to be in view, or out of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.building_plan import BuildingPlan
from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.route import Route

STEP_NS = 250_000_000
"""Time step of the search, ns."""
_STEP_S = STEP_NS / 1e9
_SEEING_M = 5.0  # m, a thing within it is large enough in the image to be detected
_KEEP_APART_M = 0.65  # m between the robot's and a person's middle: both radii and a hand's breadth
_SEEN_S = 2.0  # s for which a place has to be seen before and after a change there
_UNOBSERVED_S = 2.0  # s for which it has to be out of view between
_EVERY = 2  # steps: how finely the time in view is counted


@dataclass(frozen=True)
class WalkStart:
    """The step of the traversal at which a person sets out (negative: before it), and how long the robot sees them."""

    step: int
    seen_s: float


class RouteVisibility:
    """What the robot can see from its route, by its poses at every step of the traversal.

    Its camera looks ahead and is `view_rad` wide.
    """

    def __init__(self, plan: BuildingPlan, obstacles: Sequence[Box3D], route: Route, view_rad: float) -> None:
        self._furnished = FreeSpace(plan, obstacles, clearance_m=0.3)
        self._walls = FreeSpace(plan, [], clearance_m=0.3)
        self._start_ns = route.start_ns
        poses = route.derivative(np.arange(route.start_ns, route.end_ns, STEP_NS))
        self._xy: FloatArray = poses[:, :2]
        self._yaw: FloatArray = poses[:, 2]
        self._view_rad = view_rad

    @property
    def duration_s(self) -> float:
        """How long the traversal takes."""
        return len(self._xy) * _STEP_S

    def stamp_ns(self, step: int) -> int:
        """The sensor time of a step."""
        return self._start_ns + step * STEP_NS

    def best_start(self, way_xy: FloatArray, worth_seeing: slice) -> WalkStart | None:
        """When to set out on a way (m, 2), one point a step, so that the robot sees most of its `worth_seeing` points.

        The person never comes near the robot, and appears and vanishes behind walls, or before and after the traversal.
        `None` where that is not possible.
        """
        starts = [k for k in range(1 - len(way_xy), len(self._xy), 2) if self._can_start(way_xy, k)]
        found = [WalkStart(k, self._seen_s(way_xy, k, worth_seeing)) for k in starts]
        return max(found, key=lambda start: start.seen_s, default=None)

    def unobserved_ns(self, target_xy: FloatArray) -> int:
        """The middle of the longest time in which walls hide a place (2,) that is well seen both before and after.

        Raises `SimulationError` when there is no such time.
        """
        ahead = self._in_view(np.arange(len(self._xy)), np.broadcast_to(target_xy, self._xy.shape))
        seen = ahead & self._furnished.sees(target_xy, self._xy)
        gaps = [
            (first, last)
            for first, last in _runs(~self._walls.sees(target_xy, self._xy))
            if min(seen[:first].sum(), seen[last:].sum()) >= _SEEN_S / _STEP_S
            and last - first >= _UNOBSERVED_S / _STEP_S
        ]
        if not gaps:
            raise SimulationError(
                "the robot does not see, leave and see again what should vanish meanwhile",
                cure="choose a longer --seconds, or another --seed",
            )
        first, last = max(gaps, key=lambda gap: gap[1] - gap[0])
        return self.stamp_ns((first + last) // 2)

    def _can_start(self, way_xy: FloatArray, start: int) -> bool:
        steps, way = self._together(way_xy, start)
        apart = (np.linalg.norm(self._xy[steps] - way, axis=1) >= _KEEP_APART_M).all()
        return bool(apart) and all(self._hidden(start + k, way_xy[k]) for k in (0, len(way_xy) - 1))

    def _together(self, way_xy: FloatArray, start: int) -> tuple[IntArray, FloatArray]:
        """The steps (k,) that a way shares with the traversal, and where the person is then (k, 2)."""
        first, last = max(start, 0), max(0, start, min(start + len(way_xy), len(self._xy)))
        return np.arange(first, last), way_xy[first - start : last - start]

    def _in_view(self, steps: IntArray, targets_xy: FloatArray) -> BoolArray:
        """(k,) whether targets (k, 2), one a step, are near enough and before the camera, whatever stands between."""
        offset = targets_xy - self._xy[steps]
        aside = np.angle(np.exp(1j * (np.arctan2(offset[:, 1], offset[:, 0]) - self._yaw[steps])))
        in_view: BoolArray = (np.linalg.norm(offset, axis=1) < _SEEING_M) & (np.abs(aside) <= self._view_rad / 2)
        return in_view

    def _hidden(self, step: int, xy: FloatArray) -> bool:
        """Whether walls hide a point (2,) at a step, or that is not in the traversal."""
        return not 0 <= step < len(self._xy) or not self._walls.sees(self._xy[step], xy[None])[0]

    def _seen_s(self, way_xy: FloatArray, start: int, worth_seeing: slice) -> float:
        first, last, _ = worth_seeing.indices(len(way_xy))
        steps, way = self._together(way_xy[first:last], start + first)
        steps, way = steps[::_EVERY], way[::_EVERY]
        ahead = self._in_view(steps, way)
        pairs = zip(self._xy[steps[ahead]], way[ahead], strict=True)
        return _EVERY * _STEP_S * sum(bool(self._furnished.sees(eye, target[None])[0]) for eye, target in pairs)


def _runs(flags: BoolArray) -> list[tuple[int, int]]:
    """Where flags (n,) are set: half-open ranges of indices."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]
