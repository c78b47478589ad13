"""Which space was seen empty, and when: asked when a thing turns up, to tell "it came" from "nobody had looked"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from supermap_cli.errors import MemoryStoreError
from supermap_cli.geometry.arrays import Float32Array, FloatArray, UInt16Array
from supermap_cli.geometry.cameras import Camera, camera_from_json
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.mapping.visibility import tolerance_m
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import KeyframeRecord


def encode_small_depth(keyframe: Keyframe, step_px: int) -> bytes:
    """A 16-bit millimetre PNG of the depth at every `step_px`-th pixel in u and v, 0 = no return."""
    _, png = cv2.imencode(".png", _small_mm(keyframe, step_px))
    return png.tobytes()


def _small_mm(keyframe: Keyframe, step_px: int) -> UInt16Array:
    small_mm: UInt16Array = np.rint(keyframe.depth_m[::step_px, ::step_px] * 1000).clip(0, 65535).astype(np.uint16)
    return small_mm


def decode_small_depth(record: KeyframeRecord) -> Float32Array:
    """The depth (h / step, w / step) float32 metres of a stored keyframe, 0 = no return."""
    mm: UInt16Array | None = cv2.imdecode(np.frombuffer(record.depth_png, np.uint8), cv2.IMREAD_UNCHANGED)  # type: ignore[assignment]
    if mm is None:
        raise MemoryStoreError(
            "a keyframe's depth is no PNG", where=f"keyframe {record.stamp_ns}", cure="run supermap db check"
        )
    return (mm / 1000).astype(np.float32)


@dataclass(frozen=True)
class SmallView:
    """A coarse depth image and where it was taken."""

    stamp_ns: int
    T_map_camera: FloatArray
    camera: Camera
    nearest_m: Float32Array
    step_px: int

    def share_empty(self, points_map: FloatArray, voxel_m: float) -> float:
        """Share of (n, 3) points that rays went through; 0 where fewer than half of the points can be told."""
        points_camera = transform_points(inverse(self.T_map_camera), points_map)
        pixels, seen = self.camera.project(points_camera)
        if seen.mean() < 0.5:
            return 0.0
        u, v = (pixels[seen] / self.step_px).astype(np.int64).T
        h, w = self.nearest_m.shape
        nearest = self.nearest_m[v.clip(0, h - 1), u.clip(0, w - 1)]
        depth = self.camera.depth_of(points_camera[seen])
        empty = np.isfinite(nearest) & (depth > 0) & (depth < nearest - tolerance_m(depth, voxel_m))
        return float(empty.sum()) / len(points_map)


def small_view(
    stamp_ns: int, T_map_camera: FloatArray, camera: Camera, small_m: Float32Array, step_px: int
) -> SmallView:
    """Prepare a coarse depth image: a ray counts as through only if it is so for all rays around it."""
    around = cv2.erode(np.where(small_m > 0, small_m, np.float32(np.inf)), np.ones((3, 3), np.uint8))
    nearest_m = np.where(small_m > 0, around, np.inf).astype(np.float32)
    return SmallView(stamp_ns, T_map_camera, camera, nearest_m, step_px)


KEPT_LOOKS, APART_NS = 3, 10_000_000_000

EMPTY_SHARE = 0.6
"""Share of an object's points that must have been looked through before its place counts as seen empty."""


@dataclass
class FreeSpaceMemory:
    """The latest looks from every viewpoint (cells of 0.5 m and 30 degrees), each traversal by itself: its size is that
    of the place, not of the recording.

    Of each there are up to `KEPT_LOOKS`: the newest, and older ones `APART_NS` apart, for a robot that stands still:
    what turns up before its eyes is believed in only after a while, and the newest look then shows it already.
    """

    views: dict[tuple[int, ...], list[SmallView]] = field(default_factory=dict)

    def remember(self, traversal: int, view: SmallView) -> None:
        """Keep a look; it takes the place of the newest one from there, or of the oldest."""
        T = view.T_map_camera
        azimuth = np.degrees(np.arctan2(T[1, 2], T[0, 2])) // 30
        elevation = np.degrees(np.arcsin(np.clip(T[2, 2], -1, 1))) // 30
        position = np.floor(T[:3, 3] / 0.5)
        looks = self.views.setdefault((traversal, *(int(x) for x in position), int(azimuth), int(elevation)), [])
        if len(looks) > 1 and looks[-1].stamp_ns - looks[-2].stamp_ns < APART_NS:
            looks.pop()
        looks.append(view)
        del looks[:-KEPT_LOOKS]

    def look(self, traversal: int, keyframe: Keyframe, step_px: int) -> None:
        """Keep a keyframe's look, the same that `recall` makes of what the memory stores of it."""
        small_m = (_small_mm(keyframe, step_px) / 1000).astype(np.float32)
        self.remember(
            traversal, small_view(keyframe.stamp_ns, keyframe.T_map_camera, keyframe.camera, small_m, step_px)
        )

    def recall(self, traversal: int, record: KeyframeRecord) -> None:
        """Keep a look that the memory had stored."""
        camera = camera_from_json(record.camera)
        small = decode_small_depth(record)
        self.remember(traversal, small_view(record.stamp_ns, record.T_map_camera, camera, small, record.depth_step))

    def last_seen_empty(self, points_map: FloatArray, voxel_m: float, before_ns: int) -> int | None:
        """The latest time before `before_ns` at which the place of (n, 3) points was seen empty, `None` if never."""
        sample = points_map[:: max(1, len(points_map) // 200)]
        earlier = _that_may_see(
            sample, [view for looks in self.views.values() for view in looks if view.stamp_ns < before_ns]
        )
        for view in sorted(earlier, key=lambda each: -each.stamp_ns):
            if view.share_empty(sample, voxel_m) > EMPTY_SHARE:
                return view.stamp_ns
        return None


def _that_may_see(points_map: FloatArray, views: Sequence[SmallView]) -> list[SmallView]:
    """Those of the views that do not look past all of (n, 3) points: for these is a look at every point worth it."""
    if not views:
        return []
    center = points_map.mean(axis=0)
    radius_m = float(np.linalg.norm(points_map - center, axis=1).max())
    rays = center - np.array([each.T_map_camera[:3, 3] for each in views])
    distances = np.maximum(np.linalg.norm(rays, axis=1), 1e-9)
    along = np.einsum("ij,ij->i", rays, np.array([each.T_map_camera[:3, 2] for each in views])) / distances
    half = np.arcsin(np.clip(radius_m / distances, 0, 1)) + np.array([each.camera.widest_angle() for each in views])
    may = (distances <= radius_m) | (np.arccos(np.clip(along, -1, 1)) <= half)
    return [views[i] for i in np.flatnonzero(may).tolist()]
