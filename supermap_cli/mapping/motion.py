"""Short-term dynamics: people and carried things are followed while they move, and never burn into the static map."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import FloatArray

RECENT = 4
"""Sightings that decide whether something moves now."""

SIGHTING_SIGMA_M = 0.15
"""How far the middle of what is seen of a person lies off its axis: one side of it, swinging limbs, the pose."""

SPEED_SIGMA_MPS = 0.8
"""What is known of the velocity (each way) of something seen once: people walk at 1.2 m/s, or stand."""

ACCELERATION_DENSITY = 0.5
"""Spectral density (m2/s3) of the acceleration: in a second, a walk turns or slows down by 0.7 m/s."""

WALKING_MPS = 0.3
"""Slower than this is standing about."""


@dataclass(frozen=True)
class Course:
    """Where something is on the floor plane and where it is going: a Kalman filter with white acceleration (Bar-Shalom,
    Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, 6.2.2).

    `place` (2,) metres and `velocity` (2,) in the map frame at `stamp_ns`; `covariance` (2, 2) is that of place and
    velocity along either axis.
    """

    stamp_ns: int
    place: FloatArray
    velocity: FloatArray
    covariance: FloatArray

    def at(self, stamp_ns: int) -> Course:
        """Where it is expected at a later time."""
        dt = max(stamp_ns - self.stamp_ns, 0) / 1e9
        step = np.array([[1.0, dt], [0.0, 1.0]])
        noise = ACCELERATION_DENSITY * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        covariance = step @ self.covariance @ step.T + noise
        return Course(stamp_ns, self.place + dt * self.velocity, self.velocity, covariance)

    def seen(self, stamp_ns: int, place: FloatArray) -> Course:
        """The course after one more sighting (2,)."""
        now = self.at(stamp_ns)
        gain = now.covariance[:, 0] / (now.covariance[0, 0] + SIGHTING_SIGMA_M**2)
        off = place - now.place
        covariance = now.covariance - np.outer(gain, now.covariance[0])
        return Course(stamp_ns, now.place + gain[0] * off, now.velocity + gain[1] * off, covariance)

    @property
    def sigma_m(self) -> float:
        """How far, along either axis, a sighting at this time is expected to lie off `place`."""
        return float(np.sqrt(self.covariance[0, 0] + SIGHTING_SIGMA_M**2))

    @property
    def walking(self) -> bool:
        """Whether it is surely on its way."""
        speed = float(np.linalg.norm(self.velocity))
        return speed > max(WALKING_MPS, 2 * float(np.sqrt(self.covariance[1, 1])))


def first_course(stamp_ns: int, place: FloatArray) -> Course:
    """What one sighting (2,) tells."""
    return Course(stamp_ns, place, np.zeros(2), np.diag([SIGHTING_SIGMA_M**2, SPEED_SIGMA_MPS**2]))


@dataclass
class MotionState:
    """The last few places of an object, and whether it is on the move.

    A thing moves when its last sightings lie clearly apart in one direction, more than partial views of a still thing
    of its size can explain; it has come to rest when they agree again. `course` is where it is going, if it is going.
    """

    stamps_ns: list[int] = field(default_factory=list)
    centroids: list[FloatArray] = field(default_factory=list)
    moving: bool = False
    course: Course | None = None

    def sighted(self, stamp_ns: int, centroid_map: FloatArray, overlap: float, size_m: float) -> None:
        """Take in a sighting: (3,) centroid, share of it that lies on the known cloud, size of what was seen."""
        place = centroid_map[:2]
        self.course = first_course(stamp_ns, place) if self.course is None else self.course.seen(stamp_ns, place)
        self.stamps_ns = [*self.stamps_ns, stamp_ns][-RECENT:]
        self.centroids = [*self.centroids, centroid_map][-RECENT:]
        if len(self.centroids) < RECENT - 1:
            return
        steps = np.diff(np.array(self.centroids), axis=0)
        travelled = float(np.linalg.norm(np.sum(steps, axis=0)))
        wandered = float(np.linalg.norm(steps, axis=1).sum())
        straight = travelled > 0.8 * wandered
        if not self.moving:
            self.moving = straight and travelled > max(0.3, 0.6 * size_m) and overlap < 0.2
        else:
            self.moving = wandered > 0.1 * (len(self.centroids) - 1)
