"""Depth images brought onto the colour camera's pixels."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera, PinholeCamera


class DepthRegistration(Protocol):
    """Turns a depth image into one on the colour camera's pixels."""

    def register(self, depth_m: Float32Array, T_color_depth: FloatArray) -> Float32Array:
        """(h_d, w_d) float32 of the depth camera -> (h, w) float32 of the colour camera, 0 = no return."""
        ...


def camera_rays(camera: Camera) -> Float32Array:
    """(h, w, 3) float32 rays such that point = ray * depth, of any camera; NaN where a pixel sees nothing."""
    u, v = np.meshgrid(np.arange(camera.width, dtype=np.float64), np.arange(camera.height, dtype=np.float64))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    rays = camera.back_project(pixels, np.ones(len(pixels)))
    return rays.astype(np.float32).reshape(camera.height, camera.width, 3)


class SameCentre:
    """Both cameras look from the same point: every colour pixel looks its depth up, without parallax."""

    def __init__(self, color: Camera, depth: Camera) -> None:
        rays = camera_rays(color).reshape(-1, 3).astype(np.float64)
        seen: BoolArray = np.isfinite(rays[:, 2])
        pixels, on_image = depth.project(np.where(seen[:, None], rays, 0.0))
        seen[seen] = on_image[seen]
        self._seen = seen
        columns, rows = np.rint(pixels[self._seen]).astype(np.int64).T
        self._lookup: IntArray = rows.clip(0, depth.height - 1) * depth.width + columns.clip(0, depth.width - 1)
        self._scale = (1 / depth.depth_of(rays[self._seen])).astype(np.float32)
        self._shape = (color.height, color.width)

    def register(self, depth_m: Float32Array, T_color_depth: FloatArray) -> Float32Array:  # noqa: ARG002 - is identity
        """See `DepthRegistration.register`."""
        registered = np.zeros(self._seen.size, np.float32)
        registered[self._seen] = depth_m.ravel()[self._lookup] * self._scale
        return registered.reshape(self._shape)


class ZBuffer:
    """The cameras stand apart: depth points are moved over and the nearest one on each colour pixel wins.

    A point covers as many pixels as the colour camera is finer than the depth camera, so that no holes open.
    """

    def __init__(self, color: Camera, depth: Camera) -> None:
        self._color = color
        self._rays = camera_rays(depth).reshape(-1, 3)
        self._splat = max(1, math.ceil(color.focal_px() / depth.focal_px() - 0.05))
        self._plain = isinstance(color, PinholeCamera) and not any(color.distortion) and self._splat == 1

    def register(self, depth_m: Float32Array, T_color_depth: FloatArray) -> Float32Array:
        """See `DepthRegistration.register`."""
        flat = depth_m.ravel()
        measured = np.flatnonzero((flat > 0) & np.isfinite(self._rays[:, 2]))
        points = self._rays[measured] * flat[measured, None]
        R, t = T_color_depth[:3, :3].astype(np.float32), T_color_depth[:3, 3].astype(np.float32)
        points = (points if np.array_equal(R, np.eye(3)) else points @ R.T) + t
        if self._plain and isinstance(self._color, PinholeCamera):
            return draw_plain(self._color, np.asarray(points, np.float32))
        return splat_nearest(self._color, points.astype(np.float64), np.full(len(points), self._splat))


def draw_plain(camera: PinholeCamera, points_camera: Float32Array) -> Float32Array:
    """Draw (n, 3) float32 points as single pixels of a camera without distortion, the nearest on top: (h, w), 0 =
    none.
    """
    x, y, z = points_camera.T
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.rint(x / z * np.float32(camera.fx) + np.float32(camera.cx))
        v = np.rint(y / z * np.float32(camera.fy) + np.float32(camera.cy))
    seen = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    flat = np.full(camera.height * camera.width, np.inf, np.float32)
    np.minimum.at(flat, v[seen].astype(np.int32) * camera.width + u[seen].astype(np.int32), z[seen])
    flat[~np.isfinite(flat)] = 0
    return flat.reshape(camera.height, camera.width)


def splat_nearest(camera: Camera, points_camera: FloatArray, sizes_px: IntArray) -> Float32Array:
    """Draw (n, 3) points as squares of (n,) `sizes_px` into a depth image, the nearest on top.

    Returns (h, w) float32 in the measure of the camera, 0 = nothing.
    """
    pixels, on_image = camera.project(points_camera)
    depth = camera.depth_of(points_camera).astype(np.float32)
    image = np.full((camera.height, camera.width), np.inf, np.float32)
    flat = image.ravel()
    visible = on_image & (depth > 0)
    for size in np.unique(sizes_px[visible]):
        chosen = visible & (sizes_px == size)
        u0, v0 = np.rint(pixels[chosen] - (size - 1) / 2).astype(np.int64).T
        values = depth[chosen]
        for row in range(int(size)):
            for column in range(int(size)):
                u, v = u0 + column, v0 + row
                inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
                np.minimum.at(flat, (v * camera.width + u)[inside], values[inside])
    image[~np.isfinite(image)] = 0
    return image
