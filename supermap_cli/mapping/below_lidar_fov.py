"""What stands below a LiDAR's field of view: seen by the camera only, and yet on the floor.

A LiDAR that looks down by 7 degrees from 0.75 m passes over a thing of 0.4 m that is nearer than 2.8 m. The image
shows it all the same. Where a mask reaches below the lowest returns of its columns, its surface is taken to go on
upright from the returns above; and where there are none, the thing is taken to stand on the floor, where its lower
edge meets it.

Departs from the paper, whose `Unproject` (algorithm 1, step 4) needs a depth at every pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.types.detections import RegionMask
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class BelowLidarFovParameters:
    """When a mask without returns can be placed on the floor, and how exactly."""

    beside_px: int = parameter(8, "px", "columns on either side over which the lowest return is looked for", TUNED)
    edge_px: float = parameter(1.5, "px", "standard deviation of a mask's lower edge", TUNED)
    max_sigma_m: float = parameter(0.15, "m", "deviation of the distance above which a thing is not placed", TUNED)
    max_width_m: float = parameter(1.2, "m", "width above which a thing is not taken for a cylinder", TUNED)
    min_below_share: float = parameter(
        0.7, "1", "share of the lower edge that must lie below all returns for the edge to be the foot", TUNED
    )
    max_covered_share: float = parameter(
        0.3, "1", "share of the lower edge that other masks may cover for the edge to be the foot", TUNED
    )
    behind_m: float = parameter(0.1, "m", "how far behind the lowest returns a thing may stand", TUNED)
    front_percentile: float = parameter(
        20.0, "%", "percentile of the lower edge's distances at which the thing begins", TUNED, at_most=100
    )
    side_percentile: float = parameter(
        1.0, "%", "percentile of the azimuths at which the thing's sides lie", TUNED, at_most=50
    )
    top_percentile: float = parameter(98.0, "%", "percentile of the slopes at which its top lies", TUNED, at_most=100)


DEFAULT = BelowLidarFovParameters()


@dataclass(frozen=True)
class LowestReturns:
    """Down to where a LiDAR saw, for every column of an image of width w.

    `row` (w,) is the lowest row with a return about the column, the image's height where there is none; `distance_m`
    (w,) how far off, horizontally, that return lies: what stands there goes on downwards, as walls do.
    """

    row: IntArray
    distance_m: FloatArray

    def below(self, u: IntArray, v: IntArray) -> BoolArray:
        """(n,) which pixels lie below all returns."""
        below: BoolArray = v > self.row[u]
        return below


def lowest_returns(
    depth_m: Float32Array,
    camera: Camera,
    T_map_camera: FloatArray,
    parameters: BelowLidarFovParameters = DEFAULT,
) -> LowestReturns:
    """Read them off a depth image (h, w), 0 = no return."""
    height, width = depth_m.shape
    measured = depth_m > 0
    some = measured.any(axis=0)
    last = np.where(some, height - 1 - np.argmax(measured[::-1], axis=0), 0)
    columns = np.arange(width)
    pixels_uv = np.column_stack([columns, last]).astype(np.float64)
    points = camera.back_project(pixels_uv, depth_m[last, columns].astype(np.float64)) @ T_map_camera[:3, :3].T
    distance_m = np.where(some, np.hypot(points[:, 0], points[:, 1]), np.inf)
    row = cv2.dilate(last.astype(np.float32)[None], np.ones((1, 2 * parameters.beside_px + 1), np.uint8))[0]
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


def extend_down(
    rays: MaskRays, measured_map: FloatArray, measured_u: IntArray, floor_z: float | None
) -> tuple[FloatArray, IntArray]:
    """(m, 3) points of pixels below the returns, upright below the lowest of those (k, 3) measured near their column,
    and which rays (m,) these are: one that meets the floor before is left out, for a mask's lower edge bleeds.
    """
    order = np.argsort(measured_map[:, 2])[: max(1, len(measured_map) // 2)]
    distance_m = np.linalg.norm(measured_map[order, :2] - rays.origin[:2], axis=1)
    columns, first = np.unique(measured_u[order], return_index=True)
    nearest = np.abs(rays.u[:, None] - columns[None, :]).argmin(axis=1)
    points = rays.at(distance_m[first[nearest]])
    kept = np.flatnonzero(points[:, 2] > (-np.inf if floor_z is None else floor_z))
    return points[kept], kept


def place_on_floor(
    rays: MaskRays,
    lowest: LowestReturns,
    focal_px: float,
    floor_z: float,
    covered_below: BoolArray,
    *,
    parameters: BelowLidarFovParameters = DEFAULT,
) -> FloatArray | None:
    """(n, 3) points of a thing that stands on the floor where its mask's lower edge meets it; `None` if it cannot.

    Nothing tells how deep it is; so it is taken to be as deep as it is wide, an upright cylinder. `covered_below` (n,)
    are pixels below which another mask begins: an edge that another thing makes is none of its own.
    """
    columns, column = np.unique(rays.u, return_inverse=True)
    bottom = np.full(len(columns), -1)
    np.maximum.at(bottom, column, rays.v)
    at_bottom = rays.v == bottom[column]
    height_m = float(rays.origin[2] - floor_z)
    if height_m <= 0 or rays.slope[at_bottom].max() >= -1e-3:
        return None
    if lowest.below(rays.u[at_bottom], rays.v[at_bottom]).mean() < parameters.min_below_share:
        return None
    if covered_below[at_bottom].mean() > parameters.max_covered_share:
        return None
    front_m = float(np.percentile(height_m / -rays.slope[at_bottom], parameters.front_percentile))
    sigma_m = (front_m**2 + height_m**2) / height_m * parameters.edge_px / focal_px
    behind_m = float(np.median(lowest.distance_m[columns]))
    if sigma_m > parameters.max_sigma_m or front_m > behind_m + parameters.behind_m:
        return None
    return _cylinder(rays, front_m, behind_m, floor_z, parameters)


def _cylinder(
    rays: MaskRays, front_m: float, behind_m: float, floor_z: float, parameters: BelowLidarFovParameters
) -> FloatArray | None:
    """The mask's pixels on the upright cylinder that fills its width and begins at a horizontal distance."""
    middle = np.arctan2(np.sin(rays.azimuth).mean(), np.cos(rays.azimuth).mean())
    aside = (rays.azimuth - middle + np.pi) % (2 * np.pi) - np.pi
    low, high = np.percentile(aside, (parameters.side_percentile, 100 - parameters.side_percentile))
    sine = float(np.sin(min((high - low) / 2, 1.0)))
    radius_m = front_m * sine / (1 - sine)
    if radius_m > parameters.max_width_m / 2:
        return None
    aside = aside - (low + high) / 2
    axis_m = front_m + radius_m
    half_m = np.sqrt(np.maximum(radius_m**2 - (axis_m * np.sin(aside)) ** 2, 0))
    near_m, far_m = axis_m * np.cos(aside) - half_m, np.minimum(axis_m * np.cos(aside) + half_m, max(behind_m, front_m))
    top_z = float(rays.origin[2] + (axis_m + radius_m) * np.percentile(rays.slope, parameters.top_percentile))
    points = rays.at(near_m)
    above = (points[:, 2] > top_z) & (rays.slope < -1e-3)
    on_top_m = (top_z - rays.origin[2]) / np.minimum(rays.slope, -1e-3)
    points[above] = rays.at(np.clip(on_top_m[above], near_m[above], np.maximum(far_m, near_m)[above]), above)
    points[:, 2] = np.maximum(points[:, 2], floor_z)
    return points


def covered_below(mask: RegionMask, others: Sequence[RegionMask], u: IntArray, v: IntArray, gap_px: int) -> BoolArray:
    """(n,) below which pixels of a mask another mask begins within a gap."""
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
