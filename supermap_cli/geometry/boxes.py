"""Boxes in the image (xyxy, pixels) and in the level map (yaw only)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import FloatArray


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
    for start, end in zip(window, np.roll(window, -1, axis=0), strict=True):
        if not len(polygon):
            break
        edge = end - start
        side = edge[0] * (polygon[:, 1] - start[1]) - edge[1] * (polygon[:, 0] - start[0])
        following, side_following = np.roll(polygon, -1, axis=0), np.roll(side, -1)
        kept = []
        for point, next_point, s, s_next in zip(polygon, following, side, side_following, strict=True):
            if s >= 0:
                kept.append(point)
            if (s >= 0) != (s_next >= 0):
                kept.append(point + (next_point - point) * s / (s - s_next))
        polygon = np.array(kept).reshape(-1, 2)
    return polygon


def polygon_area_m2(polygon: FloatArray) -> float:
    """Area of a polygon (n, 2) by the shoelace formula."""
    if len(polygon) < 3:
        return 0.0
    x, y = polygon[:, 0], polygon[:, 1]
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


def footprint_overlap_m2(first: Box3D, second: Box3D) -> float:
    """Area that two boxes share on the floor."""
    reach = (np.linalg.norm(first.size[:2]) + np.linalg.norm(second.size[:2])) / 2
    if np.linalg.norm(first.center[:2] - second.center[:2]) >= reach:
        return 0.0
    return polygon_area_m2(clip_convex(first.footprint(), second.footprint()))


def footprint_gap_m(first: Box3D, second: Box3D) -> float:
    """Shortest horizontal distance between two boxes, 0 where they overlap."""
    a, b = first.footprint(), second.footprint()
    if len(clip_convex(a, b)):
        return 0.0
    return min(_corners_to_outline_m(a, b), _corners_to_outline_m(b, a))


def _corners_to_outline_m(corners: FloatArray, outline: FloatArray) -> float:
    starts, ends = outline, np.roll(outline, -1, axis=0)
    edges = ends - starts
    lengths2 = np.maximum((edges**2).sum(axis=1), 1e-12)
    offsets = corners[:, None, :] - starts[None]
    along = np.clip((offsets * edges[None]).sum(axis=2) / lengths2, 0, 1)
    nearest = starts[None] + along[..., None] * edges[None]
    return float(np.linalg.norm(corners[:, None, :] - nearest, axis=2).min())


def box_iou(first: Box3D, second: Box3D) -> float:
    """Intersection over union of two upright boxes, in [0, 1]."""
    height = min(first.z_max, second.z_max) - max(first.z_min, second.z_min)
    shared = max(height, 0.0) * footprint_overlap_m2(first, second)
    total = first.volume + second.volume - shared
    return shared / total if total > 0 else 0.0
