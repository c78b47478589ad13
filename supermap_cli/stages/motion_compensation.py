"""Depth taken at another moment than colour is moved to where the camera stood when colour was.

Drivers publish colour and depth up to half a frame apart, each with its own stamp (TUM RGB-D: 12 ms in the median,
Sturm et al. 2012). At 65 degrees/s that is 6 pixels. Both poses are known, so the points of the depth image are
projected through both.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray
from supermap_cli.geometry.cameras import Camera, PinholeCamera
from supermap_cli.recordings.registration import camera_rays, draw_plain, splat_nearest

LEAST_SHIFT_PX = 0.5
"""px; images that are shifted by less lie on one another as well as pixels can."""

NEAREST_M = 0.5
"""m; distance at which the shift by the camera's translation is judged: most depth cameras see little nearer."""

_HOLE_NEIGHBOURS = 5
"""Of a pixel's eight neighbours so many have depth where a hole is left by drawing single pixels, not by the sensor."""


def move_depth(camera: Camera, depth_m: Float32Array, T_color_depth: FloatArray) -> Float32Array:
    """(h, w) depth on the camera's pixels, as it would be from where it stood when colour was taken.

    `T_color_depth` (4, 4) places the camera at the moment of depth in the camera at the moment of colour.
    """
    if shift_px(camera, T_color_depth) < LEAST_SHIFT_PX:
        return depth_m
    flat, rays = depth_m.ravel(), _rays(camera)
    measured = np.flatnonzero((flat > 0) & np.isfinite(rays[:, 2]))
    R, t = T_color_depth[:3, :3].astype(np.float32), T_color_depth[:3, 3].astype(np.float32)
    points = (rays[measured] * flat[measured, None]) @ R.T + t
    if isinstance(camera, PinholeCamera) and not any(camera.distortion):
        moved = draw_plain(camera, np.asarray(points, np.float32))
    else:
        moved = splat_nearest(camera, points.astype(np.float64), np.ones(len(points), np.int64))
    return _without_holes(moved)


def shift_px(camera: Camera, T_color_depth: FloatArray) -> float:
    """How far, in pixels, the image's middle moves by the turn and, at `NEAREST_M`, by the translation."""
    cosine = np.clip((np.trace(T_color_depth[:3, :3]) - 1) / 2, -1.0, 1.0)
    moved_m = float(np.linalg.norm(T_color_depth[:3, 3]))
    return camera.focal_px() * (float(np.arccos(cosine)) + moved_m / NEAREST_M)


@lru_cache(maxsize=8)
def _rays(camera: Camera) -> Float32Array:
    return camera_rays(camera).reshape(-1, 3)


def _without_holes(depth_m: Float32Array) -> Float32Array:
    """Single pixels left out by the drawing get the nearest depth around them."""
    padded = np.pad(depth_m, 1)
    height, width = depth_m.shape
    around = np.stack(
        [
            padded[1 + v : 1 + v + height, 1 + u : 1 + u + width]
            for v in (-1, 0, 1)
            for u in (-1, 0, 1)
            if (u, v) != (0, 0)
        ]
    )
    hole: BoolArray = (depth_m == 0) & (np.count_nonzero(around, axis=0) >= _HOLE_NEIGHBOURS)
    filled = depth_m.copy()
    at_holes = around[:, hole]
    filled[hole] = np.where(at_holes > 0, at_holes, np.inf).min(axis=0)
    return filled
