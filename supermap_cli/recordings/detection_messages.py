"""Recorded detections joined with the image of instance numbers that may belong to them.

The mask image has the array's header.stamp; 0 is no object, k the k-th detection of the array (1-based).
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, UInt16Array
from supermap_cli.types.detections import Detections, RegionMask, cut_mask


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
