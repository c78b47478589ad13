"""Geometric consistency: what one depth image says of every point of every object near by (design: delta = d_proj -
D).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.mapping.depth import DepthView, depth_sigma_m
from supermap_cli.mapping.objects import MapObject

POSE_SIGMA_M = 0.015
"""What a good odometry is off by from one keyframe to the next; the paper assumes none."""

LEAST_REACHABLE = 1 / 3
"""Share of an object's voxels that counts as within a LiDAR's reach at least."""


@dataclass(frozen=True)
class ObjectView:
    """What a depth image says of one object's n voxels, (n,) each.

    `u`, `v`: pixels; `on_image`: projected onto it; `supported`: |delta| <= tau; `contradicted`: the ray went through;
    `occluded`: behind a measured surface. A voxel without a return, beyond range or at a depth edge is none of the
    three. `solid`: believed to be the object's; shares are of these. `unmeasured`: beneath all that a LiDAR can reach,
    before what it saw there, so that only the image shows them.
    """

    u: IntArray
    v: IntArray
    depth: FloatArray
    on_image: BoolArray
    supported: BoolArray
    contradicted: BoolArray
    occluded: BoolArray
    solid: BoolArray
    unmeasured: BoolArray

    def unchecked(self) -> ObjectView:
        """What is left of it without the depth: whatever falls onto the image counts as seen there."""
        nothing = np.zeros(len(self.u), dtype=bool)
        return replace(self, supported=self.on_image, contradicted=nothing, occluded=nothing)

    @cached_property
    def observable(self) -> BoolArray:
        """Voxels the image can speak of."""
        return self.supported | self.contradicted

    @cached_property
    def observable_share(self) -> float:
        """Share of all solid voxels that are observable, but for those that no ray can reach from here.

        A few that can be reached do not speak for the whole.
        """
        return float(np.count_nonzero(self.observable & self.solid) / self.reachable) if self.reachable else 0.0

    @cached_property
    def reachable(self) -> float:
        """Number of solid voxels that rays can reach from here, or a share of all where these are few."""
        solid = np.count_nonzero(self.solid)
        return float(max(solid - np.count_nonzero(self.unmeasured & self.solid), LEAST_REACHABLE * solid))

    @cached_property
    def shown(self) -> BoolArray:
        """Voxels that the image shows if the thing is there: measured, or beneath what can be measured."""
        return self.supported | self.unmeasured

    @cached_property
    def contradicted_share(self) -> float:
        """Share of the observable solid voxels that the rays went through, 0 if none is observable."""
        observable = np.count_nonzero(self.observable & self.solid)
        return np.count_nonzero(self.contradicted & self.solid) / observable if observable else 0.0

    @property
    def hidden(self) -> bool:
        """Whether most of what falls onto the image lies behind something nearer."""
        on_image = np.count_nonzero(self.on_image)
        return bool(on_image > 0 and np.count_nonzero(self.occluded) > 0.7 * on_image)

    @cached_property
    def box_xyxy(self) -> FloatArray | None:
        """The image box (4,) around the voxels on the image (the hybrid state's prior); `None` if there are none."""
        if not self.on_image.any():
            return None
        pixels = np.stack([self.u[self.on_image], self.v[self.on_image]])
        return percentiles(pixels.T, (1, 99)).ravel()


def tolerance_m(
    depth_m: FloatArray, voxel_m: FloatArray | float, sigma_m: FloatArray | float | None = None
) -> FloatArray:
    """tau: three sigma of the sensor (a depth camera's at that depth) and of the pose, and half a voxel's diagonal."""
    sensor_m = depth_sigma_m(depth_m) if sigma_m is None else sigma_m
    tau: FloatArray = 3 * np.hypot(sensor_m, POSE_SIGMA_M) + 0.87 * np.asarray(voxel_m)
    return tau


def check_visibility(view: DepthView, points_map: FloatArray, voxel_m: FloatArray | float) -> ObjectView:
    """Compare (n, 3) map points, of voxels `voxel_m` wide, with a depth image."""
    u, v, depth, on_image = view.project(points_map)
    supported, contradicted, occluded = (np.zeros(len(u), dtype=bool) for _ in range(3))
    pixels = v * view.camera.width + u
    told = np.flatnonzero(on_image & (depth <= view.max_depth_m) & (view.depth_m.ravel()[pixels] > 0))
    pixels, behind = pixels[told], depth[told]
    measured, nearest, farthest = (each.ravel()[pixels] for each in (view.depth_m, view.nearest_m, view.farthest_m))
    tau = tolerance_m(behind, voxel_m if isinstance(voxel_m, float) else voxel_m[told], view.sigma_m(behind))
    slant = np.minimum((farthest - np.minimum(nearest, farthest)) / 2, 2 * tau)
    contradicted[told] = behind < nearest - tau
    occluded[told] = behind > farthest + tau
    supported[told] = np.abs(behind - measured) <= tau + slant
    solid, unmeasured = np.ones(len(u), dtype=bool), np.zeros(len(u), dtype=bool)
    if view.lowest is not None:
        away_m = np.linalg.norm(points_map[:, :2] - view.T_map_camera[:2, 3], axis=1)
        before = away_m < view.lowest.distance_m[u] + tolerance_m(depth, voxel_m, view.sigma_m(depth))
        unmeasured = on_image & (depth <= view.max_depth_m) & view.lowest.below(u, v) & before
    return ObjectView(u, v, depth, on_image, supported, contradicted, occluded, solid, unmeasured)


def within_sight(view: DepthView, objects: Sequence[MapObject]) -> list[MapObject]:
    """The objects that the camera may see: those whose bounding spheres are not wholly outside its view."""
    holding = [each for each in objects if len(each.voxels)]
    if not holding:
        return []
    spheres = np.array([each.voxels.sphere() for each in holding])
    return [holding[i] for i in np.flatnonzero(view.may_show(spheres[:, :3], spheres[:, 3]))]


def look_at(view: DepthView, objects: Sequence[MapObject]) -> dict[int, ObjectView]:
    """Check all given objects in one pass; returns the views of those with a voxel on the image, by object number."""
    objects = within_sight(view, objects)
    if not objects:
        return {}
    sizes = np.array([len(each.voxels) for each in objects])
    voxel_m = np.repeat([each.voxels.voxel_m for each in objects], sizes)
    whole = check_visibility(view, np.concatenate([each.voxels.centers() for each in objects]), voxel_m)
    ends = np.cumsum(sizes)
    views: dict[int, ObjectView] = {}
    for each, start, end in zip(objects, ends - sizes, ends, strict=True):
        part = slice(int(start), int(end))
        if whole.on_image[part].any():
            views[each.number] = ObjectView(
                whole.u[part],
                whole.v[part],
                whole.depth[part],
                whole.on_image[part],
                whole.supported[part],
                whole.contradicted[part],
                whole.occluded[part],
                each.solid,
                whole.unmeasured[part],
            )
    return views
