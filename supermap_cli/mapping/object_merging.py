"""ObjMerge (Algorithm 1, step 5): every detection becomes evidence for an object, splits one, or starts a new one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from supermap_cli.mapping import lifecycle
from supermap_cli.mapping.association import Affinity, affinity, associate, expected_courses, reached
from supermap_cli.mapping.detection_fusion import DetectionFusion
from supermap_cli.mapping.keyframe_view import STRONG_SCORE, KeyframeView
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.mapping.pair_evidence import PairEvidence
from supermap_cli.mapping.splitting import (
    WHOLE_SHARE,
    SplitEvidence,
    nearer_to_second,
    parts_beside,
    side_by_side,
    split_off,
    whole_of,
)
from supermap_cli.mapping.transitions import Transitions
from supermap_cli.types.labels import ANIMATE

NO_PARTS: Mapping[int, Sequence[LiftedDetection]] = MappingProxyType({})


@dataclass
class ObjectMerging:
    """Associates the detections of one image with the map's objects and fuses them."""

    objects: ObjectMap
    transitions: Transitions
    fusion: DetectionFusion
    pairs: PairEvidence
    splits: SplitEvidence

    def merge(self, view: KeyframeView, lifted: Sequence[LiftedDetection]) -> set[int]:
        """The numbers of the objects that a detection was assigned to.

        Strong detections first, then weak ones (ByteTrack's two stages), then re-activation of what was absent; only
        then new objects.
        """
        strong = [detection for detection in lifted if detection.score >= STRONG_SCORE]
        weak = [detection for detection in lifted if detection.score < STRONG_SCORE]
        courses = expected_courses(self.objects, view.stamp_ns)
        near = reached(lifted, self.objects, courses)
        present = [obj for obj in near if obj.present]
        matched: dict[int, LiftedDetection] = {}

        first = associate(strong, present, view.views, courses)
        given = {number: strong[row] for row, number, _ in first.pairs}
        parts = parts_beside(self.objects, given, [strong[row] for row in first.free])
        self._fuse_pairs(view, strong, first.pairs, matched, parts)
        remaining = [obj for obj in present if obj.number not in matched]
        second = associate(weak, remaining, view.views, courses)
        self._fuse_pairs(view, weak, second.pairs, matched)

        unexplained = [strong[row] for row in first.free]
        absent = [obj for obj in near if not obj.present]
        third = associate(unexplained, absent, view.views, courses)
        self._fuse_pairs(view, unexplained, third.pairs, matched)

        for detection in (unexplained[row] for row in third.free):
            whole = whole_of(self.objects, detection, matched)
            if whole is not None:
                part = self._split(view, whole, matched[whole.number], detection)
                self.fusion.fuse(view, part or whole, detection, None)
            else:
                self._initialize(view, detection)
        self.pairs.take_in(self.objects, matched, view.views)
        return set(matched)

    def merge_by_track(self, view: KeyframeView, lifted: Sequence[LiftedDetection]) -> set[int]:
        """Without the 3D-aware tracker (an ablation) a thing is what was one track in the image, and a new track is a
        new thing.
        """
        tracked = {obj.track_id: obj for obj in self.objects if obj.present and obj.track_id >= 0}
        matched: set[int] = set()
        for detection in lifted:
            obj = tracked.get(detection.track_id)
            if obj is not None and obj.number not in matched:
                self.fusion.fuse(view, obj, detection, affinity(detection, obj, view.views.get(obj.number)))
                matched.add(obj.number)
            elif detection.score >= STRONG_SCORE:
                self._initialize(view, detection)
        return matched

    def _fuse_pairs(
        self,
        view: KeyframeView,
        detections: Sequence[LiftedDetection],
        pairs: Sequence[tuple[int, int, Affinity]],
        matched: dict[int, LiftedDetection],
        parts: Mapping[int, Sequence[LiftedDetection]] = NO_PARTS,
    ) -> None:
        for row, number, fit in pairs:
            obj = self.objects[number]
            if obj.confirmed and obj.present and obj.label not in ANIMATE and fit.explained > WHOLE_SHARE:
                self.splits.seen_as_one(number, view.viewpoint_of(obj))
            self.fusion.fuse(view, obj, detections[row], fit, parts.get(number, ()))
            matched[number] = detections[row]

    def _split(
        self, view: KeyframeView, whole: MapObject, first: LiftedDetection, second: LiftedDetection
    ) -> MapObject | None:
        """The object of the second detection, if by now the images say that the two on `whole` are two things."""
        if not whole.confirmed or whole.label in ANIMATE or first.score < STRONG_SCORE:
            return None
        if not side_by_side(whole.shape, first, second):
            return None
        if not self.splits.seen_as_two(whole.number, first, second, view.viewpoint_of(whole)):
            return None
        part = nearer_to_second(whole.voxels.centers(), first.points_map, second.points_map)
        if not part.any() or part.all():
            return None
        new = split_off(self.objects.new_number(), whole, part, view.stamp_ns)
        self.objects.add(new)
        whole.touched()
        self.transitions.split(whole, new)
        self.pairs.told_apart(whole.number, new.number, self.splits.looks(whole.number))
        self.splits.forget(whole.number)
        return new

    def _initialize(self, view: KeyframeView, detection: LiftedDetection) -> None:
        new = lifecycle.initialize(self.objects.new_number(), detection, view.stamp_ns)
        self.objects.add(new)
        self.fusion.fuse(view, new, detection, None)
