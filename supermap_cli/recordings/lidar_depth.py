"""What a LiDAR saw around an image's stamp: returns, deskewed with the trajectory, and a depth image drawn of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.types.sensing import CameraFrame, Sweep

PosesAt = Callable[[IntArray], tuple[FloatArray, BoolArray]]
"""`T_odom_base` (n, 4, 4) at n stamps, and (n,) which of them the trajectory reaches."""

_KNOTS = 11
"""Moments of a sweep, evenly spread, at which the pose is looked up: every 10 ms at 10 Hz."""

_LONGEST_SWEEP_NS = 200_000_000
"""ns a sweep may last, 5 Hz; older ones are dropped from the window."""

_CELL_PX = 16
"""Pixels of a side of the cells in which returns are counted; set by hand, so that several returns fall on one."""

_LARGEST_SPLAT_RAD = 0.037
"""rad that a return covers at most, 2.1 degrees: the rings of a 16-ring LiDAR (VLP-16) are 2.0 degrees apart."""

_SAME_SURFACE = 0.05
"""Share of the range by which both sides of a gap may differ to be one surface; set by hand."""

_NEAREST_RANGE_M = 0.3
"""m; nearer returns are of the robot itself or noise; set by hand."""


def deskew_to_odom(sweep: Sweep, T_odom_base_at: PosesAt) -> FloatArray | None:
    """(n, 3) points of a sweep in odom, each moved by the pose at its own stamp; `None` without any pose.

    Poses are asked for at 11 moments of the sweep; between two of them a point moves on the chord (where the robot
    turns by 0.1 rad in a sweep, less than 2e-5 of the range off the arc).
    """
    stamps = sweep.point_stamps_ns
    if not len(stamps):
        return np.zeros((0, 3))
    first, last = int(stamps.min()), int(stamps.max())
    knots_ns = np.unique(np.linspace(first, last, _KNOTS).round().astype(np.int64))
    T_odom_base, known = T_odom_base_at(knots_ns)
    if not known.any():
        return None
    T_odom_lidar: FloatArray = T_odom_base[known] @ sweep.T_base_lidar
    at = knots_ns[known]
    if len(at) == 1:
        return transform_points(T_odom_lidar[0], sweep.points_lidar)
    left = (np.searchsorted(at, stamps, side="right") - 1).clip(0, len(at) - 2)
    fraction = ((stamps - at[left]) / (at[left + 1] - at[left])).clip(0, 1)[:, None]
    points_odom = np.empty_like(sweep.points_lidar)
    for knot in range(len(at) - 1):
        those = left == knot
        start = transform_points(T_odom_lidar[knot], sweep.points_lidar[those])
        end = transform_points(T_odom_lidar[knot + 1], sweep.points_lidar[those])
        points_odom[those] = start + fraction[those] * (end - start)
    return points_odom


def deskew_sweep(sweep: Sweep, T_odom_base_at: PosesAt, stamp_ns: int) -> FloatArray | None:
    """(n, 3) points of a sweep in the base frame as it stood at `stamp_ns`; `None` beyond the trajectory."""
    T_odom_base, known = T_odom_base_at(np.array([stamp_ns], np.int64))
    points_odom = deskew_to_odom(sweep, T_odom_base_at) if known[0] else None
    return None if points_odom is None else transform_points(inverse(T_odom_base[0]), points_odom)


class SweepDepth:
    """Depth for one camera image after the other, in ascending order of their stamps.

    `half_window_s` is how far a return's own time may lie from the image's; only the sweeps of that window are kept.
    """

    def __init__(self, sweeps: Iterable[Sweep], T_odom_base_at: PosesAt, half_window_s: float = 0.15) -> None:
        self._sweeps = iter(sweeps)
        self._T_odom_base_at = T_odom_base_at
        self._half_window_ns = round(half_window_s * 1e9)
        self._window: deque[Sweep] = deque()
        self._points_odom: dict[int, FloatArray] = {}
        self._next: Sweep | None = next(self._sweeps, None)

    def complete(self, frame: CameraFrame) -> CameraFrame:
        """The frame with the LiDAR's returns about its stamp, and the depth image they make."""
        returns = self.returns_for(frame.stamp_ns, frame.T_base_camera)
        return replace(frame, depth_m=draw_returns(frame.camera, returns), returns_camera=returns)

    def depth_for(self, stamp_ns: int, camera: Camera, T_base_camera: FloatArray) -> Float32Array:
        """(h, w) float32 in the measure of the camera, 0 = no return (everywhere, beyond the trajectory)."""
        return draw_returns(camera, self.returns_for(stamp_ns, T_base_camera))

    def returns_for(self, stamp_ns: int, T_base_camera: FloatArray) -> FloatArray:
        """(n, 3) returns in the camera's frame as it stood at the stamp; none beyond the trajectory."""
        self._move_to(stamp_ns)
        T_odom_base, known = self._T_odom_base_at(np.array([stamp_ns], np.int64))
        if not known[0]:
            return np.zeros((0, 3))
        near = [self._near_in_odom(sweep, stamp_ns) for sweep in self._window]
        points = transform_points(inverse(T_odom_base[0] @ T_base_camera), np.concatenate([np.zeros((0, 3)), *near]))
        far_enough: BoolArray = np.einsum("ij,ij->i", points, points) > _NEAREST_RANGE_M**2
        return points[far_enough]

    def _move_to(self, stamp_ns: int) -> None:
        reach = self._half_window_ns
        while self._next is not None and self._next.stamp_ns <= stamp_ns + reach:
            self._window.append(self._next)
            self._next = next(self._sweeps, None)
        while self._window and self._window[0].stamp_ns < stamp_ns - reach - _LONGEST_SWEEP_NS:
            self._points_odom.pop(self._window.popleft().stamp_ns, None)

    def _near_in_odom(self, sweep: Sweep, stamp_ns: int) -> FloatArray:
        """(n, 3) those points of a sweep in odom that returned within the window."""
        near = np.abs(sweep.point_stamps_ns - stamp_ns) <= self._half_window_ns
        points = self._in_odom(sweep) if near.any() else None
        return np.zeros((0, 3)) if points is None else points[near]

    def _in_odom(self, sweep: Sweep) -> FloatArray | None:
        points = self._points_odom.get(sweep.stamp_ns)
        if points is None:
            points = deskew_to_odom(sweep, self._T_odom_base_at)
            if points is not None:
                self._points_odom[sweep.stamp_ns] = points
        return points


