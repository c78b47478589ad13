"""What stands beneath a LiDAR's lowest ray: seen by the camera only, and yet on the floor.

A LiDAR that looks down by 7 degrees from 0.75 m passes over a thing of 0.4 m that is nearer than 2.8 m. The image
shows it all the same. Where a mask reaches below the lowest returns of its columns, its surface is taken to go on
upright from the returns above; and where there are none, the thing is taken to stand on the floor, where its lower
edge meets it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.types.detections import RegionMask

_BESIDE_PX = 8
_EDGE_PX = 1.5
_LARGEST_SIGMA_M = 0.15
_WIDEST_M = 1.2
_BENEATH_SHARE = 0.7
_COVERED_SHARE = 0.3
_BEHIND_M = 0.1


@dataclass(frozen=True)
class LowestReturns:
    """Down to where a LiDAR saw, for every column of an image of width w.

    `row` (w,) is the lowest row with a return about the column, the image's height where there is none; `distance_m`
    (w,) how far off, horizontally, that return lies: what stands there goes on downwards, as walls do.
    """

    row: IntArray
    distance_m: FloatArray

    def beneath(self, u: IntArray, v: IntArray) -> BoolArray:
        """(n,) which pixels lie beneath all returns."""
        below: BoolArray = v > self.row[u]
        return below


def lowest_returns(depth_m: Float32Array, camera: Camera, T_map_camera: FloatArray) -> LowestReturns:
    """Read them off a depth image (h, w), 0 = no return."""
    height, width = depth_m.shape
    measured = depth_m > 0
    some = measured.any(axis=0)
    last = np.where(some, height - 1 - np.argmax(measured[::-1], axis=0), 0)
    columns = np.arange(width)
    pixels_uv = np.column_stack([columns, last]).astype(np.float64)
    points = camera.back_project(pixels_uv, depth_m[last, columns].astype(np.float64)) @ T_map_camera[:3, :3].T
    distance_m = np.where(some, np.hypot(points[:, 0], points[:, 1]), np.inf)
    row = cv2.dilate(last.astype(np.float32)[None], np.ones((1, 2 * _BESIDE_PX + 1), np.uint8))[0]
    row = np.where(row > 0, row + 1, height)
    return LowestReturns(row.astype(np.int64), distance_m)


@dataclass(frozen=True)
class MaskRays:
    """The rays of n pixels in the map frame: `azimuth` (n,) radians, `slope` (n,) rise per horizontal metre."""

    u: IntArray
    v: IntArray
    origin: FloatArray
    azimuth: FloatArray
    slope: FloatArray

    def take(self, chosen: BoolArray) -> MaskRays:
        """The chosen ones (n,)."""
        return MaskRays(self.u[chosen], self.v[chosen], self.origin, self.azimuth[chosen], self.slope[chosen])

    def at(self, distance_m: FloatArray, chosen: BoolArray | None = None) -> FloatArray:
        """Points (n, 3) in the map at horizontal distances (n,)."""
        azimuth, slope = (self.azimuth, self.slope) if chosen is None else (self.azimuth[chosen], self.slope[chosen])
        offsets = np.column_stack([np.cos(azimuth), np.sin(azimuth), slope]) * distance_m[:, None]
        points: FloatArray = self.origin + offsets
        return points


def mask_rays(camera: Camera, T_map_camera: FloatArray, u: IntArray, v: IntArray) -> MaskRays:
    """The rays of the pixels (n,)."""
    rays = camera.back_project(np.column_stack([u, v]).astype(np.float64), np.ones(len(u))) @ T_map_camera[:3, :3].T
    horizontal = np.maximum(np.hypot(rays[:, 0], rays[:, 1]), 1e-9)
    return MaskRays(u, v, T_map_camera[:3, 3], np.arctan2(rays[:, 1], rays[:, 0]), rays[:, 2] / horizontal)


def hang_down(
    rays: MaskRays, measured_map: FloatArray, measured_u: IntArray, floor_z: float | None
) -> tuple[FloatArray, IntArray]:
    """(m, 3) points of pixels beneath the returns, upright below the lowest of those (k, 3) measured near their column,
    and which rays (m,) these are: one that meets the floor before is left out, for a mask's lower edge bleeds.
    """
    order = np.argsort(measured_map[:, 2])[: max(1, len(measured_map) // 2)]
    distance_m = np.linalg.norm(measured_map[order, :2] - rays.origin[:2], axis=1)
    columns, first = np.unique(measured_u[order], return_index=True)
    nearest = np.abs(rays.u[:, None] - columns[None, :]).argmin(axis=1)
    points = rays.at(distance_m[first[nearest]])
    kept = np.flatnonzero(points[:, 2] > (-np.inf if floor_z is None else floor_z))
    return points[kept], kept


def stand_on_floor(
    rays: MaskRays, lowest: LowestReturns, focal_px: float, floor_z: float, covered_below: BoolArray
) -> FloatArray | None:
    """(n, 3) points of a thing that stands on the floor where its mask's lower edge meets it; `None` if it cannot.

    Nothing tells how deep it is; so it is taken to be as deep as it is wide, an upright cylinder. `covered_below` (n,)
    are pixels beneath which another mask begins: an edge that another thing makes is none of its own.
    """
    columns, column = np.unique(rays.u, return_inverse=True)
    bottom = np.full(len(columns), -1)
    np.maximum.at(bottom, column, rays.v)
    at_bottom = rays.v == bottom[column]
    height_m = float(rays.origin[2] - floor_z)
    if height_m <= 0 or rays.slope[at_bottom].max() >= -1e-3:
        return None
    if lowest.beneath(rays.u[at_bottom], rays.v[at_bottom]).mean() < _BENEATH_SHARE:
        return None
    if covered_below[at_bottom].mean() > _COVERED_SHARE:
        return None
    front_m = float(np.percentile(height_m / -rays.slope[at_bottom], 20))
    sigma_m = (front_m**2 + height_m**2) / height_m * _EDGE_PX / focal_px
    behind_m = float(np.median(lowest.distance_m[columns]))
    if sigma_m > _LARGEST_SIGMA_M or front_m > behind_m + _BEHIND_M:
        return None
    return _cylinder(rays, front_m, behind_m, floor_z)


def _cylinder(rays: MaskRays, front_m: float, behind_m: float, floor_z: float) -> FloatArray | None:
    """The mask's pixels on the upright cylinder that fills its width and begins at a horizontal distance."""
    middle = np.arctan2(np.sin(rays.azimuth).mean(), np.cos(rays.azimuth).mean())
    aside = (rays.azimuth - middle + np.pi) % (2 * np.pi) - np.pi
    low, high = np.percentile(aside, (1, 99))
    sine = float(np.sin(min((high - low) / 2, 1.0)))
    radius_m = front_m * sine / (1 - sine)
    if radius_m > _WIDEST_M / 2:
        return None
    aside = aside - (low + high) / 2
    axis_m = front_m + radius_m
    half_m = np.sqrt(np.maximum(radius_m**2 - (axis_m * np.sin(aside)) ** 2, 0))
    near_m, far_m = axis_m * np.cos(aside) - half_m, np.minimum(axis_m * np.cos(aside) + half_m, max(behind_m, front_m))
    top_z = float(rays.origin[2] + (axis_m + radius_m) * np.percentile(rays.slope, 98))
    points = rays.at(near_m)
    above = (points[:, 2] > top_z) & (rays.slope < -1e-3)
    on_top_m = (top_z - rays.origin[2]) / np.minimum(rays.slope, -1e-3)
    points[above] = rays.at(np.clip(on_top_m[above], near_m[above], np.maximum(far_m, near_m)[above]), above)
    points[:, 2] = np.maximum(points[:, 2], floor_z)
    return points


def covered_below(mask: RegionMask, others: Sequence[RegionMask], u: IntArray, v: IntArray, gap_px: int) -> BoolArray:
    """(n,) beneath which pixels of a mask another mask begins within a gap."""
    covered = np.zeros(len(u), bool)
    for other in others:
        if other is mask:
            continue
        h, w = other.pixels.shape
        for step in range(1, gap_px + 1):
            x, y = u - other.u0, v + step - other.v0
            within = (x >= 0) & (x < w) & (y >= 0) & (y < h)
            covered[within] |= other.pixels[y[within], x[within]]
    return covered
