"""Compares the stored depth images of one map with the objects of another: geometric consistency after the recording.

The stored images are small. A pixel stands for the nearest and the farthest return of its neighbourhood, so that free
space is only seen where all rays around it passed: the result is never bolder than the full image's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np

from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.geometry.cameras import camera_from_json
from supermap_cli.map_merge.displacement import MIN_OBSERVABLE_SHARE, DisplacementHypothesis
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
from supermap_cli.types.memory import KeyframeRecord, Visit

MAX_RANGE_M = 6.0
"""Returns farther away are not used; the default of `depth.max_depth_m` in a build."""


@dataclass
class ViewCounts:
    """Keyframes of one traversal in which an object's place was in view, and in which it was seen empty."""

    in_view: int = 0
    contradicted: int = 0

    def visit(self, number: int) -> Visit:
        """As a visit without support."""
        return Visit(number, 0, self.in_view, self.contradicted, None, None)


@dataclass
class DepthConsistency:
    """Compares keyframes of one map with the `objects` of another, in the order of time.

    `matched` are the objects that the other map knows in their place: its detector did not miss these, and the images
    test their `displacements`. An object that is seen to be gone has `present` False and `gone_ns` from then on.
    `views` counts by traversal and object number.
    """

    objects: ObjectMap
    matched: frozenset[int]
    displacements: Mapping[int, DisplacementHypothesis]
    recall: RecallModel = field(default_factory=RecallModel)
    views: dict[tuple[int, int], ViewCounts] = field(default_factory=dict)

    def add_keyframe(self, traversal: int, keyframe: KeyframeRecord) -> None:
        """Compare one keyframe, given in the map's frame and time."""
        near = self.objects.within(keyframe.T_map_camera[:3, 3], MAX_RANGE_M)
        present = [obj for obj in near if obj.present and not obj.is_dynamic]
        if not present:
            return
        depth = stored_view(keyframe)
        for number, view in check_objects(depth, present).items():
            if view.observable_share >= ABSENCE.observable_share:
                self.views.setdefault((traversal, number), ViewCounts()).in_view += 1
            self._update(traversal, self.objects[number], view, keyframe, depth)

    def _update(
        self, traversal: int, seen: MapObject, view: ObjectView, keyframe: KeyframeRecord, depth: DepthView
    ) -> None:
        """Update displacement, presence and existence of one object that is in view."""
        if seen.number in self.displacements and view.observable_share >= MIN_OBSERVABLE_SHARE:
            self.displacements[seen.number].add_view(depth, seen, keyframe.stamp_ns)
        gone_ns = update_absence(seen, view, keyframe.stamp_ns)
        if view.contradicted_share > ABSENCE.absent_share:
            self.views.setdefault((traversal, seen.number), ViewCounts()).contradicted += 1
        if gone_ns is not None:
            seen.mark_absent(max(gone_ns, seen.last_seen_ns + 1))
            return
        visible = (
            view.observable_share >= ABSENCE.observable_share and view.contradicted_share <= ABSENCE.absent_share / 2
        )
        if visible and keyframe.detected and seen.number not in self.matched:
            box, area_px = view.box_xyxy, depth.camera.width * depth.camera.height
            truncated = box is not None and is_truncated(box, depth.camera)
            rate = self.recall.expected(seen.label, area_share(view, area_px), truncated)
            viewpoint = Viewpoint(keyframe.stamp_ns, keyframe.T_map_camera[:3, 3], seen.shape.centroid)
            fuse_miss(seen, rate, viewpoint, self.recall)


def stored_view(record: KeyframeRecord, max_range_m: float = MAX_RANGE_M) -> DepthView:
    """The depth stored with a keyframe, upsampled to the camera's pixels."""
    camera = camera_from_json(record.camera)
    small = decode_small_depth(record)
    small[small > max_range_m] = 0
    around = np.ones((3, 3), np.uint8)
    nearest = cv2.erode(np.where(small > 0, small, np.float32(np.inf)), around, borderType=cv2.BORDER_REPLICATE)
    farthest = cv2.dilate(small, around)

    def upsampled(image: Float32Array) -> Float32Array:
        rows = np.repeat(image, record.depth_step, axis=0)[: camera.height]
        return np.ascontiguousarray(np.repeat(rows, record.depth_step, axis=1)[:, : camera.width], np.float32)

    return DepthView(
        camera,
        record.T_map_camera,
        upsampled(small),
        upsampled(np.asarray(nearest, np.float32)),
        upsampled(np.asarray(farthest, np.float32)),
        max_range_m,
        np.zeros((camera.height, camera.width), bool),
    )
