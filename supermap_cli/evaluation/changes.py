"""Precision, recall and F1 of the changes that the map reports between its last two traversals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedChange, EstimatedMap
from supermap_cli.evaluation.known_truth import KnownTruth, Place, known_truth
from supermap_cli.evaluation.matching import identify, match_one_to_one
from supermap_cli.evaluation.net_changes import NetChange, NetChanges, net_changes
from supermap_cli.evaluation.shares import PrecisionRecall, precision_recall
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.types.truth import GroundTruth

MAX_CHANGE_OFFSET_M = 0.5
"""Metres within which the centroids of a reported change must lie of the true ones. Chosen."""


@dataclass(frozen=True)
class MissedChange:
    """A true change that the map does not report; `reported_as_two`: as a disappearance and an appearance."""

    kind: str
    object_id: str
    label: str
    reported_as_two: bool


@dataclass(frozen=True)
class FalseChange:
    """A reported change without a true one; `unchanged_object`: id of the true object that stands there unchanged, if
    any.
    """

    kind: str
    instance_id: str
    label: str
    unchanged_object: str | None


@dataclass(frozen=True)
class ChangeScores:
    """Precision, recall and F1 of reported changes, in the manner of Khronos (Schmid et al., RSS 2024, whose evaluation
    counts right, false and missed appearances and disappearances of associated objects), with moves as a third kind.

    True changes are the net differences between how objects stand at the last keyframes of the last two mapped
    traversals, `between`. A reported change is right if its kind is and its centroids lie within 0.5 m of the true ones
    (moved: both), one-to-one, as many as possible. `overall` and the three kinds are strict: a true move that is
    reported as a disappearance and an appearance is one missed and two false changes. `lenient` takes such a pair for
    the move, found.

    Not scored, `unobservable`, are changes that images do not show: an object left and its place was not in view
    afterwards, an object came and its place had not been in view before, an object was never shown well. Reports that
    touch only places of such changes, or of what came and went within the two traversals, are neither right nor wrong.
    `static_reported` counts false changes of unchanged objects. The scores are `None` where the map holds fewer than
    two traversals.
    """

    between: tuple[str, str] | None
    overall: PrecisionRecall | None
    appeared: PrecisionRecall | None
    disappeared: PrecisionRecall | None
    moved: PrecisionRecall | None
    lenient: PrecisionRecall | None
    static_reported: int
    missed: tuple[MissedChange, ...]
    false: tuple[FalseChange, ...]
    unobservable: tuple[str, ...]


def score_changes(estimate: EstimatedMap, truth: GroundTruth) -> ChangeScores:
    """Score the reported changes."""
    known = known_truth(estimate, truth)
    if len(known.traversals) < 2:
        return ChangeScores(None, None, None, None, None, None, 0, (), (), ())
    changes = net_changes(known)
    reports = [ReportedChange.of(change, estimate) for change in estimate.changes]
    matching = _match_changes(reports, changes)
    false = _false_changes(matching.false, _unchanged_instances(estimate, known, changes))
    return ChangeScores(
        between=(known.traversals[-2].name, known.traversals[-1].name),
        overall=matching.of_kinds("appeared", "disappeared", "moved"),
        appeared=matching.of_kinds("appeared"),
        disappeared=matching.of_kinds("disappeared"),
        moved=matching.of_kinds("moved"),
        lenient=matching.lenient(),
        static_reported=sum(row.unchanged_object is not None for row in false),
        missed=tuple(
            MissedChange(change.kind, change.object_id, change.label, change in matching.split_moves)
            for change in matching.missed
        ),
        false=false,
        unobservable=tuple(f"{change.object_id} {change.kind}" for change in changes.unobservable),
    )


@dataclass(frozen=True, eq=False)
class ReportedChange:
    """A reported change with the positions (3,) that its kind has; without one, that of its instance is taken."""

    change: EstimatedChange
    before: FloatArray | None
    after: FloatArray | None

    @classmethod
    def of(cls, change: EstimatedChange, estimate: EstimatedMap) -> ReportedChange:
        """Fill in missing positions from the map's instance."""
        own = next((instance.centroid for instance in estimate.objects if instance.id == change.object_id), None)
        before = change.position_before if change.position_before is not None else own
        after = change.position_after if change.position_after is not None else own
        return cls(
            change,
            None if change.kind == "appeared" else before,
            None if change.kind == "disappeared" else after,
        )

    def offset_m(self, change: NetChange) -> float:
        """Greatest distance of its positions from those of a true change; infinite for another kind."""
        if self.change.kind != change.kind:
            return np.inf
        return max(_distance_m(self.before, change.before), _distance_m(self.after, change.after))

    def touches_only(self, places: Iterable[Place]) -> bool:
        """Whether each of its positions lies in one of these places."""
        ends = [end for end in (self.before, self.after) if end is not None]
        return bool(ends) and all(
            any(_distance_m(end, place) < MAX_CHANGE_OFFSET_M for place in places) for end in ends
        )


