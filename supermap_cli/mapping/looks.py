"""One keyframe held against the map: what it shows of every object, from where, and what it can tell by silence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray
from supermap_cli.geometry.boxes import pairwise_iou
from supermap_cli.mapping import lifecycle
from supermap_cli.mapping.absence import OBSERVABLE_SHARE
from supermap_cli.mapping.belief import Vantage
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.seam import turned_depth, turned_keyframe, turned_view
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.types.detections import Detections
from supermap_cli.types.keyframe import Keyframe

STRONG_SCORE = 0.3
"""Detections below this support what the map already holds, and give birth to nothing (ByteTrack's two stages)."""

EXPECTED_IOU = 0.2
"""Overlap with an object's predicted box from which a weak detection may be of that object."""


@dataclass(frozen=True)
class Look:
    """One keyframe held against the map: its depth, and what it says of every object it can see.

    A panorama may be `turned_px` columns to the left of how it came (`seam`).
    """

    keyframe: Keyframe
    depth: DepthView
    views: dict[int, ObjectView]
    turned_px: int = 0

    def turned(self, by_px: int) -> Look:
        """The same look at a panorama with its seam elsewhere."""
        keyframe = turned_keyframe(self.keyframe, by_px)
        width = keyframe.camera.width
        views = {number: turned_view(view, width, by_px) for number, view in self.views.items()}
        return Look(keyframe, turned_depth(self.depth, keyframe, by_px), views, by_px)


@dataclass(frozen=True)
class Sight:
    """What a keyframe can tell of an object by silence: its `view`; `unmeasured`: the image shows its place, and no ray
    can reach it; `detector_looked`.
    """

    view: ObjectView
    unmeasured: bool
    detector_looked: bool


def vantage_of(keyframe: Keyframe, seen: MapObject) -> Vantage:
    """From where a keyframe looks at an object."""
    return Vantage(keyframe.stamp_ns, keyframe.T_map_camera[:3, 3], seen.shape.centroid)


def worth_lifting(look: Look, detections: Detections) -> BoolArray:
    """(n,) the detections that can come to something: strong ones, and weak ones about where an object is expected."""
    worth: BoolArray = detections.scores >= STRONG_SCORE
    boxes = [view.box_xyxy for view in look.views.values() if view.box_xyxy is not None]
    if boxes and not worth.all():
        worth = worth | (pairwise_iou(detections.boxes_xyxy, np.array(boxes)) > EXPECTED_IOU).any(axis=1)
    return worth


def covered_by(detections: Detections, shape: tuple[int, ...]) -> BoolArray:
    """(h, w) the pixels that some detection's mask covers."""
    covered = np.zeros(shape, bool)
    for mask in detections.masks:
        if mask is not None:
            h, w = mask.pixels.shape
            covered[mask.v0 : mask.v0 + h, mask.u0 : mask.u0 + w] |= mask.pixels
    return covered


def in_sight(view: ObjectView, masked: BoolArray | None) -> bool:
    """Whether an object lies where only the image shows it, and nothing that is detected covers most of its place."""
    if masked is None:
        return False
    free = (view.unmeasured & ~masked[view.v, view.u]) | view.contradicted
    if not len(free) or float(view.unmeasured.mean()) < OBSERVABLE_SHARE:
        return False
    return float(free.mean()) > lifecycle.UNCOVERED_SHARE


def area_px(keyframe: Keyframe) -> int:
    """Pixels of its image."""
    return keyframe.camera.width * keyframe.camera.height
