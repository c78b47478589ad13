"""Depth images from a LiDAR: the sweeps around an image's stamp, deskewed with the trajectory, seen by the camera."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.protocols import Recording
from supermap_cli.recordings.registration import splat_nearest
from supermap_cli.types.sensing import Sweep

PoseAt = Callable[[int], FloatArray | None]
"""`T_odom_base` (4, 4) at a stamp, `None` where the trajectory does not reach."""

_KNOTS = 11
_LONGEST_SWEEP_NS = 200_000_000
_CELL_PX = 16
_LARGEST_SPLAT_RAD = 0.037
_SAME_SURFACE = 0.05
_NEAREST_RANGE_M = 0.3


def deskew_to_odom(sweep: Sweep, T_odom_base_at: PoseAt) -> FloatArray | None:
    """(n, 3) points of a sweep in odom, each moved by the pose at its own stamp; `None` without any pose.

    Poses are asked for at 11 moments of the sweep; between two of them a point moves on the chord (where the robot
    turns by 0.1 rad in a sweep, less than 2e-5 of the range off the arc).
    """
    stamps = sweep.point_stamps_ns
    if not len(stamps):
        return np.zeros((0, 3))
    first, last = int(stamps.min()), int(stamps.max())
    knots_ns = np.unique(np.linspace(first, last, _KNOTS).round().astype(np.int64))
    known = [(stamp, T) for stamp in knots_ns.tolist() if (T := T_odom_base_at(stamp)) is not None]
    if not known:
        return None
    T_odom_lidar: FloatArray = np.stack([T for _, T in known]) @ sweep.T_base_lidar
    at = np.array([stamp for stamp, _ in known], np.int64)
    if len(at) == 1:
        return transform_points(T_odom_lidar[0], sweep.points_lidar)
    left = (np.searchsorted(at, stamps, side="right") - 1).clip(0, len(at) - 2)
    fraction = ((stamps - at[left]) / (at[left + 1] - at[left])).clip(0, 1)[:, None]
    start = _move_each(T_odom_lidar, left, sweep.points_lidar)
    end = _move_each(T_odom_lidar, left + 1, sweep.points_lidar)
    points_odom: FloatArray = start + fraction * (end - start)
    return points_odom


def _move_each(T: FloatArray, chosen: IntArray, points: FloatArray) -> FloatArray:
    """Point i moved by `T[chosen[i]]`."""
    moved = np.empty_like(points)
    for index in np.unique(chosen):
        those = chosen == index
        moved[those] = transform_points(T[index], points[those])
    return moved


def deskew_sweep(sweep: Sweep, T_odom_base_at: PoseAt, stamp_ns: int) -> FloatArray | None:
    """(n, 3) points of a sweep in the base frame as it stood at `stamp_ns`; `None` beyond the trajectory."""
    T_odom_base = T_odom_base_at(stamp_ns)
    points_odom = None if T_odom_base is None else deskew_to_odom(sweep, T_odom_base_at)
    if T_odom_base is None or points_odom is None:
        return None
    return transform_points(inverse(T_odom_base), points_odom)


class SweepDepth:
    """Depth for one camera image after the other, in ascending order of their stamps.

    `half_window_s` is how far a sweep's stamp may lie from the image's; only the sweeps of that window are kept.
    """

    def __init__(self, recording: Recording, T_odom_base_at: PoseAt, half_window_s: float = 0.15) -> None:
        self._sweeps = recording.sweeps()
        self._T_odom_base_at = T_odom_base_at
        self._half_window_ns = round(half_window_s * 1e9)
        self._window: deque[Sweep] = deque()
        self._points_odom: dict[int, FloatArray] = {}
        self._next: Sweep | None = next(self._sweeps, None)

    def depth_for(self, stamp_ns: int, camera: Camera, T_base_camera: FloatArray) -> Float32Array:
        """(h, w) float32 in the measure of the camera, 0 = no return (everywhere, beyond the trajectory)."""
        self._move_to(stamp_ns)
        T_odom_base = self._T_odom_base_at(stamp_ns)
        clouds = [points for sweep in self._window if (points := self._in_odom(sweep)) is not None]
        if T_odom_base is None or not clouds:
            return np.zeros((camera.height, camera.width), np.float32)
        T_camera_odom = inverse(T_odom_base @ T_base_camera)
        return draw_sweeps(camera, [transform_points(T_camera_odom, points) for points in clouds])

    def _move_to(self, stamp_ns: int) -> None:
        reach = self._half_window_ns
        while self._next is not None and self._next.stamp_ns <= stamp_ns + reach:
            self._window.append(self._next)
            self._next = next(self._sweeps, None)
        while self._window and self._window[0].stamp_ns < stamp_ns - reach - _LONGEST_SWEEP_NS:
            self._points_odom.pop(self._window.popleft().stamp_ns, None)

    def _in_odom(self, sweep: Sweep) -> FloatArray | None:
        points = self._points_odom.get(sweep.stamp_ns)
        if points is None:
            points = deskew_to_odom(sweep, self._T_odom_base_at)
            if points is not None:
                self._points_odom[sweep.stamp_ns] = points
        return points


def draw_sweeps(camera: Camera, sweeps_camera: Sequence[FloatArray]) -> Float32Array:
    """Sweeps, (n, 3) points each, as a depth image (h, w): each point as large as its sweep is wide-meshed there.

    The mesh follows from how many points of the sweep fall on the 16-pixel cell around one, up to 2 degrees; what then
    is left open between the rings of a spinning LiDAR is closed where both sides are on one surface.
    """
    drawn, sizes = [], []
    columns = -(-camera.width // _CELL_PX)
    largest = max(1, round(_LARGEST_SPLAT_RAD * camera.focal_px()))
    for points in sweeps_camera:
        pixels, on_image = camera.project(points)
        on_image &= np.einsum("ij,ij->i", points, points) > _NEAREST_RANGE_M**2
        cells = (np.rint(pixels[on_image]).astype(np.int64) // _CELL_PX) @ np.array([1, columns])
        counts = np.bincount(cells, minlength=1)
        drawn.append(points[on_image])
        sizes.append(np.ceil(_CELL_PX / np.sqrt(counts[cells])).astype(np.int64).clip(1, largest))
    depth = splat_nearest(camera, np.concatenate(drawn), np.concatenate(sizes))
    return close_gaps(close_gaps(depth, largest).T, largest).T.copy()


def close_gaps(depth_m: Float32Array, longest_px: int) -> Float32Array:
    """Fill runs of no return (0) along the columns, no longer than `longest_px` and equally far (5 %) at both ends."""
    height = len(depth_m)
    rows = np.arange(height)[:, None]
    measured = depth_m > 0
    above = np.maximum.accumulate(np.where(measured, rows, -1), axis=0)
    below = np.minimum.accumulate(np.where(measured, rows, height)[::-1], axis=0)[::-1]
    v, u = np.nonzero(~measured & (above >= 0) & (below < height) & (below - above <= longest_px + 1))
    v_above, v_below = above[v, u], below[v, u]
    d_above, d_below = depth_m[v_above, u], depth_m[v_below, u]
    same = np.abs(d_above - d_below) < _SAME_SURFACE * np.minimum(d_above, d_below)
    weight = ((v - v_above) / (v_below - v_above)).astype(np.float32)
    closed = depth_m.copy()
    closed[v[same], u[same]] = (d_above + weight * (d_below - d_above))[same]
    return closed
