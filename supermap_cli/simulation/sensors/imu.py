"""What an inertial sensor on the robot measures: exact rates and forces of its way, then noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray, check_shape
from supermap_cli.simulation.rigs import Imu
from supermap_cli.simulation.route import Route

GRAVITY = 9.81
"""m/s^2."""


@dataclass(frozen=True)
class ImuSamples:
    """n samples in the sensor's own frame, as in `sensor_msgs/Imu`.

    `angular_rate` (n, 3) radians per second; `specific_force` (n, 3) metres per second squared, what an accelerometer
    feels: acceleration less gravity, so that at rest it points up with 9.81.
    """

    stamps_ns: IntArray
    angular_rate: FloatArray
    specific_force: FloatArray

    def __post_init__(self) -> None:
        for name in ("angular_rate", "specific_force"):
            check_shape(name, getattr(self, name), (len(self.stamps_ns), 3))


def sample_stamps_ns(route: Route, rate_hz: float) -> IntArray:
    """(n,) stamps of a sensor that samples at a fixed rate from the route's start to its end."""
    count = 1 + int((route.end_ns - route.start_ns) * rate_hz / 1e9 + 1e-6)
    stamps_ns: IntArray = route.start_ns + np.round(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)
    return stamps_ns


def imu_samples(route: Route, imu: Imu, T_base_imu: FloatArray, rng: np.random.Generator) -> ImuSamples:
    """Rates and specific forces at `T_base_imu`, from the route's derivatives; with zero noise and bias they are exact.

    Away from the base's origin the sensor feels the Euler and the centripetal acceleration of the turning base besides,
    alpha x r + omega x (omega x r). White noise is added to every sample, a constant bias drawn once for each axis.
    """
    stamps_ns = sample_stamps_ns(route, imu.rate_hz)
    yaw = route.derivative(stamps_ns)[:, 2]
    omega = route.derivative(stamps_ns, 1)[:, 2]
    acceleration = route.derivative(stamps_ns, 2)
    arm_x, arm_y = T_base_imu[:2, 3]
    forward = np.cos(yaw) * acceleration[:, 0] + np.sin(yaw) * acceleration[:, 1]
    leftward = np.cos(yaw) * acceleration[:, 1] - np.sin(yaw) * acceleration[:, 0]
    alpha = acceleration[:, 2]
    force_base = np.column_stack(
        [
            forward - alpha * arm_y - omega**2 * arm_x,
            leftward + alpha * arm_x - omega**2 * arm_y,
            np.full(len(yaw), GRAVITY),
        ]
    )
    rate_base = np.column_stack([np.zeros_like(omega), np.zeros_like(omega), omega])
    R_base_imu = T_base_imu[:3, :3]
    return ImuSamples(
        stamps_ns,
        _disturbed(rate_base @ R_base_imu, imu.gyro_noise, imu.gyro_bias, rng),
        _disturbed(force_base @ R_base_imu, imu.accelerometer_noise, imu.accelerometer_bias, rng),
    )


def _disturbed(exact: FloatArray, noise: float, bias: float, rng: np.random.Generator) -> FloatArray:
    disturbed: FloatArray = exact + rng.normal(0, 1, 3) * bias + rng.normal(0, 1, exact.shape) * noise
    return disturbed
