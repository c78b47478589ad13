"""Short-term dynamics: people and carried things are followed while they move, and never burn into the static map.

The paper leaves dynamic objects to its tracker in the image; here they are tracked on the floor plane, so that they
are associated in 3D as everything else is.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class MotionParameters:
    """A constant-velocity model of people, and when an object's detections say that it moves."""

    detection_sigma_m: float = parameter(
        0.15,
        "m",
        "how far the middle of what is seen of a person lies off their axis: one side, swinging limbs, the pose",
        TUNED,
        at_least=1e-3,
    )
    speed_sigma_mps: float = parameter(
        0.8, "m/s", "what is known of each velocity component of something seen once: people walk or stand", "1.2 m/s"
    )
    acceleration_density: float = parameter(
        0.5, "m2/s3", "spectral density of the acceleration: in a second, a walk turns or slows by 0.7 m/s", TUNED
    )
    dynamic_share: float = parameter(
        0.2,
        "1",
        "probability of moving by itself from which what has moved before the robot's eyes is taken to: things are "
        "carried far less often than people are called by a wrong name",
        "prior",
        at_most=1.0,
    )
    walking_mps: float = parameter(0.3, "m/s", "slower than this is standing about", TUNED)
    walking_sigmas: float = parameter(2.0, "1", "deviations that a walk's speed must exceed its uncertainty by", TUNED)
    recent_detections: int = parameter(4, "1", "detections that decide whether something moves now", TUNED, at_least=3)
    straightness: float = parameter(
        0.8, "1", "share of the way travelled that must lead in one direction", TUNED, at_most=1.0
    )
    min_travel_m: float = parameter(0.3, "m", "least distance that says that something moves", TUNED)
    min_travel_share: float = parameter(0.6, "1", "the same as a share of its size: parts of a large thing", TUNED)
    max_overlap: float = parameter(0.2, "1", "share of a moving thing's detection that lies on its known cloud", TUNED)
    resting_step_m: float = parameter(0.1, "m", "mean step below which it has come to rest", TUNED)


DEFAULT = MotionParameters()


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
    parameters: MotionParameters = field(default=DEFAULT, repr=False)

    def at(self, stamp_ns: int) -> Course:
        """Where it is expected at a later time."""
        dt = max(stamp_ns - self.stamp_ns, 0) / 1e9
        step = np.array([[1.0, dt], [0.0, 1.0]])
        noise = self.parameters.acceleration_density * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        covariance = step @ self.covariance @ step.T + noise
        return Course(stamp_ns, self.place + dt * self.velocity, self.velocity, covariance, self.parameters)

    def updated(self, stamp_ns: int, place: FloatArray) -> Course:
        """The course after one more detection (2,)."""
        now = self.at(stamp_ns)
        gain = now.covariance[:, 0] / (now.covariance[0, 0] + self.parameters.detection_sigma_m**2)
        off = place - now.place
        covariance = now.covariance - np.outer(gain, now.covariance[0])
        return Course(stamp_ns, now.place + gain[0] * off, now.velocity + gain[1] * off, covariance, self.parameters)

    @property
    def sigma_m(self) -> float:
        """How far, along either axis, a detection at this time is expected to lie off `place`."""
        return float(np.sqrt(self.covariance[0, 0] + self.parameters.detection_sigma_m**2))

    @cached_property
    def walking(self) -> bool:
        """Whether it is surely on its way."""
        speed = float(np.linalg.norm(self.velocity))
        uncertain = self.parameters.walking_sigmas * float(np.sqrt(self.covariance[1, 1]))
        return speed > max(self.parameters.walking_mps, uncertain)


def first_course(stamp_ns: int, place: FloatArray, parameters: MotionParameters = DEFAULT) -> Course:
    """What one detection (2,) tells."""
    covariance = np.diag([parameters.detection_sigma_m**2, parameters.speed_sigma_mps**2])
    return Course(stamp_ns, place, np.zeros(2), covariance, parameters)


@dataclass
class MotionState:
    """The last few places of an object, and whether it is moving.

    A thing moves when its last detections lie clearly apart in one direction, more than partial views of a still thing
    of its size can explain; it has come to rest when they agree again. `course` is where it is going, if it is going.
    """

    stamps_ns: list[int] = field(default_factory=list)
    centroids: list[FloatArray] = field(default_factory=list)
    moving: bool = False
    course: Course | None = None
    parameters: MotionParameters = field(default=DEFAULT, repr=False)

    def start(self, stamp_ns: int, centroid_map: FloatArray) -> None:
        """Take in a detection (3,) of a new object; no step leads to it yet."""
        if self.course is None:
            self.course = first_course(stamp_ns, centroid_map[:2], self.parameters)

    def add_detection(self, stamp_ns: int, centroid_map: FloatArray, overlap: float, size_m: float) -> None:
        """Take in a detection: (3,) centroid, share of it that lies on the known cloud, size of what was seen.

        Detections of one moment by several cameras, each of another side, are one: their mean.
        """
        place, parameters = centroid_map[:2], self.parameters
        if self.course is None:
            self.course = first_course(stamp_ns, place, parameters)
        else:
            self.course = self.course.updated(stamp_ns, place)
        if self.stamps_ns and self.stamps_ns[-1] == stamp_ns:
            self.centroids = [*self.centroids[:-1], (self.centroids[-1] + centroid_map) / 2]
        else:
            self.stamps_ns = [*self.stamps_ns, stamp_ns][-parameters.recent_detections :]
            self.centroids = [*self.centroids, centroid_map][-parameters.recent_detections :]
        if len(self.centroids) < parameters.recent_detections - 1:
            return
        steps = np.diff(np.array(self.centroids), axis=0)
        travelled = float(np.linalg.norm(np.sum(steps, axis=0)))
        wandered = float(np.linalg.norm(steps, axis=1).sum())
        straight = travelled > parameters.straightness * wandered
        if not self.moving:
            least_m = max(parameters.min_travel_m, parameters.min_travel_share * size_m)
            self.moving = straight and travelled > least_m and overlap < parameters.max_overlap
        else:
            self.moving = wandered > parameters.resting_step_m * (len(self.centroids) - 1)
