"""The robot's own odometry: exact without drift, and wandering off with it."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.geometry.se3 import inverse, make_transform
from supermap_cli.simulation.rigs import OdometryDrift
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.sensors.odometry import drifting_odometry

START_NS = 1_700_000_000_000_000_000
NONE = OdometryDrift(position=0, yaw_deg=0, per_turn_deg=0, scale=0, jitter_m=0)
T_WORLD_ODOM = make_transform([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [3.0, -2.0, 0.4])


def _rounds(seconds: float = 120.0) -> Route:
    """About 64 m round a circle of 2 m, looking to and fro."""
    times_s = np.linspace(0, seconds, int(seconds) + 1)
    angle = 0.27 * times_s
    return Route(START_NS, times_s, 2 * np.column_stack([np.cos(angle), np.sin(angle)]), angle + np.sin(times_s / 3))


def _errors_m(route: Route, drift: OdometryDrift, seed: int) -> np.ndarray:
    samples = drifting_odometry(route, drift, T_WORLD_ODOM, np.random.default_rng(seed))
    estimate = T_WORLD_ODOM @ samples.T_odom_base
    return np.linalg.norm((estimate - route.T_world_base(samples.stamps_ns))[:, :3, 3], axis=1)


def test_without_drift_it_is_the_truth_in_its_own_frame() -> None:
    route = _rounds()
    samples = drifting_odometry(route, NONE, T_WORLD_ODOM, np.random.default_rng(0))
    truth = inverse(T_WORLD_ODOM) @ route.T_world_base(samples.stamps_ns)
    assert np.allclose(samples.T_odom_base, truth, atol=1e-9)
    assert len(samples.stamps_ns) == 120 * 20 + 1


def test_the_first_pose_is_exact_and_all_stay_level_and_planar() -> None:
    samples = drifting_odometry(_rounds(), OdometryDrift(), T_WORLD_ODOM, np.random.default_rng(1))
    first = inverse(T_WORLD_ODOM) @ _rounds().T_world_base(samples.stamps_ns[:1])[0]
    assert np.allclose(samples.T_odom_base[0], first)
    assert np.allclose(samples.T_odom_base[:, 2, 3], first[2, 3])
    assert np.allclose(samples.T_odom_base[:, 2, 2], 1)


def test_drift_grows_with_the_way() -> None:
    route = _rounds()
    errors = np.sqrt(np.mean([_errors_m(route, OdometryDrift(), seed) ** 2 for seed in range(30)], axis=0))
    tenth = len(errors) // 10
    assert errors[1:tenth].mean() < errors[4 * tenth : 5 * tenth].mean() < errors[-tenth:].mean()


def test_the_default_drift_is_a_decimetre_or_two_after_sixty_metres() -> None:
    ends = [_errors_m(_rounds(), OdometryDrift(), seed)[-1] for seed in range(40)]
    assert 0.05 < np.median(ends) < 0.3


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_that_stands_does_not_drift(seed: int) -> None:
    still = Route(START_NS, np.array([0.0, 5, 10]), np.ones((3, 2)), np.zeros(3))
    assert np.allclose(_errors_m(still, OdometryDrift(jitter_m=0), seed), 0)
    assert 0 < _errors_m(still, OdometryDrift(jitter_m=0.001), seed).max() < 0.01
