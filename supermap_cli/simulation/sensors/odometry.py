"""The robot's own odometry: its true motion, misjudged a little at every step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray, check_shape
from supermap_cli.geometry.se3 import inverse
from supermap_cli.simulation.rigs import OdometryDrift
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.sensors.imu import sample_stamps_ns


@dataclass(frozen=True)
class OdometrySamples:
    """`T_odom_base` (n, 4, 4) at `stamps_ns` (n,)."""

    stamps_ns: IntArray
    T_odom_base: FloatArray

    def __post_init__(self) -> None:
        check_shape("T_odom_base", self.T_odom_base, (len(self.stamps_ns), 4, 4))


def drifting_odometry(
    route: Route, drift: OdometryDrift, T_world_odom: FloatArray, rng: np.random.Generator
) -> OdometrySamples:
    """Poses in a frame `T_world_odom` that the estimate leaves little by little; the first pose is exact.

    The robot drives on wheels on a level floor: the estimate stays planar, and errs in x, y and heading only. Each step
    is the true relative motion with its length scaled (one factor for the whole way) and white errors whose variance
    grows with the distance gone and, for the heading, with the angle turned, so that the errors of the poses are random
    walks (Thrun, Burgard and Fox 2005, section 5.4). White jitter of the single pose comes on top.
    """
    stamps_ns = sample_stamps_ns(route, drift.rate_hz)
    truth = route.derivative(stamps_ns)
    steps = _relative(truth)
    length_m, turned = np.linalg.norm(steps[:, :2], axis=1), np.abs(steps[:, 2])
    heading_deg = np.hypot(drift.yaw_deg * np.sqrt(length_m), drift.per_turn_deg * np.sqrt(turned / (2 * np.pi)))
    steps[:, :2] *= 1 + drift.scale * rng.normal()
    steps[:, :2] += rng.normal(0, 1, (len(steps), 2)) * drift.position * np.sqrt(length_m)[:, None]
    steps[:, 2] += rng.normal(0, 1, len(steps)) * np.radians(heading_deg)
    walked = _accumulated(steps)
    walked[1:, :2] += rng.normal(0, 1, (len(steps), 2)) * drift.jitter_m
    T_first_base = _planar(walked)
    T_odom_first = inverse(T_world_odom) @ _planar(truth[:1])[0]
    return OdometrySamples(stamps_ns, T_odom_first @ T_first_base)


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
