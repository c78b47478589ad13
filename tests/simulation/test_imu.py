"""The simulated IMU: what it measures integrates to the way it went."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.geometry.se3 import make_transform
from supermap_cli.simulation.rigs import Imu
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.sensors.imu import GRAVITY, imu_samples

START_NS = 1_700_000_000_000_000_000
EXACT = Imu(rate_hz=400.0, gyro_noise=0, gyro_bias=0, accelerometer_noise=0, accelerometer_bias=0)
TILTED = make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0.3, -0.2, 0.5])


def _route(seconds: float = 12.0) -> Route:
    times_s = np.linspace(0, seconds, 13)
    xy = np.column_stack([2 * np.sin(times_s / 2), 1.5 - 1.5 * np.cos(times_s / 3)])
    return Route(START_NS, times_s, xy, 0.8 * np.sin(times_s) + 0.3 * times_s)


def _standing() -> Route:
    return Route(START_NS, np.array([0.0, 1, 2, 3]), np.ones((4, 2)), np.ones(4))


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_at_rest_it_feels_gravity_upwards_and_no_turning() -> None:
    samples = imu_samples(_standing(), EXACT, np.eye(4), _rng())
    assert np.allclose(samples.angular_rate, 0)
    assert np.allclose(samples.specific_force, [0, 0, GRAVITY])


def test_in_a_tilted_mount_gravity_lies_along_its_own_axis() -> None:
    samples = imu_samples(_standing(), EXACT, TILTED, _rng())
    assert np.allclose(samples.specific_force, [0, -GRAVITY, 0])


@pytest.mark.parametrize("T_base_imu", [np.eye(4), TILTED], ids=["at the origin", "tilted and off the axis"])
def test_rates_and_forces_integrate_to_the_path(T_base_imu: np.ndarray) -> None:
    route = _route()
    samples = imu_samples(route, EXACT, T_base_imu, _rng())
    truth = route.T_world_base(samples.stamps_ns) @ T_base_imu
    step_s = 1 / EXACT.rate_hz
    velocity, T = _velocity(truth, step_s), truth[0].copy()
    positions = [T[:3, 3].copy()]
    for k in range(len(truth) - 1):
        turn = (samples.angular_rate[k] + samples.angular_rate[k + 1]) / 2 * step_s
        R_next = T[:3, :3] @ _rotation(turn)
        force = (T[:3, :3] @ samples.specific_force[k] + R_next @ samples.specific_force[k + 1]) / 2
        acceleration = force - [0, 0, GRAVITY]
        T[:3, 3] += velocity * step_s + acceleration * step_s**2 / 2
        velocity = velocity + acceleration * step_s
        T[:3, :3] = R_next
        positions.append(T[:3, 3].copy())
    assert np.abs(np.array(positions) - truth[:, :3, 3]).max() < 0.01
    assert np.allclose(T[:3, :3], truth[-1, :3, :3], atol=1e-3)


def test_samples_come_at_the_rate_from_the_start_to_the_end() -> None:
    stamps_ns = imu_samples(_route(), Imu(), np.eye(4), _rng()).stamps_ns
    assert len(stamps_ns) == 1201
    assert (stamps_ns[0], stamps_ns[-1]) == (START_NS, START_NS + 12_000_000_000)
    assert (np.diff(stamps_ns) == 10_000_000).all()


def test_noise_and_bias_have_the_size_they_are_given() -> None:
    noisy = Imu(rate_hz=1000.0, gyro_noise=0.01, gyro_bias=0, accelerometer_noise=0.2, accelerometer_bias=0)
    still = imu_samples(_standing(), noisy, np.eye(4), _rng())
    assert still.angular_rate.std(axis=0) == pytest.approx([0.01] * 3, rel=0.1)
    assert still.specific_force.std(axis=0) == pytest.approx([0.2] * 3, rel=0.1)
    biased = Imu(gyro_noise=0, gyro_bias=0.5, accelerometer_noise=0, accelerometer_bias=0)
    rate = imu_samples(_standing(), biased, np.eye(4), _rng()).angular_rate
    assert np.ptp(rate, axis=0) == pytest.approx([0, 0, 0])
    assert np.abs(rate[0]).max() > 0.05


def _velocity(truth: np.ndarray, step_s: float) -> np.ndarray:
    """At the start, from the first three positions (second order)."""
    a, b, c = truth[:3, :3, 3]
    velocity: np.ndarray = (-3 * a + 4 * b - c) / (2 * step_s)
    return velocity


def _rotation(turn: np.ndarray) -> np.ndarray:
    angle = float(np.linalg.norm(turn))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = turn / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation: np.ndarray = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return rotation
