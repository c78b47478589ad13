"""Masks of one image that cover the same pixels: a large mask often swallows the smaller things on or before it.

Comes between `GenerateMasks` and `Unproject` of the paper's Algorithm 1, step (4), which takes masks as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray
from supermap_cli.types.detections import RegionMask
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class MaskOverlapParameters:
    """Which of two masks has a pixel that both cover."""

    smaller_share: float = parameter(
        0.3, "1", "a mask of another label smaller than this share of one takes its pixels", TUNED, at_most=1.0
    )


DEFAULT = MaskOverlapParameters()


def without_smaller(
    masks: list[RegionMask | None], labels: tuple[str, ...], parameters: MaskOverlapParameters = DEFAULT
) -> list[RegionMask | None]:
    """Take out of each mask what a much smaller detection with another label claims: the cup is not the table."""
    areas = [0 if mask is None else np.count_nonzero(mask.pixels) for mask in masks]
    result: list[RegionMask | None] = []
    for i, mask in enumerate(masks):
        if mask is None:
            result.append(None)
            continue
        pixels = mask.pixels.copy()
        for j, other in enumerate(masks):
            if other is not None and labels[i] != labels[j] and areas[j] < parameters.smaller_share * areas[i]:
                _subtract(pixels, mask, other)
        result.append(RegionMask(mask.u0, mask.v0, pixels))
    return result


def overlap_share(first: RegionMask, second: RegionMask) -> float:
    """The share of the smaller one of two masks that lies in the other."""
    (first_h, first_w), (second_h, second_w) = first.pixels.shape, second.pixels.shape
    u0, v0 = max(first.u0, second.u0), max(first.v0, second.v0)
    u1, v1 = min(first.u0 + first_w, second.u0 + second_w), min(first.v0 + first_h, second.v0 + second_h)
    if u1 <= u0 or v1 <= v0:
        return 0.0
    of_first = first.pixels[v0 - first.v0 : v1 - first.v0, u0 - first.u0 : u1 - first.u0]
    of_second = second.pixels[v0 - second.v0 : v1 - second.v0, u0 - second.u0 : u1 - second.u0]
    smaller = min(int(np.count_nonzero(first.pixels)), int(np.count_nonzero(second.pixels)))
    return np.count_nonzero(of_first & of_second) / smaller if smaller else 0.0


def _subtract(pixels: BoolArray, mask: RegionMask, other: RegionMask) -> None:
    h, w = pixels.shape
    oh, ow = other.pixels.shape
    left, top = max(mask.u0, other.u0), max(mask.v0, other.v0)
    right, bottom = min(mask.u0 + w, other.u0 + ow), min(mask.v0 + h, other.v0 + oh)
    if left < right and top < bottom:
        part = other.pixels[top - other.v0 : bottom - other.v0, left - other.u0 : right - other.u0]
        pixels[top - mask.v0 : bottom - mask.v0, left - mask.u0 : right - mask.u0] &= ~part
