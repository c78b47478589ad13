"""The mapping engine: P(M_t | M_t-1, I_t, P_t, Q_t), one keyframe at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from supermap_cli.config import Ablation, MappingConfig
from supermap_cli.geometry.arrays import BoolArray, IntArray
from supermap_cli.mapping import lifecycle
from supermap_cli.mapping.absence import ABSENT_SHARE, OBSERVABLE_SHARE
from supermap_cli.mapping.association import ANIMATE_MEMORY_NS, Affinity, affinity, associate, expected_courses, reached
from supermap_cli.mapping.belief import LabelBelief
from supermap_cli.mapping.crops import better_crop
from supermap_cli.mapping.depth import depth_view
from supermap_cli.mapping.free_space import FreeSpaceMemory
from supermap_cli.mapping.fusion import (
    area_share,
    believe_less,
    believe_more,
    claimed_by_smaller,
    expected_recall,
    fuse_geometry,
    fuse_mask,
    fuse_points,
)
from supermap_cli.mapping.lifting import LiftedDetection, is_truncated, lift
from supermap_cli.mapping.looks import (
    STRONG_SCORE,
    Look,
    Sight,
    area_px,
    covered_by,
    in_sight,
    vantage_of,
    worth_lifting,
)
from supermap_cli.mapping.motion import first_course
from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.mapping.pair_evidence import PairEvidence
from supermap_cli.mapping.recall import RecallModel, ScoreModel
from supermap_cli.mapping.seam import (
    box_before_turning,
    turn_px,
    turned_detections,
)
from supermap_cli.mapping.shifting import SURE_GAIN, find_shift, shifted_since_ns, sure_gain
from supermap_cli.mapping.splitting import (
    WHOLE_SHARE,
    SplitEvidence,
    nearer_to_second,
    parts_beside,
    side_by_side,
    split_off,
    whole_of,
)
from supermap_cli.mapping.transitions import Transitions, Whereabouts
from supermap_cli.mapping.visibility import ObjectView, look_at
from supermap_cli.types.detections import Detections, TrackPrior
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.labels import ANIMATE
from supermap_cli.types.memory import MapDelta, Observation

SURE_LOG_ODDS = 4.0
"""Only objects believed this firmly teach how often the detector misses what is there."""

LEFT_SHARE = 0.3
"""Of what moves by itself, the cloud is one of where it was if less of a detection than this lies on it."""

NO_PARTS: Mapping[int, Sequence[LiftedDetection]] = MappingProxyType({})


@dataclass
class MappingEngine:
    """Holds the map while it is being built. `look`, then `integrate`; `take_changes` after a batch of keyframes."""

    config: MappingConfig = field(default_factory=MappingConfig)
    ablate: frozenset[Ablation] = frozenset()
    objects: ObjectMap = field(default_factory=ObjectMap)
    recall: RecallModel = field(default_factory=RecallModel)
    scores: ScoreModel = field(default_factory=ScoreModel)
    floor_z: float | None = None
    free_space: FreeSpaceMemory = field(default_factory=FreeSpaceMemory)
    pairs: PairEvidence = field(default_factory=PairEvidence)
    splits: SplitEvidence = field(default_factory=SplitEvidence)
    linked: set[tuple[int, int]] = field(default_factory=set)
    merged: set[int] = field(default_factory=set)
    turns: Transitions = field(init=False)

    def __post_init__(self) -> None:
        self.turns = Transitions(self.objects)

    @property
    def touched(self) -> frozenset[int]:
        """The objects whose shape, label or presence the last keyframe has changed."""
        return frozenset(self.turns.touched)

    @property
    def left_ns(self) -> dict[int, int]:
        """Since when those that the last keyframes have shown to be gone or moved do not stand where they stood."""
        states = self.turns.changes.closed_states
        return {each.object_number: each.gone_ns for each in states if each.gone_ns is not None}

    def look(self, keyframe: Keyframe) -> Look:
        """Geometric consistency of all objects near by with this keyframe's depth."""
        reach_m = self.config.max_depth_m if keyframe.returns_camera is None else self.config.max_range_m
        depth = depth_view(keyframe, reach_m, self.floor_z)
        near = self.objects.within(keyframe.T_map_camera[:3, 3], reach_m)
        views = look_at(depth, near)
        if "geometric-consistency" in self.ablate:
            views = {number: view.unchecked() for number, view in views.items()}
        return Look(keyframe, depth, views)

    def track_priors(self, look: Look) -> tuple[TrackPrior, ...]:
        """Where tracked objects ought to be in this image (hybrid state: c = pi(K T_CW X))."""
        if "tracker" in self.ablate:
            return ()
        priors = []
        for number, view in look.views.items():
            tracked = self.objects[number]
            box = view.box_xyxy
            if look.keyframe.camera.full_turn and box is not None and box[2] - box[0] > look.keyframe.camera.width / 2:
                continue  # across the seam
            if tracked.track_id >= 0 and tracked.present and box is not None:
                priors.append(TrackPrior(tracked.track_id, box.astype(np.float32), tracked.label, view.hidden))
        return tuple(priors)

    def integrate(self, look: Look, detections: Detections | None, track_ids: IntArray | None = None) -> None:
        """Take in one keyframe. `detections` `None`: no detector looked at it, only geometry speaks."""
        stamp_ns = look.keyframe.stamp_ns
        matched: set[int] = set()
        masked: BoolArray | None = None
        self.turns.touched.clear()
        if detections is not None:
            ids = np.full(len(detections), -1) if track_ids is None else track_ids
            by_px = turn_px(detections, look.keyframe.camera)
            if by_px:
                look = look.turned(by_px)
                detections, ids = turned_detections(detections, ids, look.keyframe.camera.width, by_px)
            masked = None if look.depth.lowest is None else covered_by(detections, look.depth.depth_m.shape)
            masks = claimed_by_smaller(list(detections.masks), detections.labels)
            masks = [
                mask if worth else None for mask, worth in zip(masks, worth_lifting(look, detections), strict=True)
            ]
            lifted = lift(look.keyframe, look.depth, detections.with_masks(tuple(masks)), ids)
            by_track = "tracker" in self.ablate
            matched = self._match_by_track(look, lifted) if by_track else self._match(look, lifted)
        for number, view in look.views.items():
            seen = self.objects[number]
            sight = Sight(view, in_sight(view, masked), detector_looked=detections is not None)
            self._weigh_silence(look, seen, sight, number in matched)
        self._lose_animate(stamp_ns)
        self._confirm()
        if "tracker" not in self.ablate:
            self._merge(matched, stamp_ns)
        self._forget()

    def leave(self) -> None:
        """The traversal ends: what moves by itself is believed to be nowhere from now on."""
        self.turns.touched.clear()
        self._lose_animate(None)
        self._forget()

    def take_changes(self) -> MapDelta:
        """What has changed since the last call."""
        return self.turns.changes.drain(self.objects)

    # -- association

    def _match(self, look: Look, lifted: Sequence[LiftedDetection]) -> set[int]:
        """Strong detections first, then weak ones, then re-activation of what was gone; only then birth."""
        strong = [each for each in lifted if each.score >= STRONG_SCORE]
        weak = [each for each in lifted if each.score < STRONG_SCORE]
        courses = expected_courses(self.objects, look.keyframe.stamp_ns)
        near = reached(lifted, self.objects, courses)
        present = [each for each in near if each.present]
        matched: dict[int, LiftedDetection] = {}

        first = associate(strong, present, look.views, courses)
        given = {number: strong[row] for row, number, _ in first.pairs}
        parts = parts_beside(self.objects, given, [strong[row] for row in first.free])
        self._fuse_pairs(look, strong, first.pairs, matched, parts)
        remaining = [each for each in present if each.number not in matched]
        second = associate(weak, remaining, look.views, courses)
        self._fuse_pairs(look, weak, second.pairs, matched)

        unexplained = [strong[i] for i in first.free]
        gone = [each for each in near if not each.present]
        third = associate(unexplained, gone, look.views, courses)
        self._fuse_pairs(look, unexplained, third.pairs, matched)

        for detection in (unexplained[i] for i in third.free):
            whole = whole_of(self.objects, detection, matched)
            if whole is not None:
                part = self._split(look, whole, matched[whole.number], detection)
                self._fuse(look, part or whole, detection, None)
            else:
                self._give_birth(look, detection)
        self.pairs.take_in(self.objects, matched, look.views)
        return set(matched)

    def _match_by_track(self, look: Look, lifted: Sequence[LiftedDetection]) -> set[int]:
        """Without the 3D-aware tracker, a thing is what was one track in the image, and a new track is a new thing."""
        followed = {each.track_id: each for each in self.objects if each.present and each.track_id >= 0}
        matched: set[int] = set()
        for detection in lifted:
            seen = followed.get(detection.track_id)
            if seen is not None and seen.number not in matched:
                self._fuse(look, seen, detection, affinity(detection, seen, look.views.get(seen.number)))
                matched.add(seen.number)
            elif detection.score >= STRONG_SCORE:
                self._give_birth(look, detection)
        return matched

    def _fuse_pairs(
        self,
        look: Look,
        detections: Sequence[LiftedDetection],
        pairs: Sequence[tuple[int, int, Affinity]],
        matched: dict[int, LiftedDetection],
        parts: Mapping[int, Sequence[LiftedDetection]] = NO_PARTS,
    ) -> None:
        for row, number, fit in pairs:
            seen = self.objects[number]
            if seen.confirmed and seen.present and seen.label not in ANIMATE and fit.explained > WHOLE_SHARE:
                self.splits.seen_as_one(number, vantage_of(look.keyframe, seen))
            self._fuse(look, seen, detections[row], fit, parts.get(number, ()))
            matched[number] = detections[row]

    def _split(self, look: Look, whole: MapObject, first: LiftedDetection, second: LiftedDetection) -> MapObject | None:
        """The object of the second detection, if by now the images say that the two on `whole` are two things."""
        if not whole.confirmed or whole.label in ANIMATE or first.score < STRONG_SCORE:
            return None
        if not side_by_side(whole.shape, first, second):
            return None
        if not self.splits.seen_as_two(whole.number, first, second, vantage_of(look.keyframe, whole)):
            return None
        part = nearer_to_second(whole.voxels.centers(), first.points_map, second.points_map)
        if not part.any() or part.all():
            return None
        born = split_off(self.objects.new_number(), whole, part, look.keyframe.stamp_ns)
        self.objects.add(born)
        whole.touched()
        self.turns.split(whole, born)
        self.pairs.told_apart(whole.number, born.number, self.splits.looks(whole.number))
        self.splits.forget(whole.number)
        return born

    # -- fusion

    def _fuse(
        self,
        look: Look,
        seen: MapObject,
        detection: LiftedDetection,
        fit: Affinity | None,
        parts: Sequence[LiftedDetection] = (),
    ) -> None:
        """Take a detection for an object; `parts` are others of the image that lie on it as well, whose masks then do
        not say that it ends beside its own.
        """
        stamp_ns = look.keyframe.stamp_ns
        view = look.views.get(seen.number) if fit is not None else None
        covered = 1.0 if fit is None else fit.covered
        if not seen.present:
            self.turns.come_back(seen, stamp_ns)
            view = None
        elif fit is not None and (to := self._moves(look, seen, view, detection, covered)) is not None:
            surely = seen.shifted_looks >= lifecycle.SHIFTED_LOOKS and seen.shifted_gain >= sure_gain(seen)
            if not surely and seen.label not in ANIMATE:
                in_place_ns = seen.last_seen_ns
                self._support(look, seen, detection, view)
                seen.last_seen_ns = in_place_ns
                return
            seen.last_seen_ns, since_ns = shifted_since_ns(seen, stamp_ns)
            self.turns.shift(seen, to, since_ns)
            view = None
        if view is not None:
            if "semantic-fusion" not in self.ablate:
                fuse_mask(seen, view, detection, parts)
            fuse_geometry(seen, view)
        fuse_points(seen, detection)
        self._support(look, seen, detection, view)
        if fit is not None:
            seen.motion.sighted(stamp_ns, detection.centroid_map, covered, seen.shape.extent_m)
        elif seen.motion.course is None:
            seen.motion.course = first_course(stamp_ns, detection.centroid_map[:2])

    @staticmethod
    def _moves(
        look: Look, seen: MapObject, view: ObjectView | None, detection: LiftedDetection, covered: float
    ) -> Whereabouts | None:
        """Where this image shows the object, if away from its place; counts such images in a row."""
        to: Whereabouts | None = None
        walked = seen.label in ANIMATE and covered < LEFT_SHARE
        if walked or seen.on_the_move or lifecycle.has_shifted(seen, view, detection, covered):
            to = Whereabouts(detection.centroid_map, None, SURE_GAIN)
        elif view is not None and view.observable_share >= OBSERVABLE_SHARE:
            shift = find_shift(look.depth, seen, view, detection)
            to = None if shift is None else Whereabouts(seen.shape.centroid + shift.by_m, shift.by_m, shift.gain)
        agrees = to is not None and (seen.shifted_to is None or to.agrees_with(seen.shifted_to))
        seen.shifted_looks = 0 if to is None else seen.shifted_looks + 1 if agrees else 1
        seen.shifted_to = None if to is None else to.shift_m
        seen.shifted_gain = 0.0 if to is None else to.gain + (seen.shifted_gain if agrees else 0.0)
        if seen.shifted_looks == 1:
            seen.first_shifted_ns = look.keyframe.stamp_ns
        return to

    def _support(self, look: Look, seen: MapObject, detection: LiftedDetection, view: ObjectView | None) -> None:
        """Label, existence, track and the observation itself."""
        keyframe = look.keyframe
        if "semantic-fusion" in self.ablate:
            seen.labels = LabelBelief()
        if seen.confirmed and seen.existence > SURE_LOG_ODDS:
            self.scores.record_real(detection.score)
        believe_more(seen, detection, self.scores, vantage_of(keyframe, seen))
        seen.observations += 1
        for share, truncated in seen.unsettled:
            self.recall.record(seen.label, share, truncated, detected=False, weight=1.0)
        seen.in_place()
        seen.last_seen_ns = keyframe.stamp_ns
        if detection.track_id >= 0:
            seen.track_id = detection.track_id
        seen.visit.support(keyframe.stamp_ns)
        self._observe(look, seen, detection, view)
        self.turns.touch(seen)

    def _observe(self, look: Look, seen: MapObject, detection: LiftedDetection, view: ObjectView | None) -> None:
        keyframe = look.keyframe
        observation = Observation(
            keyframe.stamp_ns,
            seen.number,
            box_before_turning(detection.box_xyxy, keyframe.camera.width, look.turned_px),
            detection.score,
            detection.hypotheses,
            detection.centroid_map,
            better_crop(keyframe, seen, detection, self.config.crop_px),
            0 if view is None else int(np.count_nonzero(view.supported)),
            0 if view is None else int(np.count_nonzero(view.contradicted)),
            detection.track_id,
            keyframe.camera_id,
        )
        self.turns.observe(observation)

    # -- what silence and emptiness say

    def _weigh_silence(self, look: Look, seen: MapObject, sight: Sight, matched: bool) -> None:
        keyframe, view, detector_looked = look.keyframe, sight.view, sight.detector_looked
        if not matched and seen.label in ANIMATE and view.contradicted_share > 0.5:
            return  # it has walked on, and is not where it was for anybody to miss it
        observable = view.observable_share >= OBSERVABLE_SHARE or sight.unmeasured
        if observable and not matched:
            seen.visit.in_view += 1
            self.turns.changes.dirty.add(seen.number)
        box = view.box_xyxy
        truncated = box is not None and is_truncated(box, keyframe.camera)
        if observable and detector_looked and seen.confirmed and seen.present and seen.existence > SURE_LOG_ODDS:
            share = area_share(view, area_px(keyframe))
            if sight.unmeasured and not matched:
                seen.unsettled.append((share, truncated))
            else:
                self.recall.record(seen.label, share, truncated, matched, 1.0)
        if matched or not seen.present:
            return
        if "geometric-consistency" not in self.ablate:
            self._weigh_geometry(seen, view, keyframe.stamp_ns)
        stands = sight.unmeasured or (observable and view.contradicted_share <= 0.5)
        if stands and seen.present and detector_looked and "semantic-fusion" not in self.ablate:
            rate = expected_recall(self.recall, seen, view, area_px(keyframe), truncated)
            believe_less(seen, rate, vantage_of(keyframe, seen))
            if sight.unmeasured and lifecycle.fallen_silent(seen, view, keyframe, rate):
                self.turns.go(seen, seen.first_silent_ns)

    def _weigh_geometry(self, seen: MapObject, view: ObjectView, stamp_ns: int) -> None:
        gone_ns = lifecycle.watch_presence(seen, view, stamp_ns)
        if gone_ns is not None:
            self.turns.go(seen, gone_ns)
            return
        if view.contradicted_share > ABSENT_SHARE:
            seen.visit.contradicted += 1
        elif view.observable_share >= OBSERVABLE_SHARE:
            fuse_geometry(seen, view)

    def _lose_animate(self, stamp_ns: int | None) -> None:
        """What moves by itself is believed in only while it is seen: nobody saw it go, but nothing keeps it there.

        `None`: nobody looks any more.
        """
        for each in self.objects:
            lost = stamp_ns is None or stamp_ns - each.last_seen_ns > ANIMATE_MEMORY_NS
            if lost and each.present and each.label in ANIMATE:
                each.existence = min(each.existence, lifecycle.FORGET_LOG_ODDS)

    # -- lifecycle

    def _give_birth(self, look: Look, detection: LiftedDetection) -> None:
        born = lifecycle.give_birth(self.objects.new_number(), detection, look.keyframe.stamp_ns)
        self.objects.add(born)
        self._fuse(look, born, detection, None)

    def _confirm(self) -> None:
        newly = [each for each in self.objects if not each.confirmed and lifecycle.ready_to_confirm(each)]
        for each in newly:
            points = each.shape.points
            empty_ns = self.free_space.last_seen_empty(points, each.voxels.voxel_m, each.state.first_seen_ns)
            each.state.empty_before_ns = empty_ns
            each.confirmed = True
        relocated = set() if "tracker" in self.ablate else self._relocate(newly)
        for each in newly:
            if each.number not in relocated:
                self.turns.enter(each)

    def _relocate(self, newly: Sequence[MapObject]) -> set[int]:
        """Things found that are things gone: they take over the identity, if the evidence singles it out.

        A pair is judged at the later of two turns: the one confirmed, the other seen to be gone; either may be noticed
        first. It is judged again when two that were found have turned out to be one: that may end an ambiguity.
        """
        gone, found, standing = lifecycle.by_presence(self.objects)
        turned = {each.number for each in newly} | {each.number for each in gone if each.number in self.touched}
        turned |= self.merged
        self.merged = set()
        if not gone or not turned:
            return set()
        taken = set()
        for match in lifecycle.relocations(gone, found, standing):
            if turned.isdisjoint((match.gone, match.found)):
                continue
            old, new = self.objects[match.gone], self.objects[match.found]
            if match.certain:
                self.turns.take_over(old, new)
                taken.add(new.number)
            elif (old.number, new.number) not in self.linked:
                self.linked.add((old.number, new.number))
                self.turns.link_candidate(old, new, match.probability)
        return taken

    def _merge(self, touched: set[int], stamp_ns: int) -> None:
        for first, second in lifecycle.near_pairs(self.objects, touched):
            if first.number not in self.objects.by_number or second.number not in self.objects.by_number:
                continue
            apart = self.pairs.seen_apart(first.number, second.number)
            as_one = self.pairs.seen_as_one(first.number, second.number)
            if as_one or lifecycle.same_thing(first, second, seen_apart=apart):
                kept, joined = lifecycle.older(first, second)
                self.turns.merge(kept, joined, stamp_ns)
                self.pairs.forget(joined.number)
                self.splits.forget(joined.number)
                self.merged.add(kept.number)

    def _forget(self) -> None:
        """Drop tentative objects that nothing speaks for; doubt confirmed ones, until they are confirmed again.

        What was dropped for silence alone was clutter; what went away, or moves by itself, had been there.
        """
        for each in list(self.objects):
            if not each.confirmed:
                if each.existence <= lifecycle.FORGET_LOG_ODDS or not each.present:
                    if each.present and each.label not in ANIMATE:
                        self.scores.record_clutter(seen.score for seen in each.pending)
                    self.objects.remove(each.number)
                continue
            doubted = each.existence <= (lifecycle.CONFIRM_LOG_ODDS if each.doubted else lifecycle.DOUBT_LOG_ODDS)
            if doubted != each.doubted:
                self.turns.doubt(each, doubted=doubted)
