"""Boxes in the image (xyxy, pixels) and in the level map (yaw only)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import FloatArray

Outline = list[tuple[float, float]]
"""The corners (x, y) of a polygon, counter-clockwise."""


@dataclass(frozen=True)
class Reach:
    """Range around a box in which another may lie, in metres: along the floor, and upwards or downwards.

    `rise_m`: at least so far above the second's upper face lies the first's lower one. `covered`: at least this share
    of the first's footprint lies within the second's.
    """

    floor_m: float
    height_m: float
    rise_m: float = -math.inf
    covered: float = 0.0


@dataclass(frozen=True)
class Box3D:
    """An upright box in the map frame.

    `center` (3,) metres; `size` (3,) metres along the box's own x, y and the map's z; `yaw` radians about the map's z.
    """

    center: FloatArray
    size: FloatArray
    yaw: float

    def __post_init__(self) -> None:
        if self.center.shape != (3,) or self.size.shape != (3,):
            raise ValueError(f"expected shapes (3,) and (3,), got {self.center.shape} and {self.size.shape}")
        if not (np.isfinite(self.center).all() and np.isfinite(self.size).all() and np.isfinite(self.yaw)):
            raise ValueError("a box must be finite")
        if (self.size < 0).any():
            raise ValueError(f"a box has no negative size: {self.size.tolist()}")

    @property
    def z_min(self) -> float:
        """Height of its lower face."""
        return float(self.center[2] - self.size[2] / 2)

    @property
    def z_max(self) -> float:
        """Height of its upper face."""
        return float(self.center[2] + self.size[2] / 2)

    @property
    def volume(self) -> float:
        """Cubic metres."""
        return float(np.prod(self.size))

    @cached_property
    def outline(self) -> Outline:
        """The corners of its footprint as plain numbers."""
        return _corners(self.footprint())

    def footprint(self) -> FloatArray:
        """The four corners (4, 2) of its outline on the floor, counter-clockwise."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * self.size[:2] / 2
        corners: FloatArray = half @ np.array([[c, s], [-s, c]]) + self.center[:2]
        return corners

    def corners(self) -> FloatArray:
        """All eight corners (8, 3), the lower four first."""
        outline = self.footprint()
        low = np.column_stack([outline, np.full(4, self.z_min)])
        high = np.column_stack([outline, np.full(4, self.z_max)])
        return np.concatenate([low, high])


def pairwise_iou(a_xyxy: NDArray[np.floating], b_xyxy: NDArray[np.floating]) -> FloatArray:
    """Intersection over union of image boxes (n, 4) with (m, 4), (n, m) in [0, 1]; 0 where a box is empty."""
    a, b = a_xyxy.astype(np.float64), b_xyxy.astype(np.float64)
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = np.prod(np.clip(high - low, 0, None), axis=2)
    area_a = np.prod(np.clip(a[:, 2:] - a[:, :2], 0, None), axis=1)
    area_b = np.prod(np.clip(b[:, 2:] - b[:, :2], 0, None), axis=1)
    union = area_a[:, None] + area_b[None, :] - shared
    iou: FloatArray = np.divide(shared, union, out=np.zeros_like(shared), where=union > 0)
    return iou


def clip_convex(polygon: FloatArray, window: FloatArray) -> FloatArray:
    """The part (k, 2) of a convex polygon (n, 2) within a convex counter-clockwise window (m, 2) (Sutherland, Hodgman
    1974).
    """
    return np.array(_clipped(_corners(polygon), _corners(window))).reshape(-1, 2)


def polygon_area_m2(polygon: FloatArray) -> float:
    """Area of a polygon (n, 2) by the shoelace formula."""
    return _area_m2(_corners(polygon))


def footprint_overlap_m2(first: Box3D, second: Box3D) -> float:
    """Area that two boxes share on the floor."""
    reach = (math.hypot(*first.size[:2].tolist()) + math.hypot(*second.size[:2].tolist())) / 2
    if math.dist(first.center[:2].tolist(), second.center[:2].tolist()) >= reach:
        return 0.0
    return _area_m2(_clipped(first.outline, second.outline))


