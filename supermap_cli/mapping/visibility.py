"""Geometric consistency: what one depth image says of every point of every object near by (design: delta = d_proj -
D).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.mapping.depth import DepthView, depth_sigma_m
from supermap_cli.mapping.objects import MapObject

POSE_SIGMA_M = 0.015
"""What a good odometry is off by from one keyframe to the next; the paper assumes none."""


@dataclass(frozen=True)
class ObjectView:
    """What a depth image says of one object's n voxels, (n,) each.

    `u`, `v`: pixels; `on_image`: projected onto it; `supported`: |delta| <= tau; `contradicted`: the ray went through;
    `occluded`: behind a measured surface. A voxel without a return, beyond range or at a depth edge is none of the
    three.
    """

    u: IntArray
    v: IntArray
    depth: FloatArray
    on_image: BoolArray
    supported: BoolArray
    contradicted: BoolArray
    occluded: BoolArray

    @property
    def observable(self) -> BoolArray:
        """Voxels the image can speak of."""
        return self.supported | self.contradicted

    @property
    def observable_share(self) -> float:
        """Share of all voxels that are observable."""
        return float(self.observable.mean()) if len(self.u) else 0.0

    @property
    def contradicted_share(self) -> float:
        """Share of the observable voxels that the rays went through, 0 if none is observable."""
        observable = int(self.observable.sum())
        return float(self.contradicted.sum()) / observable if observable else 0.0

    @property
    def hidden(self) -> bool:
        """Whether most of what falls onto the image lies behind something nearer."""
        on_image = int(self.on_image.sum())
        return on_image > 0 and int(self.occluded.sum()) > 0.7 * on_image

    @cached_property
    def box_xyxy(self) -> FloatArray | None:
        """The image box (4,) around the voxels on the image (the hybrid state's prior); `None` if there are none."""
        if not self.on_image.any():
            return None
        u, v = self.u[self.on_image], self.v[self.on_image]
        (u_min, u_max), (v_min, v_max) = np.percentile(u, (1, 99)), np.percentile(v, (1, 99))
        return np.array([u_min, v_min, u_max, v_max])


def tolerance_m(depth_m: FloatArray, voxel_m: FloatArray | float) -> FloatArray:
    """tau: three sigma of the sensor at that depth and of the pose, and half a voxel's diagonal."""
    tau: FloatArray = 3 * np.hypot(depth_sigma_m(depth_m), POSE_SIGMA_M) + 0.87 * np.asarray(voxel_m)
    return tau


def check_visibility(view: DepthView, points_map: FloatArray, voxel_m: FloatArray | float) -> ObjectView:
    """Compare (n, 3) map points, of voxels `voxel_m` wide, with a depth image."""
    u, v, depth, on_image = view.project(points_map)
    measured = view.depth_m[v, u]
    nearest, farthest = view.nearest_m[v, u], view.farthest_m[v, u]
    tau = tolerance_m(depth, voxel_m)
    told = on_image & (measured > 0) & (depth <= view.max_depth_m)
    contradicted = told & (depth < nearest - tau)
    occluded = told & (depth > farthest + tau)
    slant = np.minimum((farthest - np.minimum(nearest, farthest)) / 2, 2 * tau)
    supported = told & (np.abs(depth - measured) <= tau + slant)
    return ObjectView(u, v, depth, on_image, supported, contradicted, occluded)


def look_at(view: DepthView, objects: Sequence[MapObject]) -> dict[int, ObjectView]:
    """Check all given objects in one pass; returns the views of those with a voxel on the image, by object number."""
    if not objects:
        return {}
    sizes = [len(each.voxels) for each in objects]
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
            )
    return views