def draw_returns(camera: Camera, points_camera: FloatArray) -> Float32Array:
    """(n, 3) returns as a depth image (h, w), 0 = none: each as large as they are wide-meshed there, the nearest on
    top.

    The mesh follows from how many fall on the 16-pixel cells about one, up to 2 degrees; what then is left open, as
    between the rings of a spinning LiDAR, is closed where both sides are on one surface.
    """
    drawn = np.zeros((camera.height, camera.width), np.float32)
    pixels, on_image = camera.project(points_camera)
    if not on_image.any():
        return drawn
    u, v = np.rint(pixels[on_image]).astype(np.int64).T
    u, v = u.clip(0, camera.width - 1), v.clip(0, camera.height - 1)
    largest = max(1, round(_LARGEST_SPLAT_RAD * camera.focal_px()))
    top = max(0, int(v.min()) - largest) // _CELL_PX * _CELL_PX
    bottom = min(camera.height, int(v.max()) + largest + 1)
    v -= top
    single = np.full((bottom - top, camera.width), np.inf, np.float32)
    np.minimum.at(single.ravel(), v * camera.width + u, camera.depth_of(points_camera[on_image]).astype(np.float32))
    margin = largest if camera.full_turn else 0
    around = cv2.copyMakeBorder(single, 0, 0, margin, margin, cv2.BORDER_WRAP)
    reach = cv2.copyMakeBorder(_reach_px(u, v, single.shape, largest), 0, 0, margin, margin, cv2.BORDER_WRAP)
    depth = _grown(around, reach)
    depth[np.isinf(depth)] = 0
    depth = close_gaps(close_gaps(depth, largest).T, largest).T
    drawn[top:bottom] = depth[:, margin : margin + camera.width]
    return drawn


def _reach_px(u: IntArray, v: IntArray, shape: tuple[int, int], largest_px: int) -> NDArray[np.uint8]:
    """(h, w) how many pixels a return reaches to every side, so that they touch one another where they are even."""
    height, width = shape
    rows, columns = -(-height // _CELL_PX), -(-width // _CELL_PX)
    counts = np.bincount(v // _CELL_PX * columns + u // _CELL_PX, minlength=rows * columns).reshape(rows, columns)
    mesh_px = _CELL_PX / np.sqrt(np.maximum(counts, 1))
    reach = np.ceil((mesh_px - 1) / 2).clip(0, largest_px // 2).astype(np.uint8)
    return np.repeat(np.repeat(reach, _CELL_PX, axis=0), _CELL_PX, axis=1)[:height, :width]


def _grown(single_m: NDArray[Any], reach_px: NDArray[Any]) -> NDArray[np.float32]:
    """Every pixel of (h, w), +inf where there is none, as a square of its own reach, the nearest on top."""
    kernel = np.ones((3, 3), np.uint8)
    grown = np.full_like(single_m, np.inf)
    for reach in range(int(reach_px.max()), 0, -1):
        grown = np.minimum(grown, np.where(reach_px == reach, single_m, np.float32(np.inf)))
        grown = np.asarray(cv2.erode(grown, kernel, borderType=cv2.BORDER_REPLICATE), np.float32)
    return np.asarray(np.minimum(grown, single_m), np.float32)


def close_gaps(depth_m: Float32Array, longest_px: int) -> Float32Array:
    """Fill runs of no return (0) along the columns, no longer than `longest_px` and equally far (5 %) at both ends.

    Of the depth's inverse, a closing gives the farther end, and a dilation the nearer; what is filled lies between.
    """
    nearness = np.divide(1, depth_m, out=np.zeros_like(depth_m), where=depth_m > 0)
    padded = cv2.copyMakeBorder(nearness, longest_px, longest_px, 0, 0, cv2.BORDER_CONSTANT, value=0)
    closing = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((longest_px // 2 * 2 + 1, 1), np.uint8))
    farther = closing[longest_px : longest_px + len(depth_m)]
    nearer = cv2.dilate(nearness, np.ones((2 * longest_px + 1, 1), np.uint8))
    closed = depth_m.copy()
    filled = (depth_m == 0) & (farther > 0) & (nearer < (1 + _SAME_SURFACE) * farther)
    closed[filled] = 2 / (farther[filled] + nearer[filled])
    return closed
