"""Geometric consistency (eq. 7 to 9): what one depth image says of every voxel of every object near by.

With delta = d_proj - D(u), a voxel is supported for |delta| <= tau (the paper's observable), occluded for delta > tau
(unobservable) and contradicted for delta < -tau (disappeared). Departs from the paper in that tau grows with the depth
and the voxel, that D(u) is a range over the pixel's neighbourhood, that a return from too far away to be mapped
contradicts what its ray passed, and that voxels without a measured depth are none of the three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.mapping.depth import DepthView, depth_sigma_m
from supermap_cli.mapping.objects import MapObject
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class VisibilityParameters:
    """The threshold tau, and what of an object a view can speak of."""

    pose_sigma_m: float = parameter(
        0.015, "m", "what a good odometry is off by from one keyframe to the next; the paper assumes none", TUNED
    )
    sigmas: float = parameter(3.0, "1", "deviations of sensor and pose within which depths agree", "99.7 %")
    voxel_share: float = parameter(
        0.87, "1", "half of a voxel's diagonal, as a share of its edge: its centre stands for all of it", "sqrt(3) / 2"
    )
    max_slant: float = parameter(
        2.0, "1", "how much slant, in taus, the range of depths around a pixel may add to tau", TUNED
    )
    min_reachable_share: float = parameter(
        1 / 3, "1", "share of an object's voxels that counts as within a LiDAR's reach at least", TUNED, at_most=1.0
    )
    hidden_share: float = parameter(
        0.7, "1", "share of the voxels on the image above which an occluded object counts as hidden", TUNED
    )
    box_percentiles: tuple[float, float] = parameter(
        (1.0, 99.0), "%", "of the voxels' pixels, the box expected on the image: less strays", TUNED, at_most=100.0
    )


DEFAULT = VisibilityParameters()


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
    parameters: VisibilityParameters = field(default=DEFAULT, repr=False)

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
        measurable = solid - np.count_nonzero(self.unmeasured & self.solid)
        return float(max(measurable, self.parameters.min_reachable_share * solid))

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
        return bool(on_image > 0 and np.count_nonzero(self.occluded) > self.parameters.hidden_share * on_image)

    @cached_property
    def box_xyxy(self) -> FloatArray | None:
        """The image box (4,) around the voxels on the image (the hybrid state's prior); `None` if there are none."""
        if not self.on_image.any():
            return None
        pixels = np.stack([self.u[self.on_image], self.v[self.on_image]])
        return percentiles(pixels.T, self.parameters.box_percentiles).ravel()


def tolerance_m(
    depth_m: FloatArray,
    voxel_m: FloatArray | float,
    sigma_m: FloatArray | float | None = None,
    parameters: VisibilityParameters = DEFAULT,
) -> FloatArray:
    """tau: three sigma of the sensor (a depth camera's at that depth) and of the pose, and half a voxel's diagonal."""
    sensor_m = depth_sigma_m(depth_m) if sigma_m is None else sigma_m
    noise_m = parameters.sigmas * np.hypot(sensor_m, parameters.pose_sigma_m)
    tau: FloatArray = noise_m + parameters.voxel_share * np.asarray(voxel_m)
    return tau


def check_visibility(
    view: DepthView,
    points_map: FloatArray,
    voxel_m: FloatArray | float,
    parameters: VisibilityParameters = DEFAULT,
) -> ObjectView:
    """Compare (n, 3) map points, of voxels `voxel_m` wide, with a depth image."""
    u, v, depth, on_image = view.project(points_map)
    supported, contradicted, occluded = (np.zeros(len(u), dtype=bool) for _ in range(3))
    pixels = v * view.camera.width + u
    witnessed = (view.depth_m.ravel()[pixels] > 0) | view.far.ravel()[pixels]
    measurable = np.flatnonzero(on_image & (depth <= view.max_depth_m) & witnessed)
    pixels, projected = pixels[measurable], depth[measurable]
    far = view.far.ravel()[pixels]
    measured_m, nearest, farthest = (image.ravel()[pixels] for image in (view.depth_m, view.nearest_m, view.farthest_m))
    edges_m = voxel_m if isinstance(voxel_m, float) else voxel_m[measurable]
    tau = tolerance_m(projected, edges_m, view.sigma_m(projected), parameters)
    slant = np.minimum((farthest - np.minimum(nearest, farthest)) / 2, parameters.max_slant * tau)
    contradicted[measurable] = projected < nearest - tau
    occluded[measurable] = ~far & (projected > farthest + tau)
    supported[measurable] = ~far & (np.abs(projected - measured_m) <= tau + slant)
    solid, unmeasured = np.ones(len(u), dtype=bool), np.zeros(len(u), dtype=bool)
    if view.lowest is not None:
        away_m = np.linalg.norm(points_map[:, :2] - view.T_map_camera[:2, 3], axis=1)
        tau = tolerance_m(depth, voxel_m, view.sigma_m(depth), parameters)
        before = away_m < view.lowest.distance_m[u] + tau
        unmeasured = on_image & (depth <= view.max_depth_m) & view.lowest.below(u, v) & before
    return ObjectView(u, v, depth, on_image, supported, contradicted, occluded, solid, unmeasured, parameters)


def in_field_of_view(view: DepthView, objects: Sequence[MapObject]) -> list[MapObject]:
    """The objects that the camera may see: those whose bounding spheres are not wholly outside its view."""
    candidates = [obj for obj in objects if len(obj.voxels)]
    if not candidates:
        return []
    spheres = np.array([obj.voxels.sphere() for obj in candidates])
    return [candidates[i] for i in np.flatnonzero(view.may_show(spheres[:, :3], spheres[:, 3]))]


def check_objects(
    view: DepthView, objects: Sequence[MapObject], parameters: VisibilityParameters = DEFAULT
) -> dict[int, ObjectView]:
    """Check all given objects in one pass; returns the views of those with a voxel on the image, by object number."""
    objects = in_field_of_view(view, objects)
    if not objects:
        return {}
    sizes = np.array([len(obj.voxels) for obj in objects])
    voxel_m = np.repeat([obj.voxels.voxel_m for obj in objects], sizes)
    whole = check_visibility(view, np.concatenate([obj.voxels.centers() for obj in objects]), voxel_m, parameters)
    ends = np.cumsum(sizes)
    views: dict[int, ObjectView] = {}
    for obj, start, end in zip(objects, ends - sizes, ends, strict=True):
        part = slice(int(start), int(end))
        if whole.on_image[part].any():
            views[obj.number] = ObjectView(
                whole.u[part],
                whole.v[part],
                whole.depth[part],
                whole.on_image[part],
                whole.supported[part],
                whole.contradicted[part],
                whole.occluded[part],
                obj.solid,
                whole.unmeasured[part],
                parameters,
            )
    return views
