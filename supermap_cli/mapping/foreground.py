"""What a mask is of: the surfaces that end with it, not those that go on beyond it.

A segmenter's mask is a hint where a thing is, not its outline: it leaks over edges, fills the gaps between legs, is a
hull or a mere box, or misses a part. The depth around it tells more. Planes that are seen beside the mask (floor, wall,
table top) and go on under it are not the thing; and of the surfaces that depth edges part, the thing's own lie mostly
inside the mask, others mostly outside. Where nothing is left, as of a picture on a wall, the mask is taken as it is.

Comes between `GenerateMasks` and `Unproject` of the paper's algorithm 1, step (4), which takes masks as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.mapping.depth import DepthView, edge_step_m, pixel_scale
from supermap_cli.types.detections import RegionMask
from supermap_cli.types.parameters import parameter


@dataclass(frozen=True)
class ForegroundParameters:
    """How far around a mask is looked at, what a plane is, and which surfaces are the thing's."""

    ring_share: float = parameter(
        0.2, "1", "width of the surroundings that are looked at, as a share of the mask's longer side", "chosen"
    )
    min_ring_px: float = parameter(10.0, "px", "least width of them, on an image 640 wide", "chosen")
    max_ring_px: float = parameter(60.0, "px", "greatest width of them", "bounds the time")
    ring_points: int = parameter(240, "1", "points of them that are looked at", "bounds the time", at_least=16)
    max_planes: int = parameter(3, "1", "planes about a thing: a floor and two walls", "rooms")
    plane_share: float = parameter(
        0.15, "1", "share of the surroundings that a plane must make up", "a strip on one side", at_most=1.0
    )
    plane_sigmas: float = parameter(3.0, "1", "deviations of the depth within which a point lies on a plane", "99.7 %")
    plane_m: float = parameter(0.01, "m", "distance from a plane allowed on top: what is not quite flat", "chosen")
    before_share: float = parameter(
        0.8,
        "1",
        "share of the mask's other points that must lie on the camera's side of a plane: a thing stands before what is "
        "behind it, and a part of its own front that the mask missed lies before the rest of it",
        "visibility",
        at_most=1.0,
    )
    clear_factor: float = parameter(
        3.0,
        "1",
        "how many tolerances the mask's other points must lie off a plane, in the median: of a bowl or a board, which "
        "rise from it by a little, noise would take a part",
        "chosen",
    )
    own_share: float = parameter(
        0.6, "1", "share of a surface inside the mask from which all of it is the thing's", "chosen", at_most=1.0
    )
    rival_share: float = parameter(
        0.5,
        "1",
        "share of a surface inside the mask, of that of the main surface, below which none of it is the thing's",
        "chosen",
        at_most=1.0,
    )
    min_points: int = parameter(12, "1", "pixels that must be left", "as of any lifted mask", at_least=1)
    span_share: float = parameter(
        0.2,
        "1",
        "share of the mask's image box that what is left must span: less is noise on something flat",
        "chosen",
        at_most=1.0,
    )


DEFAULT = ForegroundParameters()


