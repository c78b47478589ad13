"""What a segmenter does to a thing's outline: bleeding, erosion, patches of the surroundings, merging, splitting."""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray
from supermap_cli.types.detections import RegionMask, cut_mask

_GRID_PX = 12
"""px over which the outline's wobble changes; chosen so that it runs in bays, and not in single pixels."""
_LARGEST_SHARE = 0.08
"""The most that an outline moves, as a share of the square root of the mask's area (px / px); chosen so that a square
eroded all around keeps 70 % of its area.
"""


def enlarged(mask: RegionMask, margin: int, height: int, width: int) -> RegionMask:
    """The mask with up to `margin` empty pixels on every side, as far as the image goes."""
    h, w = mask.pixels.shape
    u0, v0 = max(mask.u0 - margin, 0), max(mask.v0 - margin, 0)
    u1, v1 = min(mask.u0 + w + margin, width), min(mask.v0 + h + margin, height)
    pixels = np.zeros((v1 - v0, u1 - u0), bool)
    pixels[mask.v0 - v0 : mask.v0 - v0 + h, mask.u0 - u0 : mask.u0 - u0 + w] = mask.pixels
    return RegionMask(u0, v0, pixels)


def tight(mask: RegionMask) -> RegionMask | None:
    """The mask cut to what it covers; `None` for an empty one."""
    cut = cut_mask(mask.pixels)
    return None if cut is None else RegionMask(mask.u0 + cut.u0, mask.v0 + cut.v0, cut.pixels)


def touch(first: RegionMask, second: RegionMask) -> bool:
    """Whether two masks come within two pixels of one another."""
    import cv2  # noqa: PLC0415 - keeps start-up light

    low_u, low_v = max(first.u0, second.u0) - 2, max(first.v0, second.v0) - 2
    high_u = min(first.u0 + first.pixels.shape[1], second.u0 + second.pixels.shape[1]) + 2
    high_v = min(first.v0 + first.pixels.shape[0], second.v0 + second.pixels.shape[0]) + 2
    if low_u >= high_u or low_v >= high_v:
        return False
    a, b = (_window(mask, low_u, low_v, high_u, high_v) for mask in (first, second))
    return bool((cv2.dilate(a.view(np.uint8), np.ones((5, 5), np.uint8)).view(bool) & b).any())


def _window(mask: RegionMask, u0: int, v0: int, u1: int, v1: int) -> BoolArray:
    """What a mask covers of a window of the image, (v1 - v0, u1 - u0)."""
    window = np.zeros((v1 - v0, u1 - u0), bool)
    h, w = mask.pixels.shape
    low_u, low_v, high_u, high_v = max(u0, mask.u0), max(v0, mask.v0), min(u1, mask.u0 + w), min(v1, mask.v0 + h)
    if low_u < high_u and low_v < high_v:
        part = mask.pixels[low_v - mask.v0 : high_v - mask.v0, low_u - mask.u0 : high_u - mask.u0]
        window[low_v - v0 : high_v - v0, low_u - u0 : high_u - u0] = part
    return window


def redrawn(
    mask: RegionMask, *, grow_px: float, wobble_px: float, height: int, width: int, rng: np.random.Generator
) -> RegionMask:
    """The mask grown by `grow_px` (shrunk, if negative) with an outline that wobbles smoothly.

    A thing is small in proportion to what it loses or gains: neither exceeds 8 % of the square root of its area, and
    one that would vanish keeps its outline.
    """
    area_px = int(mask.pixels.sum())
    most_px = _LARGEST_SHARE * np.sqrt(area_px)
    grow_px = float(np.clip(grow_px, -most_px, most_px))
    wobble_px = float(min(wobble_px, most_px / 2))
    if not grow_px and not wobble_px:
        return mask
    canvas = enlarged(mask, 2 + int(np.ceil(max(grow_px, 0) + 3 * wobble_px)), height, width)
    outline_px = signed_distance_px(canvas.pixels) + grow_px
    if wobble_px:
        outline_px += _smooth_noise(canvas.pixels.shape, rng) * wobble_px
    found = tight(RegionMask(canvas.u0, canvas.v0, outline_px > 0))
    return found if found is not None and found.pixels.sum() > area_px / 3 else mask


def signed_distance_px(pixels: BoolArray) -> Float32Array:
    """How far each pixel lies within (positive) or outside of the mask's outline."""
    import cv2  # noqa: PLC0415

    inside = pixels.view(np.uint8)
    within = np.asarray(cv2.distanceTransform(inside, cv2.DIST_L2, 3), np.float32)
    outside = np.asarray(cv2.distanceTransform(1 - inside, cv2.DIST_L2, 3), np.float32)
    return within - outside + np.where(pixels, np.float32(-0.5), np.float32(0.5))


