"""What a mask is of: the surfaces that end with it, not those that go on beyond it.

A segmenter's mask is a hint where a thing is, not its outline: it leaks over edges, fills the gaps between legs, is a
hull or a mere box, or misses a part. The depth around it tells more. Planes that are seen beside the mask (floor, wall,
table top) and go on under it are not the thing; and of the surfaces that depth edges part, the thing's own lie mostly
inside the mask, others mostly outside. Where nothing is left, as of a picture on a wall, the mask is taken as it is.

Comes between `GenerateMasks` and `Unproject` of the paper's algorithm 1, step (4), which takes masks as they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.mapping import relief
from supermap_cli.mapping.depth import DepthView, edge_step_m, pixel_scale
from supermap_cli.mapping.relief import Relief, ReliefParameters, planes_through, relief_of
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
class Foreground:
    """What depth says of a mask: the pixels of the thing that it is of (`region`, `None` where depth cannot tell them
    from what is around), and how far what it shows rises from the planes that go on beside it (`relief`, `None` where
    there are none).
    """

    region: RegionMask | None = None
    relief: Relief | None = None


@lru_cache(maxsize=8)
def _ray_columns(camera: Camera) -> Float32Array:
    """(3, height, width) a camera's rays, coordinate by coordinate: what lies so in memory is faster to work with."""
    return np.ascontiguousarray(np.moveaxis(camera.rays(), -1, 0))


@dataclass(frozen=True)
class _Window:
    """The part of an image about a mask, every `step`-th pixel of it across and down: (h, w) each.

    `sigma_m` is the deviation of the depth; `own` is the mask, `others` what lies in masks of others alone.
    """

    rows: slice
    columns: slice
    depth_m: Float32Array
    sigma_m: FloatArray
    own: BoolArray
    others: BoolArray

    @property
    def at(self) -> tuple[slice, slice]:
        """Where it lies in the image."""
        return self.rows, self.columns

    def points(self, view: DepthView) -> Float32Array:
        """(3, h * w) the points in the camera's frame, column by column; without a return they mean nothing."""
        points: Float32Array = _ray_columns(view.camera)[:, self.rows, self.columns] * self.depth_m
        return points.reshape(3, -1)

    def region(self, pixels: BoolArray) -> RegionMask:
        """Some of its pixels as a region of the image."""
        step = self.rows.step
        u, v, w, h = cv2.boundingRect(pixels.view(np.uint8))
        top, left = self.rows.start + step * v, self.columns.start + step * u
        full = pixels[v : v + h, u : u + w].repeat(step, axis=0).repeat(step, axis=1)
        tight = np.ascontiguousarray(full[: self.rows.stop - top, : self.columns.stop - left])
        return RegionMask(left, top, tight)


