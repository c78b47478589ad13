"""CompareDepth's result (Algorithm 1, step 2): one keyframe compared with the map, object by object."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, IntArray
from supermap_cli.geometry.boxes import pairwise_iou
from supermap_cli.mapping import seam
from supermap_cli.mapping.belief import Viewpoint
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.seam import (
    SeamParameters,
    turn_px,
    turned_depth,
    turned_detections,
    turned_keyframe,
    turned_view,
)
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.types.detections import Detections
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class KeyframeViewParameters:
    """Which detections are lifted."""

    expected_iou: float = parameter(
        0.2, "1", "overlap with an object's predicted box from which a weak detection may be of it", TUNED, at_most=1.0
    )


DEFAULT = KeyframeViewParameters()


@dataclass(frozen=True)
class KeyframeView:
    """A keyframe, its depth, and `views`: what the depth says of every object on the image, by object number.

    A panorama may be `turned_px` columns to the left of how it came (`seam`). `masked` (h, w) are the pixels that some
    detection's mask covers; `None` where no detector looked, or where the depth measures all that the image shows.
    `detector` is the identity of what looks at the keyframe.
    """

    keyframe: Keyframe
    depth: DepthView
    views: dict[int, ObjectView]
    turned_px: int = 0
    masked: BoolArray | None = None
    detector: str = ""

    def turned(self, by_px: int) -> KeyframeView:
        """The same view of a panorama with its seam elsewhere."""
        keyframe = turned_keyframe(self.keyframe, by_px)
        width = keyframe.camera.width
        views = {number: turned_view(view, width, by_px) for number, view in self.views.items()}
        depth = turned_depth(self.depth, keyframe, by_px)
        return KeyframeView(keyframe, depth, views, by_px, detector=self.detector)

    def with_masked(self, detections: Detections) -> KeyframeView:
        """The same view with the pixels of the detections' masks, where a LiDAR does not reach all of the image."""
        if self.depth.lowest is None:
            return self
        return replace(self, masked=masked_pixels(detections, self.depth.depth_m.shape))

    @property
    def stamp_ns(self) -> int:
        """The keyframe's."""
        return self.keyframe.stamp_ns

    def viewpoint_of(self, obj: MapObject) -> Viewpoint:
        """From where the keyframe shows an object."""
        return Viewpoint(self.stamp_ns, self.keyframe.T_map_camera[:3, 3], obj.shape.centroid, self.detector)


def move_seam(
    view: KeyframeView,
    detections: Detections,
    track_ids: IntArray,
    parameters: SeamParameters = seam.DEFAULT,
) -> tuple[KeyframeView, Detections, IntArray]:
    """Preprocessing of panoramas: turn view, detections and their tracks so that no mask lies across the seam.

    Anything else comes back as it is.
    """
    by_px = turn_px(detections, view.keyframe.camera, parameters)
    if not by_px:
        return view, detections, track_ids
    turned = view.turned(by_px)
    return turned, *turned_detections(detections, track_ids, view.keyframe.camera.width, by_px, parameters)


def worth_lifting(
    view: KeyframeView,
    detections: Detections,
    strong_score: float,
    parameters: KeyframeViewParameters = DEFAULT,
) -> BoolArray:
    """(n,) the detections that can come to something: strong ones, and weak ones about where an object is expected."""
    worth: BoolArray = detections.scores >= strong_score
    boxes = [object_view.box_xyxy for object_view in view.views.values() if object_view.box_xyxy is not None]
    if boxes and not worth.all():
        worth = worth | (pairwise_iou(detections.boxes_xyxy, np.array(boxes)) > parameters.expected_iou).any(axis=1)
    return worth


def masked_pixels(detections: Detections, shape: tuple[int, ...]) -> BoolArray:
    """(h, w) the pixels that some detection's mask covers."""
    masked = np.zeros(shape, bool)
    for mask in detections.masks:
        if mask is not None:
            h, w = mask.pixels.shape
            masked[mask.v0 : mask.v0 + h, mask.u0 : mask.u0 + w] |= mask.pixels
    return masked
