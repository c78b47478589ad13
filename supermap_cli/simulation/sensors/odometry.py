"""The robot's own odometry: its true motion, misjudged a little at every step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray, check_shape
from supermap_cli.geometry.se3 import inverse
from supermap_cli.simulation.rigs import OdometryDrift
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.sensors.imu import sample_stamps_ns

_DRAWS = 8  # draws, bounds the time: of errors, of which the one nearest to a given share of the way is taken
_SCALINGS = 6  # steps: the last error is nearly proportional to the factor: each brings it tenfold nearer
_LEAST_TARGET_M = 1e-4  # m, bounds a division: who hardly moves has no share of the way to be off by


@dataclass(frozen=True)
class OdometrySamples:
    """`T_odom_base` (n, 4, 4) at `stamps_ns` (n,)."""

    stamps_ns: IntArray
    T_odom_base: FloatArray

    def __post_init__(self) -> None:
        check_shape("T_odom_base", self.T_odom_base, (len(self.stamps_ns), 4, 4))


@dataclass(frozen=True)
class _Errors:
    """What n relative motions are misjudged by: their lengths by the factor `1 + stretch`, then `shift` (n, 2) metres
    and `turn` (n,) radians on top.
    """

    stretch: float
    shift: FloatArray
    turn: FloatArray

    def walked(self, steps: FloatArray, times: float = 1.0) -> FloatArray:
        """(n + 1, 3) the poses that the steps (n, 3) then seem to lead to; errors `times` as large."""
        steps = steps.copy()
        steps[:, :2] *= 1 + times * self.stretch
        steps[:, :2] += times * self.shift
        steps[:, 2] += times * self.turn
        return _accumulated(steps)


def drifting_odometry(
    route: Route, drift: OdometryDrift, T_world_odom: FloatArray, rng: np.random.Generator
) -> OdometrySamples:
    """Poses in a frame `T_world_odom` that the estimate leaves little by little; but for a sway the first is exact.

    The robot drives on wheels on a level floor: the estimate stays planar, and errs in x, y and heading only. Each step
    is the true relative motion with its length scaled (one factor for the whole way) and white errors whose variance
    grows with the distance gone and, for the heading, with the angle turned, so that the errors of the poses are random
    walks (Thrun, Burgard and Fox 2005, section 5.4). White jitter of the single pose comes on top. A base that is
    carried knows its sway exactly, as gravity and a fast camera hold the fast part of its motion.
    """
    stamps_ns = sample_stamps_ns(route, drift.rate_hz)
    truth = route.derivative(stamps_ns)
    steps = _relative(truth)
    errors = _draw_errors(steps, drift, rng)
    jitter_m = rng.normal(0, 1, (len(steps), 2)) * drift.jitter_m
    if drift.share > 0:
        walked = _off_by(steps, drift, errors, rng)
    else:
        if drift.turned_deg_per_m or drift.jump_m:
            errors = _with_turn_and_jump(errors, steps, drift, rng)
        walked = errors.walked(steps)
    walked[1:, :2] += jitter_m
    if drift.jitter_deg > 0:
        walked[1:, 2] += rng.normal(0, np.radians(drift.jitter_deg), len(steps))
    T_first_base = _planar(walked)
    T_odom_first = inverse(T_world_odom) @ _planar(truth[:1])[0]
    T_odom_base = T_odom_first @ T_first_base
    return OdometrySamples(
        stamps_ns, T_odom_base if route.sway is None else T_odom_base @ route.T_level_base(stamps_ns)
    )


def _draw_errors(steps: FloatArray, drift: OdometryDrift, rng: np.random.Generator) -> _Errors:
    length_m, turned = np.linalg.norm(steps[:, :2], axis=1), np.abs(steps[:, 2])
    heading_deg = np.hypot(drift.yaw_deg * np.sqrt(length_m), drift.per_turn_deg * np.sqrt(turned / (2 * np.pi)))
    stretch = drift.scale * float(rng.normal())
    shift = rng.normal(0, 1, (len(steps), 2)) * drift.position * np.sqrt(length_m)[:, None]
    return _Errors(stretch, shift, rng.normal(0, 1, len(steps)) * np.radians(heading_deg))


def _off_by(steps: FloatArray, drift: OdometryDrift, errors: _Errors, rng: np.random.Generator) -> FloatArray:
    """The poses of errors that put the last one off by `drift.share` of the way.

    Random errors may happen to cancel out at the end, and would have to be huge to come to the share nevertheless: of
    several draws the one is scaled that is nearest to it.
    """
    target_m = drift.share * float(np.linalg.norm(steps[:, :2], axis=1).sum())
    exact_xy = _accumulated(steps)[-1, :2]
    if target_m < _LEAST_TARGET_M:
        return errors.walked(steps)

    def ratio(errors: _Errors, times: float) -> float:
        off_m = float(np.linalg.norm(errors.walked(steps, times)[-1, :2] - exact_xy))
        return target_m / max(off_m, _LEAST_TARGET_M)

    drawn = [errors, *(_draw_errors(steps, drift, rng) for _ in range(_DRAWS - 1))]
    nearest = min(drawn, key=lambda candidate: abs(np.log(ratio(candidate, 1.0))))
    times = 1.0
    for _ in range(_SCALINGS):
        times *= ratio(nearest, times)
    return nearest.walked(steps, times)


def _with_turn_and_jump(errors: _Errors, steps: FloatArray, drift: OdometryDrift, rng: np.random.Generator) -> _Errors:
    """A constant heading error to one side, and a jump at a time in the middle half of the way."""
    side, jump_side = rng.choice([-1.0, 1.0], 2)
    turn = errors.turn + side * np.radians(drift.turned_deg_per_m) * np.linalg.norm(steps[:, :2], axis=1)
    shift, direction = errors.shift.copy(), rng.uniform(0, 2 * np.pi)
    at = int(len(steps) * rng.uniform(0.25, 0.75))
    if drift.jump_m:
        shift[at] += drift.jump_m * np.array([np.cos(direction), np.sin(direction)])
        turn[at] += jump_side * np.radians(drift.jump_deg)
    return _Errors(errors.stretch, shift, turn)


def _relative(poses: FloatArray) -> FloatArray:
    """(n - 1, 3) forward, leftward and turn from each of n planar poses (n, 3) to the next."""
    dx, dy, turn = np.diff(poses, axis=0).T
    cos, sin = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    return np.column_stack([cos * dx + sin * dy, cos * dy - sin * dx, turn])


def _accumulated(steps: FloatArray) -> FloatArray:
    """(n + 1, 3) planar poses, from the origin, of n relative motions (n, 3): the inverse of `_relative`."""
    yaw = np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    moves = np.column_stack([cos * steps[:, 0] - sin * steps[:, 1], sin * steps[:, 0] + cos * steps[:, 1]])
    return np.column_stack([np.vstack([np.zeros(2), np.cumsum(moves, axis=0)]), yaw])


def _planar(poses: FloatArray) -> FloatArray:
    """Transforms (n, 4, 4) of planar poses (n, 3)."""
    T = np.tile(np.eye(4), (len(poses), 1, 1))
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    T[:, 0, 0], T[:, 0, 1], T[:, 1, 0], T[:, 1, 1] = cos, -sin, sin, cos
    T[:, :2, 3] = poses[:, :2]
    return T
