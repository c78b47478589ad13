"""One detection enters the object it was assigned to: cloud, label, existence, motion, and the observation itself.

The paper's fusion (log-odds occupancy, label fusion) presumes that an object stands where it stood. Here a detection
that shows it elsewhere is not fused into the old cloud: it counts as evidence of a displacement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.config import Ablation
from supermap_cli.mapping.association import Affinity
from supermap_cli.mapping.belief import LabelBelief
from supermap_cli.mapping.crops import better_crop
from supermap_cli.mapping.displacement import displaced_since_ns, is_displaced, observe_displacement
from supermap_cli.mapping.fusion import fuse_detection, fuse_geometry, fuse_mask, fuse_points
from supermap_cli.mapping.keyframe_view import KeyframeView
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.mapping.recall import FoundBy, RecallModel, ScoreModel
from supermap_cli.mapping.relief import look_at
from supermap_cli.mapping.seam import box_before_turning
from supermap_cli.mapping.transitions import Transitions
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.types.memory import Observation


@dataclass
class DetectionFusion:
    """Fuses detections into objects; `recall` and `scores` learn from those of objects believed in firmly."""

    transitions: Transitions
    recall: RecallModel
    scores: ScoreModel
    crop_px: int
    ablate: frozenset[Ablation]
    parameters: MappingParameters

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
        stamp_ns, parameters = view.stamp_ns, self.parameters
        object_view = view.views.get(obj.number) if fit is not None else None
        covered = 1.0 if fit is None else fit.covered
        if not obj.present:
            self.transitions.reactivate(obj, stamp_ns)
            object_view = None
        elif fit is not None:
            to = observe_displacement(
                obj,
                object_view,
                view.depth,
                detection,
                covered,
                stamp_ns=stamp_ns,
                parameters=parameters.displacement,
                absence_parameters=parameters.absence,
            )
            if to is not None:
                if not is_displaced(obj, parameters.displacement) and not obj.is_dynamic:
                    in_place_ns = obj.last_seen_ns
                    self._support(view, obj, detection, object_view)
                    obj.last_seen_ns = in_place_ns
                    return
                obj.last_seen_ns, since_ns = displaced_since_ns(obj, stamp_ns, parameters.displacement)
                self.transitions.displace(obj, to, since_ns)
                object_view = None
        if object_view is not None:
            if "semantic-fusion" not in self.ablate:
                fuse_mask(obj, object_view, detection, parts)
            fuse_geometry(obj, object_view, parameters.fusion)
        fuse_points(obj, detection, parameters.fusion)
        self._support(view, obj, detection, object_view)
        if fit is not None:
            obj.motion.add_detection(stamp_ns, detection.centroid_map, covered, obj.shape.extent_m)
        else:
            obj.motion.start(stamp_ns, detection.centroid_map)

    def _support(
        self, view: KeyframeView, obj: MapObject, detection: LiftedDetection, object_view: ObjectView | None
    ) -> None:
        """Label, existence, track and the observation itself."""
        keyframe, sets = view.keyframe, obj.parameters
        if obj.confirmed and obj.existence_log_odds > self.parameters.recall.sure_log_odds:
            self.scores.record_real(detection.score)
        if "semantic-fusion" in self.ablate:
            obj.labels = LabelBelief(
                parameters=sets.belief, size_parameters=sets.class_sizes, detector=self.recall.detector
            )
        viewpoint = view.viewpoint_of(obj)
        fuse_detection(obj, detection, self.scores, self.recall, viewpoint)
        weight = obj.existence.viewpoints.last_weight(viewpoint)
        obj.add_look(self.recall.detector, FoundBy(found=weight))
        label = detection.hypotheses[0].label
        if (relief_look := look_at(detection.relief, label, weight, sets.relief)) is not None:
            obj.add_relief(label, relief_look)
        obj.observations += 1
        for share, truncated in obj.misses.unsettled:
            self.recall.record(obj.label, share, truncated, detected=False, weight=1.0)
        obj.clear_negative_evidence()
        obj.last_seen_ns = keyframe.stamp_ns
        if detection.track_id >= 0:
            obj.track_ids[keyframe.camera_id] = detection.track_id
        obj.visit.add_support(keyframe.stamp_ns, keyframe.camera_id)
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
            better_crop(keyframe, obj, detection, self.crop_px, self.parameters.crops),
            0 if object_view is None else int(np.count_nonzero(object_view.supported)),
            0 if object_view is None else int(np.count_nonzero(object_view.contradicted)),
            detection.track_id,
            keyframe.camera_id,
        )