@dataclass(frozen=True)
class ChangeMatching:
    """True changes found and missed, false reports, and the missed moves that were reported as two changes."""

    found: tuple[NetChange, ...]
    missed: tuple[NetChange, ...]
    false: tuple[ReportedChange, ...]
    split_moves: tuple[NetChange, ...]

    def of_kinds(self, *kinds: str) -> PrecisionRecall:
        """Strict scores of some kinds of change."""
        return precision_recall(
            sum(change.kind in kinds for change in self.found),
            sum(report.change.kind in kinds for report in self.false),
            sum(change.kind in kinds for change in self.missed),
        )

    def lenient(self) -> PrecisionRecall:
        """Scores in which a disappearance and an appearance make a move."""
        split_count = len(self.split_moves)
        return precision_recall(
            len(self.found) + split_count, len(self.false) - 2 * split_count, len(self.missed) - split_count
        )


def _match_changes(reports: Sequence[ReportedChange], changes: NetChanges) -> ChangeMatching:
    offsets_m = np.array([[report.offset_m(change) for change in changes.judged] for report in reports])
    offsets_m = offsets_m.reshape(len(reports), len(changes.judged))
    pairs = match_one_to_one(offsets_m < MAX_CHANGE_OFFSET_M, 1 - np.minimum(offsets_m / MAX_CHANGE_OFFSET_M, 1.0))
    right, found = {row for row, _ in pairs}, {column for _, column in pairs}
    missed = tuple(change for column, change in enumerate(changes.judged) if column not in found)
    false = tuple(
        report
        for row, report in enumerate(reports)
        if row not in right and not report.touches_only(changes.unjudged_places)
    )
    return ChangeMatching(
        found=tuple(change for column, change in enumerate(changes.judged) if column in found),
        missed=missed,
        false=false,
        split_moves=_split_moves(missed, false),
    )


def _split_moves(missed: Sequence[NetChange], false: Sequence[ReportedChange]) -> tuple[NetChange, ...]:
    """The missed moves that were reported as a disappearance and an appearance; no report is used twice."""
    unused = list(false)
    split_moves = []
    for change in (move for move in missed if move.kind == "moved"):
        disappearance = next(
            (report for report in unused if report.offset_m(NetChange(change.before, None)) < MAX_CHANGE_OFFSET_M), None
        )
        appearance = next(
            (report for report in unused if report.offset_m(NetChange(None, change.after)) < MAX_CHANGE_OFFSET_M), None
        )
        if disappearance is not None and appearance is not None:
            split_moves.append(change)
            unused.remove(disappearance)
            unused.remove(appearance)
    return tuple(split_moves)


def _unchanged_instances(estimate: EstimatedMap, known: KnownTruth, changes: NetChanges) -> dict[str, str]:
    """Instance id -> id of the unchanged true object that one of its states is."""
    of_instance = {}
    for instance, states in zip(estimate.objects, identify(estimate, known), strict=True):
        for state in states:
            if state is not None and state.object_id in changes.unchanged:
                of_instance[instance.id] = state.object_id
    return of_instance


def _false_changes(false: Iterable[ReportedChange], unchanged: dict[str, str]) -> tuple[FalseChange, ...]:
    changes = [report.change for report in false]
    return tuple(
        FalseChange(change.kind, change.object_id, change.label, unchanged.get(change.object_id)) for change in changes
    )


def _distance_m(end: FloatArray | None, place: Place | None) -> float:
    """Distance of a reported position from a true place; infinite where one of them is missing, 0 where both are."""
    if end is None or place is None:
        return 0.0 if end is None and place is None else np.inf
    return float(np.linalg.norm(end - place.centroid))
