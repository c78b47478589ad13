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

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
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
    window_pixels: int = parameter(
        15000,
        "1",
        "pixels looked at, about; of a larger window every second, third ... one",
        "bounds the time",
        at_least=100,
    )
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


@dataclass(frozen=True)
class _Window:
    """The part of an image about a mask, every `step`-th pixel of it across and down: (h, w) each, `rays` (h, w, 3).

    `own` is the mask, `core` the mask without its rim, `others` what lies in masks of others alone.
    """

    rows: slice
    columns: slice
    depth_m: Float32Array
    rays: Float32Array
    own: BoolArray
    core: BoolArray
    others: BoolArray

    @property
    def at(self) -> tuple[slice, slice]:
        """Where it lies in the image."""
        return self.rows, self.columns

    def region(self, pixels: BoolArray) -> RegionMask:
        """Some of its pixels as a region of the image."""
        step = self.rows.step
        full = np.repeat(np.repeat(pixels, step, axis=0), step, axis=1)
        full = full[: self.rows.stop - self.rows.start, : self.columns.stop - self.columns.start]
        v, u = np.flatnonzero(full.any(axis=1)), np.flatnonzero(full.any(axis=0))
        tight = np.ascontiguousarray(full[v[0] : v[-1] + 1, u[0] : u[-1] + 1])
        return RegionMask(int(self.columns.start + u[0]), int(self.rows.start + v[0]), tight)


def foreground(
    view: DepthView, mask: RegionMask, core: BoolArray, masked: BoolArray, parameters: ForegroundParameters = DEFAULT
) -> RegionMask | None:
    """The pixels of the thing that a mask is of; `None` where depth cannot tell them from what is around.

    `core`: the mask without its rim, on its region; `masked` (h, w): pixels in any mask of the image; what lies in
    those of others is not the surroundings.
    """
    window = _window(view, mask, core, masked, parameters)
    measured = (window.depth_m > 0) & np.isfinite(window.rays[..., 2])
    if np.count_nonzero(window.own & measured) < parameters.min_points:
        return None
    v, u = np.nonzero(measured)
    depth_m = window.depth_m[v, u]
    points = np.asarray(window.rays[v, u] * depth_m[:, None], np.float32)
    in_mask = window.own[v, u]
    beside = np.flatnonzero(~(in_mask | window.others[v, u]))
    noise_m = parameters.plane_sigmas * view.sigma_m(depth_m)
    tolerance_m: Float32Array = (noise_m + parameters.plane_m).astype(np.float32)
    on_plane = np.zeros(measured.shape, dtype=bool)
    for normal, offset in planes_beside(points, beside, (u, v), tolerance_m, parameters):
        height_m = (points @ normal - offset) * (-1 if offset > 0 else 1)
        if stands_before(height_m[in_mask], tolerance_m[in_mask], parameters):
            near = np.abs(height_m) < tolerance_m
            on_plane[v[near], u[near]] = True
    left = _own_surfaces(view, window, measured & ~on_plane, parameters) & ~window.others
    if not on_plane.any() and not np.count_nonzero(left & ~window.own):
        return None
    if np.count_nonzero(left) < parameters.min_points or _spanned(left, window.own) < parameters.span_share:
        return None
    return window.region(left)


def stands_before(
    height_m: FloatArray | Float32Array, tolerance_m: Float32Array, parameters: ForegroundParameters
) -> bool:
    """Whether what a mask (n,) shows off a plane stands clearly before it, and does not just rise from it a little."""
    off = np.abs(height_m) >= tolerance_m
    rest = height_m[off]
    if np.count_nonzero(rest > 0) < parameters.before_share * len(rest):
        return False
    return len(rest) > 0 and float(np.median(rest / tolerance_m[off])) > parameters.clear_factor


def _window(
    view: DepthView, mask: RegionMask, core: BoolArray, masked: BoolArray, parameters: ForegroundParameters
) -> _Window:
    h, w = mask.pixels.shape
    height, width = view.depth_m.shape
    scale = pixel_scale(view.camera, view.parameters)
    ring_px = np.clip(parameters.ring_share * max(h, w), parameters.min_ring_px * scale, parameters.max_ring_px * scale)
    ring = max(1, round(float(ring_px)))
    top, left = max(0, mask.v0 - ring), max(0, mask.u0 - ring)
    bottom, right = min(height, mask.v0 + h + ring), min(width, mask.u0 + w + ring)
    step = max(1, round(float(np.sqrt((bottom - top) * (right - left) / parameters.window_pixels))))
    own, inner = np.zeros((2, bottom - top, right - left), dtype=bool)
    at = (slice(mask.v0 - top, mask.v0 - top + h), slice(mask.u0 - left, mask.u0 - left + w))
    own[at], inner[at] = mask.pixels, core
    own, inner = own[::step, ::step], inner[::step, ::step]
    rows, columns = slice(top, bottom, step), slice(left, right, step)
    return _Window(
        rows,
        columns,
        view.depth_m[rows, columns],
        view.camera.rays()[rows, columns],
        own,
        inner,
        masked[rows, columns] & ~own,
    )


def planes_beside(
    points: Float32Array,
    beside: IntArray,
    uv: tuple[IntArray, IntArray],
    tolerance_m: Float32Array,
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


def _best_plane(points: Float32Array, tolerance_m: Float32Array, least: int) -> tuple[FloatArray, float] | None:
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


def _own_surfaces(view: DepthView, window: _Window, solid: BoolArray, parameters: ForegroundParameters) -> BoolArray:
    """The pixels of the surfaces that lie mostly inside the mask, and of others that do within its core."""
    own = window.own
    step_m = edge_step_m(window.depth_m, view.parameters)
    surface = solid & (view.farthest_m[window.at] - view.nearest_m[window.at] < step_m)
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
    left: BoolArray = whole[label] | (partly[label] & window.core) | edges
    return left


def _reaching_beyond(label: IntArray, window: _Window, shape: tuple[int, ...]) -> IntArray:
    """The surfaces that go on beyond the window (those that end at the image's border do not)."""
    rows, columns = window.at
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
