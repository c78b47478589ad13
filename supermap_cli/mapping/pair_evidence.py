"""What images say of two objects of one label: that they are two, or parts of one.

Evidence for MapMerge (Algorithm 1, step 5); the paper merges without it, and so joins chairs that stand together.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.mapping.association import share_inside
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class PairEvidenceParameters:
    """When one image speaks of two objects, and how many are enough."""

    spanned_share: float = parameter(
        0.6, "1", "a mask spans an object when it holds more than this share of what is seen of it", TUNED, at_most=1.0
    )
    sure_images: int = parameter(
        3, "1", "images that must have shown two objects under one mask before they are taken for one", TUNED
    )
    apart_factor: float = parameter(3.0, "1", "how many times as often as apart they must have been shown so", TUNED)
    gap_m: float = parameter(0.3, "m", "gap between the bounds of two objects that may be one", TUNED)
    box_overlap: float = parameter(
        0.3, "1", "boxes that share less of the smaller one than this are side by side", TUNED, at_most=1.0
    )


DEFAULT = PairEvidenceParameters()


@dataclass
class PairEvidence:
    """Counts of images for pairs of objects: apart, in which each had a detection of its own, and as one.

    The former are kept with the objects (`MapObject.seen_apart`), for they hold for later traversals too. `spanned`, by
    their numbers, the smaller first: images in which the detection of one covered what was seen of the other as well,
    as the mask of a chair covers the back and the seat that were first seen alone.
    """

    spanned: dict[tuple[int, int], int] = field(default_factory=dict)
    parameters: PairEvidenceParameters = field(default=DEFAULT, repr=False, compare=False)

    def add_image(
        self,
        objects: Iterable[MapObject],
        matched: Mapping[int, LiftedDetection],
        views: Mapping[int, ObjectView],
    ) -> None:
        """Count one image's evidence. `views` are the objects as they were before the image."""
        in_view = [obj for obj in objects if obj.number in views and views[obj.number].shown.any()]
        parameters = self.parameters
        for obj in in_view:
            detection = matched.get(obj.number)
            if detection is None:
                continue
            for other in in_view:
                if other.number == obj.number or other.label != obj.label:
                    continue
                if not bounds_within(obj, other, parameters.gap_m):
                    continue
                if other.number in matched:
                    apart = obj.number < other.number and boxes_apart(detection, matched[other.number], parameters)
                    if apart:
                        set_apart(obj, other, obj.seen_apart.get(other.number, 0) + 1)
                elif share_inside(detection, views[other.number]) > parameters.spanned_share:
                    key = _key(obj, other)
                    self.spanned[key] = self.spanned.get(key, 0) + 1

    def surely_two(self, first: MapObject, second: MapObject) -> bool:
        """Whether images have shown the two side by side often enough, and no fewer under one mask."""
        apart = first.seen_apart.get(second.number, 0)
        return apart >= self.parameters.sure_images and apart >= self.spanned.get(_key(first, second), 0)

    def seen_as_one(self, first: MapObject, second: MapObject) -> bool:
        """Whether images have shown the two under one mask often enough, and clearly more often than apart."""
        spanned = self.spanned.get(_key(first, second), 0)
        enough = spanned >= self.parameters.sure_images
        return enough and spanned > self.parameters.apart_factor * first.seen_apart.get(second.number, 0)

    def forget(self, number: int) -> None:
        """Drop an object's pairs."""
        for key in [key for key in self.spanned if number in key]:
            del self.spanned[key]


def _key(first: MapObject, second: MapObject) -> tuple[int, int]:
    return min(first.number, second.number), max(first.number, second.number)


def set_apart(first: MapObject, second: MapObject, images: int) -> None:
    """So many images have shown two objects side by side."""
    first.seen_apart[second.number] = second.seen_apart[first.number] = images


def bounds_within(first: MapObject, second: MapObject, gap_m: float) -> bool:
    """Whether two objects' bounds come within a distance along every axis."""
    gap = np.maximum(first.shape.low - second.shape.high, second.shape.low - first.shape.high)
    return bool(gap.max() < gap_m)


def boxes_apart(first: LiftedDetection, second: LiftedDetection, parameters: PairEvidenceParameters = DEFAULT) -> bool:
    """Whether two image boxes share little of the smaller one."""
    a, b = first.box_xyxy, second.box_xyxy
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return True
    smaller = min((a[2] - a[0]) * (a[3] - a[1]), (b[2] - b[0]) * (b[3] - b[1]))
    return bool(width * height < parameters.box_overlap * smaller)
