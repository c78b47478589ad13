"""Which pixels of a mask are surely the object's: masks bleed, and depth is mixed at edges.

Comes between `GenerateMasks` and `Unproject` of the paper's algorithm 1, step (4), which takes masks as they are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.mapping.depth import DepthView, edge_step_m, plane_residual_limit_m
from supermap_cli.types.detections import RegionMask
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class MaskCoreParameters:
    """How far masks are cut back.

    The margin is `margin_share` of the square root of a mask's area, within bounds told for an image 640 wide.
    """

    margin_share: float = parameter(
        0.08, "1", "margin that masks bleed over, as a share of the root of the area", TUNED
    )
    min_margin_px: float = parameter(2.0, "px", "least margin", TUNED)
    max_margin_px: float = parameter(6.0, "px", "greatest margin", TUNED)
    max_cut: float = parameter(
        0.35, "1", "share of its half thickness that a part of a mask may lose", TUNED, at_least=0.01
    )
    thickness_steps: tuple[float, ...] = parameter(
        (0.25, 0.5, 1.0), "1", "thickness at which parts are told apart, as shares of the greatest that matters", TUNED
    )
    max_shrinkage: float = parameter(
        3.0, "1", "a mask that would be smaller than its area divided by this is taken as it is", TUNED
    )


DEFAULT = MaskCoreParameters()


@dataclass(frozen=True)
class MaskCore:
    """The part of a mask that is surely the object's, worked out when it is first asked for: what the depth around the
    mask tells can make it needless.
    """

    view: DepthView
    mask: RegionMask
    rim_px: int
    parameters: MaskCoreParameters = DEFAULT

    @cached_property
    def clear(self) -> BoolArray:
        """What of the mask's rim lies in the foreground, on the mask's region."""
        return foreground_rim(self.view, self.mask, self.rim_px)

    @cached_property
    def pixels(self) -> BoolArray:
        """All but the mask's rim, and what of the rim lies in the foreground, on the mask's region."""
        return erode(self.mask.pixels, self.rim_px, self.parameters) | self.clear


def erosion_px(area_px: int, scale: float, parameters: MaskCoreParameters = DEFAULT) -> int:
    """How far a mask is cut back: 2 to 6 pixels of a usual image, more for larger masks, which bleed more."""
    margin = max(parameters.margin_share * math.sqrt(area_px), parameters.min_margin_px * scale)
    return max(1, round(min(margin, parameters.max_margin_px * scale)))


def erode(mask: BoolArray, margin_px: int, parameters: MaskCoreParameters = DEFAULT) -> BoolArray:
    """Cut a mask back by a margin, and by less where it is thin: a pen must not vanish, nor the legs of a table, nor
    its top seen from the side.

    A part is as thick as the largest disc that fits into it (its local thickness); it loses `max_cut` of that
    disc's radius, at least a pixel, and never all of it.
    """
    thickest_px = int(np.ceil(margin_px / parameters.max_cut))
    padded = cv2.copyMakeBorder(mask.astype(np.uint8), *(1,) * 4, cv2.BORDER_CONSTANT, value=0)
    within_px = cv2.distanceTransform(padded, cv2.DIST_L2, 3)
    cut_px = np.ones_like(within_px)
    deepest_px, most_cut_px = float(within_px.max()), 1.0
    for share in parameters.thickness_steps:
        radius_px, part_cut_px = share * thickest_px, max(1.0, share * margin_px)
        if deepest_px <= radius_px:
            break
        most_cut_px = max(most_cut_px, part_cut_px)
        if most_cut_px == 1.0:
            continue  # as everywhere
        around = (within_px <= radius_px).view(np.uint8)
        cut_px[cv2.distanceTransform(around, cv2.DIST_L2, 3) <= radius_px] = part_cut_px
    core = (padded > 0) & (within_px > cut_px)
    if np.count_nonzero(core) * parameters.max_shrinkage < np.count_nonzero(mask):
        return mask
    return np.asarray(core[1:-1, 1:-1], dtype=bool)


def off_depth_edges(view: DepthView, v: IntArray, u: IntArray) -> BoolArray:
    """(n,) which pixels with a return have a neighbourhood that lies on one surface: on no depth edge.

    Either the depths around a pixel span no more than noise and a moderate slant; or, since the inverse depth of a
    plane is affine in the pixel, the inverse depth bends little about it: a table's top seen at a grazing angle spans a
    lot and is one surface all the same.
    """
    at = v * view.depth_m.shape[1] + u
    depth = view.depth_m.ravel()[at]
    one: BoolArray = view.farthest_m.ravel()[at] - view.nearest_m.ravel()[at] < edge_step_m(depth, view.parameters)
    wide = np.flatnonzero(~one)
    one[wide] = plane_residual_m(view, v[wide], u[wide]) < plane_residual_limit_m(depth[wide], view.parameters)
    return one


def plane_residual_m(view: DepthView, v: IntArray, u: IntArray) -> FloatArray:
    """How far (metres) the depth of each of n pixels lies off the plane through its neighbours on both sides: the
    greatest of four directions; infinite where fewer than two directions have a return on both sides.
    """
    height, width = view.depth_m.shape
    r = view.reach_px
    rows = np.stack([np.maximum(v - r, 0), v, np.minimum(v + r, height - 1)]) * width
    columns = np.stack([np.maximum(u - r, 0), u, np.minimum(u + r, width - 1)])
    depth = view.depth_m.ravel()[(rows[:, None] + columns).reshape(9, -1)]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse_depth = 1 / depth
        inverse_depth[np.isinf(inverse_depth)] = np.nan
        own = inverse_depth[4]
        residuals = np.abs(own - (inverse_depth[:4] + inverse_depth[:4:-1]) / 2) / own**2
    known = np.isfinite(residuals)
    residuals[~known] = 0.0
    return np.where(np.count_nonzero(known, axis=0) >= 2, residuals.max(axis=0), np.inf)


def foreground_rim(view: DepthView, mask: RegionMask, rim_px: int) -> BoolArray:
    """The pixels of a mask's rim, on its region, that lie clearly before all that is seen beside the mask near by.

    A mask bleeds onto surfaces that go on beyond it; what lies before all of those is none of them. So thin parts,
    legs, poles and leaves, which are nothing but rim, are kept. A pixel that lies behind its neighbours is left out:
    at edges sensors mix both depths.
    """
    h, w = mask.pixels.shape
    height, width = view.depth_m.shape
    top, left = max(0, mask.v0 - rim_px), max(0, mask.u0 - rim_px)
    rows, columns = slice(top, min(height, mask.v0 + h + rim_px)), slice(left, min(width, mask.u0 + w + rim_px))
    depth = view.depth_m[rows, columns]
    beside = depth > 0
    at = (slice(mask.v0 - top, mask.v0 - top + h), slice(mask.u0 - left, mask.u0 - left + w))
    beside[at] &= ~mask.pixels
    kernel = np.ones((2 * rim_px + 1, 2 * rim_px + 1), np.uint8)
    nearest_beside = cv2.erode(np.where(beside, depth, np.float32(np.inf)), kernel, borderType=cv2.BORDER_REPLICATE)[at]
    own = depth[at]
    rim = np.flatnonzero(mask.pixels & (own > 0) & (nearest_beside < np.inf))
    own_m = own.ravel()[rim]
    step = edge_step_m(own_m, view.parameters)
    before = own_m < nearest_beside.ravel()[rim] - step
    whole = own_m - view.nearest_m[rows, columns][at].ravel()[rim] < step
    clear = np.zeros(mask.pixels.shape, dtype=bool)
    clear.ravel()[rim] = before & whole
    return clear
