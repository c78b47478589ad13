"""What a depth camera makes of an exact view: noise, and holes where such cameras return nothing."""

from __future__ import annotations

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, IntArray
from supermap_cli.simulation.rigs import DepthSensor
from supermap_cli.simulation.views import RenderedView

_EDGE_M, _EDGE_SHARE = 0.03, 0.05  # m and share of the depth: the greater is the least jump of an edge
_PATCH_PX = 6  # px, chosen: width of patches that flicker together
_MULTIPATH_PX, _BLIND_PX = 40, 12  # px, chosen by looking: width of patches of equal multipath, and without return
_TEXTURE_PX = 9  # px: side of the square over which texture is measured
_TEXTURED = 6.0  # grey levels (0..255): standard deviation of the brightness from which a match is certain
_BLIND_TEXTURED, _BLIND_PLAIN = 2.0, 0.3  # standard deviations of the noise above which a patch is blind
_PLAIN_FAR_M = 4.0  # m, chosen: farther off a projected pattern helps no plain surface


def measure_depth(view: RenderedView, sensor: DepthSensor, rng: np.random.Generator) -> Float32Array:
    """Depth (h, w) in metres as the sensor reports it, 0 = no return.

    Beside a depth edge (a jump of more than 3 cm and 5 %) some pixels return nothing and some fly between both
    surfaces, as where one pixel sees parts of each: with the usual sensor most and a few.
    """
    exact = view.depth_m
    sigma = np.float32(sensor.noise_per_m) * exact * exact
    if sensor.noise_m > 0:
        sigma = np.hypot(sigma, np.float32(sensor.noise_m))
    if sensor.noise_px > 0:
        measured = exact + sigma * smooth_noise(exact.shape, sensor.noise_px, rng)
    else:
        measured = exact + sigma * rng.standard_normal(exact.shape, dtype=np.float32)
    if sensor.multipath_share > 0:
        longer = np.maximum(smooth_noise(exact.shape, _MULTIPATH_PX, rng) + 1, 0)
        measured += np.float32(sensor.multipath_share) * exact * longer
    near, far = _nearest_around(exact, sensor.edge_px), _farthest_around(exact, sensor.edge_px)
    edge = np.flatnonzero(_beside_edges(exact, sensor.edge_px))
    fate = rng.random(len(edge), dtype=np.float32)
    _mix(measured, near, far, edge[fate >= 1 - sensor.edge_mixed], rng)
    if sensor.flicker:
        in_front = smooth_noise(exact.shape, _PATCH_PX, rng) > 0
        flickering = edge[fate < 1 - sensor.edge_mixed]
        measured.flat[flickering] = np.where(in_front, near, far).flat[flickering]
    lost = (view.slant_cos < np.cos(np.radians(sensor.steepest_deg))) | (exact == 0)
    lost |= rng.random(exact.shape, dtype=np.float32) < sensor.lost_share
    lost |= (measured < sensor.nearest_m) | (measured > sensor.farthest_m)
    lost.flat[edge[fate < sensor.edge_holes]] = True
    if sensor.blind_patches:
        lost |= _blind(view, rng)
    if view.returns is not None:
        lost |= ~view.returns
    measured[lost] = 0
    return measured


def smooth_noise(shape: tuple[int, ...], patch_px: int, rng: np.random.Generator) -> Float32Array:
    """(h, w) noise of variance 1 whose patches are about `patch_px` wide."""
    height, width = shape
    coarse = rng.standard_normal((height // patch_px + 2, width // patch_px + 2), dtype=np.float32)
    fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    noise: Float32Array = np.asarray(fine / max(float(fine.std()), 1e-6), np.float32)
    return noise


def _blind(view: RenderedView, rng: np.random.Generator) -> BoolArray:
    """(h, w) where stereo finds no match: patches, the more of them the less texture there is and the farther it is."""
    grey = view.rgb.mean(axis=2, dtype=np.float32)
    square = (_TEXTURE_PX, _TEXTURE_PX)
    variance = cv2.blur(grey * grey, square) - cv2.blur(grey, square) ** 2
    plain = 1 - np.clip(np.sqrt(np.maximum(variance, 0)) / _TEXTURED, 0, 1)
    plain *= np.clip(view.depth_m / _PLAIN_FAR_M, 0, 1)
    threshold = _BLIND_TEXTURED - (_BLIND_TEXTURED - _BLIND_PLAIN) * plain
    blind: BoolArray = smooth_noise(grey.shape, _BLIND_PX, rng) > threshold
    return blind


def _beside_edges(depth_m: Float32Array, reach_px: int) -> BoolArray:
    """(h, w) which returns lie within a square of `reach_px` of a jump from one pixel to the next."""
    if reach_px < 1:
        return np.zeros(depth_m.shape, bool)
    near, far = _nearest_around(depth_m, 1), _farthest_around(depth_m, 1)
    jump = far - near > np.maximum(_EDGE_M, _EDGE_SHARE * near)
    return (_farthest_around(jump.astype(np.float32), reach_px - 1) > 0) & (depth_m > 0)


def _mix(measured: Float32Array, near: Float32Array, far: Float32Array, at: IntArray, rng: np.random.Generator) -> None:
    """Replace some pixels (flat indices) by a random mean of the nearest and the farthest depth around them."""
    weight = rng.random(len(at), dtype=np.float32)
    measured.flat[at] = near.flat[at] * weight + far.flat[at] * (1 - weight)


def _nearest_around(depth_m: Float32Array, reach_px: int) -> Float32Array:
    """(h, w) the nearest return within a square of `reach_px` around each pixel, inf where there is none."""
    return -_farthest_around(np.where(depth_m > 0, -depth_m, np.float32(-np.inf)), reach_px)


def _farthest_around(depth_m: Float32Array, reach_px: int) -> Float32Array:
    """(h, w) the largest value within a square of `reach_px` around each pixel: rows first, then columns."""
    largest = depth_m.copy()
    for axis in (0, 1):
        values = np.moveaxis(largest.copy(), axis, 0)
        into = np.moveaxis(largest, axis, 0)
        for step in range(1, reach_px + 1):
            np.maximum(into[step:], values[:-step], out=into[step:])
            np.maximum(into[:-step], values[step:], out=into[:-step])
    return largest
