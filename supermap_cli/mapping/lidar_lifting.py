"""Lifting with a LiDAR: from the returns under a mask, and what the image shows below them, to an object's points.

`Unproject` of the paper's algorithm 1, step (4), for sparse depth. Departs from it below the LiDAR's field of view.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, UInt8Array
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.mapping import below_lidar_fov, clusters, foreground, lidar_foreground, relief
from supermap_cli.mapping.below_lidar_fov import (
    BelowLidarFovParameters,
    covered_below,
    extend_down,
    mask_rays,
    place_on_floor,
)
from supermap_cli.mapping.clusters import ClusterParameters
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.foreground import ForegroundParameters
from supermap_cli.mapping.lidar_foreground import LidarForegroundParameters, own_returns
from supermap_cli.mapping.relief import Relief, ReliefParameters
from supermap_cli.types.detections import RegionMask
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class LidarLiftingParameters:
    """How many returns tell where a thing is, and when its foot tells it better."""

    max_points: int = parameter(
        2000, "1", "points of one mask; more are thinned out evenly", "bounds the time", at_least=1
    )
    min_points: int = parameter(12, "1", "points below which there is no evidence of a shape", TUNED)
    min_returns: int = parameter(5, "1", "returns that tell where a thing is", TUNED)
    min_below_share: float = parameter(
        0.8, "1", "share of a mask below all returns from which the thing is placed by its foot", TUNED
    )
    covered_gap_px: int = parameter(4, "px", "gap below a pixel within which another mask covers it", TUNED)
    beyond_m: float = parameter(
        0.3, "m", "how far behind its foot's place returns are not the thing's but a wall's", TUNED
    )


DEFAULT = LidarLiftingParameters()


@dataclass(frozen=True)
class LiftedPoints:
    """What a mask shows in 3D: points (n, 3) in the map, in metres, their colours (n, 3), and their median distance.

    `measured`: depth or returns tell where they are, and not the thing's foot alone. `relief` is how far what the mask
    shows rises from the planes beside it, `None` where that is not known.
    """

    points_map: FloatArray
    rgb: UInt8Array
    depth_m: float
    measured: bool
    relief: Relief | None


def lift_returns(
    keyframe: Keyframe,
    view: DepthView,
    mask: RegionMask,
    core: BoolArray,
    masks: Sequence[RegionMask],
    *,
    masked: BoolArray,
    parameters: LidarLiftingParameters = DEFAULT,
    foreground_parameters: LidarForegroundParameters = lidar_foreground.DEFAULT,
    surface_parameters: ForegroundParameters = foreground.DEFAULT,
    cluster_parameters: ClusterParameters = clusters.DEFAULT,
    fov_parameters: BelowLidarFovParameters = below_lidar_fov.DEFAULT,
    relief_parameters: ReliefParameters = relief.DEFAULT,
) -> LiftedPoints | None:
    """The returns on a mask that are the thing's, and what the image shows of it below them.

    `core`: the mask without its rim, on its region; `masks`: all of the image; `masked` (h, w): pixels in any of them.
    """
    if view.returns is None or view.lowest is None:
        return None
    least = parameters.min_returns
    own = own_returns(
        view,
        mask,
        core,
        masked,
        parameters=foreground_parameters,
        surface_parameters=surface_parameters,
        cluster_parameters=cluster_parameters,
        relief_parameters=relief_parameters,
    )
    measured = own.which if len(own.which) >= least else own.which[:0]
    cluster = transform_points(keyframe.T_map_camera, view.returns.smoothed(measured))
    v, u = np.nonzero(mask.pixels)
    rays = mask_rays(keyframe.camera, keyframe.T_map_camera, u + mask.u0, v + mask.v0)
    below = view.lowest.below(rays.u, rays.v)
    shown, kept = np.zeros((0, 3)), np.zeros(len(u), bool)
    on_floor = None
    if view.floor_z is not None and below.mean() > parameters.min_below_share:
        covered = covered_below(mask, masks, rays.u, rays.v, parameters.covered_gap_px)
        focal_px = keyframe.camera.focal_px()
        on_floor = place_on_floor(rays, view.lowest, focal_px, view.floor_z, covered, parameters=fov_parameters)
    if on_floor is not None and (
        len(cluster) < least or _is_beyond(cluster, on_floor, rays.origin, parameters.beyond_m)
    ):
        measured, cluster, shown, kept = measured[:0], cluster[:0], on_floor, np.ones(len(u), bool)
    elif len(cluster) >= least and below.any():
        below &= core[v, u]
        shown, kept = extend_down(rays.take(below), cluster, view.returns.u[measured], view.floor_z)
        kept = np.flatnonzero(below)[kept]
    points_map = np.concatenate([cluster, shown])
    u, v = (
        np.concatenate([view.returns.u[measured], rays.u[kept]]),
        np.concatenate([view.returns.v[measured], rays.v[kept]]),
    )
    if len(points_map) < parameters.min_points:
        return None
    if len(points_map) > parameters.max_points:
        chosen = np.linspace(0, len(points_map) - 1, parameters.max_points).astype(np.int64)
        points_map, u, v = points_map[chosen], u[chosen], v[chosen]
    depth_m = float(np.median(np.linalg.norm(points_map - rays.origin, axis=1)))
    return LiftedPoints(points_map, keyframe.rgb[v, u], depth_m, measured=len(measured) > 0, relief=own.relief)


def _is_beyond(cluster: FloatArray, on_floor: FloatArray, origin: FloatArray, beyond_m: float) -> bool:
    """Whether returns lie clearly behind where a thing must stand: a mask of a thing below bleeds onto the wall."""
    distance_m = np.linalg.norm(cluster[:, :2] - origin[:2], axis=1)
    farthest_m = np.linalg.norm(on_floor[:, :2] - origin[:2], axis=1).max()
    return bool(np.median(distance_m) > farthest_m + beyond_m)
