"""Which pixels of a mask are surely the object's: masks bleed, and depth is mixed at edges."""

from __future__ import annotations

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.mapping.depth import DepthView, depth_sigma_m
from supermap_cli.types.detections import RegionMask

LARGEST_CUT, CUT_STEPS = 0.35, (0.25, 0.5, 1.0)
"""No part of a mask loses more than this share of its half thickness on either side; thickness is told in steps."""

LEAST_LEFT = 3
"""A mask that would lose all but one in so many pixels is taken as it is."""


def erode(mask: BoolArray, margin_px: int) -> BoolArray:
    """Cut a mask back by a margin, and by less where it is thin: a pen must not vanish, nor the legs of a table, nor
    its top seen from the side.

    A part is as thick as the largest disc that fits into it (its local thickness); it loses `LARGEST_CUT` of that
    disc's radius, at least a pixel, and never all of it.
    """
    thickest_px = int(np.ceil(margin_px / LARGEST_CUT))
    padded = cv2.copyMakeBorder(mask.astype(np.uint8), *(1,) * 4, cv2.BORDER_CONSTANT, value=0)
    within_px = cv2.distanceTransform(padded, cv2.DIST_L2, 3)
    cut_px = np.ones_like(within_px)
    for share in CUT_STEPS:
        radius_px = share * thickest_px
        centers = within_px > radius_px
        if not centers.any():
            break
        in_disc = cv2.distanceTransform((~centers).astype(np.uint8), cv2.DIST_L2, 3) <= radius_px
        cut_px[in_disc] = max(1.0, share * margin_px)
    core = (padded > 0) & (within_px > cut_px)
    if core.sum() * LEAST_LEFT < mask.sum():
        return mask
    return np.asarray(core[1:-1, 1:-1], dtype=bool)


def on_one_surface(view: DepthView, v: IntArray, u: IntArray) -> BoolArray:
    """(n,) which pixels with a return have a neighbourhood that lies on one surface: on no depth edge.

    Either the depths around a pixel span no more than noise and a moderate slant; or, since the inverse depth of a
    plane is affine in the pixel, the inverse depth bends little about it: a table's top seen at a grazing angle spans a
    lot and is one surface all the same.
    """
    at = v * view.depth_m.shape[1] + u
    depth = view.depth_m.ravel()[at]
    one: BoolArray = view.farthest_m.ravel()[at] - view.nearest_m.ravel()[at] < edge_step_m(depth)
    wide = np.flatnonzero(~one)
    one[wide] = bend_m(view, v[wide], u[wide]) < bend_step_m(depth[wide])
    return one


def bend_m(view: DepthView, v: IntArray, u: IntArray) -> FloatArray:
    """How far (metres) the depth of each of n pixels lies off the plane through its neighbours on both sides: the
    greatest of four directions; infinite where fewer than two directions have a return on both sides.
    """
    height, width = view.depth_m.shape
    r = view.reach_px
    rows = [np.maximum(v - r, 0) * width, v * width, np.minimum(v + r, height - 1) * width]
    columns = [np.maximum(u - r, 0), u, np.minimum(u + r, width - 1)]
    depth = view.depth_m.ravel()[np.stack([row + column for row in rows for column in columns])]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse_depth = 1 / depth
        inverse_depth[np.isinf(inverse_depth)] = np.nan
        own = inverse_depth[4]
        bends = np.abs(own - (inverse_depth[:4] + inverse_depth[:4:-1]) / 2) / own**2
    told = np.isfinite(bends)
    bends[~told] = 0.0
    return np.where(np.count_nonzero(told, axis=0) >= 2, bends.max(axis=0), np.inf)


def standing_clear(view: DepthView, mask: RegionMask, rim_px: int) -> BoolArray:
    """The pixels of a mask's rim, on its region, that stand clearly before all that is seen beside the mask near by.

    A mask bleeds onto surfaces that go on beyond it; what stands before all of those is none of them. So thin parts,
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
    step = edge_step_m(own_m)
    before = own_m < nearest_beside.ravel()[rim] - step
    whole = own_m - view.nearest_m[rows, columns][at].ravel()[rim] < step
    clear = np.zeros(mask.pixels.shape, dtype=bool)
    clear.ravel()[rim] = before & whole
    return clear


def bend_step_m(depth_m: Float32Array | FloatArray) -> FloatArray:
    """The bend above which a pixel lies on a depth edge: 4 sigma and what a surface may curve by."""
    step: FloatArray = 4 * depth_sigma_m(depth_m) + 0.01
    return step


def edge_step_m(depth_m: Float32Array | FloatArray) -> FloatArray:
    """The depth range within a pixel's neighbourhood above which it lies on an edge: 4 sigma and a slant of 75
    degrees.
    """
    step: FloatArray = 4 * depth_sigma_m(depth_m) + 0.03 * np.asarray(depth_m, np.float64) + 0.02
    return step
