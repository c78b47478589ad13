"""ObjNegate by semantics (Algorithm 1, step 5): an object was in view, and the detector did not find it.

The paper negates every observable object without a track. Here a miss weighs as much as the detector would have been
likely to find the object, which is learnt from the run (`recall`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

from supermap_cli.geometry.cameras import Camera
from supermap_cli.mapping import absence, lifting
from supermap_cli.mapping.absence import AbsenceParameters
from supermap_cli.mapping.belief import Viewpoint
from supermap_cli.mapping.fusion import area_share, fuse_miss
from supermap_cli.mapping.keyframe_view import KeyframeView
from supermap_cli.mapping.lifting import LiftingParameters, is_truncated
from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.mapping.recall import RecallModel, miss_log_ratio
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class MissedDetectionParameters:
    """When a miss counts, and when misses alone say that an object has gone."""

    empty_share: float = parameter(
        0.5,
        "1",
        "share of the measured part of an object's place: if rays went through more, a miss says nothing",
        TUNED,
        at_most=1.0,
    )
    uncovered_share: float = parameter(
        0.6, "1", "share of an object below all rays that must be free of other masks before a miss counts", TUNED
    )
    gone_log_odds: float = parameter(
        4.0, "1", "evidence of misses from which an object is gone that no ray can reach", TUNED
    )
    gone_after_s: float = parameter(2.0, "s", "time that these misses must last", TUNED)
    min_found_share: float = parameter(
        0.5, "1", "share of the views before that must have found it: else it was never real", TUNED, at_most=1.0
    )
    through_log_odds: float = parameter(
        -1.0, "1", "what the few rays say that reach the top of such an object, and go through it", TUNED, at_most=0.0
    )


DEFAULT = MissedDetectionParameters()


@dataclass(frozen=True)
class Detectability:
    """Whether a detector that looked at an image could have found an object, and how well it is shown.

    `unmeasured`: the image shows its place, and no ray can reach it.
    """

    view: ObjectView
    camera: Camera
    unmeasured: bool
    absence_parameters: AbsenceParameters = absence.DEFAULT
    lifting_parameters: LiftingParameters = lifting.DEFAULT

    @property
    def observable(self) -> bool:
        """Whether its not being found counts."""
        return self.unmeasured or self.view.observable_share >= self.absence_parameters.observable_share

    def missable(self, parameters: MissedDetectionParameters = DEFAULT) -> bool:
        """Whether it would be found if it is there: its place is not seen to be empty."""
        return self.unmeasured or (self.observable and self.view.contradicted_share <= parameters.empty_share)

    @cached_property
    def truncated(self) -> bool:
        """Whether the image's border cuts it."""
        box = self.view.box_xyxy
        return box is not None and is_truncated(box, self.camera, self.lifting_parameters)

    @cached_property
    def area_share(self) -> float:
        """Share of the image that it spans."""
        return area_share(self.view, self.camera.width * self.camera.height)


@dataclass(frozen=True)
class MissedObject:
    """An object on the image that no detection was assigned to.

    `expected_recall` is P(the detector fires | it is there and looks as it does now); `None` where a miss says nothing,
    so that only geometry speaks.
    """

    obj: MapObject
    detectability: Detectability
    expected_recall: float | None


def find_missed(
    view: KeyframeView,
    matched: Collection[int],
    objects: ObjectMap,
    recall: RecallModel,
    *,
    detector_looked: bool,
    parameters: MissedDetectionParameters = DEFAULT,
    absence_parameters: AbsenceParameters = absence.DEFAULT,
    lifting_parameters: LiftingParameters = lifting.DEFAULT,
) -> tuple[MissedObject, ...]:
    """The objects in view that were not found, in the view's order.

    Every object that could have been found is counted in its visit, and those believed in firmly in the `recall`
    statistics, one after the other: what is expected of an object includes what the ones before it have taught.
    """
    missed = []
    for number, object_view in view.views.items():
        obj, found = objects[number], number in matched
        if not found and obj.is_dynamic and object_view.contradicted_share > parameters.empty_share:
            continue  # it has moved on and cannot be missed where it was
        unmeasured = _only_image_shows(object_view, view, parameters, absence_parameters)
        detectability = Detectability(
            object_view, view.keyframe.camera, unmeasured, absence_parameters, lifting_parameters
        )
        if detectability.observable and not found:
            obj.visit.in_view += 1
        if detector_looked and detectability.observable:
            _record_recall(recall, obj, detectability, found=found)
        if not found:
            expected = None
            if detector_looked and obj.present and detectability.missable(parameters):
                expected = recall.expected(obj.label, detectability.area_share, detectability.truncated)
            missed.append(MissedObject(obj, detectability, expected))
    return tuple(missed)


