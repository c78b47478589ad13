"""What a LiDAR saw around an image's stamp: returns, deskewed with the trajectory, and a depth image drawn of them.

The paper takes synchronised depth as given (section IV); a LiDAR's returns are made into it here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.types.sensing import Sweep

PosesAt = Callable[[IntArray], tuple[FloatArray, BoolArray]]
"""`T_odom_base` (n, 4, 4) at n stamps, and (n,) which of them the trajectory reaches."""

_KNOTS = 11
"""Moments of a sweep, evenly spread, at which the pose is looked up: every 10 ms at 10 Hz."""

_CELL_PX = 16
"""Pixels of a side of the cells in which returns are counted; set by hand, so that several returns fall on one."""

_LARGEST_SPLAT_RAD = 0.037
"""rad that a return covers at most, 2.1 degrees: the rings of a 16-ring LiDAR (VLP-16) are 2.0 degrees apart."""

_SAME_SURFACE = 0.05
"""Share of the range by which both sides of a gap may differ to be one surface; set by hand."""


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
