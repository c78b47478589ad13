"""One detection enters the object it was assigned to: cloud, label, existence, motion, and the observation itself.

The paper's fusion (log-odds occupancy, label fusion) presumes that an object stands where it stood. Here a detection
that shows it elsewhere is not fused into the old cloud: it counts as evidence of a displacement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.config import Ablation
from supermap_cli.mapping.absence import OBSERVABLE_SHARE
from supermap_cli.mapping.association import Affinity
from supermap_cli.mapping.belief import LabelBelief
from supermap_cli.mapping.crops import better_crop
from supermap_cli.mapping.fusion import believe_more, fuse_geometry, fuse_mask, fuse_points
from supermap_cli.mapping.keyframe_view import KeyframeView
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.missed_detections import SURE_LOG_ODDS
from supermap_cli.mapping.motion import first_course
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.recall import RecallModel, ScoreModel
from supermap_cli.mapping.seam import box_before_turning
from supermap_cli.mapping.shifting import (
    SHIFTED_LOOKS,
    SURE_GAIN,
    find_shift,
    has_left_place,
    shifted_since_ns,
    sure_gain,
)
from supermap_cli.mapping.transitions import Transitions, Whereabouts
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.types.labels import ANIMATE
from supermap_cli.types.memory import Observation

LEFT_SHARE = 0.3
"""Of what moves by itself, the cloud is one of where it was if less of a detection than this lies on it."""


@dataclass
class DetectionFusion:
    """Fuses detections into objects; `recall` and `scores` learn from those of objects believed in firmly."""

    transitions: Transitions
    recall: RecallModel
    scores: ScoreModel
    crop_px: int
    ablate: frozenset[Ablation]

    def fuse(
        self,
        view: KeyframeView,
        obj: MapObject,
        detection: LiftedDetection,
        fit: Affinity | None,
        parts: Sequence[LiftedDetection] = (),
    ) -> None:
        """Take a detection for an object; `parts` are others of the image that lie on it as well, whose masks then do
        not say that it ends beside its own. Without `fit` the object is new, and nothing is known of its place.
        """
        stamp_ns = view.stamp_ns
        object_view = view.views.get(obj.number) if fit is not None else None
        covered = 1.0 if fit is None else fit.covered
        if not obj.present:
            self.transitions.reactivate(obj, stamp_ns)
            object_view = None
        elif fit is not None and (to := _displacement(view, obj, object_view, detection, covered)) is not None:
            surely = obj.shifted_looks >= SHIFTED_LOOKS and obj.shifted_gain >= sure_gain(obj)
            if not surely and obj.label not in ANIMATE:
                in_place_ns = obj.last_seen_ns
                self._support(view, obj, detection, object_view)
                obj.last_seen_ns = in_place_ns
                return
            obj.last_seen_ns, since_ns = shifted_since_ns(obj, stamp_ns)
            self.transitions.displace(obj, to, since_ns)
            object_view = None
        if object_view is not None:
            if "semantic-fusion" not in self.ablate:
                fuse_mask(obj, object_view, detection, parts)
            fuse_geometry(obj, object_view)
        fuse_points(obj, detection)
        self._support(view, obj, detection, object_view)
        if fit is not None:
            obj.motion.sighted(stamp_ns, detection.centroid_map, covered, obj.shape.extent_m)
        elif obj.motion.course is None:
            obj.motion.course = first_course(stamp_ns, detection.centroid_map[:2])

    def _support(
        self, view: KeyframeView, obj: MapObject, detection: LiftedDetection, object_view: ObjectView | None
    ) -> None:
        """Label, existence, track and the observation itself."""
        if "semantic-fusion" in self.ablate:
            obj.labels = LabelBelief()
        if obj.confirmed and obj.existence > SURE_LOG_ODDS:
            self.scores.record_real(detection.score)
        believe_more(obj, detection, self.scores, view.viewpoint_of(obj))
        obj.observations += 1
        for share, truncated in obj.unsettled:
            self.recall.record(obj.label, share, truncated, detected=False, weight=1.0)
        obj.in_place()
        obj.last_seen_ns = view.stamp_ns
        if detection.track_id >= 0:
            obj.track_id = detection.track_id
        obj.visit.support(view.stamp_ns)
        self.transitions.add_observation(self._observation(view, obj, detection, object_view))
        self.transitions.mark_changed(obj)

    def _observation(
        self, view: KeyframeView, obj: MapObject, detection: LiftedDetection, object_view: ObjectView | None
    ) -> Observation:
        keyframe = view.keyframe
        return Observation(
            keyframe.stamp_ns,
            obj.number,
            box_before_turning(detection.box_xyxy, keyframe.camera.width, view.turned_px),
            detection.score,
            detection.hypotheses,
            detection.centroid_map,
            better_crop(keyframe, obj, detection, self.crop_px),
            0 if object_view is None else int(np.count_nonzero(object_view.supported)),
            0 if object_view is None else int(np.count_nonzero(object_view.contradicted)),
            detection.track_id,
            keyframe.camera_id,
        )


def _displacement(
    view: KeyframeView, obj: MapObject, object_view: ObjectView | None, detection: LiftedDetection, covered: float
) -> Whereabouts | None:
    """Where this image shows the object, if away from its place; counts such images in a row."""
    to: Whereabouts | None = None
    walked = obj.label in ANIMATE and covered < LEFT_SHARE
    if walked or obj.on_the_move or has_left_place(obj, object_view, detection, covered):
        to = Whereabouts(detection.centroid_map, None, SURE_GAIN)
    elif object_view is not None and object_view.observable_share >= OBSERVABLE_SHARE:
        shift = find_shift(view.depth, obj, object_view, detection)
        to = None if shift is None else Whereabouts(obj.shape.centroid + shift.by_m, shift.by_m, shift.gain)
    agrees = to is not None and (obj.shifted_to is None or to.agrees_with(obj.shifted_to))
    obj.shifted_looks = 0 if to is None else obj.shifted_looks + 1 if agrees else 1
    obj.shifted_to = None if to is None else to.shift_m
    obj.shifted_gain = 0.0 if to is None else to.gain + (obj.shifted_gain if agrees else 0.0)
    if obj.shifted_looks == 1:
        obj.first_shifted_ns = view.stamp_ns
    return to
