"""Recorded detections: vision_msgs/Detection2DArray with an optional image of instance numbers.

The mask image has the array's header.stamp; 0 is no object, k the k-th detection of the array (1-based).
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, UInt16Array
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask, cut_mask, no_detections
from supermap_cli.types.sensing import MAIN_CAMERA


def read_detections(message: Any, stamp_ns: int, camera_id: str = MAIN_CAMERA) -> Detections:
    """A camera's detections of a vision_msgs 4.x or older array (and ROS 1's), without masks; `class_id` or `id` is the
    label.

    The k-th of them belongs to the array's k-th detection: one without a usable label or box is kept as an empty box
    of score 0, so that mask numbers stay right (drop it after the masks are in).
    """
    found = list(message.detections)
    if not found:
        return no_detections(stamp_ns, camera_id)
    boxes = np.array([_box_xyxy(detection.bbox) for detection in found], np.float32)
    hypotheses = tuple(_hypotheses(detection.results) for detection in found)
    broken = ~np.isfinite(boxes).all(axis=1)
    boxes[broken] = 0
    scores = np.array([ranked[0].score for ranked in hypotheses], np.float32)
    scores[broken] = 0
    return Detections(stamp_ns, boxes, scores, hypotheses, (None,) * len(found), camera_id)


def _box_xyxy(box: Any) -> tuple[float, float, float, float]:
    center = getattr(box.center, "position", box.center)
    half_width, half_height = float(box.size_x) / 2, float(box.size_y) / 2
    u, v = float(center.x), float(center.y)
    return u - half_width, v - half_height, u + half_width, v + half_height


def _hypotheses(results: Any) -> tuple[Hypothesis, ...]:
    read = []
    for result in results:
        inner = getattr(result, "hypothesis", result)
        label = str(getattr(inner, "class_id", None) if hasattr(inner, "class_id") else inner.id)
        score = float(inner.score)
        if label and np.isfinite(score):
            read.append(Hypothesis(label, min(max(score, 0.0), 1.0)))
    read.sort(key=lambda hypothesis: -hypothesis.score)
    return tuple(read) or (Hypothesis("object", 0.0),)


def with_mask_image(detections: Detections, numbers: UInt16Array) -> Detections:
    """The detections with the regions of an instance image, (h, w) uint16."""
    masks = tuple(_region(numbers, index + 1, box) for index, box in enumerate(detections.boxes_xyxy))
    return detections.with_masks(masks)


def _region(numbers: UInt16Array, number: int, box_xyxy: Float32Array) -> RegionMask | None:
    """The mask of one number: looked for in and around its box first, in the whole image if that touches the rim."""
    height, width = numbers.shape
    margin = 8
    u0, v0 = np.floor(box_xyxy[:2]).astype(int) - margin
    u1, v1 = np.ceil(box_xyxy[2:]).astype(int) + margin
    u0, v0, u1, v1 = max(u0, 0), max(v0, 0), min(u1, width), min(v1, height)
    if u1 > u0 and v1 > v0:
        region = cut_mask(numbers[v0:v1, u0:u1] == number)
        if region is not None and not _touches(region, u1 - u0, v1 - v0):
            return RegionMask(region.u0 + u0, region.v0 + v0, region.pixels)
    return cut_mask(numbers == number)


def _touches(region: RegionMask, width: int, height: int) -> bool:
    h, w = region.pixels.shape
    return region.u0 == 0 or region.v0 == 0 or region.u0 + w == width or region.v0 + h == height


@dataclass(frozen=True)
class DetectionArrival:
    """One message of either topic as it arrives: detections, or the instance image of the same stamp."""

    stamp_ns: int
    log_ns: int
    detections: Detections | None = None
    numbers: UInt16Array | None = None


def join_masks(arrivals: Iterator[DetectionArrival], late_ns: int) -> Iterator[Detections]:
    """Detections with their masks in the order of image stamps, though either may arrive up to `late_ns` late.

    An array whose mask has not come by then goes without; what arrives later than that is out of order and dropped.
    """
    waiting: list[int] = []
    arrays: dict[int, Detections] = {}
    numbers: dict[int, UInt16Array] = {}
    last_ns: int | None = None
    for arrival in arrivals:
        stamp_ns = arrival.stamp_ns
        if last_ns is not None and stamp_ns <= last_ns:
            continue
        if arrival.numbers is not None:
            numbers[stamp_ns] = arrival.numbers
        elif arrival.detections is not None and stamp_ns not in arrays:
            arrays[stamp_ns] = arrival.detections
            heapq.heappush(waiting, stamp_ns)
        if stamp_ns in arrays and stamp_ns in numbers:
            arrays[stamp_ns] = with_mask_image(arrays[stamp_ns], numbers.pop(stamp_ns))
        while waiting and waiting[0] < arrival.log_ns - late_ns:
            last_ns = heapq.heappop(waiting)
            yield _usable(arrays.pop(last_ns))
        for old in [stamp for stamp in numbers if stamp < arrival.log_ns - late_ns]:
            del numbers[old]
    while waiting:
        yield _usable(arrays.pop(heapq.heappop(waiting)))


def _usable(detections: Detections) -> Detections:
    return detections.take(detections.scores > 0)
