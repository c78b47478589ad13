"""Which LiDAR returns on a mask are the thing's: those of bodies that end with it, not of what goes on beyond it.

A mask fills the gaps between legs, leaks and lies over what is nearer; and a LiDAR is mounted beside the camera, so
that some of its returns, seen from there, lie on a thing that hides them from the camera: it looks under the table top
that the camera looks upon. The wall behind then returns more than the table. So, as with dense depth (`foreground`),
planes that are seen beside the mask are left out under it where the rest stands before them; and of the bodies that the
other returns form in space, those that lie mostly inside the mask are the thing's.

Comes between `GenerateMasks` and `Unproject` of the paper's algorithm 1, step (4), which takes masks as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.mapping import clusters, foreground, relief
from supermap_cli.mapping.clusters import ClusterParameters, cell_m, main_cluster, voxel_clusters
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.foreground import ForegroundParameters, planes_beside, ring_order, stands_before
from supermap_cli.mapping.relief import Plane, Relief, ReliefParameters, relief_of
from supermap_cli.mapping.returns import spacing_m
from supermap_cli.types.detections import RegionMask
from supermap_cli.types.parameters import parameter


@dataclass(frozen=True)
class LidarForegroundParameters:
    """How far around a mask is looked at, and which bodies make up one thing."""

    ring_share: float = parameter(
        0.5,
        "1",
        "width of the surroundings that are looked at, as a share of the mask's longer side: of what goes on beyond a "
        "mask, no more than half then lies inside",
        "geometry",
    )
    ring_spacings: float = parameter(
        3.0, "1", "least width of the surroundings that are looked at, in distances between returns", "chosen"
    )
    max_returns: int = parameter(
        3000, "1", "returns off such planes; of more every second, third ... one", "bounds the time", at_least=100
    )
    depth_per_width: float = parameter(
        1.0,
        "1",
        "how far before or behind one body of a thing its others may lie, as a share of the mask's longer side: "
        "nothing tells how deep a thing is, and most are no deeper than wide",
        "as a thing on the floor is taken for a cylinder",
    )
    min_returns: int = parameter(2, "1", "returns of a body: one alone may be a mixture of two ranges", "chosen")


DEFAULT = LidarForegroundParameters()


@dataclass(frozen=True)
class _Around:
    """The n returns on a mask and about it: `which` of all returns they are, and (n,) each: `own`, on the mask; `core`,
    on its core; `others`, on masks of others alone. `points` (n, 3) and `depth_m` (n,) are the camera's, `uv` (2, n)
    the pixels.
    """

    which: IntArray
    points: FloatArray
    depth_m: FloatArray
    uv: IntArray
    own: BoolArray
    core: BoolArray
    others: BoolArray


@dataclass(frozen=True)
class OwnReturns:
    """Which returns (k,) are of the thing that a mask shows, none if nothing on the mask is of it; and how far what the
    mask shows rises from the planes that go on beside it (`relief`, `None` where there are none).
    """

    which: IntArray
    relief: Relief | None = None


def own_returns(
    view: DepthView,
    mask: RegionMask,
    core: BoolArray,
    masked: BoolArray,
    *,
    parameters: LidarForegroundParameters = DEFAULT,
    surface_parameters: ForegroundParameters = foreground.DEFAULT,
    cluster_parameters: ClusterParameters = clusters.DEFAULT,
    relief_parameters: ReliefParameters = relief.DEFAULT,
) -> OwnReturns:
    """Which returns are of the thing that a mask shows, and its relief.

    `core`: the mask without its rim, on its region; `masked` (h, w): pixels in any mask of the image.
    """
    around = _around(view, mask, core, masked, parameters)
    none = np.zeros(0, np.int64)
    if not around.core.any():
        return OwnReturns(none)
    planes = _planes_beside(view, around, surface_parameters)
    tolerance_m = _tolerance_m(view, around, surface_parameters)[around.own]
    rise = relief_of(around.points[around.own].T, tolerance_m, planes, relief_parameters)
    left = np.flatnonzero(~_on_planes_behind(view, around, planes, surface_parameters))
    left = left[:: len(left) // parameters.max_returns + 1]
    inside = around.own[left]
    if not inside.any():
        return OwnReturns(none, rise)
    points = around.points[left]
    depth_m = float(np.median(around.depth_m[left[inside]]))
    body = voxel_clusters(points, max(cell_m(depth_m, cluster_parameters), _apart_m(view, mask, around, depth_m)))
    own = _own_bodies(body, inside, around.core[left], parameters, surface_parameters) & ~around.others[left]
    if not own.any():
        return OwnReturns(none, rise)
    longest_m = max(mask.pixels.shape) * depth_m / view.camera.focal_px()
    beyond_m = parameters.depth_per_width * longest_m
    kept = _one_thing(points[own], around.depth_m[left[own]], body[own], beyond_m, cluster_parameters)
    return OwnReturns(around.which[left[own][kept]], rise)


def _around(
    view: DepthView,
    mask: RegionMask,
    core: BoolArray,
    masked: BoolArray,
    parameters: LidarForegroundParameters,
) -> _Around:
    returns = view.returns
    if returns is None:
        raise ValueError("a depth camera has no single returns")
    h, w = mask.pixels.shape
    ring = max(1, round(max(parameters.ring_share * max(h, w), parameters.ring_spacings * view.spacing_px)))
    u, v = returns.u - mask.u0, returns.v - mask.v0
    which = np.flatnonzero((u >= -ring) & (u < w + ring) & (v >= -ring) & (v < h + ring))
    u, v = u[which], v[which]
    own, inner = np.zeros((2, len(which)), bool)
    on = np.flatnonzero((u >= 0) & (u < w) & (v >= 0) & (v < h))
    own[on], inner[on] = mask.pixels[v[on], u[on]], core[v[on], u[on]]
    others = masked[returns.v[which], returns.u[which]] & ~own
    return _Around(which, returns.points_camera[which], returns.depth_m[which], np.stack([u, v]), own, inner, others)


def _tolerance_m(view: DepthView, around: _Around, parameters: ForegroundParameters) -> Float32Array:
    """(n,) the distance from a plane within which a return lies on it."""
    return (parameters.plane_sigmas * view.sigma_m(around.depth_m) + parameters.plane_m).astype(np.float32)


def _planes_beside(view: DepthView, around: _Around, parameters: ForegroundParameters) -> list[Plane]:
    """The planes that the returns beside the mask lie on."""
    beside = np.flatnonzero(~(around.own | around.others))
    thinned = beside[:: len(beside) // parameters.ring_points + 1]
    u, v = around.uv
    ring = thinned[ring_order(v[thinned], u[thinned])]
    tolerance_m = _tolerance_m(view, around, parameters)
    return planes_beside(around.points[ring].astype(np.float32), tolerance_m[ring], parameters)


def _on_planes_behind(
    view: DepthView, around: _Around, planes: Sequence[Plane], parameters: ForegroundParameters
) -> BoolArray:
    """(n,) which returns lie on planes that go on beside the mask, and before which what is on none of them stands.

    Of a corner, one wall may lie behind the other's plane; it says nothing of what stands before both.
    """
    tolerance_m = _tolerance_m(view, around, parameters)
    points = around.points.astype(np.float32)
    heights_m = np.array([points @ normal - offset for normal, offset in planes])
    near = np.abs(heights_m.reshape(-1, len(points))) < tolerance_m
    rest = around.own & ~near.any(axis=0)
    behind = np.zeros(len(points), bool)
    for height_m, on_plane in zip(heights_m, near, strict=True):
        if stands_before(height_m[rest], tolerance_m[rest], parameters):
            behind |= on_plane
    return behind


def _apart_m(view: DepthView, mask: RegionMask, around: _Around, depth_m: float) -> float:
    """How far two returns of one body may lie apart: twice their distance on the mask, where the LiDAR reaches it."""
    reached_px = np.count_nonzero(mask.pixels)
    if view.lowest is not None:
        v, u = np.nonzero(mask.pixels)
        reached_px -= np.count_nonzero(view.lowest.below(u + mask.u0, v + mask.v0))
    return 2 * spacing_m(int(np.count_nonzero(around.own)), max(int(reached_px), 1), depth_m, view.camera.focal_px())


def _own_bodies(
    body: IntArray,
    inside: BoolArray,
    core: BoolArray,
    parameters: LidarForegroundParameters,
    surface_parameters: ForegroundParameters,
) -> BoolArray:
    """(n,) the returns of the bodies that lie mostly inside the mask, and of others that do on its core.

    Few returns on a body that ends with the mask count for more than many on one that goes on beyond it.
    """
    count = int(body.max()) + 1
    within = np.bincount(body[inside], minlength=count).astype(np.float64)
    share = within / np.maximum(np.bincount(body, minlength=count), 1)
    share[within < parameters.min_returns] = 0
    main = int(np.argmax(within * share**2))
    whole = share >= surface_parameters.own_share
    partly = ~whole & (share > 0) & (share >= surface_parameters.rival_share * share[main])
    own: BoolArray = whole[body] | (partly[body] & core)
    return own


def _one_thing(
    points: FloatArray, depth_m: FloatArray, body: IntArray, beyond_m: float, parameters: ClusterParameters
) -> BoolArray:
    """(n,) the returns of the body with most of them, of what goes on near by, and of further ones about as far off."""
    kept = main_cluster(points, body, parameters)
    near, far = np.percentile(depth_m[kept], (parameters.near_percentile, 100 - parameters.near_percentile))
    apart = np.maximum(np.maximum(near - depth_m, depth_m - far), 0)
    beyond = np.zeros(int(body.max()) + 1)
    np.maximum.at(beyond, body, apart)
    also: BoolArray = kept | (beyond[body] < beyond_m)
    return also
