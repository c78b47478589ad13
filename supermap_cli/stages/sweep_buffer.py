"""The latest LiDAR sweeps: what they returned around an image's stamp becomes the image's depth."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.mapping.lidar_depth import deskew_to_odom, draw_returns
from supermap_cli.types.sensing import CameraFrame, Sweep

HALF_WINDOW_NS = 150_000_000
"""ns; how far a return's own time may lie from the image's: a spinning LiDAR at 10 Hz sees everything once within."""

LONGEST_SWEEP_NS = 200_000_000
"""ns; the time a sweep may take: a LiDAR at 5 Hz, the slowest rate that common drivers set."""

NEAREST_RANGE_M = 0.3
"""m; nearer returns are the robot itself."""


class SweepBuffer:
    """Sweeps by ascending stamp, deskewed once each with the trajectory's poses."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self._sweeps: deque[Sweep] = deque()
        self._points_odom: dict[tuple[str, int], FloatArray] = {}
        self._newest_ns: int | None = None

    def add(self, sweep: Sweep) -> None:
        """The next sweep."""
        self._sweeps.append(sweep)
        self._newest_ns = sweep.stamp_ns

    def is_complete(self, stamp_ns: int) -> bool:
        """Whether all returns about a stamp have come, and poses for each of them."""
        newest_pose_ns = self._trajectory.newest_ns
        if self._newest_ns is None or self._newest_ns <= stamp_ns + HALF_WINDOW_NS:
            return False
        if newest_pose_ns is None or newest_pose_ns < stamp_ns:
            return False
        return all(int(sweep.point_stamps_ns.max(initial=0)) <= newest_pose_ns for sweep in self._about(stamp_ns))

    def complete(self, frame: CameraFrame) -> CameraFrame:
        """The frame with the returns about its stamp, and the depth image they make."""
        returns = self.returns_about(frame.stamp_ns, frame.T_base_camera)
        return replace(frame, depth_m=draw_returns(frame.camera, returns), returns_camera=returns)

    def returns_about(self, stamp_ns: int, T_base_camera: FloatArray) -> FloatArray:
        """(n, 3) returns in the camera's frame as it stood at the stamp; none beyond the trajectory."""
        T_odom_base, known = self._trajectory.at_many(np.array([stamp_ns], np.int64))
        if not known[0]:
            return np.zeros((0, 3))
        near = [self._near_in_odom(sweep, stamp_ns) for sweep in self._about(stamp_ns)]
        points = transform_points(inverse(T_odom_base[0] @ T_base_camera), np.concatenate([np.zeros((0, 3)), *near]))
        far_enough: BoolArray = np.einsum("ij,ij->i", points, points) > NEAREST_RANGE_M**2
        return points[far_enough]

    def nearest(self, stamp_ns: int) -> Sweep | None:
        """The sweep nearest in time, within half a window."""
        about = self._about(stamp_ns)
        found = min(about, key=lambda sweep: abs(sweep.stamp_ns - stamp_ns), default=None)
        return found if found is not None and abs(found.stamp_ns - stamp_ns) <= HALF_WINDOW_NS else None

    def forget_before(self, stamp_ns: int) -> None:
        """Drop the sweeps that no image from this stamp on needs."""
        while self._sweeps and self._sweeps[0].stamp_ns < stamp_ns - HALF_WINDOW_NS - LONGEST_SWEEP_NS:
            self._points_odom.pop(_key(self._sweeps.popleft()), None)

    def _about(self, stamp_ns: int) -> list[Sweep]:
        first_ns, last_ns = stamp_ns - HALF_WINDOW_NS - LONGEST_SWEEP_NS, stamp_ns + HALF_WINDOW_NS
        return [sweep for sweep in self._sweeps if first_ns <= sweep.stamp_ns <= last_ns]

    def _near_in_odom(self, sweep: Sweep, stamp_ns: int) -> FloatArray:
        """(n, 3) those points of a sweep in odom that returned within the window."""
        near = np.abs(sweep.point_stamps_ns - stamp_ns) <= HALF_WINDOW_NS
        points = self._in_odom(sweep) if near.any() else None
        return np.zeros((0, 3)) if points is None else points[near]

    def _in_odom(self, sweep: Sweep) -> FloatArray | None:
        points = self._points_odom.get(_key(sweep))
        if points is None:
            points = deskew_to_odom(sweep, self._trajectory.at_many)
            if points is not None:
                self._points_odom[_key(sweep)] = points
        return points


def _key(sweep: Sweep) -> tuple[str, int]:
    """Which sweep it is: two LiDARs may share a stamp."""
    return sweep.frame_id, sweep.stamp_ns
