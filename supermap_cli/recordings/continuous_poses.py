"""Odometry that steps farther than any body can move: its frame has jumped, and the poses after it are brought back.

A frame of odometry is continuous (REP-105). Where a driver starts anew, a filter resets or a match fails it is not, and
later poses are wrong by the jump. Locally the motion is known all the same: a body goes on about as it went before, to
within half its acceleration times the time squared. A frame of a map jumps rightly, when localization has corrected
itself or a loop was closed; its poses are taken as they are.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import interpolate_transform, inverse, make_transform, rotation_angle_rad
from supermap_cli.types.sensing import StampedPose

LARGEST_ACCELERATION, LARGEST_TURN_ACCELERATION = 20.0, 50.0
"""m/s^2 and rad/s^2: 2 g is more than wheels, legs and hands give; a wrist turns a camera at up to some 30 rad/s^2."""

JUMP_SLACK_M, JUMP_SLACK_RAD = 0.1, float(np.radians(2.0))
"""m and rad; less than this is left to the drift correction, which follows what grows slowly (estimate)."""

JITTER_TIMES = 6.0
"""A jump is at least this many times the median of what the last steps deviated by: a pose that jitters does not
jump (estimate).
"""

MOST_JITTER_M, MOST_JITTER_RAD = 0.5, float(np.radians(10.0))
"""m and rad; what deviates by more is no jitter: it would double a chair (estimate)."""

REMEMBERED_STEPS = 100
"""Steps whose deviations and lengths in time are remembered: some seconds."""

LONGEST_STEP_S = 1.0
"""s; beyond it nobody knows how a body went on, and the poses are taken as they are (`Trajectory.max_gap_s`)."""


@dataclass(frozen=True)
class PoseJump:
    """How far a pose deviates from where the body must be: metres and degrees."""

    distance_m: float
    turn_deg: float


class ContinuousPoses:
    """Takes poses in the order of time. A pose that is repeated to the bit is no step: it was not measured anew."""

    def __init__(self) -> None:
        self._T_continuous_raw: FloatArray = np.eye(4)
        self._jumped = False
        self._last: StampedPose | None = None
        self._received_ns = 0
        self._step: FloatArray | None = None
        self._step_s = 1.0
        self._steps_s: deque[float] = deque(maxlen=REMEMBERED_STEPS)
        self._deviations_m: deque[float] = deque(maxlen=REMEMBERED_STEPS)
        self._deviations_rad: deque[float] = deque(maxlen=REMEMBERED_STEPS)

    def add(self, pose: StampedPose) -> tuple[StampedPose, PoseJump | None]:
        """The pose in the frame of the first one, and its jump if it is one. Its stamp is later than the last one's."""
        T, last = self._T_continuous_raw @ pose.T_odom_base, self._last
        silent_s, self._received_ns = (pose.stamp_ns - self._received_ns) / 1e9, pose.stamp_ns
        if last is None or np.array_equal(T, last.T_odom_base):
            self._last = self._last or pose
            return self._moved(pose, T), None
        waited_s = (pose.stamp_ns - last.stamp_ns) / 1e9
        usual_s = float(np.median(self._steps_s)) if self._steps_s else waited_s
        rested = waited_s > 2 * usual_s and silent_s < waited_s / 2
        elapsed_s = max(usual_s, silent_s) if rested else waited_s
        expected = last.T_odom_base if rested or self._step is None else self._gone_on(last.T_odom_base, elapsed_s)
        jump = None if self._step is None or elapsed_s > LONGEST_STEP_S else self._jump(expected, T, elapsed_s)
        if jump is not None:
            self._jumped = True
            self._T_continuous_raw = _level_step(T, expected) @ self._T_continuous_raw
            T = self._T_continuous_raw @ pose.T_odom_base
        else:
            self._step, self._step_s = inverse(last.T_odom_base) @ T, elapsed_s
        self._steps_s.append(waited_s)
        self._last = StampedPose(pose.stamp_ns, T)
        return self._moved(pose, T), jump

    def _moved(self, pose: StampedPose, T: FloatArray) -> StampedPose:
        if not self._jumped:
            return pose
        R = self._T_continuous_raw[:3, :3]
        turn = np.kron(np.eye(2), R)
        return StampedPose(
            pose.stamp_ns, T, None if pose.covariance is None else np.asarray(turn @ pose.covariance @ turn.T)
        )

    def _gone_on(self, T_odom_base: FloatArray, elapsed_s: float) -> FloatArray:
        """Where the body is if it goes on as in its last step."""
        assert self._step is not None  # noqa: S101 - `add` looks
        share = elapsed_s / self._step_s
        step = interpolate_transform(np.eye(4), self._step, min(share, 1.0))
        step[:3, 3] = share * self._step[:3, 3]
        return T_odom_base @ step

    def _jump(self, expected: FloatArray, T: FloatArray, elapsed_s: float) -> PoseJump | None:
        distance_m = float(np.linalg.norm(T[:3, 3] - expected[:3, 3]))
        turn_rad = rotation_angle_rad(T[:3, :3] @ expected[:3, :3].T)
        squared = elapsed_s**2 / 2
        most_m = LARGEST_ACCELERATION * squared + _usual(self._deviations_m, JUMP_SLACK_M, MOST_JITTER_M)
        most_rad = LARGEST_TURN_ACCELERATION * squared + _usual(self._deviations_rad, JUMP_SLACK_RAD, MOST_JITTER_RAD)
        self._deviations_m.append(distance_m)
        self._deviations_rad.append(turn_rad)
        if distance_m <= most_m and turn_rad <= most_rad:
            return None
        return PoseJump(distance_m, float(np.degrees(turn_rad)))


def _usual(deviations: deque[float], least: float, most: float) -> float:
    """What a step deviates by without a jump."""
    return float(np.clip(JITTER_TIMES * np.median(deviations), least, most)) if deviations else least


def _level_step(T_from: FloatArray, T_to: FloatArray) -> FloatArray:
    """The turn about the vertical and the shift that take one pose's place to another's: level stays level."""
    R = T_to[:3, :3] @ T_from[:3, :3].T
    heading = np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])
    cos, sin = np.cos(heading), np.sin(heading)
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
    return make_transform(turn, T_to[:3, 3] - turn @ T_from[:3, 3])
