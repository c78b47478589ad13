"""Fusion: one keyframe's evidence enters an object's voxels, its label belief and its existence.

The log-odds update of eq. 8 with an inverse sensor model for each ray, as in OctoMap, of voxels instead of points.
Departs from the paper in that voxels also count how often they lay inside and outside the object's masks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray
from supermap_cli.geometry.voxels import part_numbers, voxel_keys
from supermap_cli.mapping.association import pixels_in_region
from supermap_cli.mapping.belief import Viewpoint
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.recall import FoundBy, RecallModel, ScoreModel, miss_log_ratio, return_log_ratio
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.mapping.voxel_map import VoxelMap
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class FusionParameters:
    """The inverse sensor model, and which voxels are dropped."""

    hit_log_odds: float = parameter(
        0.85, "1", "what a point of a detection says for its voxel: logit(0.70)", "Hornung et al. 2013 (OctoMap): 0.7"
    )
    supported_log_odds: float = parameter(
        0.425, "1", "what a ray that ends at a voxel says for it, inside a mask or not: half as much", TUNED
    )
    miss_log_odds: float = parameter(
        -0.6,
        "1",
        "what a ray that goes through a voxel says of it: logit(0.35)",
        "Hornung et al. 2013 (OctoMap): 0.4",
        at_most=0.0,
    )
    min_log_odds: float = parameter(-1.2, "1", "voxels at or below this are dropped: two rays through", TUNED)
    max_outside_ratio: float = parameter(
        2.0, "1", "voxels seen outside more than this many times as often as inside are dropped", TUNED
    )
    max_outside: float = parameter(2.0, "1", "views outside that are allowed on top of this", TUNED)
    loose_gap_m: float = parameter(
        0.06, "m", "gap between voxels over which an object's parts hang together: two coarse voxels", "depth and pose"
    )
    loose_share: float = parameter(
        0.05,
        "1",
        "share of an object's voxels below which a part that hangs together with no other is a stray",
        "chosen",
    )


DEFAULT = FusionParameters()


def fuse_geometry(obj: MapObject, view: ObjectView, parameters: FusionParameters = DEFAULT) -> None:
    """Occupancy: L += logit(p) for every voxel the rays hit or went through (eq. 8)."""
    log_odds, most = obj.voxels.log_odds, obj.parameters.voxel_map.log_odds_max
    log_odds[view.supported] = np.minimum(log_odds[view.supported] + parameters.supported_log_odds, most)
    log_odds[view.contradicted] += parameters.miss_log_odds


def fuse_mask(
    obj: MapObject, view: ObjectView, detection: LiftedDetection, parts: Sequence[LiftedDetection] = ()
) -> None:
    """Semantic support: the voxels visible now lie in the mask's core, outside the mask, or at its rim (which says
    nothing). What lies in the masks of other `parts` of the object is not outside it.
    """
    mask, rim = detection.mask, detection.rim_px
    inside = view.shown & pixels_in_region(detection.core, mask.u0, mask.v0, view)
    padded = cv2.copyMakeBorder(mask.pixels.astype(np.uint8), *(rim,) * 4, cv2.BORDER_CONSTANT, value=0)
    grown = cv2.dilate(padded, np.ones((2 * rim + 1, 2 * rim + 1), np.uint8)) > 0
    outside = view.shown & ~pixels_in_region(grown, mask.u0 - rim, mask.v0 - rim, view)
    for part in parts:
        outside &= ~pixels_in_region(part.mask.pixels, part.mask.u0, part.mask.v0, view)
    obj.voxels.inside[inside] += 1
    obj.voxels.outside[outside] += 1


def fuse_points(obj: MapObject, detection: LiftedDetection, parameters: FusionParameters = DEFAULT) -> None:
    """Enter the points a detection adds, and drop the voxels that the evidence has turned against."""
    voxels = obj.voxels
    if not len(voxels):
        voxels.voxel_m = max(voxels.voxel_m, detection.voxel_m)
    voxels.add_points(detection.points_map, detection.rgb, parameters.hit_log_odds)
    most_outside = parameters.max_outside_ratio * voxels.inside + parameters.max_outside
    kept = (voxels.log_odds > parameters.min_log_odds) & (voxels.outside <= most_outside)
    if kept.any():
        voxels.keep(kept)
    unmeasured = None if obj.measured else voxels.codes  # of a new object, measured next
    if len(obj.voxels) and _reaches_beyond(obj, detection, parameters.loose_gap_m):
        voxels.keep(hanging_together(voxels, parameters))
    voxels.fit_voxel(obj.parameters.voxel_map)
    obj.voxels_changed(measured=voxels.codes is unmeasured)


def _reaches_beyond(obj: MapObject, detection: LiftedDetection, gap_m: float) -> bool:
    """Whether a detection's points lie clearly outside of what the object measured before."""
    points, shape = detection.points_map, obj.shape
    return bool((points < shape.low - gap_m).any() or (points > shape.high + gap_m).any())


def hanging_together(voxels: VoxelMap, parameters: FusionParameters = DEFAULT) -> BoolArray:
    """(n,) which voxels belong to parts of an object that are more than strays: one bad mask, or a depth between two
    surfaces, leaves a few voxels far from all others, and they would be its box.
    """
    edge_m = max(parameters.loose_gap_m, 2 * voxels.voxel_m)
    part = part_numbers(voxel_keys(voxels.centers(), edge_m))
    share = np.bincount(part) / len(part)
    kept: BoolArray = (share >= min(parameters.loose_share, float(share.max())))[part]
    return kept


def fuse_detection(
    obj: MapObject, detection: LiftedDetection, scores: ScoreModel, recall: RecallModel, viewpoint: Viewpoint
) -> None:
    """Label and existence after a detection."""
    returns = 0.0
    if obj.observations > 0:
        rate = recall.rate_of_class(detection.hypotheses[0].label)
        own = recall.own_rate(rate, obj.found_by)
        returns = return_log_ratio(own, rate, soon=_soon(obj, viewpoint), parameters=recall.parameters)
    log_ratio = scores.detection_log_ratio(detection.score, returns, obj.observations)
    weight = obj.existence.add_detection(viewpoint, log_ratio)
    obj.labels.update(detection.hypotheses, weight)
    obj.labels.longest_side_m = float(obj.shape.box.size.max())


def fuse_miss(obj: MapObject, expected_recall: float, viewpoint: Viewpoint, recall: RecallModel) -> None:
    """Existence after a view in which the detector did not find the object although it could have."""
    own, soon = recall.own_rate(expected_recall, obj.found_by), _soon(obj, viewpoint)
    obj.existence.add_miss(viewpoint, miss_log_ratio(own, expected_recall, soon=soon, parameters=recall.parameters))
    obj.add_look(recall.detector, FoundBy(missed=obj.existence.viewpoints.last_weight(viewpoint)))


def _soon(obj: MapObject, viewpoint: Viewpoint) -> bool:
    """Whether an object was detected so short a time before that an error would still last."""
    return viewpoint.stamp_ns - obj.last_seen_ns < obj.parameters.belief.error_duration_s * 1e9


def area_share(view: ObjectView, image_area_px: int) -> float:
    """Share of the image that the object's observable voxels span, by their box and how full of them it is."""
    box = view.box_xyxy
    if box is None:
        return 0.0
    observable = np.count_nonzero(view.observable | view.unmeasured)
    seen = observable / max(1, int(np.count_nonzero(view.on_image)))
    return float((box[2] - box[0] + 1) * (box[3] - box[1] + 1)) * seen / image_area_px
