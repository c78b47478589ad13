"""Whether colour and depth really fit together, judged by the images themselves.

Many recordings carry one camera's calibration for both images, or call a depth image registered that is not. Where
depth jumps, colour mostly changes too; so the colour camera's focal length and principal point are looked for under
which the depth image's jumps fall best on the colour image's edges. Between two cameras as near to one another as an
RGB-D sensor's, the difference is a scaling and a shift of the image, up to a parallax of a few pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray, UInt8Array
from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.geometry.se3 import make_transform

_JUMP_M, _JUMP_SHARE, _JUMP_PX = 0.1, 0.1, 3
"""A depth jump is more than so many m, and than this share of the nearer depth, between pixels so far apart: above an
RGB-D sensor's noise and the slant of a floor.
"""

_MOST_JUMPS = 1000
"""Depth jumps of an image that are looked at, evenly drawn from all: bounds the time of the search."""

_LEAST_JUMPS = 2000
"""Depth jumps of all images together below which nothing is said; set by hand on the test recordings."""

_LEAST_GAIN = 0.2
"""Standard deviations of edge strength by which a fit must be better than the given calibration to replace it; set by
hand on the test recordings.
"""

_AS_IT_IS = np.array([1.0, 0.0, 0.0])
"""Scale, shift u and shift v (pixels) of images that fit as they are."""


@dataclass(frozen=True)
class ImageFit:
    """Depth pixel p at z metres is seen at `scale * (p - centre) + centre + shift + parallax / z` of the colour image.

    `parallax_u` and `parallax_v` are pixels times metres: what the cameras' standing apart shifts near things by.
    `score` is the mean strength of the colour edges under the depth jumps, in standard deviations above the image's
    mean; `score_before` is the same where the two images are taken as they are.
    """

    scale: float
    shift_u: float
    shift_v: float
    score: float
    score_before: float
    parallax_u: float = 0.0
    parallax_v: float = 0.0


@dataclass(frozen=True)
class ColorDepthFit:
    """The colour camera as the images show it, and where the depth camera stands from it: `T_color_depth` (4, 4)."""

    camera: PinholeCamera
    T_color_depth: FloatArray
    fit: ImageFit


@dataclass(frozen=True)
class _Level:
    """One level of the search: how far the edges are blurred, which share of the jumps is looked at, how far the search
    reaches and by which steps.
    """

    blur_px: float
    every: int
    reach_scale: float
    step_scale: float
    reach_px: float
    step_px: float

    def candidates(self, best: FloatArray) -> FloatArray:
        """(k, 3) scales, shifts u and shifts v around the best so far."""
        scales = np.arange(-self.reach_scale, self.reach_scale + self.step_scale / 2, self.step_scale)
        shifts = np.arange(-self.reach_px, self.reach_px + self.step_px / 2, self.step_px)
        around: FloatArray = best + np.stack(np.meshgrid(scales, shifts, shifts, indexing="ij"), axis=-1).reshape(-1, 3)
        return around

    def at_edge(self, moved: FloatArray) -> bool:
        """Whether (3,) scale and shifts, relative to the search's middle, lie where the search ends."""
        reach = np.array([self.reach_scale, self.reach_px, self.reach_px])
        return bool((np.abs(moved) > 0.99 * reach).any())


_COARSE = _Level(6, 4, 0.24, 0.02, 24, 8)
"""The first level: focal lengths up to 24 % off, as a depth camera's given for the colour camera's (Kinect: 10 %)."""

_FINER = (_Level(2.5, 1, 0.02, 0.005, 8, 2), _Level(1.5, 1, 0.005, 0.00125, 2, 0.5))
"""The levels after it: each reaches one step of the one before and is as fine as its blur allows."""

_COMPARED = (_Level(2.5, 2, 0.02, 0.005, 8, 2),)
"""The level at which the two halves of the images are compared."""

_MOST_APART = np.array([0.02, 4.0, 4.0])
"""Scale and shifts (pixels) by which the fits of the two halves may differ: a few steps of that level."""

_JUDGED_BLUR_PX = 2.5
"""Pixels, the blur of the edges under which fits are compared: what is left of lens distortion and unequal stamps."""

_LEAST_PARALLAX_GAIN = 0.02
"""Standard deviations by which a parallax must improve a fit to be kept; set by hand on the test recordings."""

_MOST_PARALLAX = 0.1
"""Pixel metres for each pixel of image width; an RGB-D sensor's baseline of 50 mm at 600 px is 30 px m, 0.05."""


