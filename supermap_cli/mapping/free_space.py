"""Which space was seen empty, and when: asked when a thing turns up, to tell "it came" from "nobody had looked".

Departs from the paper, where whatever is new has appeared. The test is its eq. 9 (a point in front of the surface),
asked of earlier depth images.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from supermap_cli.errors import MemoryStoreError
from supermap_cli.geometry.arrays import Float32Array, FloatArray, UInt16Array
from supermap_cli.geometry.cameras import Camera, camera_from_json
from supermap_cli.geometry.pictures import decode_grey16
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.mapping import visibility
from supermap_cli.mapping.visibility import VisibilityParameters, tolerance_m
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import KeyframeRecord
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class FreeSpaceParameters:
    """Which depth images are kept, and when a place counts as seen empty."""

    min_empty_share: float = parameter(
        0.6, "1", "share of an object's points looked through for its place to count as seen empty", TUNED, at_most=1
    )
    min_in_view_share: float = parameter(
        0.5, "1", "share of the points in a view below which it tells nothing", TUNED, at_most=1
    )
    max_points: int = parameter(
        200, "1", "points of an object that views are asked about", "bounds the time", at_least=1
    )
    min_empty_views: int = parameter(
        2,
        "1",
        "views of one traversal that must have seen a place empty: one may be noise, or see through a gap",
        "two witnesses",
        at_least=1,
    )
    cell_m: float = parameter(0.5, "m", "edge of the cells of position of a viewpoint", TUNED, at_least=0.05)
    cell_deg: float = parameter(30.0, "deg", "width of the cells of direction of a viewpoint", TUNED, at_least=1)
    views_per_cell: int = parameter(3, "1", "depth images kept of each viewpoint", "bounds the memory", at_least=1)
    apart_s: float = parameter(
        10.0, "s", "time between these: what turns up is confirmed only after a while, when the newest shows it", TUNED
    )


DEFAULT = FreeSpaceParameters()


def encode_small_depth(keyframe: Keyframe, step_px: int) -> bytes:
    """A 16-bit millimetre PNG of the depth at every `step_px`-th pixel in u and v, 0 = no return."""
    _, png = cv2.imencode(".png", _small_mm(keyframe, step_px))
    return png.tobytes()


def _small_mm(keyframe: Keyframe, step_px: int) -> UInt16Array:
    small_mm: UInt16Array = np.rint(keyframe.depth_m[::step_px, ::step_px] * 1000).clip(0, 65535).astype(np.uint16)
    return small_mm


def decode_small_depth(record: KeyframeRecord) -> Float32Array:
    """The depth (h / step, w / step) float32 metres of a stored keyframe, 0 = no return."""
    mm = decode_grey16(record.depth_png)
    if mm is None:
        raise MemoryStoreError(
            "a keyframe's depth is no 16-bit PNG", where=f"keyframe {record.stamp_ns}", cure="run supermap db check"
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

    def share_empty(
        self,
        points_map: FloatArray,
        voxel_m: float,
        parameters: FreeSpaceParameters = DEFAULT,
        visibility_parameters: VisibilityParameters = visibility.DEFAULT,
    ) -> float:
        """Share of (n, 3) points that rays went through; 0 where fewer than half of the points are in view, or where
        what they show is narrower than the rays are apart: it may stand between them.
        """
        points_camera = transform_points(inverse(self.T_map_camera), points_map)
        pixels, seen = self.camera.project(points_camera)
        if seen.mean() < parameters.min_in_view_share or np.ptp(pixels[seen], axis=0).min() < self.step_px:
            return 0.0
        u, v = (pixels[seen] / self.step_px).astype(np.int64).T
        h, w = self.nearest_m.shape
        nearest = self.nearest_m[v.clip(0, h - 1), u.clip(0, w - 1)]
        depth = self.camera.depth_of(points_camera[seen])
        tau = tolerance_m(depth, voxel_m, parameters=visibility_parameters)
        empty = np.isfinite(nearest) & (depth > 0) & (depth < nearest - tau)
        return float(empty.sum()) / len(points_map)


def small_view(
    stamp_ns: int, T_map_camera: FloatArray, camera: Camera, small_m: Float32Array, step_px: int
) -> SmallView:
    """Prepare a coarse depth image: a ray counts as through only if it is so for all rays around it.

    A ray without a return may have ended as near as any around it: the edge of a table mostly gives none.
    """
    around = np.ones((3, 3), np.uint8)
    known_m = np.where(small_m > 0, small_m, np.float32(np.inf))
    assumed_m = np.where(small_m > 0, small_m, cv2.erode(known_m, around))
    nearest_m = np.where(small_m > 0, cv2.erode(assumed_m, around), np.inf).astype(np.float32)
    return SmallView(stamp_ns, T_map_camera, camera, nearest_m, step_px)


@dataclass
class FreeSpaceMemory:
    """The latest views from every viewpoint (cells of 0.5 m and 30 degrees), each traversal by itself: its size is that
    of the place, not of the recording.

    Of each there are up to `views_per_cell`: the newest, and older ones `apart_s` apart, for a robot that stands still:
    what turns up before its eyes is confirmed only after a while, and the newest view then shows it already.
    """

    parameters: FreeSpaceParameters = DEFAULT
    visibility_parameters: VisibilityParameters = visibility.DEFAULT
    views: dict[tuple[int, ...], list[SmallView]] = field(default_factory=dict)

    def add(self, traversal: int, view: SmallView) -> None:
        """Keep a view; it takes the place of the newest one from there, or of the oldest."""
        parameters = self.parameters
        T = view.T_map_camera
        azimuth = np.degrees(np.arctan2(T[1, 2], T[0, 2])) // parameters.cell_deg
        elevation = np.degrees(np.arcsin(np.clip(T[2, 2], -1, 1))) // parameters.cell_deg
        position = np.floor(T[:3, 3] / parameters.cell_m)
        kept = self.views.setdefault((traversal, *(int(x) for x in position), int(azimuth), int(elevation)), [])
        if len(kept) > 1 and kept[-1].stamp_ns - kept[-2].stamp_ns < parameters.apart_s * 1e9:
            kept.pop()
        kept.append(view)
        del kept[: -parameters.views_per_cell]

    def add_keyframe(self, traversal: int, keyframe: Keyframe, step_px: int) -> None:
        """Keep a keyframe's view, the same that `add_record` makes of what the memory stores of it."""
        small_m = (_small_mm(keyframe, step_px) / 1000).astype(np.float32)
        self.add(traversal, small_view(keyframe.stamp_ns, keyframe.T_map_camera, keyframe.camera, small_m, step_px))

    def add_record(self, traversal: int, record: KeyframeRecord) -> None:
        """Keep a view that the memory had stored."""
        camera = camera_from_json(record.camera)
        small = decode_small_depth(record)
        self.add(traversal, small_view(record.stamp_ns, record.T_map_camera, camera, small, record.depth_step))

    def last_seen_empty(self, points_map: FloatArray, voxel_m: float, before_ns: int) -> int | None:
        """The latest time before `before_ns` at which the place of (n, 3) points was seen empty; `None` if never.

        One view of an earlier traversal is enough; of the running one it takes `min_empty_views`, for what turns up
        while the robot is there is rare, and one view that is wrong is not.
        """
        sample = points_map[:: max(1, len(points_map) // self.parameters.max_points)]
        running = max((key[0] for key in self.views), default=0)
        traversal_of = {id(view): key[0] for key, kept in self.views.items() for view in kept}
        earlier = _facing_views(
            sample, [view for kept in self.views.values() for view in kept if view.stamp_ns < before_ns]
        )
        empty_ns: list[int] = []
        for view in sorted(earlier, key=lambda view: -view.stamp_ns):
            share = view.share_empty(sample, voxel_m, self.parameters, self.visibility_parameters)
            if share > self.parameters.min_empty_share:
                empty_ns.append(view.stamp_ns)
                if traversal_of[id(view)] < running or len(empty_ns) >= self.parameters.min_empty_views:
                    return empty_ns[0]
        return None


def _facing_views(points_map: FloatArray, views: Sequence[SmallView]) -> list[SmallView]:
    """Those of the views that do not look past all of (n, 3) points: only these are worth a test of every point."""
    if not views:
        return []
    center = points_map.mean(axis=0)
    radius_m = float(np.linalg.norm(points_map - center, axis=1).max())
    rays = center - np.array([view.T_map_camera[:3, 3] for view in views])
    distances = np.maximum(np.linalg.norm(rays, axis=1), 1e-9)
    along = np.einsum("ij,ij->i", rays, np.array([view.T_map_camera[:3, 2] for view in views])) / distances
    half = np.arcsin(np.clip(radius_m / distances, 0, 1)) + np.array([view.camera.widest_angle() for view in views])
    may = (distances <= radius_m) | (np.arccos(np.clip(along, -1, 1)) <= half)
    return [views[i] for i in np.flatnonzero(may).tolist()]