def displacement_m(first: Box3D, second: Box3D) -> float:
    """Distance in metres that an object moved between two boxes of it.

    Horizontally that of the boxes' centres, which depend less than the points' mean on the sides that were seen;
    vertically that of the top or the bottom, whichever moved less, because the other may have been occluded once.
    """
    low, high = abs(second.z_min - first.z_min), abs(second.z_max - first.z_max)
    return float(np.hypot(np.linalg.norm(second.center[:2] - first.center[:2]), min(low, high)))


def footprint_gap_m(first: Box3D, second: Box3D) -> float:
    """Shortest horizontal distance between two boxes, 0 where they overlap."""
    a, b = first.outline, second.outline
    if _clipped(a, b):
        return 0.0
    return min(_corners_to_outline_m(a, b), _corners_to_outline_m(b, a))


def _corners(polygon: FloatArray) -> Outline:
    return [(x, y) for x, y in polygon.tolist()]


def _clipped(polygon: Outline, window: Outline) -> Outline:
    """`clip_convex` on plain numbers: numpy costs many times the computation for four corners."""
    start_x, start_y = window[-1]
    for end_x, end_y in window:
        if not polygon:
            break
        edge_x, edge_y = end_x - start_x, end_y - start_y
        kept = []
        x, y = polygon[-1]
        side = edge_x * (y - start_y) - edge_y * (x - start_x)
        for next_x, next_y in polygon:
            next_side = edge_x * (next_y - start_y) - edge_y * (next_x - start_x)
            if (side >= 0) != (next_side >= 0):
                share = side / (side - next_side)
                kept.append((x + (next_x - x) * share, y + (next_y - y) * share))
            if next_side >= 0:
                kept.append((next_x, next_y))
            x, y, side = next_x, next_y, next_side
        polygon = kept
        start_x, start_y = end_x, end_y
    return polygon


def _area_m2(polygon: Outline) -> float:
    if len(polygon) < 3:
        return 0.0
    twice = 0.0
    x, y = polygon[-1]
    for next_x, next_y in polygon:
        twice += x * next_y - next_x * y
        x, y = next_x, next_y
    return abs(twice) / 2


def nearest_points(first: Box3D, second: Box3D) -> tuple[tuple[float, float], tuple[float, float]]:
    """The two points (x, y) of two boxes' outlines on the floor that are nearest to each other."""
    one_m, corner, foot = _nearest_to_outline(first.outline, second.outline)
    other_m, other_corner, other_foot = _nearest_to_outline(second.outline, first.outline)
    return (corner, foot) if one_m <= other_m else (other_foot, other_corner)


def _corners_to_outline_m(corners: Outline, outline: Outline) -> float:
    return _nearest_to_outline(corners, outline)[0]


def _nearest_to_outline(corners: Outline, outline: Outline) -> tuple[float, tuple[float, float], tuple[float, float]]:
    """The least distance of corners from an outline, the corner, and the point of the outline."""
    least, nearest, foot = math.inf, corners[0], outline[0]
    start_x, start_y = outline[-1]
    for end_x, end_y in outline:
        edge_x, edge_y = end_x - start_x, end_y - start_y
        length2 = max(edge_x * edge_x + edge_y * edge_y, 1e-12)
        for x, y in corners:
            along = min(max(((x - start_x) * edge_x + (y - start_y) * edge_y) / length2, 0.0), 1.0)
            off_x, off_y = x - start_x - along * edge_x, y - start_y - along * edge_y
            if off_x * off_x + off_y * off_y < least:
                least, nearest = off_x * off_x + off_y * off_y, (x, y)
                foot = (start_x + along * edge_x, start_y + along * edge_y)
        start_x, start_y = end_x, end_y
    return math.sqrt(least), nearest, foot


def box_iou(first: Box3D, second: Box3D) -> float:
    """Intersection over union of two upright boxes, in [0, 1]."""
    height = min(first.z_max, second.z_max) - max(first.z_min, second.z_min)
    shared = max(height, 0.0) * footprint_overlap_m2(first, second)
    total = first.volume + second.volume - shared
    return shared / total if total > 0 else 0.0
