"""The part of a frame around one box: its depth as points, sampled on a regular grid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray
from supermap_cli.geometry.cameras import Camera

_MARGIN_SHARE = 0.25
"""How far the patch reaches beyond the box on each side, as a share of the box's size. Chosen."""
_MIN_MARGIN_PX = 6
"""The same in pixels, at least. Chosen."""
_CENTRALITY_STD = 0.25
"""Standard deviation of the central weight as a share of the box's size. Chosen: the edges are at two of them."""
_NOISE_PER_M = 1.425e-3
"""Standard deviation of the depth of a Kinect per square metre of depth (Khoshelham and Elberink 2012, equation 11)."""


@dataclass(frozen=True)
class Patch:
    """Samples `step` pixels apart from pixel (`u0`, `v0`) on, (h, w) of them.

    `depth_m` (h, w), 0 = no return; `points` (h, w, 3) metres in the optical frame; `share_u` (w,) and `share_v` (h,)
    where in the box a column or row lies, 0 at its left or upper side and 1 at the other; `size_at_1m` is the longer
    side of the box in metres, were it one metre away.
    """

    u0: int
    v0: int
    step: int
    depth_m: Float32Array
    points: FloatArray
    share_u: FloatArray
    share_v: FloatArray
    size_at_1m: float

    @cached_property
    def valid(self) -> BoolArray:
        """(h, w) where there is a depth."""
        return self.depth_m > 0

    @cached_property
    def in_box(self) -> BoolArray:
        """(h, w) which samples lie in the box."""
        return self.within(0.0)

    @cached_property
    def centrality(self) -> FloatArray:
        """(h, w) weight of the samples: a Gaussian about the box's centre, 0 outside the box."""
        across, down = (
            np.exp(-((share - 0.5) ** 2) / (2 * _CENTRALITY_STD**2)) for share in (self.share_u, self.share_v)
        )
        return down[:, None] * across[None, :] * self.in_box

    def within(self, margin: float) -> BoolArray:
        """(h, w) which samples lie in the box made smaller by `margin`, a share of its size, on each side."""
        across, down = ((share >= margin) & (share <= 1 - margin) for share in (self.share_u, self.share_v))
        return down[:, None] & across[None, :]


def cut_patch(depth_m: Float32Array, camera: Camera, box_xyxy: Float32Array, samples: int) -> Patch | None:
    """Cut the patch around a box, sampled to about `samples` points; `None` for a box outside the image."""
    height, width = depth_m.shape
    box = np.clip(box_xyxy.astype(np.float64), 0, [width, height, width, height])
    size = box[2:] - box[:2]
    if (size < 1).any():
        return None
    margin_px = np.maximum(_MARGIN_SHARE * size, _MIN_MARGIN_PX)
    u0, v0 = np.maximum(np.floor(box[:2] - margin_px), 0).astype(int).tolist()
    u1, v1 = np.minimum(np.ceil(box[2:] + margin_px), [width, height]).astype(int).tolist()
    step = max(1, int(np.ceil(np.sqrt((u1 - u0) * (v1 - v0) / samples))))
    depth = depth_m[v0:v1:step, u0:u1:step]
    u, v = np.arange(u0, u1, step), np.arange(v0, v1, step)
    pixels = np.column_stack([np.tile(u, len(v)), np.repeat(v, len(u))]).astype(np.float64)
    points = camera.back_project(pixels, depth.ravel().astype(np.float64)).reshape(*depth.shape, 3)
    corners = camera.back_project(box.reshape(2, 2), np.ones(2))
    share_u, share_v = (u + 0.5 - box[0]) / size[0], (v + 0.5 - box[1]) / size[1]
    return Patch(u0, v0, step, depth, points, share_u, share_v, float(np.abs(corners[1] - corners[0]).max()))


def depth_noise_m(depth_m: Float32Array | FloatArray) -> FloatArray:
    """Standard deviation of a structured-light depth camera, metres (Khoshelham and Elberink 2012, equation 11)."""
    return _NOISE_PER_M * np.square(np.asarray(depth_m, np.float64))
