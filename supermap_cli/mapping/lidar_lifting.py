"""Lifting with a LiDAR: from the returns under a mask, and what the image shows beneath them, to an object's points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray, UInt8Array
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.mapping.beneath import covered_below, hang_down, mask_rays, stand_on_floor
from supermap_cli.mapping.bodies import main_component
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.returns import spacing_m
from supermap_cli.types.detections import RegionMask
from supermap_cli.types.keyframe import Keyframe

MOST_POINTS, FEWEST_POINTS = 2000, 12
"""More points of one mask than the first are thinned out evenly; fewer than the second are no evidence of a shape."""

MIN_RETURNS = 5
"""So many of a LiDAR's returns tell where a thing is."""

MOSTLY_BENEATH = 0.8
"""A thing of which the image shows more than this share beneath a LiDAR's lowest ray is placed by its foot."""

BELOW_PX = 4


def lift_returns(
    keyframe: Keyframe,
    view: DepthView,
    mask: RegionMask,
    core: BoolArray,
    masks: Sequence[RegionMask],
) -> tuple[FloatArray, UInt8Array, float] | None:
    """The body that most of the returns under the mask's core lie on, and what the image shows of it beneath them."""
    if view.returns is None or view.lowest is None:
        return None
    measured, body = _measured_body(keyframe, view, mask, core)
    v, u = np.nonzero(mask.pixels)
    rays = mask_rays(keyframe.camera, keyframe.T_map_camera, u + mask.u0, v + mask.v0)
    beneath = view.lowest.beneath(rays.u, rays.v)
    shown, kept = np.zeros((0, 3)), np.zeros(len(u), bool)
    standing = None
    if view.floor_z is not None and beneath.mean() > MOSTLY_BENEATH:
        below = covered_below(mask, masks, rays.u, rays.v, BELOW_PX)
        standing = stand_on_floor(rays, view.lowest, keyframe.camera.focal_px(), view.floor_z, below)
    if standing is not None and (len(body) < MIN_RETURNS or _is_beyond(body, standing, rays.origin)):
        measured, body, shown, kept = measured[:0], body[:0], standing, np.ones(len(u), bool)
    elif len(body) >= MIN_RETURNS and beneath.any():
        beneath &= core[v, u]
        shown, kept = hang_down(rays.take(beneath), body, view.returns.u[measured], view.floor_z)
        kept = np.flatnonzero(beneath)[kept]
    points_map = np.concatenate([body, shown])
    u, v = (
        np.concatenate([view.returns.u[measured], rays.u[kept]]),
        np.concatenate([view.returns.v[measured], rays.v[kept]]),
    )
    if len(points_map) < FEWEST_POINTS:
        return None
    if len(points_map) > MOST_POINTS:
        chosen = np.linspace(0, len(points_map) - 1, MOST_POINTS).astype(np.int64)
        points_map, u, v = points_map[chosen], u[chosen], v[chosen]
    depth_m = float(np.median(np.linalg.norm(points_map - rays.origin, axis=1)))
    return points_map, keyframe.rgb[v, u], depth_m


def _measured_body(
    keyframe: Keyframe, view: DepthView, mask: RegionMask, core: BoolArray
) -> tuple[IntArray, FloatArray]:
    """Which returns (k,) lie on the body that the mask's core is mostly made of, and where (k, 3) in the map."""
    if view.returns is None or view.lowest is None:
        return np.zeros(0, np.int64), np.zeros((0, 3))
    chosen = view.returns.under(mask, core)
    if len(chosen) < MIN_RETURNS:
        return chosen[:0], np.zeros((0, 3))
    focal_px = keyframe.camera.focal_px()
    v, u = np.nonzero(core)
    reached = int((~view.lowest.beneath(u + mask.u0, v + mask.v0)).sum())
    points_camera = view.returns.smoothed(chosen)
    depth_m = float(np.median(view.returns.depth_m[chosen]))
    main = main_component(points_camera, depth_m, 2 * spacing_m(len(chosen), max(reached, 1), depth_m, focal_px))
    return chosen[main], transform_points(keyframe.T_map_camera, points_camera[main])


def _is_beyond(body: FloatArray, standing: FloatArray, origin: FloatArray) -> bool:
    """Whether returns lie clearly behind where a thing must stand: a mask of a thing beneath bleeds onto the wall."""
    distance_m = np.linalg.norm(body[:, :2] - origin[:2], axis=1)
    farthest_m = np.linalg.norm(standing[:, :2] - origin[:2], axis=1).max()
    return bool(np.median(distance_m) > farthest_m + 0.3)