def corrected_color_camera(
    images: Sequence[tuple[UInt8Array, Float32Array]], camera: PinholeCamera
) -> ColorDepthFit | None:
    """The colour camera under which colour and depth images fit; `None` if they fit as they are or it cannot be told.

    `images` are a dozen or more pairs of (h, w, 3) rgb and (h, w) depth in metres, in order of time, spread over the
    recording and taken to share `camera`, which is right for the depth.
    """
    fit = fit_images(images)
    if fit is None or fit.score - fit.score_before < _LEAST_GAIN:
        return None
    fit = add_parallax(images, fit)
    centre_u, centre_v = (camera.width - 1) / 2, (camera.height - 1) / 2
    corrected = replace(
        camera,
        fx=camera.fx * fit.scale,
        fy=camera.fy * fit.scale,
        cx=fit.scale * (camera.cx - centre_u) + centre_u + fit.shift_u,
        cy=fit.scale * (camera.cy - centre_v) + centre_v + fit.shift_v,
    )
    apart_m = [fit.parallax_u / corrected.fx, fit.parallax_v / corrected.fy, 0.0]
    return ColorDepthFit(corrected, make_transform(np.eye(3), apart_m), fit)


def add_parallax(images: Sequence[tuple[UInt8Array, Float32Array]], fit: ImageFit) -> ImageFit:
    """Refine a fit by the cameras' standing apart; kept only where it explains the edges clearly better.

    A shift of the whole image and a parallax look alike at one depth, so all five values are fitted together
    (Nelder, Mead 1965) and a baseline of an RGB-D sensor's size is asked for.
    """
    from scipy.optimize import minimize  # noqa: PLC0415 - loaded when used

    jumps = [_depth_jumps(depth_m) for _, depth_m in images]
    edges = [_normal_edges(_gradient(rgb), _JUDGED_BLUR_PX) for rgb, _ in images]
    count = sum(map(len, jumps))

    def loss(step: FloatArray) -> float:
        return (
            -sum(
                _score_with_parallax(edge, points, start + step * unit)
                for edge, points in zip(edges, jumps, strict=True)
            )
            / count
        )

    start = np.array([fit.scale, fit.shift_u, fit.shift_v, 0.0, 0.0])
    unit = np.array([0.01, 2.0, 2.0, 5.0, 5.0])
    simplex = np.concatenate([np.zeros((1, 5)), np.eye(5) * [1, 2, 1, -2, 1]])
    found = minimize(loss, np.zeros(5), method="Nelder-Mead", options={"initial_simplex": simplex, "maxiter": 250})
    scale, shift_u, shift_v, parallax_u, parallax_v = (start + found.x * unit).tolist()
    plain = -loss(np.zeros(5))
    baseline_px_m = float(np.hypot(parallax_u, parallax_v))
    if -found.fun < plain + _LEAST_PARALLAX_GAIN or baseline_px_m > _MOST_PARALLAX * images[0][0].shape[1]:
        return fit
    return ImageFit(scale, shift_u, shift_v, float(-found.fun), fit.score_before, parallax_u, parallax_v)


def _score_with_parallax(edges: Float32Array, jumps: FloatArray, values: FloatArray) -> float:
    """Sum of the edges under the jumps for (scale, shift u and v, parallax u and v)."""
    height, width = edges.shape
    pixels = jumps[:, :2] * values[0] + values[1:3] + values[3:5] / jumps[:, 2:3]
    u, v = np.rint(pixels + np.array([(width - 1) / 2, (height - 1) / 2])).astype(np.int64).T
    seen = (u >= 0) & (v >= 0) & (u < width) & (v < height)
    return float(edges[v[seen], u[seen]].sum())


