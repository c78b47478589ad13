"""Which of two clocks a sensor runs by, told by turns: those that it saw itself against those of the odometry.

A LiDAR whose stamps lie seconds before the camera's has another clock, or its sweeps were processed for seconds before
they were recorded. Times of recording are the same for both; how the robot turned at the stamps is not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from supermap_cli.errors import CalibrationError, RecordingError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import interpolate_transform, rotation_angle_rad
from supermap_cli.recordings import messages
from supermap_cli.recordings.messages import PoseMessage
from supermap_cli.recordings.motion import PoseSource
from supermap_cli.recordings.pointclouds import read_points
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.transforms import Edge, TransformTree
from supermap_cli.recordings.window import RecordedData

_MOMENTS = 32
"""Moments of a recording at which turns are measured: 64 sweeps, a second of work."""

_TURN_NS = 600_000_000
"""ns over which a turn is measured: 10 degrees at a slow 0.3 rad/s, and hardly any way of the robot."""

_SWEEPS_A_TURN = 2.5
"""Periods of a sensor that its turns last at least, so that they have two sweeps."""

_AROUND_NS = 200_000_000
"""ns around a stamp in which poses are read to interpolate: odometry comes at 10 Hz and more."""

_TELLING_RAD = float(np.deg2rad(3.0))
"""A turn tells the clocks apart if the odometry turned by so much more at one time than at the other: three times what
a turn between two sweeps is measured to (estimate).
"""

_LEAST_TELLING, _AGREEING, _CLEAR = 5, 0.8, 1 / 3
"""How many turns must tell, which share of them must agree on the clock, and the share of what separates the clocks
that they may be off at the median. By chance one in several hundred recordings gets as far.
"""

_BINS = 360
"""Bins of azimuth of a sweep's profile, one degree each."""

_LARGEST_BINS = 60
"""Bins by which sweeps are turned against each other at most: 100 degrees a second are few robots'."""

_LEAST_BINS = 45
"""Bins in which both sweeps must have seen something."""

_NEAREST_M, _LARGEST_SLOPE = 0.3, 0.27
"""Metres from which returns are of the surroundings, and the slope (15 degrees) up to which they are of walls."""

_LARGEST_STEP = 0.5
"""Difference of logarithms of range at which the difference of two profiles ends: another surface is in between."""

_LEAST_SHAPE = 0.01
"""Difference of logarithms of range, at the median turn, of surroundings that have a shape: 1 % of the range, which is
what sensors err by.
"""

_DISTINCT = 0.7
"""The best turn of two sweeps leaves at most this share of what the others leave, else the surroundings are round."""

Poses = list[tuple[int, FloatArray]]


@dataclass(frozen=True)
class Turn:
    """By how many radians a sensor turned between two of its stamps, whatever about."""

    start_ns: int
    end_ns: int
    angle_rad: float


