"""What one memory's stored depth images say of another's objects: geometric consistency long after the recording.

The images are small. Around every pixel the nearest and the farthest return of its neighbours count, so that a ray is
taken to have gone through a place only where all around it did: they are silent sooner than a build's, never bolder.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np

from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.geometry.cameras import camera_from_json
from supermap_cli.mapping.absence import DEFAULT as ABSENCE
from supermap_cli.mapping.belief import Viewpoint
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.free_space import decode_small_depth
from supermap_cli.mapping.fusion import area_share, fuse_miss
from supermap_cli.mapping.geometric_negation import update_absence
from supermap_cli.mapping.lifting import is_truncated
from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.mapping.recall import RecallModel
from supermap_cli.mapping.visibility import ObjectView, check_objects
from supermap_cli.merging.laying_aside import TOLD_SHARE, LaidAside
from supermap_cli.types.memory import KeyframeRecord, Visit

REACH_M = 6.0
"""Returns farther off are not used."""


@dataclass
class Testimony:
    """What the looks of one traversal said of one object: how often its place was in view, and was seen empty."""

    in_view: int = 0
    contradicted: int = 0

    def visit(self, number: int) -> Visit:
        """As a visit that supported nothing."""
        return Visit(number, 0, self.in_view, self.contradicted, None, None)


@dataclass
class Witness:
    """Holds keyframes of one memory against the `objects` of another, in the order of time.

    `found` are those that the other memory knows as well, in their place: its detector did not miss these, and the
    images say whether they were pushed `aside`. An object that is seen to be gone has `present` False and `gone_ns`
    from then on.
    """

    objects: ObjectMap
    found: frozenset[int]
    aside: Mapping[int, LaidAside]
    recall: RecallModel = field(default_factory=RecallModel)
    visits: dict[tuple[int, int], Testimony] = field(default_factory=dict)

    def look(self, traversal: int, keyframe: KeyframeRecord) -> None:
        """Take in one keyframe, in the map's frame and time."""
        near = self.objects.within(keyframe.T_map_camera[:3, 3], REACH_M)
        standing = [each for each in near if each.present and not each.is_dynamic]
        if not standing:
            return
        depth = stored_view(keyframe)
        for number, view in check_objects(depth, standing).items():
            if view.observable_share >= ABSENCE.observable_share:
                self.visits.setdefault((traversal, number), Testimony()).in_view += 1
            self._weigh(traversal, self.objects[number], view, keyframe, depth)

    def _weigh(
        self, traversal: int, seen: MapObject, view: ObjectView, keyframe: KeyframeRecord, depth: DepthView
    ) -> None:
        if seen.number in self.aside and view.observable_share >= TOLD_SHARE:
            self.aside[seen.number].look(depth, seen, keyframe.stamp_ns)
        gone_ns = update_absence(seen, view, keyframe.stamp_ns)
        if view.contradicted_share > ABSENCE.absent_share:
            self.visits.setdefault((traversal, seen.number), Testimony()).contradicted += 1
        if gone_ns is not None:
            seen.mark_absent(max(gone_ns, seen.last_seen_ns + 1))
            return
        stands = (
            view.observable_share >= ABSENCE.observable_share and view.contradicted_share <= ABSENCE.absent_share / 2
        )
        if stands and keyframe.detected and seen.number not in self.found:
            box, area_px = view.box_xyxy, depth.camera.width * depth.camera.height
            truncated = box is not None and is_truncated(box, depth.camera)
            rate = self.recall.expected(seen.label, area_share(view, area_px), truncated)
            viewpoint = Viewpoint(keyframe.stamp_ns, keyframe.T_map_camera[:3, 3], seen.shape.centroid)
            fuse_miss(seen, rate, viewpoint, self.recall)


def stored_view(record: KeyframeRecord, reach_m: float = REACH_M) -> DepthView:
    """The depth that the memory keeps with a keyframe, on the camera's pixels."""
    camera = camera_from_json(record.camera)
    small = decode_small_depth(record)
    small[small > reach_m] = 0
    around = np.ones((3, 3), np.uint8)
    nearest = cv2.erode(np.where(small > 0, small, np.float32(np.inf)), around, borderType=cv2.BORDER_REPLICATE)
    farthest = cv2.dilate(small, around)

    def grown(each: Float32Array) -> Float32Array:
        rows = np.repeat(each, record.depth_step, axis=0)[: camera.height]
        return np.ascontiguousarray(np.repeat(rows, record.depth_step, axis=1)[:, : camera.width], np.float32)

    return DepthView(
        camera,
        record.T_map_camera,
        grown(small),
        grown(np.asarray(nearest, np.float32)),
        grown(np.asarray(farthest, np.float32)),
        reach_m,
    )