def foreground(
    view: DepthView, mask: RegionMask, core: BoolArray, masked: BoolArray, parameters: ForegroundParameters = DEFAULT
) -> RegionMask | None:
    """The pixels of the thing that a mask is of; `None` where depth cannot tell them from what is around.

    `core`: the mask without its rim, on its region; `masked` (h, w): pixels in any mask of the image; what lies in
    those of others is not the surroundings.
    """
    window, own, core = _window(view, mask, core, parameters)
    depth = view.depth_m[window]
    measured = depth > 0
    inside = own & measured
    if np.count_nonzero(inside) < parameters.min_points:
        return None
    v, u = np.nonzero(measured)
    origin = np.array([window[1].start, window[0].start])
    points = view.camera.back_project(
        np.column_stack([u, v]).astype(np.float64) + origin, depth[v, u].astype(np.float64)
    )
    beside = np.flatnonzero((~own & ~masked[window])[v, u])
    on_plane = np.zeros(depth.shape, dtype=bool)
    tolerance_m = parameters.plane_sigmas * view.sigma_m(points[:, 2]) + parameters.plane_m
    in_mask = own[v, u]
    for normal, offset in _planes(points, beside, (u, v), tolerance_m, parameters):
        height_m = (points @ normal - offset) * (-1 if offset > 0 else 1)
        if _stands_before(height_m[in_mask], tolerance_m[in_mask], parameters):
            near = np.abs(height_m) < tolerance_m
            on_plane[v[near], u[near]] = True
    left = _own_surfaces(view, window, measured & ~on_plane, own=own, core=core, parameters=parameters)
    left &= own | ~masked[window]
    if not on_plane.any() and not np.count_nonzero(left & ~own):
        return None
    if np.count_nonzero(left) < parameters.min_points or _spanned(left, own) < parameters.span_share:
        return None
    rows, columns = np.flatnonzero(left.any(axis=1)), np.flatnonzero(left.any(axis=0))
    tight = left[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return RegionMask(int(origin[0] + columns[0]), int(origin[1] + rows[0]), np.ascontiguousarray(tight))


def _stands_before(height_m: FloatArray, tolerance_m: FloatArray, parameters: ForegroundParameters) -> bool:
    """Whether what a mask (n,) shows off a plane stands clearly before it, and does not just rise from it a little."""
    off = np.abs(height_m) >= tolerance_m
    rest = height_m[off]
    if np.count_nonzero(rest > 0) < parameters.before_share * len(rest):
        return False
    return len(rest) > 0 and float(np.median(rest / tolerance_m[off])) > parameters.clear_factor


def _window(
    view: DepthView, mask: RegionMask, core: BoolArray, parameters: ForegroundParameters
) -> tuple[tuple[slice, slice], BoolArray, BoolArray]:
    """The part of the image about a mask, and the mask and its core on it."""
    h, w = mask.pixels.shape
    height, width = view.depth_m.shape
    scale = pixel_scale(view.camera, view.parameters)
    ring_px = np.clip(parameters.ring_share * max(h, w), parameters.min_ring_px * scale, parameters.max_ring_px * scale)
    ring = max(1, round(float(ring_px)))
    top, left = max(0, mask.v0 - ring), max(0, mask.u0 - ring)
    bottom, right = min(height, mask.v0 + h + ring), min(width, mask.u0 + w + ring)
    own, inner = np.zeros((2, bottom - top, right - left), dtype=bool)
    at = (slice(mask.v0 - top, mask.v0 - top + h), slice(mask.u0 - left, mask.u0 - left + w))
    own[at], inner[at] = mask.pixels, core
    return (slice(top, bottom), slice(left, right)), own, inner


def _planes(
    points: FloatArray,
    beside: IntArray,
    uv: tuple[IntArray, IntArray],
    tolerance_m: FloatArray,
    parameters: ForegroundParameters,
) -> list[tuple[FloatArray, float]]:
    """(normal (3,), offset) of the planes that the surroundings, rows `beside` of the points (n, 3), consist of.

    RANSAC (Fischler and Bolles 1981) with triples that lie near one another on the ring, drawn in a fixed order.
    """
    thinned = beside[:: len(beside) // parameters.ring_points + 1]
    u, v = uv[0][thinned], uv[1][thinned]
    angle = np.arctan2(v - v.mean(), u - u.mean()) if len(thinned) else np.zeros(0)
    left = thinned[np.argsort(angle, kind="stable")]
    least = max(3, round(parameters.plane_share * len(left)))
    planes: list[tuple[FloatArray, float]] = []
    while len(planes) < parameters.max_planes and len(left) >= max(least, 12):
        found = _best_plane(points[left], tolerance_m[left], least)
        if found is None:
            break
        normal, offset = found
        planes.append(found)
        left = left[np.abs(points[left] @ normal - offset) >= tolerance_m[left]]
    return planes


def _best_plane(points: FloatArray, tolerance_m: FloatArray, least: int) -> tuple[FloatArray, float] | None:
    """The plane with the most inliers among points (n, 3) in the order of the ring; `None` for fewer than `least`."""
    n = len(points)
    seeds = np.arange(0, n, max(1, n // 32))
    first = np.concatenate([seeds, seeds])
    span = np.repeat([max(1, n // 16), max(2, n // 6)], len(seeds))
    a, b, c = points[first], points[(first + span) % n], points[(first - span // 2) % n]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    sound = lengths > 1e-9
    if not sound.any():
        return None
    normals = normals[sound] / lengths[sound, None]
    offsets = np.einsum("ij,ij->i", normals, a[sound])
    inliers = np.abs(points @ normals.T - offsets) < tolerance_m[:, None]
    chosen = inliers[:, int(np.argmax(np.count_nonzero(inliers, axis=0)))]
    for _ in range(2):
        if np.count_nonzero(chosen) < least:
            return None
        middle = points[chosen].mean(axis=0)
        normal = np.linalg.eigh(np.cov((points[chosen] - middle).T))[1][:, 0]
        chosen = np.abs((points - middle) @ normal) < tolerance_m
    return normal, float(normal @ middle)


def _own_surfaces(
    view: DepthView,
    window: tuple[slice, slice],
    solid: BoolArray,
    *,
    own: BoolArray,
    core: BoolArray,
    parameters: ForegroundParameters,
) -> BoolArray:
    """The pixels of the surfaces that lie mostly inside the mask, and of others that do within its core."""
    depth = view.depth_m[window]
    step_m = edge_step_m(depth, view.parameters)
    surface = solid & (view.farthest_m[window] - view.nearest_m[window] < step_m)
    count, components = cv2.connectedComponents(surface.astype(np.uint8), connectivity=4)
    label = np.asarray(components, np.int64)
    sizes = np.bincount(label.ravel(), minlength=count).astype(np.float64)
    within = np.bincount(label[own], minlength=count).astype(np.float64)
    sizes[0] = within[0] = 0
    share = within / np.maximum(sizes, 1)
    # Pixels on depth edges are of no surface; inside the mask, off the planes, they go with the thing.
    edges = solid & own & ~surface
    if not within.any():
        return edges
    main = int(np.argmax(within * share))
    whole = share >= parameters.own_share
    whole[_reaching_beyond(label, window, view.depth_m.shape)] = False
    partly = ~whole & (share >= parameters.rival_share * share[main])
    whole[0] = partly[0] = False
    left: BoolArray = whole[label] | (partly[label] & core) | edges
    return left


def _reaching_beyond(label: IntArray, window: tuple[slice, slice], shape: tuple[int, ...]) -> IntArray:
    """The surfaces that go on beyond the window (those that end at the image's border do not)."""
    rows, columns = window
    sides = [
        label[0] if rows.start > 0 else label[0, :0],
        label[-1] if rows.stop < shape[0] else label[0, :0],
        label[:, 0] if columns.start > 0 else label[0, :0],
        label[:, -1] if columns.stop < shape[1] else label[0, :0],
    ]
    beyond: IntArray = np.unique(np.concatenate(sides))
    return beyond


def _spanned(left: BoolArray, own: BoolArray) -> float:
    """The area of the image box of what is left inside the mask, as a share of the mask's."""

    def area(pixels: BoolArray) -> int:
        rows, columns = np.flatnonzero(pixels.any(axis=1)), np.flatnonzero(pixels.any(axis=0))
        return int((rows[-1] - rows[0] + 1) * (columns[-1] - columns[0] + 1)) if len(rows) else 0

    return area(left & own) / max(area(own), 1)