def fit_images(images: Sequence[tuple[UInt8Array, Float32Array]]) -> ImageFit | None:
    """The scaling and shift that lay the depth images' jumps onto the colour images' edges, from coarse to fine.

    `None` where the depth images hold too few jumps, where the first and the second half of the images, which are in
    order of time, do not say the same, or where the best lies at the edge of the search.
    """
    jumps = [_depth_jumps(depth_m) for _, depth_m in images]
    count = sum(map(len, jumps))
    if count < _LEAST_JUMPS:
        return None
    gradients = [_gradient(rgb) for rgb, _ in images]
    candidates = _COARSE.candidates(_AS_IT_IS)
    scores = _scores(gradients, jumps, candidates, _COARSE.blur_px, _COARSE.every)
    middle = len(images) // 2
    halves = [
        _best(gradients[part], jumps[part], candidates, scores[:, part], _COMPARED)
        for part in (slice(None, middle), slice(middle, None))
    ]
    if halves[0] is None or halves[1] is None or (np.abs(halves[0] - halves[1]) > _MOST_APART).any():
        return None
    best = _best(gradients, jumps, candidates, scores, _FINER)
    if best is None:
        return None
    judged = _scores(gradients, jumps, np.stack([best, _AS_IT_IS]), _JUDGED_BLUR_PX, 1).sum(axis=1)
    score, before = (judged / count).tolist()
    scale, shift_u, shift_v = best.tolist()
    return ImageFit(scale, shift_u, shift_v, score, before)


def _best(
    gradients: Sequence[Float32Array],
    jumps: Sequence[FloatArray],
    candidates: FloatArray,
    scores: FloatArray,
    levels: Sequence[_Level],
) -> FloatArray | None:
    """(3,) the best of the coarse level's candidates, refined; `None` where the coarse search has it at its edge."""
    best: FloatArray = candidates[int(scores.sum(axis=1).argmax())]
    if _COARSE.at_edge(best - _AS_IT_IS):
        return None
    for level in levels:
        around = level.candidates(best)
        best = around[int(_scores(gradients, jumps, around, level.blur_px, level.every).sum(axis=1).argmax())]
    return best


def _depth_jumps(depth_m: Float32Array) -> FloatArray:
    """(n, 3) u, v relative to the image's centre, and the nearer depth, where it jumps between two measured pixels."""
    height, width = depth_m.shape
    found = []
    for du, dv in ((_JUMP_PX, 0), (0, _JUMP_PX)):
        a, b = depth_m[dv:, du:], depth_m[: height - dv, : width - du]
        near = np.minimum(a, b)
        v, u = np.nonzero((near > 0) & (np.abs(a - b) > np.maximum(_JUMP_SHARE * near, _JUMP_M)))
        found.append(np.column_stack([u + du / 2, v + dv / 2, near[v, u]]))
    jumps = np.concatenate(found) - [(width - 1) / 2, (height - 1) / 2, 0]
    chosen = np.linspace(0, len(jumps) - 1, min(len(jumps), _MOST_JUMPS)).astype(np.int64)
    some: FloatArray = jumps[chosen]
    return some


def _gradient(rgb: UInt8Array) -> Float32Array:
    """(h, w) strength of the colour image's edges, its root: many weak ones are to count for more than a strong one."""
    import cv2  # noqa: PLC0415 - loaded when used

    grey = cv2.GaussianBlur(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), (0, 0), 1.0)
    strength = np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1))
    compressed: Float32Array = np.sqrt(strength).astype(np.float32)
    return compressed


def _normal_edges(gradient: Float32Array, blur_px: float) -> Float32Array:
    """(h, w) edges blurred, with mean 0 and deviation 1."""
    import cv2  # noqa: PLC0415 - loaded when used

    blurred = cv2.GaussianBlur(gradient, (0, 0), blur_px)
    normal: Float32Array = (blurred - blurred.mean()) / max(float(blurred.std()), 1e-6)
    return normal


def _scores(
    gradients: Sequence[Float32Array], jumps: Sequence[FloatArray], candidates: FloatArray, blur_px: float, every: int
) -> FloatArray:
    """(k, images) sum of the blurred edges (mean 0, deviation 1, 0 beyond the image) under each image's jumps."""
    scores = np.zeros((len(candidates), len(gradients)))
    for i, (gradient, points) in enumerate(zip(gradients, jumps, strict=True)):
        normal = _normal_edges(gradient, blur_px)
        height, width = normal.shape
        border = int(0.15 * max(width, height)) + 40
        flat = np.pad(normal, border).ravel()
        stride = width + 2 * border
        some = points[::every, :2].astype(np.float32)
        origin = candidates[:, 1:] + [(width - 1) / 2 + border, (height - 1) / 2 + border]
        for k, (scale, (u0, v0)) in enumerate(zip(candidates[:, 0], origin, strict=True)):
            pixels = (some * np.float32(scale) + np.array([u0 + 0.5, v0 + 0.5], np.float32)).astype(np.int32)
            scores[k, i] = flat[pixels[:, 1] * stride + pixels[:, 0]].sum()
    return scores
