"""The seam of a full turn: a thing across it is found as two halves, one at either border of the image.

A panorama turned about its own vertical is the same panorama with its seam elsewhere. Where masks touch the seam, the
image is turned until it lies where nothing was found, and the halves are joined. Comes before the paper's algorithm 1,
which knows no panoramas.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.mapping.below_lidar_fov import LowestReturns
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.types.detections import Detections, RegionMask, joined_masks
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class SeamParameters:
    """Which masks are two halves of one thing."""

    at_seam_px: int = parameter(2, "px", "distance from the image's border up to which a mask touches the seam", TUNED)
    min_shared_rows: float = parameter(
        0.5, "1", "share of the shorter half's rows at the seam that both halves must cover", TUNED, at_most=1
    )


DEFAULT = SeamParameters()


def turn_px(detections: Detections, camera: Camera, parameters: SeamParameters = DEFAULT) -> int:
    """By how many pixels to turn an image to the left, so that no mask lies across its seam; 0: leave it as it is."""
    regions = [mask for mask in detections.masks if mask is not None]
    near_px = parameters.at_seam_px
    if not camera.full_turn or not any(
        _at_left(mask, near_px) or _at_right(mask, camera.width, near_px) for mask in regions
    ):
        return 0
    taken = np.zeros(camera.width, bool)
    for mask in regions:
        taken[mask.u0 : mask.u0 + mask.pixels.shape[1]] = True
    if taken.all():
        return 0
    begins = int(np.argmax(taken))
    turned = np.roll(taken, -begins)
    ends = np.flatnonzero(np.diff(np.concatenate([[True], turned, [True]]).astype(np.int8)))
    gaps = ends.reshape(-1, 2)
    widest = gaps[int(np.argmax(gaps[:, 1] - gaps[:, 0]))]
    return int(begins + widest.sum() // 2) % camera.width


def turned_keyframe(keyframe: Keyframe, by_px: int) -> Keyframe:
    """The same panorama with its seam `by_px` columns to the right."""
    angle = 2 * np.pi * by_px / keyframe.camera.width
    cos, sin = np.cos(angle), np.sin(angle)
    T_camera_turned = make_transform([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]], np.zeros(3))
    returns = keyframe.returns_camera
    return replace(
        keyframe,
        rgb=np.roll(keyframe.rgb, -by_px, axis=1),
        depth_m=np.roll(keyframe.depth_m, -by_px, axis=1),
        T_map_camera=keyframe.T_map_camera @ T_camera_turned,
        returns_camera=None if returns is None else returns @ T_camera_turned[:3, :3],
    )


def turned_depth(view: DepthView, turned: Keyframe, by_px: int) -> DepthView:
    """The depth of a turned keyframe."""
    returns, lowest = view.returns, view.lowest
    width = view.camera.width
    if returns is not None:
        points = returns.points_camera @ view.T_map_camera[:3, :3].T @ turned.T_map_camera[:3, :3]
        returns = replace(returns, u=(returns.u - by_px) % width, points_camera=points)
    if lowest is not None:
        lowest = LowestReturns(np.roll(lowest.row, -by_px), np.roll(lowest.distance_m, -by_px))
    return replace(
        view,
        T_map_camera=turned.T_map_camera,
        depth_m=np.roll(view.depth_m, -by_px, axis=1),
        nearest_m=np.roll(view.nearest_m, -by_px, axis=1),
        farthest_m=np.roll(view.farthest_m, -by_px, axis=1),
        far=np.roll(view.far, -by_px, axis=1),
        returns=returns,
        lowest=lowest,
    )


def turned_view(view: ObjectView, width: int, by_px: int) -> ObjectView:
    """What a turned keyframe says of an object."""
    return replace(view, u=(view.u - by_px) % width)


def turned_detections(
    detections: Detections, track_ids: IntArray, width: int, by_px: int, parameters: SeamParameters = DEFAULT
) -> tuple[Detections, IntArray]:
    """Detections and their tracks on the turned image, halves at the former seam joined."""
    masks = [None if m is None else replace(m, u0=(m.u0 - by_px) % width) for m in detections.masks]
    boxes = detections.boxes_xyxy.copy()
    shift = ((boxes[:, 0] - by_px) % width) - boxes[:, 0]
    boxes[:, [0, 2]] += shift[:, None]
    kept = np.ones(len(detections), bool)
    for left, right in _halves(detections, width, parameters):
        first, second = masks[left], masks[right]
        if first is None or second is None:
            continue
        larger, other = (left, right) if first.pixels.sum() >= second.pixels.sum() else (right, left)
        masks[larger] = joined_masks(first, second)
        boxes[larger] = [*np.minimum(boxes[left, :2], boxes[right, :2]), *np.maximum(boxes[left, 2:], boxes[right, 2:])]
        kept[other] = False
    turned = replace(detections, boxes_xyxy=boxes, masks=tuple(masks))
    return turned.take(kept), track_ids[kept]


def box_before_turning(box_xyxy: Float32Array, width: int, by_px: int) -> Float32Array:
    """An image box on the image as it came; of one across the seam, the larger part."""
    box = box_xyxy.copy()
    box[[0, 2]] += by_px
    if box[0] >= width:
        box[[0, 2]] -= width
    if box[2] > width:
        box[[0, 2]] = [box[0], width] if width - box[0] >= box[2] - width else [0, box[2] - width]
    return box


def _halves(detections: Detections, width: int, parameters: SeamParameters) -> list[tuple[int, int]]:
    """Pairs (at the left border, at the right border) that are called alike and meet at the seam."""
    near_px = parameters.at_seam_px
    pairs: list[tuple[int, int]] = []
    for left, first in enumerate(detections.masks):
        if first is None or not _at_left(first, near_px):
            continue
        for right, second in enumerate(detections.masks):
            if second is None or right == left or right in {taken for _, taken in pairs}:
                continue
            if not _at_right(second, width, near_px):
                continue
            labels = {hypothesis.label for hypothesis in detections.hypotheses[right]}
            if detections.labels[left] in labels and _rows_meet(first, second, parameters):
                pairs.append((left, right))
                break
    return pairs


def _at_left(mask: RegionMask, near_px: int) -> bool:
    return mask.u0 <= near_px


def _at_right(mask: RegionMask, width: int, near_px: int) -> bool:
    return bool(mask.u0 + mask.pixels.shape[1] >= width - near_px)


def _rows_meet(first: RegionMask, second: RegionMask, parameters: SeamParameters) -> bool:
    """Whether the rows that two masks cover beside the seam are mostly the same."""
    rows = [
        set((np.flatnonzero(part.any(axis=1)) + mask.v0).tolist())
        for mask, part in (
            (first, first.pixels[:, : parameters.at_seam_px + 1]),
            (second, second.pixels[:, -parameters.at_seam_px - 1 :]),
        )
    ]
    return bool(len(rows[0] & rows[1]) > parameters.min_shared_rows * min(len(rows[0]), len(rows[1])))
