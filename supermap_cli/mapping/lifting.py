"""Lifting: from a mask and a depth image to an object's points, without what masks bleed onto."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray, UInt8Array
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.geometry.voxels import connected_components, pack_keys, voxel_keys
from supermap_cli.mapping.depth import DepthView, depth_sigma_m
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask
from supermap_cli.types.keyframe import Keyframe

MAX_POINTS = 2000
"""More pixels of one mask than this are thinned out evenly: voxels get no fuller from them."""

NEAR_END, REACH_M = 5, 0.2
"""A body begins where this percentile of its points lies; so far from it the next one may begin."""

LARGEST_CUT = 0.35
"""No part of a mask loses more than this share of its half thickness on either side."""

MIN_POINTS = 12
"""Fewer pixels than this are no evidence of a shape."""


@dataclass(frozen=True)
class LiftedDetection:
    """One detection in 3D.

    `points_map` (n, 3) metres with `rgb` (n, 3); `centroid_map` (3,); `mask` is the detector's own, `core` the part of
    it that is surely the object's: all but its rim, and of the rim what stands clear (both on the region of `mask`);
    `rim_px` is how wide the rim is; `truncated` says that the image's border cuts it, so that its extent is only part
    of the object's.
    """

    index: int
    points_map: FloatArray
    rgb: UInt8Array
    centroid_map: FloatArray
    depth_m: float
    mask: RegionMask
    core: BoolArray
    rim_px: int
    box_xyxy: Float32Array
    score: float
    hypotheses: tuple[Hypothesis, ...]
    track_id: int
    truncated: bool

    @cached_property
    def extent_m(self) -> float:
        """Length of the longest side of what was seen, without the outermost twentieth."""
        low, high = percentiles(self.points_map, (5, 95))
        return float((high - low).max())


def erosion_px(area_px: int, image_width_px: int) -> int:
    """How far a mask is cut back: 2 to 6 pixels of a 640-pixel image, more for larger masks, which bleed more."""
    scale = image_width_px / 640
    return max(1, round(float(np.clip(0.08 * np.sqrt(area_px), 2 * scale, 6 * scale))))


def lift(keyframe: Keyframe, view: DepthView, detections: Detections, track_ids: np.ndarray) -> list[LiftedDetection]:
    """Lift all detections that have a mask and enough depth beneath it."""
    lifted = []
    for index in range(len(detections)):
        mask = detections.masks[index]
        if mask is None or not mask.pixels.any():
            continue
        rim_px = erosion_px(int(np.count_nonzero(mask.pixels)), keyframe.camera.width)
        clear = standing_clear(view, mask, rim_px)
        core = erode(mask.pixels, rim_px) | clear
        one = _lift_core(keyframe, view, mask, core, clear)
        if one is None:
            continue
        points, rgb, depth = one
        box = detections.boxes_xyxy[index]
        lifted.append(
            LiftedDetection(
                index,
                points,
                rgb,
                np.median(points, axis=0),
                depth,
                mask,
                core,
                rim_px,
                box,
                float(detections.scores[index]),
                detections.hypotheses[index],
                int(track_ids[index]),
                is_truncated(box, keyframe.camera.width, keyframe.camera.height),
            )
        )
    return lifted


def is_truncated(box_xyxy: Float32Array | FloatArray, width: int, height: int) -> bool:
    """Whether an image box reaches the border."""
    margin = max(3, width // 160)
    return bool(
        box_xyxy[0] < margin
        or box_xyxy[1] < margin
        or box_xyxy[2] > width - 1 - margin
        or box_xyxy[3] > height - 1 - margin
    )


def _lift_core(
    keyframe: Keyframe, view: DepthView, mask: RegionMask, core: BoolArray, clear: BoolArray
) -> tuple[FloatArray, UInt8Array, float] | None:
    own_m = view.depth_m[mask.window]
    inner = np.flatnonzero(core & (own_m > 0))
    v, u = np.divmod(inner, core.shape[1])
    v, u = v + mask.v0, u + mask.u0
    plain = clear.ravel()[inner]
    rest = np.flatnonzero(~plain)
    plain[rest] = on_one_surface(view, v[rest], u[rest])
    chosen = np.flatnonzero(plain)
    if len(chosen) < MIN_POINTS:
        return None
    if len(chosen) > MAX_POINTS:
        chosen = chosen[np.linspace(0, len(chosen) - 1, MAX_POINTS).astype(np.int64)]
    v, u = v[chosen], u[chosen]
    depth_m = view.depth_m[v, u].astype(np.float64)
    points_camera = keyframe.camera.back_project(np.column_stack([u, v]).astype(np.float64), depth_m)
    main = main_component(points_camera, float(np.median(depth_m)))
    if main.sum() < MIN_POINTS:
        return None
    points_map = transform_points(keyframe.T_map_camera, points_camera[main])
    return points_map, keyframe.rgb[v[main], u[main]], float(np.median(depth_m[main]))


def erode(mask: BoolArray, margin_px: int) -> BoolArray:
    """Cut a mask back by a margin, but nowhere by more than a share of how thick it is there: a pen must not vanish,
    nor the legs of a table, nor its top seen from the side.
    """
    reach = 2 * margin_px + 1
    padded = cv2.copyMakeBorder(mask.astype(np.uint8), *(reach,) * 4, cv2.BORDER_CONSTANT, value=0)
    within_px = cv2.distanceTransform(padded, cv2.DIST_L2, 3)
    half_thickness_px = cv2.dilate(within_px, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    core = (padded > 0) & (within_px > np.minimum(margin_px, LARGEST_CUT * half_thickness_px))
    return np.asarray(core[reach:-reach, reach:-reach], dtype=bool)


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
    flat_m = view.depth_m.ravel()

    def inverse_depth(dv: int, du: int) -> FloatArray:
        depth = flat_m[np.clip(v + dv, 0, height - 1) * width + np.clip(u + du, 0, width - 1)]
        with np.errstate(divide="ignore"):
            return np.where(depth > 0, 1 / depth, np.nan)

    own = inverse_depth(0, 0)
    bends = [
        np.abs(own - (inverse_depth(dv, du) + inverse_depth(-dv, -du)) / 2) / own**2
        for dv, du in ((0, r), (r, 0), (r, r), (r, -r))
    ]
    told = np.isfinite(bends)
    return np.where(told.sum(axis=0) >= 2, np.where(told, bends, 0.0).max(axis=0), np.inf)


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


def main_component(points_camera: FloatArray, depth_m: float) -> BoolArray:
    """(n,) which points belong to the depth-connected body that most of the mask's points belong to.

    Points are joined over 26-connected voxels as wide as what one pixel's noise and thinning leave between neighbours;
    further bodies count when they are a good part of the mask and begin within 0.2 m of what is kept so far: a table's
    top goes on behind the chair that cuts it in two.
    """
    cell = max(0.03, 0.02 * depth_m)
    codes = pack_keys(voxel_keys(points_camera, cell))
    unique, inverse = np.unique(codes, return_inverse=True)
    component = connected_components(unique)[inverse]
    counts = np.bincount(component)
    main = int(np.argmax(counts))
    numbers = [main, *(number for number in np.flatnonzero(counts >= 0.15 * counts[main]) if number != main)]
    bodies = [component == number for number in numbers]
    points = [np.ascontiguousarray(points_camera[body].T) for body in bodies]
    kept, others = [points[0]], list(range(1, len(bodies)))
    low, high = _ends(kept)
    reach_m = min(0.5 * float((high - low).max()), REACH_M)
    joined = True
    while joined and others:
        low, high = _ends(kept)
        near = [number for number in others if _gap_m(points[number], low, high) < reach_m]
        kept += [points[number] for number in near]
        others = [number for number in others if number not in near]
        joined = bool(near)
    whole: BoolArray = np.any([body for number, body in enumerate(bodies) if number not in others], axis=0)
    return whole


def _ends(bodies: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """The bounds (3, 1) of bodies (3, n)."""
    low = np.min([each.min(axis=1) for each in bodies], axis=0)
    high = np.max([each.max(axis=1) for each in bodies], axis=0)
    return low[:, None], high[:, None]


def _gap_m(points: FloatArray, low: FloatArray, high: FloatArray) -> float:
    """How far from bounds a body (3, n) begins."""
    gap = np.maximum(np.maximum(low - points, points - high), 0)
    return float(percentiles(np.linalg.norm(gap, axis=0), (NEAR_END,))[0])
