"""Whether a thing that stands in one place has another shape or look than on an earlier visit, as evidence for another
thing: log likelihood ratios, 0 where there is nothing to compare.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from supermap_cli.errors import MemoryStoreError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.memory.images import crop_jpegs, crops_of
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ObservationRef, StoredInstance

FIRST_LOOKS = 3
"""Looks of a visit that show the shape that was known before: what rays go through is dropped by then."""
THROUGH_PRIOR = (1.0, 9.0)
"""Beta prior of the share of a thing's points that looks go through although it stands there: errors of pose and depth,
and its edges. Chosen: a tenth, worth ten looks.
"""
SAME_CHROMA_SIGMA = 8.0
"""Standard deviation of a thing's mean colour (CIELAB a*, b*, each) from visit to visit: light and white balance.
Chosen: about three times what a person just notices (2.3, Mahy et al. 1994).
"""
OTHER_CHROMA_SIGMA = 25.0
"""The same between two things. Chosen: things indoors lie within 50 of grey."""
CENTRAL_SHARE = 0.5
"""Share of a crop's width and height around its middle that shows the thing, and not what is beside it. Chosen."""


def shape_log_ratio(old: Sequence[ObservationRef], new: Sequence[ObservationRef]) -> float:
    """Log P(what the first looks of the later visit went through | another thing) / P(... | the same thing).

    Of the same thing they go through as much of its points as later looks at it did; of another one through any share.
    """
    first = [_through(seen) for seen in new[:FIRST_LOOKS]]
    settled = [_through(seen) for seen in old[FIRST_LOOKS:]]
    shares, known = ([share for share in part if share is not None] for part in (first, settled))
    if not shares:
        return 0.0
    through, solid = sum(shares), len(shares) - sum(shares)
    known_weight = 1 / math.sqrt(len(known)) if known else 0.0  # the looks of one visit share their errors
    alpha = THROUGH_PRIOR[0] + known_weight * sum(known)
    beta = THROUGH_PRIOR[1] + known_weight * (len(known) - sum(known))
    same = _log_beta(alpha + through, beta + solid) - _log_beta(alpha, beta)
    return _log_beta(1 + through, 1 + solid) - same


def look_log_ratio(
    reader: MapReader, instance: StoredInstance, traversal_ids: tuple[int, int], until_ns: tuple[int, int]
) -> float:
    """Log P(the colours of the best pictures of both visits | two things) / P(... | one thing)."""
    crops = crops_of(reader, [instance.number]).get(instance.number, [])
    best = [
        [crop.observation for crop in crops if crop.traversal_id == traversal_id and crop.stamp_ns <= end_ns][-1:]
        for traversal_id, end_ns in zip(traversal_ids, until_ns, strict=True)
    ]
    if not all(best):
        return 0.0
    jpegs = crop_jpegs(reader, [observations[0] for observations in best])
    colours = [mean_chroma(jpegs[observations[0]]) for observations in best]
    return chroma_log_ratio(*colours)


def chroma_log_ratio(first: FloatArray, second: FloatArray) -> float:
    """The same of two mean colours (2,)."""
    squared = float(((first - second) ** 2).sum())
    precisions = 1 / SAME_CHROMA_SIGMA**2 - 1 / OTHER_CHROMA_SIGMA**2
    return 2 * math.log(SAME_CHROMA_SIGMA / OTHER_CHROMA_SIGMA) + 0.5 * squared * precisions


def mean_chroma(jpeg: bytes) -> FloatArray:
    """(2,) the mean a* and b* of the middle of a picture."""
    import cv2  # noqa: PLC0415 - only where a name differs is a picture looked at

    from supermap_cli.geometry.pictures import decode_bgr  # noqa: PLC0415

    image = decode_bgr(jpeg)
    if image is None:
        raise MemoryStoreError("a picture in the map is damaged", cure="run `supermap db check`")
    height, width = image.shape[:2]
    y, x = (int(side * (1 - CENTRAL_SHARE) / 2) for side in (height, width))
    lab = cv2.cvtColor(image[y : height - y, x : width - x].astype(np.float32) / 255, cv2.COLOR_BGR2Lab)
    return np.asarray(lab[:, :, 1:].reshape(-1, 2).mean(axis=0), np.float64)


def _through(seen: ObservationRef) -> float | None:
    """The share of the thing's points that a look went through; `None` where it spoke of none."""
    spoken = seen.evidence_for + seen.evidence_against
    return seen.evidence_against / spoken if spoken else None


def _log_beta(alpha: float, beta: float) -> float:
    return math.lgamma(alpha) + math.lgamma(beta) - math.lgamma(alpha + beta)
