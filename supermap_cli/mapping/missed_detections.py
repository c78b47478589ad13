"""ObjNegate by semantics (Algorithm 1, step 5): an object was in view, and the detector did not find it.

The paper negates every observable object without a track. Here a miss weighs as much as the detector would have been
likely to find the object, which is learnt from the run (`recall`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

from supermap_cli.geometry.cameras import Camera
from supermap_cli.mapping.absence import ABSENT_SHARE, LEAST_THROUGH, OBSERVABLE_SHARE
from supermap_cli.mapping.belief import Vantage
from supermap_cli.mapping.fusion import area_share, believe_less
from supermap_cli.mapping.keyframe_view import KeyframeView
from supermap_cli.mapping.lifting import is_truncated
from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.mapping.recall import RecallModel, miss_log_ratio
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.types.labels import ANIMATE

SURE_LOG_ODDS = 4.0
"""Only objects believed this firmly teach how often the detector misses what is there."""

UNCOVERED_SHARE = 0.6
"""Share of an object beneath all rays that must be free of other masks before a miss counts."""

GONE_LOG_ODDS, SILENT_NS, FOUND_SHARE = 4.0, 2_000_000_000, 0.5
"""Gone, too, where no ray can tell: misses of that weight and for so long, after it was found in that share."""

THROUGH_LOG_ODDS = -1.0
"""What the few rays say that reach the top of such a thing, and go through at least `LEAST_THROUGH` voxels of it."""

EMPTY_SHARE = 0.5
"""Where rays went through more than this share of what they tell of its place, an object's not being found says
nothing on its own.
"""


@dataclass(frozen=True)
class Detectability:
    """Whether a detector that looked at an image could have found an object, and how well it is shown.

    `unmeasured`: the image shows its place, and no ray can reach it.
    """

    view: ObjectView
    camera: Camera
    unmeasured: bool

    @property
    def observable(self) -> bool:
        """Whether its not being found counts."""
        return self.unmeasured or self.view.observable_share >= OBSERVABLE_SHARE

    @property
    def missable(self) -> bool:
        """Whether it would be found if it is there: its place is not seen to be empty."""
        return self.unmeasured or (self.observable and self.view.contradicted_share <= EMPTY_SHARE)

    @cached_property
    def truncated(self) -> bool:
        """Whether the image's border cuts it."""
        box = self.view.box_xyxy
        return box is not None and is_truncated(box, self.camera)

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
) -> tuple[MissedObject, ...]:
    """The objects in view that were not found, in the view's order.

    Every object that could have been found is counted in its visit, and those believed in firmly in the `recall`
    statistics, one after the other: what is expected of an object includes what the ones before it have taught.
    """
    missed = []
    for number, object_view in view.views.items():
        obj, found = objects[number], number in matched
        if not found and obj.label in ANIMATE and object_view.contradicted_share > EMPTY_SHARE:
            continue  # it has walked on, and is not where it was for anybody to miss it
        detectability = Detectability(object_view, view.keyframe.camera, _only_image_shows(object_view, view))
        if detectability.observable and not found:
            obj.visit.in_view += 1
        if detector_looked and detectability.observable:
            _record_recall(recall, obj, detectability, found=found)
        if not found:
            expected = None
            if detector_looked and obj.present and detectability.missable:
                expected = recall.expected(obj.label, detectability.area_share, detectability.truncated)
            missed.append(MissedObject(obj, detectability, expected))
    return tuple(missed)


def negate_by_miss(missed: MissedObject, vantage: Vantage) -> int | None:
    """Existence after a miss; since when the object is gone, if misses alone say so."""
    obj, expected = missed.obj, missed.expected_recall
    if expected is None:
        return None
    believe_less(obj, expected, vantage)
    if missed.detectability.unmeasured and fallen_silent(obj, missed.detectability.view, vantage, expected):
        return obj.first_silent_ns
    return None


def fallen_silent(obj: MapObject, view: ObjectView, vantage: Vantage, expected_recall: float) -> bool:
    """Take in one more view that did not find a thing that no ray can reach; whether it has gone: it was found in most
    views, and then in none for some time.

    What was never real is found now and then; it is demoted, as all that the detector imagines.
    """
    visit = obj.visit
    if obj.silence == 0:
        obj.first_silent_ns = vantage.stamp_ns
    against = miss_log_ratio(expected_recall)
    if int(view.contradicted.sum()) >= LEAST_THROUGH and view.contradicted_share > ABSENT_SHARE:
        against += THROUGH_LOG_ODDS
    obj.silence += obj.silent_views.miss(vantage, against)
    return (
        obj.confirmed
        and obj.silence < -GONE_LOG_ODDS
        and vantage.stamp_ns - obj.first_silent_ns > SILENT_NS
        and visit.supported > FOUND_SHARE * visit.in_view_then
    )


def _record_recall(recall: RecallModel, obj: MapObject, detectability: Detectability, *, found: bool) -> None:
    """A trial of the detector, if the object is surely there; where no ray can tell, later views say if it was."""
    if not (obj.confirmed and obj.present and obj.existence > SURE_LOG_ODDS):
        return
    if detectability.unmeasured and not found:
        obj.unsettled.append((detectability.area_share, detectability.truncated))
    else:
        recall.record(obj.label, detectability.area_share, detectability.truncated, detected=found, weight=1.0)


def _only_image_shows(object_view: ObjectView, view: KeyframeView) -> bool:
    """Whether an object lies where only the image shows it, and nothing that is detected covers most of its place."""
    if view.masked is None:
        return False
    free = (object_view.unmeasured & ~view.masked[object_view.v, object_view.u]) | object_view.contradicted
    if not len(free) or float(object_view.unmeasured.mean()) < OBSERVABLE_SHARE:
        return False
    return float(free.mean()) > UNCOVERED_SHARE