def negate_by_miss(
    missed: MissedObject,
    viewpoint: Viewpoint,
    recall: RecallModel,
    parameters: MissedDetectionParameters = DEFAULT,
) -> int | None:
    """Existence after a miss; since when the object is gone, if misses alone say so."""
    obj, expected = missed.obj, missed.expected_recall
    if expected is None:
        return None
    fuse_miss(obj, expected, viewpoint, recall)
    if not missed.detectability.unmeasured:
        return None
    own = recall.own_rate(expected, obj.found_by)
    against = miss_log_ratio(own, expected, parameters=recall.parameters)
    if _rays_went_through(missed.detectability):
        against += parameters.through_log_odds
    return obj.misses.first_ns if is_gone_by_misses(obj, viewpoint, against, parameters) else None


def is_gone_by_misses(
    obj: MapObject, viewpoint: Viewpoint, log_ratio: float, parameters: MissedDetectionParameters = DEFAULT
) -> bool:
    """Take in one more view that did not find an object that no ray can reach; whether it has gone: it was found in
    most views, of this visit or of earlier ones, and then in none for some time.

    What was never real is found now and then; it is demoted, as all that the detector imagines.
    """
    misses = obj.misses
    if misses.log_odds == 0:
        misses.first_ns = viewpoint.stamp_ns
    misses.log_odds += misses.viewpoints.add_miss(viewpoint, log_ratio)
    return (
        obj.confirmed
        and misses.log_odds < -parameters.gone_log_odds
        and viewpoint.stamp_ns - misses.first_ns > parameters.gone_after_s * 1e9
        and _found_share(obj) > parameters.min_found_share
    )


def _found_share(obj: MapObject) -> float:
    """Share of the views, before it went undetected, that found it: in this visit, or, of what it has not found at all,
    in earlier ones.
    """
    visit = obj.visit
    if visit.supported:
        return visit.supported / visit.in_view_at_support
    found = sum(cell.supports for cell in obj.existence.viewpoints.cells.values())
    views = sum(cell.views for cell in obj.existence.viewpoints.cells.values())
    missed = sum(cell.views for cell in obj.misses.viewpoints.cells.values())
    return found / max(views - missed, 1) if visit.earlier_ns is not None else 0.0


def _rays_went_through(detectability: Detectability) -> bool:
    view, parameters = detectability.view, detectability.absence_parameters
    enough = int(view.contradicted.sum()) >= parameters.min_voxels
    return enough and view.contradicted_share > parameters.absent_share


def _record_recall(recall: RecallModel, obj: MapObject, detectability: Detectability, *, found: bool) -> None:
    """A trial of the detector, if the object is surely there; where no ray reaches, later views say if it was."""
    if not (obj.confirmed and obj.present and obj.existence_log_odds > recall.parameters.sure_log_odds):
        return
    if detectability.unmeasured and not found:
        obj.misses.unsettled.append((detectability.area_share, detectability.truncated))
    else:
        recall.record(obj.label, detectability.area_share, detectability.truncated, detected=found, weight=1.0)


def _only_image_shows(
    object_view: ObjectView,
    view: KeyframeView,
    parameters: MissedDetectionParameters,
    absence_parameters: AbsenceParameters,
) -> bool:
    """Whether an object lies where only the image shows it, and nothing that is detected covers most of its place."""
    if view.masked is None:
        return False
    free = (object_view.unmeasured & ~view.masked[object_view.v, object_view.u]) | object_view.contradicted
    if not len(free) or float(object_view.unmeasured.mean()) < absence_parameters.observable_share:
        return False
    return float(free.mean()) > parameters.uncovered_share
