"""The hybrid state [x, y, w, h, vx, vy] of n boxes and its Kalman filter, all boxes at once.

The centre (x, y) moves with the velocity (vx, vy) in pixels per second; width and height stay, with some drift. The
camera is carried, so what changes the velocity is mostly its turning: the noise of the acceleration is a share of the
image's width, the same for boxes of all sizes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray, IntArray

_STATE_DIM, _MEASURED_DIM = 6, 4
"""Components of the state, of which the first are measured."""
_ACCELERATION_STD_WIDTHS_S2 = 1.0
"""Standard deviation of the acceleration, image widths per second squared. Chosen for a carried camera."""
_INITIAL_VELOCITY_STD_WIDTHS_S = 0.3
"""Standard deviation of the velocity of a new track, image widths per second. Chosen for a carried camera."""
_SIZE_STD_PER_SQRT_S = 0.3
"""Standard deviation of the relative change of width and height after one second. Chosen."""
_PIXEL_STD = 1.0
"""Standard deviation in pixels that every measurement has besides `_MEASUREMENT_STD_SHARE`. Chosen."""
_MIN_SIZE_PX = 1.0
"""Pixels: no box becomes smaller, whatever the filter says."""
_MEASUREMENT_STD_SHARE = 0.05
"""Standard deviation of a detected box as a share of its size (ByteTrack's `_std_weight_position`: 1/20)."""


@dataclass(frozen=True)
class BoxStates:
    """`mean` (n, 6) and `covariance` (n, 6, 6) of n boxes."""

    mean: FloatArray
    covariance: FloatArray

    def __len__(self) -> int:
        return len(self.mean)

    @property
    def boxes_xyxy(self) -> FloatArray:
        """The boxes (n, 4)."""
        half = self.mean[:, 2:4] / 2
        return np.concatenate([self.mean[:, :2] - half, self.mean[:, :2] + half], axis=1)

    @property
    def centre_deviation(self) -> FloatArray:
        """(n, 2) standard deviation of the centre, pixels."""
        deviation: FloatArray = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)[:, :2])
        return deviation

    def take(self, chosen: IntArray) -> BoxStates:
        """The chosen boxes."""
        return BoxStates(self.mean[chosen], self.covariance[chosen])


def empty_states() -> BoxStates:
    """States of no boxes."""
    return BoxStates(np.zeros((0, _STATE_DIM)), np.zeros((0, _STATE_DIM, _STATE_DIM)))


def concatenate(first: BoxStates, second: BoxStates) -> BoxStates:
    """The boxes of both, in this order."""
    return BoxStates(np.concatenate([first.mean, second.mean]), np.concatenate([first.covariance, second.covariance]))


def initiate(boxes_xyxy: Float32Array | FloatArray, image_width: int) -> BoxStates:
    """States of the boxes of new tracks."""
    n = len(boxes_xyxy)
    mean = np.zeros((n, _STATE_DIM))
    mean[:, :4] = _centre_and_size(boxes_xyxy)
    covariance = np.zeros((n, _STATE_DIM, _STATE_DIM))
    covariance[:, :4, :4] = _measurement_noise(mean[:, :4])
    velocity = (_INITIAL_VELOCITY_STD_WIDTHS_S * image_width) ** 2
    covariance[:, 4, 4] = covariance[:, 5, 5] = velocity
    return BoxStates(mean, covariance)


def predict(states: BoxStates, seconds: float, image_width: int) -> BoxStates:
    """Predict the states `seconds` later: constant velocity, discrete white noise acceleration."""
    F = np.eye(_STATE_DIM)
    F[0, 4] = F[1, 5] = seconds
    acceleration = (_ACCELERATION_STD_WIDTHS_S2 * image_width) ** 2
    Q = np.zeros((len(states), _STATE_DIM, _STATE_DIM))
    for position, velocity in ((0, 4), (1, 5)):
        Q[:, position, position] = acceleration * seconds**4 / 4
        Q[:, position, velocity] = Q[:, velocity, position] = acceleration * seconds**3 / 2
        Q[:, velocity, velocity] = acceleration * seconds**2
    for size in (2, 3):
        Q[:, size, size] = (_SIZE_STD_PER_SQRT_S * states.mean[:, size]) ** 2 * seconds
    return BoxStates(states.mean @ F.T, F @ states.covariance @ F.T + Q)


def update(states: BoxStates, boxes_xyxy: Float32Array | FloatArray) -> BoxStates:
    """Update the states by measured boxes (n, 4), one each."""
    measured = _centre_and_size(boxes_xyxy)
    S = states.covariance[:, :_MEASURED_DIM, :_MEASURED_DIM] + _measurement_noise(measured)
    gain = np.linalg.solve(S, states.covariance[:, :_MEASURED_DIM, :]).transpose(0, 2, 1)
    innovation = measured - states.mean[:, :_MEASURED_DIM]
    mean = states.mean + np.einsum("nij,nj->ni", gain, innovation)
    mean[:, 2:4] = np.maximum(mean[:, 2:4], _MIN_SIZE_PX)
    covariance = states.covariance - gain @ states.covariance[:, :_MEASURED_DIM, :]
    return BoxStates(mean, (covariance + covariance.transpose(0, 2, 1)) / 2)


def replace_boxes(states: BoxStates, which: IntArray, boxes_xyxy: Float32Array) -> BoxStates:
    """Set the boxes of the states `which` to the map's predictions; the velocities stay."""
    mean, covariance = states.mean.copy(), states.covariance.copy()
    known = _centre_and_size(boxes_xyxy)
    mean[which, :4] = known
    covariance[which, :4, :] = 0
    covariance[which, :, :4] = 0
    covariance[which, :4, :4] = _measurement_noise(known)
    return BoxStates(mean, covariance)


def _centre_and_size(boxes_xyxy: Float32Array | FloatArray) -> FloatArray:
    boxes = boxes_xyxy.astype(np.float64)
    return np.concatenate(
        [(boxes[:, :2] + boxes[:, 2:]) / 2, np.maximum(boxes[:, 2:] - boxes[:, :2], _MIN_SIZE_PX)], axis=1
    )


def _measurement_noise(centre_and_size: FloatArray) -> FloatArray:
    """(n, 4, 4) diagonal covariance of measured boxes."""
    deviation = _MEASUREMENT_STD_SHARE * np.tile(centre_and_size[:, 2:], (1, 2)) + _PIXEL_STD
    noise: FloatArray = deviation[:, :, None] ** 2 * np.eye(_MEASURED_DIM)
    return noise
