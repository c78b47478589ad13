"""The robot's trajectory: a stream of poses, interpolated at any stamp."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from supermap_cli.errors import OdometryError
from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.se3 import make_transform, quaternion_xyzw_from_rotation

_INITIAL_CAPACITY = 256
"""Poses that the arrays hold at first; they double when full."""


class TimedPose(Protocol):
    """`T_odom_base` at a sensor time, as in `types.sensing.StampedPose`."""

    @property
    def stamp_ns(self) -> int:
        """Sensor time."""
        ...

    @property
    def T_odom_base(self) -> FloatArray:
        """The pose (4, 4)."""
        ...


@dataclass(frozen=True)
class PackedPose:
    """A pose as a trajectory keeps it: moved to another trajectory it stays the same to the bit."""

    stamp_ns: int
    position: FloatArray
    rotation_xyzw: FloatArray

    @property
    def T_odom_base(self) -> FloatArray:
        """The pose (4, 4)."""
        return make_transform(_rotation_matrices(self.rotation_xyzw[None])[0], self.position)


class Trajectory:
    """Poses over time, pulled from their source only as far as later stamps are asked for.

    Between two poses the rotation is interpolated by SLERP, the translation linearly. Before the first and after the
    last pose, and at both ends of a gap longer than `max_gap_s`, the nearest pose holds for `hold_s`; beyond there is
    none. What was pulled is kept in packed arrays (64 bytes a pose), so that earlier stamps can be asked for again.

    Poses may be pushed instead (`append`), and forgotten when they are not needed any more (`forget_before`).

    Raises `OdometryError` while pulling, from the source itself or when it does not go forward in time.
    """

    def __init__(self, poses: Iterable[TimedPose] = (), *, max_gap_s: float = 1.0, hold_s: float = 0.1) -> None:
        self._source = iter(poses)
        self._exhausted = False
        self._max_gap_ns = round(max_gap_s * 1e9)
        self._hold_ns = round(hold_s * 1e9)
        self._count = 0
        self._stamps_ns: IntArray = np.empty(_INITIAL_CAPACITY, np.int64)
        self._positions: FloatArray = np.empty((_INITIAL_CAPACITY, 3))
        self._rotations_xyzw: FloatArray = np.empty((_INITIAL_CAPACITY, 4))

    def __len__(self) -> int:
        """How many poses have been pulled so far."""
        return self._count

    def at(self, stamp_ns: int) -> FloatArray | None:
        """`T_odom_base` (4, 4) at a stamp, or `None` where there is no pose."""
        transforms, valid = self.at_many(np.array([stamp_ns], np.int64))
        return transforms[0] if valid[0] else None

    def at_many(self, stamps_ns: IntArray) -> tuple[FloatArray, BoolArray]:
        """`T_odom_base` (n, 4, 4) at n stamps in any order (the identity where there is none), and (n,) where it is."""
        transforms = np.tile(np.eye(4), (len(stamps_ns), 1, 1))
        if not len(stamps_ns):
            return transforms, np.zeros(0, bool)
        self._pull_beyond(int(stamps_ns.max()))
        valid = np.zeros(len(stamps_ns), bool)
        if not self._count:
            return transforms, valid
        known_ns = self._stamps_ns[: self._count]
        after = np.searchsorted(known_ns, stamps_ns, side="left")
        start, end = np.maximum(after - 1, 0), np.minimum(after, self._count - 1)
        gap_ns = known_ns[end] - known_ns[start]
        to_start_ns, to_end_ns = np.abs(stamps_ns - known_ns[start]), np.abs(known_ns[end] - stamps_ns)
        held = np.minimum(to_start_ns, to_end_ns) <= self._hold_ns
        bridged = (start != end) & (gap_ns <= self._max_gap_ns)
        valid = held | bridged
        nearest = np.where(to_start_ns <= to_end_ns, start, end)
        start, end = np.where(bridged, start, nearest), np.where(bridged, end, nearest)
        gap_ns = known_ns[end] - known_ns[start]
        fraction = np.where(gap_ns > 0, (stamps_ns - known_ns[start]) / np.maximum(gap_ns, 1), 0.0)
        rotations = _slerp_xyzw(self._rotations_xyzw[start], self._rotations_xyzw[end], fraction)
        positions = self._positions[start] + fraction[:, None] * (self._positions[end] - self._positions[start])
        transforms[valid, :3, :3] = _rotation_matrices(rotations[valid])
        transforms[valid, :3, 3] = positions[valid]
        return transforms, valid

    @property
    def newest_ns(self) -> int | None:
        """The stamp of the last pose that is known so far; `None` before the first."""
        return int(self._stamps_ns[self._count - 1]) if self._count else None

    def append(self, pose: TimedPose) -> None:
        """Add a pose after those that are known. Raises `OdometryError` where it does not go forward in time."""
        self._append(pose)

    def forget_before(self, stamp_ns: int) -> None:
        """Drop the poses that no stamp from here on needs: all but the last one before it."""
        first = max(int(np.searchsorted(self._stamps_ns[: self._count], stamp_ns, side="right")) - 1, 0)
        if first > len(self._stamps_ns) // 2:
            kept = slice(first, self._count)
            for array in (self._stamps_ns, self._positions, self._rotations_xyzw):
                array[: self._count - first] = array[kept].copy()
            self._count -= first

    def stamps_ns(self) -> IntArray:
        """(n,) stamps of all poses, ascending; pulls the source to its end."""
        self._pull_beyond(None)
        return self._stamps_ns[: self._count].copy()

    def poses(self) -> Iterator[PackedPose]:
        """All poses; pulls the source as they are asked for."""
        index = 0
        while True:
            if index == self._count and not self._pull_one():
                return
            yield PackedPose(
                int(self._stamps_ns[index]), self._positions[index].copy(), self._rotations_xyzw[index].copy()
            )
            index += 1

    def _pull_beyond(self, stamp_ns: int | None) -> None:
        """Pull until a pose at or after the stamp is known; everything, if it is `None`."""
        while not self._exhausted and (
            stamp_ns is None or not self._count or self._stamps_ns[self._count - 1] < stamp_ns
        ):
            self._pull_one()

    def _pull_one(self) -> bool:
        """Pull one pose; says whether there was one."""
        pose = None if self._exhausted else next(self._source, None)
        if pose is None:
            self._exhausted = True
            return False
        self._append(pose)
        return True

    def _append(self, pose: TimedPose) -> None:
        last_ns = int(self._stamps_ns[self._count - 1]) if self._count else None
        if last_ns is not None and pose.stamp_ns <= last_ns:
            raise OdometryError(
                f"the odometry does not go forward in time: {pose.stamp_ns} ns after {last_ns} ns",
                cure="choose another odometry source with --odometry",
            )
        if self._count == len(self._stamps_ns):
            self._stamps_ns = np.concatenate([self._stamps_ns, np.empty_like(self._stamps_ns)])
            self._positions = np.concatenate([self._positions, np.empty_like(self._positions)])
            self._rotations_xyzw = np.concatenate([self._rotations_xyzw, np.empty_like(self._rotations_xyzw)])
        self._stamps_ns[self._count] = pose.stamp_ns
        if isinstance(pose, PackedPose):
            self._positions[self._count], self._rotations_xyzw[self._count] = pose.position, pose.rotation_xyzw
        else:
            self._positions[self._count] = pose.T_odom_base[:3, 3]
            self._rotations_xyzw[self._count] = quaternion_xyzw_from_rotation(pose.T_odom_base[:3, :3])
        self._count += 1


def _slerp_xyzw(q_start_xyzw: FloatArray, q_end_xyzw: FloatArray, fraction: FloatArray) -> FloatArray:
    """Spherical linear interpolation (Shoemake 1985) of (n, 4) quaternions by (n,) fractions, the shorter way."""
    dot = np.einsum("ij,ij->i", q_start_xyzw, q_end_xyzw)
    q_end = np.where(dot[:, None] < 0, -q_end_xyzw, q_end_xyzw)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(angle)
    straight = sine < 1e-6
    divisor = np.where(straight, 1.0, sine)
    w_start = np.where(straight, 1 - fraction, np.sin((1 - fraction) * angle) / divisor)
    w_end = np.where(straight, fraction, np.sin(fraction * angle) / divisor)
    q = w_start[:, None] * q_start_xyzw + w_end[:, None] * q_end
    normalised: FloatArray = q / np.linalg.norm(q, axis=1, keepdims=True)
    return normalised


def _rotation_matrices(q_xyzw: FloatArray) -> FloatArray:
    """Rotations (n, 3, 3) of unit quaternions (n, 4)."""
    x, y, z, w = q_xyzw.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows, np.float64), 2, 0)


__all__ = ["PackedPose", "TimedPose", "Trajectory"]
