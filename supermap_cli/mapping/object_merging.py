"""ObjMerge (Algorithm 1, step 5): every detection becomes evidence for an object, splits one, or starts a new one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from supermap_cli.mapping import lifecycle
from supermap_cli.mapping.association import (
    Affinity,
    Association,
    Courses,
    affinity,
    associate,
    expected_courses,
    within_reach,
)
from supermap_cli.mapping.detection_fusion import DetectionFusion
from supermap_cli.mapping.keyframe_view import KeyframeView
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.mapping.pair_evidence import PairEvidence, set_apart
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.mapping.splitting import (
    SplitEvidence,
    nearer_to_second,
    parts_beside,
    side_by_side,
    split_off,
    whole_of,
)
from supermap_cli.mapping.transitions import Transitions

NO_PARTS: Mapping[int, Sequence[LiftedDetection]] = MappingProxyType({})


@dataclass
class ObjectMerging:
    """Associates the detections of one image with the map's objects and fuses them."""

    objects: ObjectMap
    transitions: Transitions
    fusion: DetectionFusion
    pairs: PairEvidence
    splits: SplitEvidence
    parameters: MappingParameters

    def merge(self, view: KeyframeView, lifted: Sequence[LiftedDetection]) -> set[int]:
        """The numbers of the objects that a detection was assigned to.

        Strong detections first, then weak ones (ByteTrack's two stages), then re-activation of what was absent; only
        then new objects.
        """
        parameters = self.parameters
        strong_score = parameters.association.strong_score
        strong = [detection for detection in lifted if detection.score >= strong_score]
        weak = [detection for detection in lifted if detection.score < strong_score]
        courses = expected_courses(self.objects, view.stamp_ns, parameters.association)
        near = within_reach(lifted, self.objects, courses, parameters.association)
        present = [obj for obj in near if obj.present]
        matched: dict[int, LiftedDetection] = {}

        first = self._associate(view, strong, present, courses)
        given = {number: strong[row] for row, number, _ in first.pairs}
        parts = parts_beside(
            self.objects,
            given,
            [strong[row] for row in first.free],
            parameters.splitting,
            parameters.pair_evidence,
        )
        self._fuse_pairs(view, strong, first.pairs, matched, parts)
        remaining = [obj for obj in present if obj.number not in matched]
        second = self._associate(view, weak, remaining, courses)
        self._fuse_pairs(view, weak, second.pairs, matched)

        unexplained = [strong[row] for row in first.free]
        absent = [obj for obj in near if not obj.present]
        third = self._associate(view, unexplained, absent, courses)
        self._fuse_pairs(view, unexplained, third.pairs, matched)

        for detection in (unexplained[row] for row in third.free):
            whole = whole_of(self.objects, detection, matched, parameters.splitting)
            if whole is not None:
                part = self._split(view, whole, matched[whole.number], detection)
                self.fusion.fuse(view, part or whole, detection, None)
            else:
                self._initialize(view, detection)
        self.pairs.add_image(self.objects, matched, view.views)
        return set(matched)

    def merge_by_track(self, view: KeyframeView, lifted: Sequence[LiftedDetection]) -> set[int]:
        """Without the 3D-aware tracker (an ablation) a thing is what was one track in the image, and a new track is a
        new thing.
        """
        camera_id, parameters = view.keyframe.camera_id, self.parameters.association
        tracked = {obj.track_ids[camera_id]: obj for obj in self.objects if obj.present and camera_id in obj.track_ids}
        matched: set[int] = set()
        for detection in lifted:
            obj = tracked.get(detection.track_id)
            if obj is not None and obj.number not in matched:
                object_view = view.views.get(obj.number)
                fit = affinity(detection, obj, object_view, camera_id=camera_id, parameters=parameters)
                self.fusion.fuse(view, obj, detection, fit)
                matched.add(obj.number)
            elif detection.score >= parameters.strong_score:
                self._initialize(view, detection)
        return matched

    def _associate(
        self,
        view: KeyframeView,
        detections: Sequence[LiftedDetection],
        candidates: Sequence[MapObject],
        courses: Courses,
    ) -> Association:
        return associate(
            detections,
            candidates,
            view.views,
            courses,
            camera_id=view.keyframe.camera_id,
            parameters=self.parameters.association,
        )

    def _fuse_pairs(
        self,
        view: KeyframeView,
        detections: Sequence[LiftedDetection],
        pairs: Sequence[tuple[int, int, Affinity]],
        matched: dict[int, LiftedDetection],
        parts: Mapping[int, Sequence[LiftedDetection]] = NO_PARTS,
    ) -> None:
        for row, number, fit in pairs:
            obj, detection = self.objects[number], detections[row]
            whole = fit.explained > self.parameters.splitting.whole_share
            if obj.confirmed and obj.present and not obj.is_dynamic and whole:
                self.splits.add_one_mask(number, view.viewpoint_of(obj))
            own = self._without_neighbours(view, obj, detection)
            self.fusion.fuse(view, obj, own, fit, parts.get(number, ()))
            matched[number] = detection

    def _without_neighbours(self, view: KeyframeView, obj: MapObject, detection: LiftedDetection) -> LiftedDetection:
        """The detection without the points that lie on objects of which images have shown that they are others: one
        mask may cover two things that stand side by side.
        """
        neighbours = [
            self.objects[number]
            for number in obj.seen_apart
            if number in view.views and number in self.objects.by_number and self.objects[number].present
        ]
        taken = np.zeros(len(detection.points_map), dtype=bool)
        for other in neighbours:
            if self.pairs.surely_two(obj, other):
                taken |= other.shape.near(detection.points_map)
        if taken.any():
            taken &= ~obj.shape.near(detection.points_map)
        if not taken.any() or len(taken) - np.count_nonzero(taken) < detection.parameters.min_points:
            return detection
        return detection.with_points(~taken)

    def _split(
        self, view: KeyframeView, whole: MapObject, first: LiftedDetection, second: LiftedDetection
    ) -> MapObject | None:
        """The object of the second detection, if by now the images say that the two on `whole` are two things."""
        parameters = self.parameters
        if not whole.confirmed or whole.is_dynamic or first.score < parameters.association.strong_score:
            return None
        if not side_by_side(whole.shape, first, second, parameters.splitting, parameters.pair_evidence):
            return None
        if not self.splits.add_two_masks(whole.number, first, second, view.viewpoint_of(whole)):
            return None
        part = nearer_to_second(whole.voxels.centers(), first.points_map, second.points_map)
        if not part.any() or part.all():
            return None
        new = split_off(self.objects.new_number(), whole, part, view.stamp_ns)
        self.objects.add(new)
        whole.voxels_changed()
        self.transitions.split(whole, new)
        set_apart(whole, new, self.splits.images(whole.number))
        self.splits.forget(whole.number)
        return new

    def _initialize(self, view: KeyframeView, detection: LiftedDetection) -> None:
        new = lifecycle.initialize(
            self.objects.new_number(),
            detection,
            view.stamp_ns,
            view.keyframe.camera_id,
            parameters=self.parameters.lifecycle,
            sets=self.objects.parameters,
        )
        self.objects.add(new)
        self.fusion.fuse(view, new, detection, None)
