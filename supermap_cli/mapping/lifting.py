"""Lifting: from a mask and a depth image to an object's points, without what masks bleed onto."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, UInt8Array
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.mapping.bodies import continued_behind, image_bodies, joined_bodies, main_body
from supermap_cli.mapping.depth import DepthView, pixel_scale
from supermap_cli.mapping.lidar_lifting import lift_returns
from supermap_cli.mapping.mask_core import erode, on_one_surface, standing_clear
from supermap_cli.mapping.returns import LIDAR_SIGMA_M
from supermap_cli.mapping.voxel_map import FINEST_VOXEL_M
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask
from supermap_cli.types.keyframe import Keyframe

MAX_POINTS = 2000
"""More pixels of one mask than this are thinned out evenly: voxels get no fuller from them."""

MIN_POINTS = 12
"""Fewer pixels than this are no evidence of a shape."""


@dataclass(frozen=True)
class LiftedDetection:
    """One detection in 3D.

    `points_map` (n, 3) metres with `rgb` (n, 3); `centroid_map` (3,); `mask` is the detector's own, `core` the part of
    it that is surely the object's: all but its rim, and of the rim what stands clear (both on the region of `mask`);
    `rim_px` is how wide the rim is; `truncated` says that the image's border cuts it, so that its extent is only part
    of the object's; `voxel_m` is the edge of voxels that are not finer than what the sensor tells apart.
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
    voxel_m: float = FINEST_VOXEL_M

    @cached_property
    def extent_m(self) -> float:
        """Length of the longest side of what was seen, without the outermost twentieth."""
        low, high = percentiles(self.points_map, (5, 95))
        return float((high - low).max())


def erosion_px(area_px: int, scale: float) -> int:
    """How far a mask is cut back: 2 to 6 pixels of a usual image, more for larger masks, which bleed more."""
    return max(1, round(float(np.clip(0.08 * np.sqrt(area_px), 2 * scale, 6 * scale))))


def lift(keyframe: Keyframe, view: DepthView, detections: Detections, track_ids: np.ndarray) -> list[LiftedDetection]:
    """Lift all detections that have a mask and enough depth beneath it, or, with a LiDAR, stand on the floor."""
    lifted = []
    for index in range(len(detections)):
        mask = detections.masks[index]
        if mask is None or not mask.pixels.any():
            continue
        rim_px = erosion_px(int(np.count_nonzero(mask.pixels)), pixel_scale(keyframe.camera))
        clear = standing_clear(view, mask, rim_px)
        core = erode(mask.pixels, rim_px) | clear
        if view.returns is None:
            one = _lift_core(keyframe, view, mask, core, clear)
        else:
            one = lift_returns(keyframe, view, mask, core, [m for m in detections.masks if m is not None])
        if one is None:
            continue
        points, rgb, depth = one
        box = detections.boxes_xyxy[index]
        lifted.append(
            LiftedDetection(
                index,
                points,
                rgb,
                percentiles(points, (50,))[0],
                depth,
                mask,
                core,
                rim_px,
                box,
                float(detections.scores[index]),
                detections.hypotheses[index],
                int(track_ids[index]),
                is_truncated(box, keyframe.camera),
                FINEST_VOXEL_M if view.returns is None else LIDAR_SIGMA_M,
            )
        )
    return lifted


def is_truncated(box_xyxy: Float32Array | FloatArray, camera: Camera) -> bool:
    """Whether an image box reaches the border, which at the sides of a full turn is none."""
    margin = max(3, camera.width // 160)
    if box_xyxy[1] < margin or box_xyxy[3] > camera.height - 1 - margin:
        return True
    return not camera.full_turn and bool(box_xyxy[0] < margin or box_xyxy[2] > camera.width - 1 - margin)


def _lift_core(
    keyframe: Keyframe, view: DepthView, mask: RegionMask, core: BoolArray, clear: BoolArray
) -> tuple[FloatArray, UInt8Array, float] | None:
    inner = np.flatnonzero(core & (view.depth_m[mask.window] > 0))
    v = inner // core.shape[1]
    v, u = v + mask.v0, inner - v * core.shape[1] + mask.u0
    plain = clear.ravel()[inner]
    rest = np.flatnonzero(~plain)
    plain[rest] = on_one_surface(view, v[rest], u[rest])
    chosen = np.flatnonzero(plain)
    if len(chosen) < MIN_POINTS:
        return None
    whole = np.zeros(core.shape, dtype=bool)
    whole.ravel()[inner[chosen]] = True
    if len(chosen) > MAX_POINTS:
        chosen = chosen[np.linspace(0, len(chosen) - 1, MAX_POINTS).astype(np.int64)]
    v, u = v[chosen], u[chosen]
    depth_m = view.depth_m[v, u].astype(np.float64)
    points_camera = keyframe.camera.back_project(np.column_stack([u, v]).astype(np.float64), depth_m)
    cell_m = max(0.03, 0.02 * _median(depth_m))
    bodies = joined_bodies(points_camera, cell_m, image_bodies(whole).ravel()[inner[chosen]])
    main = main_body(points_camera, bodies)
    main |= continued_behind(view, (u, v), points_camera, bodies, main)
    if main.sum() < MIN_POINTS:
        return None
    points_map = transform_points(keyframe.T_map_camera, points_camera[main])
    return points_map, keyframe.rgb[v[main], u[main]], _median(depth_m[main])


def _median(values: FloatArray) -> float:
    return float(percentiles(values, (50,))[0])
