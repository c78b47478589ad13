"""Where a robot looks while it drives: greedily at what it has not yet seen well, with turns that it can make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.building_plan import BuildingPlan, Room
from supermap_cli.simulation.motion.free_space import FreeSpace

# All of these were chosen so that a route shows the things of a room from 1 to 3 m and from several sides
# (tests/simulation/test_routes.py), with turns as fast as those of small robots.
_SIDES = 8  # directions of view that are told apart
_NEAR_M, _FAR_M, _FAR_FOR_SMALL_M = 0.9, 4.4, 2.8  # m: nearest and farthest good view; farthest of a small thing
_SMALL_M = 0.4  # m, longest side of a small thing
_HALF_VIEW = np.radians(28)  # rad, half the width of what counts as in view
_FORGETTING_S = 25.0  # s, time constant with which views lose their weight
_LONGEST_LOOK_S = 2.2  # s at one point
_STEADY_S = 0.6  # s of steady view after which a point is done
_TURNING_RATE = np.radians(50)  # rad/s
_FAST_TURNING_RATE = np.radians(95)  # rad/s
_FAST_SHARE = 0.2  # of the turns
_TURNING_ACCELERATION = np.radians(180)  # rad/s^2
_BLURRING_RATE = np.radians(70)  # rad/s, above which nothing counts as seen
_RELUCTANCE_RAD = 1.8  # rad of turn that reduce a point's gain to 1/e
_LEAST_GAIN = 0.05  # no unit; below it the robot looks ahead
_COMING_TO_REST_S = 0.7  # s before the end
_FOCUS_WEIGHT, _OBSTACLE_WEIGHT, _WALL_WEIGHT = 5.0, 1.0, 0.3  # no unit


@dataclass(frozen=True)
class PointsOfInterest:
    """Points of a room to look at: `points_xy` (n, 2), their weights (n,), and from how far they are seen (n,) metres.

    How well they have been seen is an (n, 8) array: one column for each direction of view.
    """

    points_xy: FloatArray
    weights: FloatArray
    reach_m: FloatArray

    @property
    def things(self) -> int:
        """How many of the points are no mere wall."""
        return int((self.weights >= _OBSTACLE_WEIGHT).sum())

    @property
    def focused(self) -> bool:
        """Whether there is a focus among them."""
        return bool((self.weights >= _FOCUS_WEIGHT).any())

    def unseen(self) -> FloatArray:
        """(n, 8) zeros."""
        return np.zeros((len(self.weights), _SIDES))

    def shown_from(self, free: FreeSpace, eye_xy: FloatArray) -> FloatArray:
        """(n, 8) how well each can be seen from a place (2,), in [0, 1], in the column of that direction."""
        shown = self.unseen()
        shown[np.arange(len(self.weights)), self._side(eye_xy)] = self._quality(eye_xy) * free.sees(
            eye_xy, self.points_xy
        )
        return shown

    def _side(self, eye_xy: FloatArray) -> IntArray:
        offset = eye_xy - self.points_xy
        side: IntArray = (
            np.floor(np.arctan2(offset[:, 1], offset[:, 0]) / (2 * np.pi) * _SIDES).astype(np.int64) % _SIDES
        )
        return side

    def _quality(self, eye_xy: FloatArray) -> FloatArray:
        """Best from 0.9 m to half of how far it shows."""
        distance_m = np.linalg.norm(eye_xy - self.points_xy, axis=1)
        near = np.clip(2 * distance_m / _NEAR_M - 1, 0, 1)
        far = np.clip(2 - 2 * distance_m / self.reach_m, 0, 1)
        quality: FloatArray = near * far
        return quality


def room_points_of_interest(room: Room, obstacles: Sequence[Box3D], focus: Sequence[FloatArray]) -> PointsOfInterest:
    """The focus points and obstacles in a room, and its walls every 1.5 m; of what is nearer than 0.3 m to one another
    only the first. Small things (up to 0.4 m) want to be seen from near.
    """
    wanted = [(np.asarray(xy, np.float64), _FOCUS_WEIGHT, _FAR_M) for xy in focus]
    small = {k for k, box in enumerate(obstacles) if box.size.max() < _SMALL_M}
    wanted += [(obstacles[k].center[:2], _OBSTACLE_WEIGHT, _FAR_FOR_SMALL_M) for k in sorted(small)]
    wanted += [(box.center[:2], _OBSTACLE_WEIGHT, _FAR_M) for k, box in enumerate(obstacles) if k not in small]
    wanted += [(xy, _WALL_WEIGHT, _FAR_M) for xy in _along_walls(room)]
    chosen: list[tuple[FloatArray, float, float]] = []
    for candidate in wanted:
        if room.holds(candidate[0], -0.15) and all(np.linalg.norm(candidate[0] - other[0]) > 0.3 for other in chosen):
            chosen.append(candidate)
    points, weights, reach_m = zip(*chosen, strict=True)
    return PointsOfInterest(np.array(points), np.array(weights), np.array(reach_m))


def _along_walls(room: Room) -> list[FloatArray]:
    low, high = room.low + 0.05, room.high - 0.05
    x, y = (np.linspace(low[k], high[k], 2 + int((high[k] - low[k]) / 1.5)) for k in (0, 1))
    return [np.array(xy) for a in x for xy in ((a, low[1]), (a, high[1]))] + [
        np.array(xy) for b in y[1:-1] for xy in ((low[0], b), (high[0], b))
    ]


@dataclass
class GazeTarget:
    """Where the robot looks: at a point (2,), or (`None`) to where it drives, turning by at most `rate` rad/s."""

    at_xy: FloatArray | None
    since_s: float
    rate: float
    steady_s: float = 0.0


def follow_gaze(gaze: GazePlanner, way_xy: FloatArray, step_s: float, rng: np.random.Generator) -> FloatArray:
    """Headings (n,), unwrapped radians, of a robot at `way_xy` (n, 2) every `step_s`.

    It looks at one point of the room it is in until it has seen it steadily, or for about two seconds, then at the one
    that has most to show from here. A fifth of the turns is fast (up to 95 degrees a second), the others are at half
    that rate; at the end it comes to rest.
    """
    drives_to = _driving_directions(way_xy, step_s)
    target = gaze.choose(way_xy[0], None, 0.0, rng)
    yaw = np.zeros(len(way_xy))
    yaw[0] = _wanted(target, way_xy[0], drives_to[0])
    turning = 0.0
    for k in range(1, len(way_xy)):
        now_s = k * step_s
        error = _wrapped(_wanted(target, way_xy[k], drives_to[k]) - yaw[k - 1])
        rate = target.rate * min(1.0, (len(way_xy) - 1 - k) * step_s / _COMING_TO_REST_S)
        aim = float(np.clip(4 * error, -rate, rate))
        turning += float(np.clip(aim - turning, -_TURNING_ACCELERATION * step_s, _TURNING_ACCELERATION * step_s))
        yaw[k] = yaw[k - 1] + turning * step_s
        target.steady_s += step_s if abs(error) < np.radians(12) else 0.0
        if k % 5 == 0 and abs(turning) < _BLURRING_RATE:
            gaze.remember(way_xy[k], float(yaw[k]), 5 * step_s)
        if target.steady_s >= _STEADY_S or now_s - target.since_s > _LONGEST_LOOK_S:
            target = gaze.choose(way_xy[k], float(yaw[k]), now_s, rng)
    return yaw


class GazePlanner:
    """Keeps how well the points of all rooms have been seen from which side, and chooses the next one to look at.

    What was seen is slowly forgotten, so that it is looked at again on a later round.
    """

    def __init__(self, plan: BuildingPlan, free: FreeSpace, interests: Mapping[str, PointsOfInterest]) -> None:
        self._plan = plan
        self._free = free
        self._interests = interests
        self._seen = {name: points.unseen() for name, points in interests.items()}

    def choose(self, eye_xy: FloatArray, yaw: float | None, now_s: float, rng: np.random.Generator) -> GazeTarget:
        """The point with most to see at and around it from here, discounted by the turn it takes; straight ahead where
        there is nothing to see.
        """
        rate = (_FAST_TURNING_RATE if rng.random() < _FAST_SHARE else _TURNING_RATE) * float(rng.uniform(0.75, 1.0))
        room = self._plan.room_at(eye_xy)
        if room is None or room.name not in self._interests:
            return GazeTarget(None, now_s, rate)
        here = self._interests[room.name]
        worth = here.weights[:, None] / (0.5 + self._seen[room.name]) ** 1.5
        each_gain = (worth * here.shown_from(self._free, eye_xy)).sum(axis=1)
        bearings = _bearings(here, eye_xy)
        apart = np.abs(_wrapped(bearings[:, None] - bearings[None, :]))
        gain = each_gain + (np.clip(1 - apart / _HALF_VIEW, 0, 1) * each_gain).sum(axis=1)
        if yaw is not None:
            gain *= np.exp(-np.abs(_wrapped(bearings - yaw)) / _RELUCTANCE_RAD)
        best = int(np.argmax(gain))
        return GazeTarget(here.points_xy[best] if gain[best] >= _LEAST_GAIN else None, now_s, rate)

    def remember(self, eye_xy: FloatArray, yaw: float, elapsed_s: float) -> None:
        """Count what is in view as seen from this side for so long."""
        kept = np.exp(-elapsed_s / _FORGETTING_S)
        self._seen = {name: kept * seen for name, seen in self._seen.items()}
        room = self._plan.room_at(eye_xy)
        if room is None or room.name not in self._interests:
            return
        here = self._interests[room.name]
        in_view = np.abs(_wrapped(_bearings(here, eye_xy) - yaw)) < _HALF_VIEW
        self._seen[room.name][in_view] += here.shown_from(self._free, eye_xy)[in_view] * elapsed_s


def _driving_directions(way_xy: FloatArray, step_s: float) -> FloatArray:
    """(n,) where the robot goes over the coming second; held while it stands."""
    ahead = np.minimum(np.arange(len(way_xy)) + round(1 / step_s), len(way_xy) - 1)
    offset = way_xy[ahead] - way_xy
    moving = np.linalg.norm(offset, axis=1) > 0.1
    if not moving.any():
        return np.zeros(len(way_xy))
    known = np.maximum.accumulate(np.where(moving, np.arange(len(way_xy)), 0))
    known[known == 0] = int(np.argmax(moving))
    directions: FloatArray = np.arctan2(offset[known, 1], offset[known, 0])
    return directions


def _wanted(target: GazeTarget, eye_xy: FloatArray, ahead: float) -> float:
    if target.at_xy is None:
        return float(ahead)
    offset = target.at_xy - eye_xy
    return float(np.arctan2(offset[1], offset[0]))


def _bearings(interests: PointsOfInterest, eye_xy: FloatArray) -> FloatArray:
    offset = interests.points_xy - eye_xy
    bearings: FloatArray = np.arctan2(offset[:, 1], offset[:, 0])
    return bearings


def _wrapped(angle: FloatArray | float) -> FloatArray:
    """Into [-pi, pi)."""
    wrapped: FloatArray = np.mod(np.asarray(angle) + np.pi, 2 * np.pi) - np.pi
    return wrapped
