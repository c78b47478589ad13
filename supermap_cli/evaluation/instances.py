"""ScanNet's instance segmentation scores of the map at its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.average_precision import (
    MIN_POINTS,
    NO_INSTANCE,
    VOID,
    AveragePrecision,
    InstancePrediction,
    instance_average_precision,
)
from supermap_cli.evaluation.estimate import EstimatedMap, EstimatedObject
from supermap_cli.evaluation.known_truth import known_truth
from supermap_cli.evaluation.matching import same_label
from supermap_cli.evaluation.surface import UNASSIGNED, SeenSurface, nearest_instances, seen_surface
from supermap_cli.geometry.arrays import IntArray
from supermap_cli.types.truth import GroundTruth

BACKGROUND = 0
"""Class of the building's points; no prediction has it. The objects' classes are 1, 2, ..."""


@dataclass(frozen=True)
class LabelPrecision:
    """The figures of one label with `instances` true instances."""

    label: str
    instances: int
    ap: float
    ap50: float
    ap25: float


@dataclass(frozen=True)
class ObjectOverlap:
    """A countable object, how many of its points were seen, and the instance that covers it best, by IoU."""

    object_id: str
    label: str
    points: int
    instance_id: str | None
    iou: float
    label_right: bool | None


@dataclass(frozen=True)
class InstanceScores:
    """AP (mean over IoU .50 to .90), AP50 and AP25 by ScanNet's definition (`average_precision`), per label and as the
    mean over labels; and the same over all instances together, whatever the label, as if all had one (`regardless_`,
    which is no mean over labels).

    The points are the samples of all surfaces that images showed, as objects stand at the end. True instances are the
    countable objects (of 100 points or more; `too_small` names the others); points of ignored objects are void; the
    building is background, where an instance is wrong (the script would take it for void). Predictions are the present
    instances; the samples of one are those to which it has the nearest point of the map, within 5 cm. So no sample has
    two instances, although ScanNet would let it: the points of an object that is in the map twice are divided between
    the two. `None` where there is no true instance, and where the map lacks a part of the truth's traversals: which
    surface was seen is known for all of them together only. `note` says so.
    """

    ap: float | None
    ap50: float | None
    ap25: float | None
    regardless_ap: float | None
    regardless_ap50: float | None
    regardless_ap25: float | None
    labels: tuple[LabelPrecision, ...]
    objects: tuple[ObjectOverlap, ...]
    too_small: tuple[str, ...]
    note: str | None = None


def score_instances(estimate: EstimatedMap, truth: GroundTruth) -> InstanceScores:
    """Score the shapes of the present instances."""
    known = known_truth(estimate, truth)
    if known.gap is not None:
        return InstanceScores(None, None, None, None, None, None, (), (), (), known.gap)
    surface = seen_surface(truth, known)
    present = [instance for instance in estimate.objects if instance.presence == "present"]
    nearest = nearest_instances(surface.points, present)
    names = sorted({place.object.label.casefold() for place in surface.places if place.countable})
    by_label = _precision(surface, present, nearest, names)
    regardless = _precision(surface, present, nearest, None)
    objects = _overlaps(surface, present, nearest)
    return InstanceScores(
        ap=by_label.ap,
        ap50=by_label.ap50,
        ap25=by_label.ap25,
        regardless_ap=regardless.ap,
        regardless_ap50=regardless.ap50,
        regardless_ap25=regardless.ap25,
        labels=tuple(
            LabelPrecision(
                names[precision.label - 1], precision.instances, precision.ap, precision.ap50, precision.ap25
            )
            for precision in by_label.classes
        ),
        objects=objects,
        too_small=tuple(obj.object_id for obj in objects if obj.points < MIN_POINTS),
    )


def _precision(
    surface: SeenSurface, present: Sequence[EstimatedObject], nearest: IntArray, names: Sequence[str] | None
) -> AveragePrecision:
    """Average precision with the labels' names as classes 1, 2, ..., or with one class for all."""

    def number(label: str) -> int:
        if names is None:
            return 1
        return names.index(label.casefold()) + 1 if label.casefold() in names else BACKGROUND

    class_of_place = np.array(
        [number(place.object.label) if place.countable else VOID for place in surface.places] + [BACKGROUND], np.int64
    )
    labels = class_of_place[surface.place]
    predictions = [
        InstancePrediction(np.flatnonzero(nearest == row), number(instance.label), instance.rank)
        for row, instance in enumerate(present)
    ]
    return instance_average_precision(labels, np.where(labels > BACKGROUND, surface.place, NO_INSTANCE), predictions)


def _overlaps(surface: SeenSurface, present: Sequence[EstimatedObject], nearest: IntArray) -> tuple[ObjectOverlap, ...]:
    rows = []
    sizes = np.bincount(nearest[nearest != UNASSIGNED], minlength=len(present))
    for k, place in enumerate(surface.places):
        if not place.countable:
            continue
        own = nearest[surface.place == k]
        shared = np.bincount(own[own != UNASSIGNED], minlength=len(present))
        iou = shared / np.maximum(sizes + len(own) - shared, 1)
        best = present[int(np.argmax(iou))] if shared.any() else None
        rows.append(
            ObjectOverlap(
                object_id=place.object.id,
                label=place.object.label,
                points=len(own),
                instance_id=None if best is None else best.id,
                iou=float(iou.max(initial=0.0)),
                label_right=None if best is None else same_label(best.label, place.object.label),
            )
        )
    return tuple(rows)