def _smooth_noise(shape: tuple[int, ...], rng: np.random.Generator) -> Float32Array:
    """Noise (h, w) of about unit variance that changes over `_GRID_PX` pixels."""
    import cv2  # noqa: PLC0415

    coarse = rng.normal(0, 1.4, (2 + shape[0] // _GRID_PX, 2 + shape[1] // _GRID_PX)).astype(np.float32)
    return np.asarray(cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR), np.float32)


def with_patch(mask: RegionMask, *, height: int, width: int, rng: np.random.Generator) -> RegionMask:
    """The mask with an elliptic patch of whatever is beside it, 8 to 20 % of its size, at a random place of its rim."""
    size_px = np.sqrt(mask.pixels.sum())
    radii = np.maximum(rng.uniform(0.08, 0.2, 2) * size_px, 1.0)
    canvas = enlarged(mask, int(np.ceil(radii.max())), height, width)
    rim = np.argwhere(canvas.pixels & ~_shifted_all(canvas.pixels))
    v, u = rim[int(rng.integers(len(rim)))]
    patch = ellipse((int(u), int(v)), radii, canvas.pixels.shape)
    pixels = canvas.pixels.copy()
    h, w = patch.pixels.shape
    pixels[patch.v0 : patch.v0 + h, patch.u0 : patch.u0 + w] |= patch.pixels
    return tight(RegionMask(canvas.u0, canvas.v0, pixels)) or mask


def _shifted_all(pixels: BoolArray) -> BoolArray:
    """(h, w) whether all four neighbours are set; at the border none is."""
    inner = np.zeros_like(pixels)
    inner[1:-1, 1:-1] = pixels[:-2, 1:-1] & pixels[2:, 1:-1] & pixels[1:-1, :-2] & pixels[1:-1, 2:]
    return inner


def ellipse(center_uv: tuple[int, int], radii_px: FloatArray, shape: tuple[int, ...]) -> RegionMask:
    """An upright ellipse of `radii_px` (2,) across and down about a pixel of an image (h, w); at least that pixel."""
    (u, v), (radius_u, radius_v), (height, width) = center_uv, radii_px, shape
    u0, u1 = max(int(np.floor(u - radius_u)), 0), min(int(np.ceil(u + radius_u)) + 1, width)
    v0, v1 = max(int(np.floor(v - radius_v)), 0), min(int(np.ceil(v + radius_v)) + 1, height)
    across = ((np.arange(u0, u1) - u) / max(radius_u, 0.5)) ** 2
    down = ((np.arange(v0, v1) - v) / max(radius_v, 0.5)) ** 2
    return RegionMask(u0, v0, across[None, :] + down[:, None] <= 1)


def split_in_two(mask: RegionMask, rng: np.random.Generator) -> tuple[RegionMask, RegionMask] | None:
    """The parts on both sides of a cut across the mask's longer axis, each at least a quarter of it; `None` where there
    are none.
    """
    v, u = np.nonzero(mask.pixels)
    offsets = np.column_stack([u - u.mean(), v - v.mean()])
    _, axes = np.linalg.eigh(offsets.T @ offsets)
    along = offsets @ axes[:, 1]
    beyond = along > np.quantile(along, rng.uniform(0.3, 0.7))
    if not 0.25 <= beyond.mean() <= 0.75:
        return None
    halves = []
    for chosen in (beyond, ~beyond):
        pixels = np.zeros_like(mask.pixels)
        pixels[v[chosen], u[chosen]] = True
        halves.append(tight(RegionMask(mask.u0, mask.v0, pixels)))
    first, second = halves
    return None if first is None or second is None else (first, second)


def parts_across_seam(mask: RegionMask, width: int) -> list[RegionMask]:
    """A mask of a full turn, in which a thing across the seam touches both sides of the image: its two parts.

    The cut is the widest gap between them; a thing that goes all the way round is one.
    """
    occupied = mask.pixels.any(axis=0)
    if mask.u0 > 0 or mask.pixels.shape[1] < width or occupied.all():
        return [mask]
    columns = np.flatnonzero(occupied)
    gap = int(np.argmax(np.diff(columns)))
    middle = (int(columns[gap]) + int(columns[gap + 1])) // 2
    sides = (RegionMask(0, mask.v0, mask.pixels[:, :middle]), RegionMask(middle, mask.v0, mask.pixels[:, middle:]))
    return [part for part in map(tight, sides) if part is not None]
