"""Fusion: one keyframe's evidence enters an object's voxels, its label belief and its existence."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from supermap_cli.mapping.association import pixels_in_region
from supermap_cli.mapping.belief import Vantage
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.recall import ScoreModel, miss_log_ratio
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.mapping.voxel_map import LOG_ODDS_MAX

HIT_LOG_ODDS = 0.85
MISS_LOG_ODDS = -0.6
"""logit(0.70) and logit(0.35): the inverse sensor model of one ray (OctoMap uses 0.7 and 0.4)."""

EXISTENCE_MIN, EXISTENCE_MAX = -6.0, 12.0
"""Existence is clamped, so that a few dozen looks can always turn it."""


def fuse_geometry(seen: MapObject, view: ObjectView) -> None:
    """Occupancy: L += logit(p) for every voxel the rays hit or went through."""
    log_odds = seen.voxels.log_odds
    log_odds[view.supported] = np.minimum(log_odds[view.supported] + HIT_LOG_ODDS / 2, LOG_ODDS_MAX)
    log_odds[view.contradicted] += MISS_LOG_ODDS


def fuse_mask(
    seen: MapObject, view: ObjectView, detection: LiftedDetection, parts: Sequence[LiftedDetection] = ()
) -> None:
    """Semantic support: the voxels visible now lie in the mask's core, beside the mask, or at its rim (which says
    nothing). What lies in the masks of other `parts` of the object is not beside it.
    """
    mask, rim = detection.mask, detection.rim_px
    inside = view.shown & pixels_in_region(detection.core, mask.u0, mask.v0, view)
    padded = cv2.copyMakeBorder(mask.pixels.astype(np.uint8), *(rim,) * 4, cv2.BORDER_CONSTANT, value=0)
    grown = cv2.dilate(padded, np.ones((2 * rim + 1, 2 * rim + 1), np.uint8)) > 0
    beside = view.shown & ~pixels_in_region(grown, mask.u0 - rim, mask.v0 - rim, view)
    for part in parts:
        beside &= ~pixels_in_region(part.mask.pixels, part.mask.u0, part.mask.v0, view)
    seen.voxels.inside[inside] += 1
    seen.voxels.outside[beside] += 1


def fuse_points(seen: MapObject, detection: LiftedDetection) -> None:
    """Enter the points a detection adds, and drop the voxels that the evidence has turned against."""
    voxels = seen.voxels
    if not len(voxels):
        voxels.voxel_m = max(voxels.voxel_m, detection.voxel_m)
    voxels.add_points(detection.points_map, detection.rgb, HIT_LOG_ODDS)
    kept = (voxels.log_odds > -1.2) & (voxels.outside <= 2 * voxels.inside + 2)
    if kept.any():
        voxels.keep(kept)
    voxels.fit_voxel()
    seen.touched()


def believe_more(seen: MapObject, detection: LiftedDetection, scores: ScoreModel, vantage: Vantage) -> None:
    """Label and existence after a detection."""
    log_ratio = scores.detection_log_ratio(detection.score, again=seen.observations > 0)
    weight, gain = seen.viewpoints.support(vantage, log_ratio)
    seen.labels.update(detection.hypotheses, weight)
    seen.labels.longest_side_m = float(seen.shape.box.size.max())
    seen.existence = float(np.clip(seen.existence + gain, EXISTENCE_MIN, EXISTENCE_MAX))


def believe_less(missed: MapObject, expected_recall: float, vantage: Vantage) -> None:
    """Existence after a look at which the detector kept silent although it could have spoken."""
    gain = missed.viewpoints.miss(vantage, miss_log_ratio(expected_recall))
    missed.existence = float(np.clip(missed.existence + gain, EXISTENCE_MIN, EXISTENCE_MAX))


def area_share(view: ObjectView, image_area_px: int) -> float:
    """Share of the image that the object's observable voxels span, by their box and how full of them it is."""
    box = view.box_xyxy
    if box is None:
        return 0.0
    observable = np.count_nonzero(view.observable | view.unmeasured)
    seen = observable / max(1, int(np.count_nonzero(view.on_image)))
    return float((box[2] - box[0] + 1) * (box[3] - box[1] + 1)) * seen / image_area_px
