"""Masks for all boxes of a frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array
from supermap_cli.types.detections import Detections, RegionMask, cut_mask
from supermap_cli.types.sensing import CameraFrame
from supermap_depth_segmenter import DepthSegmenterOptions
from supermap_depth_segmenter.foreground import segment_object
from supermap_depth_segmenter.patch import Patch, cut_patch
from supermap_depth_segmenter.planes import background_mask

_MIN_OCCLUDER_SCORE = 0.3
"""Score from which on a detection is cut out of larger ones. Chosen: ByteTrack's `high_score` here."""
_MAX_AREA_RATIO = 0.5
"""Area of a box in that of a larger one, below which it is cut out. Chosen."""


class DepthSegmenter:
    """The foreground of each box in the depth image."""

    def __init__(self, options: DepthSegmenterOptions) -> None:
        self._options = options

    def segment(self, frame: CameraFrame, detections: Detections) -> tuple[RegionMask | None, ...]:
        """A mask for each box that has none; `None` without a depth image or without a depth in the box."""
        if frame.depth_m is None:
            return detections.masks
        masks = list(detections.masks)
        for i, mask in enumerate(detections.masks):
            if mask is None:
                masks[i] = self._segment_box(frame, frame.depth_m, detections.boxes_xyxy[i])
        return _cut_out_smaller(masks, detections, frame.depth_m.shape)

    def _segment_box(self, frame: CameraFrame, depth_m: Float32Array, box_xyxy: Float32Array) -> RegionMask | None:
        patch = cut_patch(depth_m, frame.camera, box_xyxy, self._options.samples)
        if patch is None:
            return None
        chosen = segment_object(patch, background_mask(patch))
        return _at_full_resolution(patch, chosen, depth_m.shape) if chosen is not None else None


def _cut_out_smaller(
    masks: Sequence[RegionMask | None], detections: Detections, image_size: tuple[int, ...]
) -> tuple[RegionMask | None, ...]:
    """Remove from each mask the masks of much smaller objects of other classes: the cup from the table."""
    sides = detections.boxes_xyxy[:, 2:] - detections.boxes_xyxy[:, :2]
    areas = sides.prod(axis=1)
    confident = detections.scores >= _MIN_OCCLUDER_SCORE
    cut: list[RegionMask | None] = list(masks)
    for i, mask in enumerate(masks):
        if mask is None or detections.masks[i] is not None:
            continue
        smaller = confident & (areas < _MAX_AREA_RATIO * areas[i])
        pixels = mask.full(*image_size)
        for j in np.flatnonzero(smaller).tolist():
            other = masks[j]
            if other is not None and detections.labels[j] != detections.labels[i]:
                h, w = other.pixels.shape
                pixels[other.v0 : other.v0 + h, other.u0 : other.u0 + w] &= ~other.pixels
        cut[i] = cut_mask(pixels)
    return tuple(cut)


def _at_full_resolution(patch: Patch, chosen: BoolArray, image_size: tuple[int, ...]) -> RegionMask | None:
    """The chosen samples as a mask of pixels."""
    if not chosen.any():
        return None
    pixels = np.repeat(np.repeat(chosen, patch.step, axis=0), patch.step, axis=1)
    return RegionMask(patch.u0, patch.v0, pixels[: image_size[0] - patch.v0, : image_size[1] - patch.u0])