@dataclass(frozen=True)
class MotionClock:
    """Compares a LiDAR's or an IMU's turns with those of the odometry, whose clock is the camera's."""

    data: RecordedData
    source: PoseSource
    tree: TransformTree
    base_frame: str
    transforms: tuple[Topic, ...]

    def is_off(self, topic: Topic, shift_ns: int) -> bool | None:
        """Whether a topic's stamps are those of the odometry only if `shift_ns` is added to them: False where they are
        right as they are, `None` where the motion does not tell.
        """
        turns = list(self._turns(topic)) if topic.kind in {"points", "imu"} else []
        compared = [(turn.angle_rad, self._turned(turn, 0), self._turned(turn, shift_ns)) for turn in turns]
        told = np.array([each for each in compared if None not in each], float).reshape(-1, 3)
        told = told[np.abs(told[:, 1] - told[:, 2]) > _TELLING_RAD]
        if len(told) < _LEAST_TELLING:
            return None
        errors = np.abs(told[:, 1:] - told[:, :1])
        off = bool(np.median(errors[:, 1]) < np.median(errors[:, 0]))
        better, worse = errors[:, int(off)], errors[:, int(not off)]
        apart_rad = np.abs(told[:, 1] - told[:, 2])
        agreeing = np.mean(better < worse)
        clear = np.median(better) < _CLEAR * np.median(apart_rad)
        return off if agreeing >= _AGREEING and clear else None

    def _turns(self, topic: Topic) -> Iterator[Turn]:
        """The sensor's turns at moments over the recording's length."""
        storage = self.data.storage
        length_ns = storage.end_ns - storage.start_ns
        lasts_ns = max(_TURN_NS, round(_SWEEPS_A_TURN * length_ns / max(topic.channel.count, 1)))
        for at_ns in np.linspace(storage.start_ns, storage.end_ns - lasts_ns, _MOMENTS).astype(np.int64).tolist():
            turn = (self._lidar_turn if topic.kind == "points" else self._imu_turn)(topic, at_ns, at_ns + lasts_ns)
            if turn is not None:
                yield turn

    def _lidar_turn(self, topic: Topic, start_ns: int, end_ns: int) -> Turn | None:
        """The turn between the first and the last sweep that was recorded within two log times."""
        raws = list(self.data.storage.messages([topic.name], start_ns, end_ns))
        if len(raws) < 2:
            return None
        try:
            first, last = (read_points(raw, self.data.decoder) for raw in (raws[0], raws[-1]))
        except RecordingError:
            return None
        angle_rad = turn_between(first.points, last.points)
        return None if angle_rad is None else Turn(first.stamp_ns, last.stamp_ns, abs(angle_rad))

    def _imu_turn(self, topic: Topic, start_ns: int, end_ns: int) -> Turn | None:
        """The mean angular rate times the time."""
        raws = self.data.storage.messages([topic.name], start_ns, end_ns)
        read = [imu for _, imu in self.data.decoder.each(raws, messages.read_imu)]
        if len(read) < 2:
            return None
        rate = float(np.linalg.norm(np.mean([imu.angular_rate for imu in read], axis=0)))
        return Turn(read[0].stamp_ns, read[-1].stamp_ns, rate * (read[-1].stamp_ns - read[0].stamp_ns) / 1e9)

    def _turned(self, turn: Turn, shift_ns: int) -> float | None:
        """By how much the odometry turned meanwhile, the stamps shifted; `None` where it does not say."""
        ends = [self._pose(stamp_ns + shift_ns) for stamp_ns in (turn.start_ns, turn.end_ns)]
        first, last = ends
        return None if first is None or last is None else rotation_angle_rad(first[:3, :3].T @ last[:3, :3])

    def _pose(self, stamp_ns: int) -> FloatArray | None:
        poses = sorted(self._poses(stamp_ns), key=lambda each: each[0])
        before = [each for each in poses if each[0] <= stamp_ns]
        after = [each for each in poses if each[0] >= stamp_ns]
        if not before or not after:
            return None
        (start_ns, T_start), (end_ns, T_end) = before[-1], after[0]
        share = (stamp_ns - start_ns) / (end_ns - start_ns) if end_ns > start_ns else 0.0
        return interpolate_transform(T_start, T_end, share)

    def _poses(self, stamp_ns: int) -> Poses:
        """What tells the robot's heading around a stamp."""
        topic = self.source.topic
        topics = [topic] if topic is not None else list(self.transforms)
        read: list[PoseMessage] = []
        for each in topics:
            log_ns = stamp_ns - each.clock_offset_ns
            raws = self.data.storage.messages([each.name], log_ns - _AROUND_NS, log_ns + _AROUND_NS)
            if topic is not None:
                read += [pose for _, pose in self.data.decoder.each(raws, messages.read_pose)]
            else:
                edge = self._moving_edge()
                told = (pose for _, poses in self.data.decoder.each(raws, messages.read_transforms) for pose in poses)
                read += [pose for pose in told if edge and _is_of(pose, edge)]
        return [(pose.stamp_ns, T) for pose in read if (T := pose.transform()) is not None]

    def _moving_edge(self) -> Edge | None:
        """The one link of TF that moves between odom and base; `None` where several do."""
        try:
            _, chain = self.tree.path(self.source.odom_frame, self.base_frame)
        except CalibrationError:
            return None
        moving = [edge for edge in chain if not edge.static]
        return moving[0] if len(moving) == 1 else None


def turn_between(first: FloatArray, second: FloatArray) -> float | None:
    """Radians by which the profile of a sweep (n, 3) is turned about z against that of another; `None` if unclear."""
    a, b = _profile(first), _profile(second)
    turns = np.arange(-_LARGEST_BINS, _LARGEST_BINS + 1)
    turned = np.stack([np.roll(b, turn) for turn in turns])
    both = np.isfinite(a)[None, :] & np.isfinite(turned)
    counts = both.sum(axis=1)
    differences = np.where(both, np.minimum(np.abs(np.where(both, turned - a[None, :], 0.0)), _LARGEST_STEP), 0.0)
    costs = np.where(counts >= _LEAST_BINS, differences.sum(axis=1) / np.maximum(counts, 1), np.inf)
    best = int(np.argmin(costs))
    usual = np.median(costs[np.isfinite(costs)]) if np.isfinite(costs[best]) else 0.0
    if usual < _LEAST_SHAPE or costs[best] > _DISTINCT * usual:
        return None
    offset = 0.0
    if 0 < best < len(turns) - 1 and np.isfinite(costs[best - 1 : best + 2]).all():
        left, middle, right = costs[best - 1 : best + 2]
        curve = left - 2 * middle + right
        offset = 0.5 * float((left - right) / curve) if curve > 0 else 0.0
    return float((turns[best] + offset) * 2 * np.pi / _BINS)


def _profile(points: FloatArray) -> FloatArray:
    """(360,) the logarithm of the range to the nearest wall in each degree of azimuth; NaN where there is none."""
    ranges = np.hypot(points[:, 0], points[:, 1])
    kept = (ranges > _NEAREST_M) & (np.abs(points[:, 2]) < _LARGEST_SLOPE * ranges)
    azimuth = np.arctan2(points[kept, 1], points[kept, 0])
    bins = np.floor((azimuth + np.pi) / (2 * np.pi) * _BINS).astype(np.int64) % _BINS
    nearest = np.full(_BINS, np.inf)
    np.minimum.at(nearest, bins, ranges[kept])
    return np.where(np.isfinite(nearest), np.log(np.where(np.isfinite(nearest), nearest, 1.0)), np.nan)


def _is_of(pose: PoseMessage, edge: Edge) -> bool:
    return (pose.frame_id, pose.child_frame_id) == (edge.parent, edge.child)
