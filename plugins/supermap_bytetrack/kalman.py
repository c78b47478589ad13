"""The hybrid state [x, y, w, h, vx, vy] of n boxes and its Kalman filter, all boxes at once.

The centre (x, y) moves with the velocity (vx, vy) in pixels per second; width and height stay, with some drift. The
camera is carried, so what changes the velocity is mostly its turning: the noise of the acceleration is a share of the
image's width, the same for boxes of all sizes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray, IntArray

_STATE, _MEASURED = 6, 4
_ACCELERATION_WIDTHS_S2 = 1.0
"""Standard deviation of the acceleration, image widths per second squared."""
_FIRST_VELOCITY_WIDTHS_S = 0.3
_SIZE_DRIFT = 0.3
"""Relative drift of width and height in one second."""
_MEASUREMENT = 0.05
"""A detected box's standard deviation as a share of its size (ByteTrack: 1/20), to which a pixel is added."""


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


def no_states() -> BoxStates:
    """No box at all."""
    return BoxStates(np.zeros((0, _STATE)), np.zeros((0, _STATE, _STATE)))


def join(first: BoxStates, second: BoxStates) -> BoxStates:
    """The boxes of both, in this order."""
    return BoxStates(np.concatenate([first.mean, second.mean]), np.concatenate([first.covariance, second.covariance]))


def begin(boxes_xyxy: Float32Array | FloatArray, image_width: int) -> BoxStates:
    """States of boxes seen for the first time."""
    n = len(boxes_xyxy)
    mean = np.zeros((n, _STATE))
    mean[:, :4] = _centre_and_size(boxes_xyxy)
    covariance = np.zeros((n, _STATE, _STATE))
    covariance[:, :4, :4] = _measurement_noise(mean[:, :4])
    velocity = (_FIRST_VELOCITY_WIDTHS_S * image_width) ** 2
    covariance[:, 4, 4] = covariance[:, 5, 5] = velocity
    return BoxStates(mean, covariance)


def predict(states: BoxStates, seconds: float, image_width: int) -> BoxStates:
    """Where the boxes are `seconds` later: constant velocity with white-noise acceleration."""
    F = np.eye(_STATE)
    F[0, 4] = F[1, 5] = seconds
    acceleration = (_ACCELERATION_WIDTHS_S2 * image_width) ** 2
    Q = np.zeros((len(states), _STATE, _STATE))
    for position, velocity in ((0, 4), (1, 5)):
        Q[:, position, position] = acceleration * seconds**4 / 4
        Q[:, position, velocity] = Q[:, velocity, position] = acceleration * seconds**3 / 2
        Q[:, velocity, velocity] = acceleration * seconds**2
    for size in (2, 3):
        Q[:, size, size] = (_SIZE_DRIFT * states.mean[:, size]) ** 2 * seconds
    return BoxStates(states.mean @ F.T, F @ states.covariance @ F.T + Q)


def correct(states: BoxStates, boxes_xyxy: Float32Array | FloatArray) -> BoxStates:
    """The states after each box was measured, boxes (n, 4)."""
    measured = _centre_and_size(boxes_xyxy)
    S = states.covariance[:, :_MEASURED, :_MEASURED] + _measurement_noise(measured)
    gain = np.linalg.solve(S, states.covariance[:, :_MEASURED, :]).transpose(0, 2, 1)
    innovation = measured - states.mean[:, :_MEASURED]
    mean = states.mean + np.einsum("nij,nj->ni", gain, innovation)
    mean[:, 2:4] = np.maximum(mean[:, 2:4], 1.0)
    covariance = states.covariance - gain @ states.covariance[:, :_MEASURED, :]
    return BoxStates(mean, (covariance + covariance.transpose(0, 2, 1)) / 2)


def replace_boxes(states: BoxStates, which: IntArray, boxes_xyxy: Float32Array) -> BoxStates:
    """The states with the boxes of `which` set to what the map says they are; their velocities stay."""
    mean, covariance = states.mean.copy(), states.covariance.copy()
    known = _centre_and_size(boxes_xyxy)
    mean[which, :4] = known
    covariance[which, :4, :] = 0
    covariance[which, :, :4] = 0
    covariance[which, :4, :4] = _measurement_noise(known)
    return BoxStates(mean, covariance)


def _centre_and_size(boxes_xyxy: Float32Array | FloatArray) -> FloatArray:
    boxes = boxes_xyxy.astype(np.float64)
    return np.concatenate([(boxes[:, :2] + boxes[:, 2:]) / 2, np.maximum(boxes[:, 2:] - boxes[:, :2], 1.0)], axis=1)


def _measurement_noise(centre_and_size: FloatArray) -> FloatArray:
    """(n, 4, 4) diagonal covariance of measured boxes."""
    deviation = _MEASUREMENT * np.tile(centre_and_size[:, 2:], (1, 2)) + 1.0
    noise: FloatArray = deviation[:, :, None] ** 2 * np.eye(_MEASURED)
    return noise
