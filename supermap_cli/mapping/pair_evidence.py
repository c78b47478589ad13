"""What images say of two objects of one label: that they are two, or parts of one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.mapping.association import share_inside
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.visibility import ObjectView

SPANNED_SHARE = 0.6
"""A mask spans an object when it holds more than this share of what is seen of it."""

SURE_LOOKS = 3
"""Images that must have shown two objects under one mask before they are taken for one."""


@dataclass
class PairEvidence:
    """Counts for pairs of object numbers, the smaller first.

    `apart`: images in which each had a detection of its own; `spanned`: images in which the detection of one covered
    what was seen of the other as well, as the mask of a chair covers the back and the seat that were first seen alone.
    """

    apart: dict[tuple[int, int], int] = field(default_factory=dict)
    spanned: dict[tuple[int, int], int] = field(default_factory=dict)

    def take_in(
        self,
        objects: Iterable[MapObject],
        matched: Mapping[int, LiftedDetection],
        views: Mapping[int, ObjectView],
    ) -> None:
        """Count one image's evidence. `views` are the objects as they were before the image."""
        in_view = [each for each in objects if each.number in views and views[each.number].shown.any()]
        for each in in_view:
            detection = matched.get(each.number)
            if detection is None:
                continue
            for other in in_view:
                if other.number == each.number or other.label != each.label or not within_reach(each, other):
                    continue
                if other.number in matched:
                    if each.number < other.number and boxes_apart(detection, matched[other.number]):
                        self._count(self.apart, each, other)
                elif share_inside(detection, views[other.number]) > SPANNED_SHARE:
                    self._count(self.spanned, each, other)

    @staticmethod
    def _count(counts: dict[tuple[int, int], int], first: MapObject, second: MapObject) -> None:
        key = (min(first.number, second.number), max(first.number, second.number))
        counts[key] = counts.get(key, 0) + 1

    def told_apart(self, first: int, second: int, images: int) -> None:
        """Two objects that were one come with the images that have shown them side by side."""
        self.apart[min(first, second), max(first, second)] = images

    def seen_apart(self, first: int, second: int) -> bool:
        """Whether images have shown the two side by side."""
        return (min(first, second), max(first, second)) in self.apart

    def seen_as_one(self, first: int, second: int) -> bool:
        """Whether images have shown the two under one mask often enough, and clearly more often than apart."""
        key = (min(first, second), max(first, second))
        spanned = self.spanned.get(key, 0)
        return spanned >= SURE_LOOKS and spanned > 3 * self.apart.get(key, 0)

    def forget(self, number: int) -> None:
        """Drop an object's pairs."""
        for counts in (self.apart, self.spanned):
            for key in [key for key in counts if number in key]:
                del counts[key]


def within_reach(first: MapObject, second: MapObject) -> bool:
    """Whether two objects' bounds come within 0.3 m."""
    gap = np.maximum(first.shape.low - second.shape.high, second.shape.low - first.shape.high)
    return bool(gap.max() < 0.3)


def boxes_apart(first: LiftedDetection, second: LiftedDetection) -> bool:
    """Whether two image boxes share less than 0.3 of the smaller one."""
    a, b = first.box_xyxy, second.box_xyxy
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return True
    smaller = min((a[2] - a[0]) * (a[3] - a[1]), (b[2] - b[0]) * (b[3] - b[1]))
    return bool(width * height < 0.3 * smaller)