def foreground(
    view: DepthView,
    mask: RegionMask,
    core: Callable[[], BoolArray],
    masked: BoolArray,
    parameters: ForegroundParameters = DEFAULT,
    *,
    relief_parameters: ReliefParameters = relief.DEFAULT,
) -> Foreground:
    """The pixels of the thing that a mask is of, and its relief.

    `core` gives the mask without its rim, on its region, and is asked only where that matters; `masked` (h, w): pixels
    in any mask of the image; what lies in those of others is not the surroundings.
    """
    window = _window(view, mask, masked, parameters)
    measured = (window.depth_m > 0) & view.camera.valid_mask()[window.at]
    in_mask = np.flatnonzero(window.own & measured)
    if len(in_mask) < parameters.min_points:
        return Foreground()
    beside = np.flatnonzero(measured & ~(window.own | window.others))
    points = window.points(view)
    tolerance_m = np.asarray(parameters.plane_sigmas * window.sigma_m + parameters.plane_m, np.float32).ravel()
    own_points, own_tolerance_m = points[:, in_mask], tolerance_m[in_mask]
    on_plane = np.zeros(measured.size, dtype=bool)
    thinned = beside[:: len(beside) // parameters.ring_points + 1]
    ring = thinned[ring_order(*np.divmod(thinned, window.own.shape[1]))]
    planes = planes_beside(np.ascontiguousarray(points[:, ring].T), tolerance_m[ring], parameters)
    for normal, offset in planes:
        if stands_before(normal @ own_points - offset, own_tolerance_m, parameters):
            on_plane |= np.abs(normal @ points - offset) < tolerance_m
    on_planes = measured & on_plane.reshape(measured.shape)
    left = _own_surfaces(view, window, measured & ~on_planes, lambda: _thinned(mask, core(), window.at), parameters)
    left &= ~window.others
    outer = ring[~_near_mask(window, ring)]
    behind = planes_through(points[:, outer], tolerance_m[outer], planes, parameters.plane_share)
    rise = relief_of(own_points, own_tolerance_m, behind, relief_parameters)
    if not on_planes.any() and not np.count_nonzero(left & ~window.own):
        return Foreground(None, rise)
    if np.count_nonzero(left) < parameters.min_points or _spanned(left, window.own) < parameters.span_share:
        return Foreground(None, rise)
    return Foreground(window.region(left), rise)


def _near_mask(window: _Window, pixels: IntArray) -> BoolArray:
    """(n,) which pixels of a window lie no farther from the mask's box than half the width of the surroundings."""
    u, v, w, h = cv2.boundingRect(window.own.view(np.uint8))
    height, width = window.own.shape
    rows, columns = np.divmod(pixels, width)
    above, left, below, right = v / 2, u / 2, (v + h + height) / 2, (u + w + width) / 2
    near: BoolArray = (rows >= above) & (rows < below) & (columns >= left) & (columns < right)
    return near


def stands_before(
    height_m: FloatArray | Float32Array, tolerance_m: Float32Array, parameters: ForegroundParameters
) -> bool:
    """Whether what a mask (n,) shows off a plane stands clearly before it, and does not just rise from it a little."""
    off = np.abs(height_m) >= tolerance_m
    rest = height_m[off]
    if np.count_nonzero(rest > 0) < parameters.before_share * len(rest):
        return False
    return len(rest) > 0 and float(percentiles(rest / tolerance_m[off], (50,))[0]) > parameters.clear_factor


def _window(view: DepthView, mask: RegionMask, masked: BoolArray, parameters: ForegroundParameters) -> _Window:
    h, w = mask.pixels.shape
    height, width = view.depth_m.shape
    scale = pixel_scale(view.camera, view.parameters)
    ring_px = max(parameters.ring_share * max(h, w), parameters.min_ring_px * scale)
    ring = max(1, round(min(ring_px, parameters.max_ring_px * scale)))
    top, left = max(0, mask.v0 - ring), max(0, mask.u0 - ring)
    bottom, right = min(height, mask.v0 + h + ring), min(width, mask.u0 + w + ring)
    step = max(1, round(math.sqrt((bottom - top) * (right - left) / parameters.window_pixels)))
    rows, columns = slice(top, bottom, step), slice(left, right, step)
    own = _thinned(mask, mask.pixels, (rows, columns))
    depth_m = np.ascontiguousarray(view.depth_m[rows, columns])
    return _Window(rows, columns, depth_m, view.sigma_m(depth_m), own, masked[rows, columns] & ~own)


def _thinned(mask: RegionMask, pixels: BoolArray, at: tuple[slice, slice]) -> BoolArray:
    """(h, w) some of a mask's pixels, given on its region, on the rows and columns of a window about it."""
    (h, w), (rows, columns) = pixels.shape, at
    whole = np.zeros((rows.stop - rows.start, columns.stop - columns.start), dtype=bool)
    top, left = mask.v0 - rows.start, mask.u0 - columns.start
    whole[top : top + h, left : left + w] = pixels
    return np.ascontiguousarray(whole[:: rows.step, :: columns.step])


def ring_order(v: IntArray, u: IntArray) -> IntArray:
    """(n,) the order of pixels (n,) beside a mask on the ring that they are."""
    n = max(len(v), 1)
    return np.argsort(np.arctan2(v - v.sum() / n, u - u.sum() / n), kind="stable")


def planes_beside(
    points: Float32Array, tolerance_m: Float32Array, parameters: ForegroundParameters
) -> list[tuple[FloatArray, float]]:
    """(normal (3,), offset) of the planes that the surroundings consist of, points (n, 3) in the order of their ring;
    normals point to the camera's side.

    RANSAC (Fischler and Bolles 1981) with triples that lie near one another on the ring, drawn in a fixed order.
    """
    least = max(3, round(parameters.plane_share * len(points)))
    planes: list[tuple[FloatArray, float]] = []
    while len(planes) < parameters.max_planes and len(points) >= max(least, 12):
        found = _best_plane(points, tolerance_m, least)
        if found is None:
            break
        normal, offset = found
        planes.append(found if offset <= 0 else (-normal, -offset))
        left = np.abs(points @ normal - offset) >= tolerance_m
        points, tolerance_m = points[left], tolerance_m[left]
    return planes


@lru_cache(maxsize=512)
def _triples(n: int) -> IntArray:
    """(3, m) the positions, on a ring of n points, of the triples that planes are laid through."""
    seeds = np.arange(0, n, max(1, n // 32))
    first = np.concatenate([seeds, seeds])
    span = np.repeat([max(1, n // 16), max(2, n // 6)], len(seeds))
    return np.stack([first, (first + span) % n, (first - span // 2) % n])


def _best_plane(points: Float32Array, tolerance_m: Float32Array, least: int) -> tuple[FloatArray, float] | None:
    """The plane with the most inliers among points (n, 3) in the order of the ring; `None` for fewer than `least`."""
    a, b, c = points[_triples(len(points))]
    normals = _cross(b - a, c - a)
    lengths = np.sqrt(np.square(normals).sum(axis=1))
    sound = lengths > 1e-9
    if not sound.any():
        return None
    if not sound.all():
        normals, lengths, a = normals[sound], lengths[sound], a[sound]
    normals /= lengths[:, None]
    offsets = np.einsum("ij,ij->i", normals, a)
    off_m = normals @ points.T
    off_m -= offsets[:, None]
    inliers = np.abs(off_m, out=off_m) < tolerance_m
    chosen = inliers[int(inliers.view(np.uint8).sum(axis=1, dtype=np.int32).argmax())]
    normal, offset = np.zeros(3), 0.0
    for _ in range(2):
        if np.count_nonzero(chosen) < least:
            return None
        fitted_to = chosen
        middle, normal = _fitted_plane(points[chosen])
        offset = float(normal @ middle)
        chosen = np.abs((points - middle) @ normal) < tolerance_m
        if np.array_equal(chosen, fitted_to):
            break
    return normal, offset


def _cross(first: Float32Array, second: Float32Array) -> Float32Array:
    """(n, 3) vector products of vectors (n, 3)."""
    (a, b, c), (x, y, z) = first.T, second.T
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1)


def _fitted_plane(points: Float32Array) -> tuple[Float32Array, FloatArray]:
    """The middle (3,) of points (n, 3), and the normal (3,) of the plane that fits them best."""
    middle = points.sum(axis=0) / np.float32(len(points))
    off = (points - middle).astype(np.float64)
    off -= off.sum(axis=0) / len(points)
    return middle, np.linalg.eigh(off.T @ off)[1][:, 0]


def _own_surfaces(
    view: DepthView,
    window: _Window,
    solid: BoolArray,
    core: Callable[[], BoolArray],
    parameters: ForegroundParameters,
) -> BoolArray:
    """The pixels of the surfaces that lie mostly inside the mask, and of others that do within its core, which is asked
    for if there are any.
    """
    own = window.own
    step_m = edge_step_m(window.depth_m, view.parameters, window.sigma_m)
    surface = solid & (view.farthest_m[window.at] - view.nearest_m[window.at] < step_m)
    count, components = cv2.connectedComponents(surface.view(np.uint8), connectivity=4)
    label = np.asarray(components, np.int64)
    outside, within = np.bincount((2 * label + own).ravel(), minlength=2 * count).reshape(-1, 2).T.astype(np.float64)
    outside[0] = within[0] = 0
    share = within / np.maximum(outside + within, 1)
    # Pixels on depth edges are of no surface; inside the mask, off the planes, they go with the thing.
    edges = solid & own & ~surface
    if not within.any():
        return edges
    main = int(np.argmax(within * share))
    whole = share >= parameters.own_share
    whole[_reaching_beyond(label, window, view.depth_m.shape)] = False
    partly = ~whole & (share >= parameters.rival_share * share[main])
    whole[0] = partly[0] = False
    left: BoolArray = whole.take(label) | edges
    if partly.any():
        left |= partly.take(label) & core()
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
    beyond: IntArray = np.concatenate(sides)
    return beyond


def _spanned(left: BoolArray, own: BoolArray) -> float:
    """The area of the image box of what is left inside the mask, as a share of the mask's."""

    def area(pixels: BoolArray) -> int:
        _, _, w, h = cv2.boundingRect(pixels.view(np.uint8))
        return w * h

    return area(left & own) / max(area(own), 1)
