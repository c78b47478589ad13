"""The instance layer (Algorithm 1): P(M_t | M_t-1, I_t, P_t, Q_t), one keyframe at a time, one method a step.

The session calls the steps one after another and does those between them that need other components:

    neighbors = engine.get_neighbor_objects(keyframe)                       GetNeighborObjects
    view = engine.compare_depth(keyframe, neighbors)                        CompareDepth
    priors = engine.update_from_map(view)                                   UpdateFromMap
    ...                                                                     Associate, GenerateMasks
    view, lifted = engine.unproject(view, detections, track_ids)            Unproject
    matched = engine.obj_merge(view, lifted)                                ObjMerge
    missed = engine.check_semantic_consistency(view, matched, detections)   lines 16-20
    engine.obj_negate(view, missed)                                         ObjNegate
    engine.map_merge(keyframe.stamp_ns, matched)                            MapMerge

Departures from the paper: ObjMerge comes before the semantic check and ObjNegate, because detections are assigned to
objects in 3D, so that only afterwards it is known who was missed, and because a detection of an object beside its empty
place says that it was displaced, not that it is gone. What the depth has shown empty (O_front) waits in the view.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.config import Ablation, MappingConfig
from supermap_cli.geometry.arrays import IntArray
from supermap_cli.mapping.depth import depth_view
from supermap_cli.mapping.detection_fusion import DetectionFusion
from supermap_cli.mapping.floor_by_feet import FloorByFeet
from supermap_cli.mapping.free_space import FreeSpaceMemory
from supermap_cli.mapping.geometric_negation import negate_by_geometry
from supermap_cli.mapping.keyframe_view import KeyframeView, move_seam, worth_lifting
from supermap_cli.mapping.lifecycle import has_left
from supermap_cli.mapping.lifting import LiftedDetection, lift
from supermap_cli.mapping.map_update import IdentityLinks, MapUpdate
from supermap_cli.mapping.mask_overlap import without_smaller
from supermap_cli.mapping.missed_detections import MissedObject, find_missed, negate_by_miss
from supermap_cli.mapping.object_merging import ObjectMerging
from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.mapping.pair_evidence import PairEvidence
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.mapping.recall import RecallModel, ScoreModel
from supermap_cli.mapping.splitting import SplitEvidence
from supermap_cli.mapping.transitions import Transitions
from supermap_cli.mapping.visibility import check_objects
from supermap_cli.types.detections import Detections, TrackPrior
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import MapDelta


@dataclass
class MappingEngine:
    """The map while it is being built, and the steps that a keyframe takes through it; `take_changes` after a batch.

    `floor_z` metres is the floor's height in the map, where rays saw it; else `feet` tells it. `recall` and `scores`
    are what this run has learnt of its detector; `pairs` and `splits` what images have said of objects being one or
    two. All of these follow the engine's `parameters`.
    """

    config: MappingConfig = field(default_factory=MappingConfig)
    ablate: frozenset[Ablation] = frozenset()
    objects: ObjectMap = field(default_factory=ObjectMap)
    free_space: FreeSpaceMemory = field(default_factory=FreeSpaceMemory)
    floor_z: float | None = None
    recall: RecallModel = field(default_factory=RecallModel)
    scores: ScoreModel = field(default_factory=ScoreModel)
    pairs: PairEvidence = field(default_factory=PairEvidence)
    splits: SplitEvidence = field(default_factory=SplitEvidence)
    links: IdentityLinks = field(default_factory=IdentityLinks)
    feet: FloorByFeet = field(default_factory=FloorByFeet)
    parameters: MappingParameters = field(default_factory=MappingParameters)
    transitions: Transitions = field(init=False)
    _merging: ObjectMerging = field(init=False, repr=False)
    _update: MapUpdate = field(init=False, repr=False)

    def __post_init__(self) -> None:
        parameters = self.parameters
        self.objects.use(parameters.object_sets())
        self.recall.parameters = self.scores.parameters = parameters.recall
        self.pairs.parameters = parameters.pair_evidence
        self.feet.parameters = parameters.floor_by_feet
        self.splits.use(parameters.splitting, parameters.belief)
        self.free_space.parameters = parameters.free_space
        self.free_space.visibility_parameters = parameters.visibility
        self.transitions = Transitions(self.objects)
        fusion = DetectionFusion(
            self.transitions, self.recall, self.scores, self.config.crop_px, self.ablate, parameters
        )
        self._merging = ObjectMerging(self.objects, self.transitions, fusion, self.pairs, self.splits, parameters)
        self._update = MapUpdate(
            self.objects,
            self.transitions,
            self.free_space,
            self.scores,
            self.pairs,
            self.splits,
            self.links,
            self.ablate,
            parameters,
        )

    def use_detector(self, detector: str) -> None:
        """From now on these detections are of the detector with this identity: its misses and its words are its own."""
        self.recall.detector = detector
        self.objects.use_detector(detector)

    def get_neighbor_objects(self, keyframe: Keyframe) -> list[MapObject]:
        """GetNeighborObjects: those whose bounds come within the sensor's range of the camera."""
        return self.objects.within(keyframe.T_map_camera[:3, 3], self._range_m(keyframe))

    def compare_depth(self, keyframe: Keyframe, neighbors: Sequence[MapObject]) -> KeyframeView:
        """CompareDepth: every voxel of the neighbours is supported (the paper's observable), occluded (unobservable) or
        contradicted (disappeared) by the keyframe's depth, or none of these.
        """
        depth = depth_view(
            keyframe,
            self._range_m(keyframe),
            self.feet.floor_z if self.floor_z is None else self.floor_z,
            parameters=self.parameters.depth,
            returns_parameters=self.parameters.returns,
            fov_parameters=self.parameters.below_lidar_fov,
        )
        views = check_objects(depth, neighbors, self.parameters.visibility)
        if "geometric-consistency" in self.ablate:
            views = {number: view.unchecked() for number, view in views.items()}
        return KeyframeView(keyframe, depth, views, detector=self.recall.detector)

    def update_from_map(self, view: KeyframeView) -> tuple[TrackPrior, ...]:
        """UpdateFromMap: where the objects that the view's camera tracks ought to be in its image, projected as in the
        hybrid state: c = pi(K T_CW X).
        """
        if "tracker" in self.ablate:
            return ()
        camera, priors = view.keyframe.camera, []
        for number, object_view in view.views.items():
            obj, box = self.objects[number], object_view.box_xyxy
            if camera.full_turn and box is not None and box[2] - box[0] > camera.width / 2:
                continue  # across the seam
            track_id = obj.track_ids.get(view.keyframe.camera_id)
            if track_id is not None and obj.present and box is not None:
                priors.append(TrackPrior(track_id, box.astype(np.float32), obj.label, object_view.hidden))
        return tuple(priors)

    def unproject(
        self, view: KeyframeView, detections: Detections, track_ids: IntArray | None = None
    ) -> tuple[KeyframeView, list[LiftedDetection]]:
        """Unproject: the detections in 3D, and the view they refer to from now on (a panorama may be turned).

        `track_ids` (n,), -1 = no track, are the detections'. Overlapping masks are parted first, and weak detections
        where nothing is expected are left out.
        """
        parameters = self.parameters
        ids = np.full(len(detections), -1) if track_ids is None else track_ids
        view, detections, ids = move_seam(view, detections, ids, parameters.seam)
        view = view.with_masked(detections)
        masks = without_smaller(list(detections.masks), detections.labels, parameters.mask_overlap)
        worth = worth_lifting(view, detections, parameters.association.strong_score, parameters.keyframe_view)
        chosen = tuple(mask if lifting else None for mask, lifting in zip(masks, worth, strict=True))
        chosen_ones = detections.with_masks(chosen)
        lifted = lift(view.keyframe, view.depth, chosen_ones, ids, parameters.lifting_sets())
        if self.floor_z is None and view.depth.returns is not None:
            self.feet.add(view.keyframe, view.depth, chosen_ones, ids, lifted)
        return view, lifted

    def obj_merge(self, view: KeyframeView, lifted: Sequence[LiftedDetection]) -> set[int]:
        """ObjMerge: assign the detections to objects and fuse them, split objects, start new ones; the numbers of those
        that were in the map and have been found.
        """
        self.transitions.touched.clear()
        if "tracker" in self.ablate:
            return self._merging.merge_by_track(view, lifted)
        return self._merging.merge(view, lifted)

    def check_semantic_consistency(
        self, view: KeyframeView, matched: set[int], detections: Detections | None
    ) -> tuple[MissedObject, ...]:
        """Lines 16 to 20: the objects on the image that were not found, and what that says; without `detections` no
        detector has looked, and only geometry speaks.
        """
        missed = find_missed(
            view,
            matched,
            self.objects,
            self.recall,
            detector_looked=detections is not None,
            parameters=self.parameters.missed_detections,
            absence_parameters=self.parameters.absence,
            lifting_parameters=self.parameters.lifting,
        )
        self.transitions.changes.dirty.update(miss.obj.number for miss in missed if miss.detectability.observable)
        return missed

    def obj_negate(self, view: KeyframeView, missed: Sequence[MissedObject]) -> None:
        """ObjNegate: geometry and misses speak against objects, until these are absent or believed in no more."""
        parameters = self.parameters
        for miss in missed:
            obj, gone_ns = miss.obj, None
            if not obj.present:
                continue
            if "geometric-consistency" not in self.ablate:
                contradicted = obj.visit.contradicted
                gone_ns = negate_by_geometry(
                    obj, miss.detectability.view, view.stamp_ns, parameters.absence, parameters.fusion
                )
                if obj.visit.contradicted != contradicted:
                    self.transitions.changes.dirty.add(obj.number)
            if gone_ns is None and "semantic-fusion" not in self.ablate:
                gone_ns = negate_by_miss(miss, view.viewpoint_of(obj), self.recall, parameters.missed_detections)
            if gone_ns is not None and has_left(obj, parameters.lifecycle):
                self.transitions.mark_absent(obj, gone_ns)
            elif gone_ns is not None:
                obj.existence.log_odds = min(obj.existence.log_odds, parameters.lifecycle.forget_log_odds)

    def map_merge(self, stamp_ns: int, matched: set[int]) -> None:
        """MapMerge: confirm, relocate, merge and forget objects."""
        self._update.update(stamp_ns, matched)

    def end_traversal(self) -> None:
        """What moves by itself is believed to be nowhere from now on; identities are judged by all that was seen."""
        self.transitions.touched.clear()
        self._update.end_traversal()

    def take_changes(self) -> MapDelta:
        """What has changed since the last call."""
        return self.transitions.changes.drain(self.objects)

    @property
    def touched(self) -> frozenset[int]:
        """The objects whose shape, label or presence the last keyframe has changed."""
        return frozenset(self.transitions.touched)

    @property
    def left_ns(self) -> dict[int, int]:
        """Since when those that the last keyframes have shown to be absent or moved do not stand where they stood."""
        states = self.transitions.changes.closed_states
        return {state.object_number: state.gone_ns for state in states if state.gone_ns is not None}

    def _range_m(self, keyframe: Keyframe) -> float:
        return self.config.max_depth_m if keyframe.returns_camera is None else self.config.max_range_m
