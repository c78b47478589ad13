"""Of which image size recorded boxes are: of their image's, of another resolution of it, or in shares of it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.arrays import BoolArray, Float32Array, UInt16Array
from supermap_cli.recordings.survey import Topic
from supermap_cli.types.detections import Detections, RegionMask

_REACH = 1.1
"""Times the image's size that a box may reach: detectors let boxes of cut things stick out. Chosen."""

_MOST_STRAY = 0.1
"""Share of boxes up to which those that reach farther are a detector's mistakes. Chosen."""

_NEAR_EDGE = 0.9
"""Share of a size that boxes must reach across or down for that size to be theirs. Chosen."""

_SHARE_REACH = 1.05
"""How far boxes in shares of the image reach, rounding and things that are cut included. Chosen."""

_MULTIPLES = (2, 3, 4)
"""How many times larger than the images of a topic those may be that were looked at by the detector."""

_ASPECT_TOLERANCE = 0.01
"""Share by which the scales across and down may differ: rounding to whole pixels."""


@dataclass(frozen=True)
class BoxScale:
    """What boxes are multiplied by, (u, v), to be in pixels of the image of `image_size` (width, height); `why` says
    why, "" where they already are.
    """

    image_size: tuple[int, int]
    factors: tuple[float, float] = (1.0, 1.0)
    why: str = ""

    def apply(self, detections: Detections) -> tuple[Detections, int]:
        """The detections in pixels of the image, and how many of them lie wholly outside: these keep their place as
        empty boxes of score 0.
        """
        if not len(detections):
            return detections, 0
        if self.why:
            boxes = detections.boxes_xyxy * np.array(self.factors * 2, np.float32)
            masks = tuple(None if mask is None else self._mask(mask) for mask in detections.masks)
            detections = replace(detections, boxes_xyxy=boxes.astype(np.float32), masks=masks)
        boxes, (width, height) = detections.boxes_xyxy, self.image_size
        outside = (boxes[:, 2:] <= 0).any(axis=1) | (boxes[:, :2] >= (width, height)).any(axis=1)
        outside &= _extents(boxes) & (detections.scores > 0)
        if not outside.any():
            return detections, 0
        boxes, scores = boxes.copy(), detections.scores.copy()
        boxes[outside], scores[outside] = 0, 0
        return replace(detections, boxes_xyxy=boxes, scores=scores), int(outside.sum())

    def _mask(self, mask: RegionMask) -> RegionMask | None:
        """A mask that came with its box, in the same pixels. None is left where a pixel is a share of the image."""
        (fu, fv), (height, width) = self.factors, mask.pixels.shape
        if min(fu, fv) > max(self.image_size) / 2:
            return None
        size = max(round(width * fu), 1), max(round(height * fv), 1)
        pixels = cv2.resize(mask.pixels.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST).astype(bool)
        return RegionMask(round(mask.u0 * fu), round(mask.v0 * fv), pixels)


def find_box_scale(
    sampled: Iterable[Detections], image_size: tuple[int, int], known: Sequence[tuple[int, int]], where: str
) -> BoxScale:
    """Of what size the boxes of a topic are. `known` are sizes (width, height) of other images of the recording.

    Raises `RecordingError` where boxes are of another image than theirs and it cannot be told of which size.
    """
    boxes = np.concatenate([np.zeros((0, 4), np.float32), *(each.boxes_xyxy for each in sampled)])
    boxes = boxes[_extents(boxes)]
    if not len(boxes):
        return BoxScale(image_size)
    width, height = image_size
    reach_u, reach_v = float(boxes[:, 2].max()), float(boxes[:, 3].max())
    if max(reach_u, reach_v) <= _SHARE_REACH and boxes.min() >= 1 - _SHARE_REACH:
        why = f"all boxes lie within 0 to 1, in shares of the image: they are multiplied by {width} x {height} pixels"
        return BoxScale(image_size, (float(width), float(height)), why)
    beyond = (boxes[:, 2] > width * _REACH) | (boxes[:, 3] > height * _REACH)
    before = (boxes[:, 0] < width * (1 - _REACH)) | (boxes[:, 1] < height * (1 - _REACH))
    if beyond.mean() <= _MOST_STRAY or 2 * before.sum() >= beyond.sum():
        return BoxScale(image_size)
    size = _size_of(boxes, image_size, known)
    if size is not None:
        why = (
            f"the boxes reach to ({reach_u:.0f}, {reach_v:.0f}) pixels, beyond their images of {width} x {height}: "
            f"they are taken as those of {size[0]} x {size[1]} pixels and scaled"
        )
        return BoxScale(image_size, (width / size[0], height / size[1]), why)
    raise RecordingError(
        f"the boxes reach to ({reach_u:.0f}, {reach_v:.0f}) pixels, {int(beyond.sum())} of {len(boxes)} looked at well "
        f"beyond their images of {width} x {height}: they are of images of another size",
        where=where,
        cure="name the images that the detector looked at with --topic color=/..., other detections with --topic "
        "detections=/..., or detect anew with --detector onnx",
    )


def image_sizes(topics: Iterable[Topic]) -> list[tuple[int, int]]:
    """The sizes (width, height) of all images and calibrations of a recording."""
    sizes = {topic.size for topic in topics if topic.size is not None}
    sizes |= {(topic.calibration.width, topic.calibration.height) for topic in topics if topic.calibration is not None}
    return sorted(size for size in sizes if min(size) > 0)


def scaled_numbers(numbers: UInt16Array, image_size: tuple[int, int]) -> UInt16Array:
    """An image of instance numbers, (h, w), in the size of the image it belongs to, if that has the same shape."""
    height, width = numbers.shape
    scale_u, scale_v = image_size[0] / width, image_size[1] / height
    if (width, height) == image_size or abs(scale_u / scale_v - 1) > _ASPECT_TOLERANCE:
        return numbers
    scaled: UInt16Array = cv2.resize(numbers, image_size, interpolation=cv2.INTER_NEAREST).astype(np.uint16)
    return scaled


def _extents(boxes: Float32Array) -> BoolArray:
    """Which boxes (n, 4) have an area: (n,) bool."""
    extents: BoolArray = np.logical_and(boxes[:, 2] > boxes[:, 0], boxes[:, 3] > boxes[:, 1])
    return extents


def _size_of(
    boxes: Float32Array, image_size: tuple[int, int], known: Sequence[tuple[int, int]]
) -> tuple[int, int] | None:
    """The smallest size that holds all boxes and has the image's shape: one that is known, else a multiple of the
    image's that they reach the edge of.
    """
    width, height = image_size
    reach = boxes[:, 2:].max(axis=0)
    same_shape = sorted(
        size for size in known if size[0] > width and abs(size[0] * height / (size[1] * width) - 1) <= _ASPECT_TOLERANCE
    )
    for size in same_shape:
        if (reach <= np.array(size) * _SHARE_REACH).all():
            return size
    for multiple in _MULTIPLES:
        shares = reach / (multiple * np.array(image_size))
        if (shares <= _SHARE_REACH).all():
            return (multiple * width, multiple * height) if shares.max() >= _NEAR_EDGE else None
    return None
