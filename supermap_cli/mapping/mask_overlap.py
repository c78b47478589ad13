"""Masks of one image that cover the same pixels: a large mask often swallows the smaller things on or before it."""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.arrays import BoolArray
from supermap_cli.types.detections import RegionMask


def claimed_by_smaller(masks: list[RegionMask | None], labels: tuple[str, ...]) -> list[RegionMask | None]:
    """Take out of each mask what a much smaller detection with another label claims: the cup is not the table."""
    areas = [0 if mask is None else np.count_nonzero(mask.pixels) for mask in masks]
    result: list[RegionMask | None] = []
    for i, mask in enumerate(masks):
        if mask is None:
            result.append(None)
            continue
        pixels = mask.pixels.copy()
        for j, other in enumerate(masks):
            if other is not None and labels[i] != labels[j] and areas[j] < 0.3 * areas[i]:
                _subtract(pixels, mask, other)
        result.append(RegionMask(mask.u0, mask.v0, pixels))
    return result


def _subtract(pixels: BoolArray, mask: RegionMask, other: RegionMask) -> None:
    h, w = pixels.shape
    oh, ow = other.pixels.shape
    left, top = max(mask.u0, other.u0), max(mask.v0, other.v0)
    right, bottom = min(mask.u0 + w, other.u0 + ow), min(mask.v0 + h, other.v0 + oh)
    if left < right and top < bottom:
        part = other.pixels[top - other.v0 : bottom - other.v0, left - other.u0 : right - other.u0]
        pixels[top - mask.v0 : bottom - mask.v0, left - mask.u0 : right - mask.u0] &= ~part
