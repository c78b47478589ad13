"""Changes between two traversals or times, with evidence (classification: `change_classification`)."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from supermap_cli.errors import QueryError
from supermap_cli.memory.labelled_observations import LabelledObservations
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import LabelledObservation, StoredInstance, StoredTraversal
from supermap_cli.query.change_classification import (
    CHANGE_KINDS,
    ChangeClassification,
    ChangeKind,
    ComparedTimes,
    StateComparison,
    compared_times,
    state_distance_m,
)
from supermap_cli.query.clock import clock_of
from supermap_cli.query.detectors import recall_of
from supermap_cli.query.label_consensus import LabelConsensus, group_by_traversal, label_consensus, label_consensus_at
from supermap_cli.query.readings import compare_readings
from supermap_cli.query.retention_policy import pruned_data_notes
from supermap_cli.query.time_points import TimePoint, parse_time_point, traversal_end
from supermap_cli.query.views import (
    EvidenceView,
    IntervalView,
    TraversalView,
    Vector,
    evidence_of,
    interval_view,
    traversal_view,
    vector,
)
from supermap_cli.types.labels import DYNAMIC_CLASSES
from supermap_cli.types.memory import StateRecord, TemporalEdge

CERTAIN_CHANGES: frozenset[ChangeKind] = frozenset({"appeared", "disappeared", "moved", "relabelled"})
MAX_NAMED_IDS = 12
"""Ids listed in a note."""


MAX_NOT_LOOKED_AT = 1000
"""Instances listed, the newest ones, where neither of two traversals looked; a note counts the others. A diff of two
visits must not grow with the building.
"""


@dataclass(frozen=True)
class IdentityCandidateView:
    """An instance that may be the same object, with the probability."""

    id: str
    probability: float


@dataclass(frozen=True)
class SideView:
    """One side of a diff: `name` is a traversal or a time in words; statements hold at `at_ns`."""

    name: str
    at_ns: int
    since_ns: int
    traversal: TraversalView | None


@dataclass(frozen=True)
class ObjectChange:
    """The change of one instance between the two sides.

    It happened within [not_before_ns, not_after_ns] (both `None` if there was no change); `perhaps_before` if that
    interval begins before the earlier side. `reason` explains the classification. Crops are ids of observations.
    """

    kind: ChangeKind
    id: str
    label: str
    reason: str
    confidence: float
    not_before_ns: int | None
    not_after_ns: int | None
    perhaps_before: bool
    position_before: Vector | None
    position_after: Vector | None
    distance_m: float | None
    label_before: str | None
    label_after: str | None
    interval_before: IntervalView | None
    interval_after: IntervalView | None
    may_be: tuple[IdentityCandidateView, ...]
    evidence_before: EvidenceView
    evidence_after: EvidenceView
    crop_before: int | None
    crop_after: int | None


@dataclass(frozen=True)
class Diff:
    """All changes between two sides, ordered by `CHANGE_KINDS` and instance."""

    before: SideView
    after: SideView
    counts: dict[str, int]
    changes: tuple[ObjectChange, ...]
    notes: tuple[str, ...]


def diff(reader: MapReader, first: str | None = None, second: str | None = None) -> Diff:
    """Compare two traversals or times in chronological order; by default the two newest traversals.

    With one, compare it to the newest traversal. Every instance that one of the two observed, or that stood then as far
    as the map knows, has exactly one row; those of dynamic classes are named in a note. Raises `QueryError` if
    there are not two traversals, or for a text that is neither a time nor a traversal.
    """
    sides = _choose_sides(reader, first, second)
    before, after = sorted(sides, key=lambda side: side.at_ns)
    times = compared_times(before, after, reader.traversals)
    builder = DiffBuilder(reader, times)
    numbers, left_out = instances_to_compare(reader, times)
    changes = [change for batch in batches(numbers) for change in builder.changes(batch)]
    changes.sort(key=lambda change: CHANGE_KINDS.index(change.kind))
    counts = Counter(change.kind for change in changes)
    notes = [side.note for side in sides if side.note is not None]
    notes += ["the two were put in the order of time"] if sides[0] is not before else []
    traversals = [side.traversal for side in (before, after) if side.traversal is not None] or reader.traversals
    if left_out:
        notes.append(f"{left_out} more stood there before where neither looked; `supermap show --at` lists them")
    notes += pruned_data_notes(traversals, clock_of(reader))
    return Diff(
        before=_side_view(before),
        after=_side_view(after),
        counts={kind: counts[kind] for kind in CHANGE_KINDS},
        changes=tuple(changes),
        notes=(*notes, *builder.dynamic_notes()),
    )


class DiffBuilder:
    """Builds the changes between two time points of a map, reading instances in batches.

    For two traversals only their own observations count; for a plain time all observations before it do.
    """

    def __init__(self, reader: MapReader, times: ComparedTimes) -> None:
        self.reader = reader
        self.times = times
        compared = [side.traversal.id for side in (times.before, times.after) if side.traversal is not None]
        self._observations = LabelledObservations(reader, compared if len(compared) == 2 else None)
        self._dynamic_ids: list[str] = []

    def changes(self, numbers: Sequence[int]) -> Iterator[ObjectChange]:
        """The changes of some instances; those of dynamic classes are kept for the notes."""
        traversal_ids = self.times.traversal_ids_before | self.times.traversal_ids_after
        candidates = self.reader.instances_of(numbers, traversal_ids=traversal_ids)
        instances = [instance for instance in candidates if instance.label not in DYNAMIC_CLASSES]
        self._dynamic_ids += [instance.id for instance in candidates if instance.label in DYNAMIC_CLASSES]
        edges = self._edges(instances)
        comparisons = [
            StateComparison(instance, self.times, edges[instance.number], self.reader.text_ids)
            for instance in instances
        ]
        classified = [
            (comparison, classification)
            for comparison in comparisons
            if (classification := comparison.account()) is not None
        ]
        observations = self._observations.of([comparison.instance for comparison, _ in classified])
        for comparison, classification in classified:
            yield self._change(comparison, classification, observations.get(comparison.instance.number, []))

    def _change(
        self,
        comparison: StateComparison,
        classification: ChangeClassification,
        observations: Sequence[LabelledObservation],
    ) -> ObjectChange:
        """A classified change with its evidence."""
        instance = comparison.instance
        side_labels = self._side_labels(observations)
        classification = self._with_readings(classification, instance, side_labels, observations)
        if classification.kind == "doubted":
            classification = self._with_recall(classification, instance)
        parts = self._parts(comparison)
        before, after = classification.before, classification.after
        sides = (
            self._side_observations(self.times.before, observations, before),
            self._side_observations(self.times.after, observations, after),
        )
        labels = [
            None if state is None else state.label if consensus is None else consensus.label
            for state, consensus in zip((before, after), side_labels, strict=True)
        ]
        low_ns = classification.not_before_ns
        return ObjectChange(
            kind=classification.kind,
            id=instance.id,
            label=instance.label,
            reason="; ".join([classification.reason, *parts]),
            confidence=round(classification.confidence, 4),
            not_before_ns=low_ns,
            not_after_ns=classification.not_after_ns,
            perhaps_before=classification.kind in CERTAIN_CHANGES
            and low_ns is not None
            and low_ns < self.times.before.since_ns,
            position_before=None if before is None else vector(before.centroid_map),
            position_after=None if after is None else vector(after.centroid_map),
            distance_m=None if before is None or after is None else round(state_distance_m(before, after), 4),
            label_before=labels[0],
            label_after=labels[1],
            interval_before=None if before is None else interval_view(before),
            interval_after=None if after is None else interval_view(after),
            may_be=self._candidates(instance, comparison.edges),
            evidence_before=self._evidence(instance, sides[0], self.times.traversal_ids_before),
            evidence_after=self._evidence(instance, sides[1], self.times.traversal_ids_after),
            crop_before=_best_crop(sides[0]),
            crop_after=_best_crop(sides[1]),
        )

    def dynamic_notes(self) -> list[str]:
        """A note on the people and animals, which are not compared."""
        ids = self._dynamic_ids
        return [f"people and animals come and go, and are not compared: {_id_list(ids)}"] if ids else []

    def _with_readings(
        self,
        classification: ChangeClassification,
        instance: StoredInstance,
        side_labels: tuple[LabelConsensus | None, LabelConsensus | None],
        observations: Sequence[LabelledObservation],
    ) -> ChangeClassification:
        """Adds what the two sides called it, if each is sure of a name and these differ: a change if another thing
        stands there, else another reading; a move stays a move.
        """
        old, new = side_labels
        if old is None or new is None or old.label == new.label or old.traversal_id == new.traversal_id:
            return classification
        label_text = f"called {old.label} in {self.times.before.text} and {new.label} in {self.times.after.text}"
        if classification.kind == "moved":
            return replace(classification, reason=f"{classification.reason}; {label_text}")
        if classification.kind != "unchanged":
            return classification
        traversal_ids, ends_ns = (old.traversal_id, new.traversal_id), (self.times.before.at_ns, self.times.after.at_ns)
        compared = compare_readings(self.reader, instance, traversal_ids, ends_ns)
        if compared.probability <= 0.5:
            return replace(classification, reason=f"{classification.reason}; {label_text}: {compared.reason}")
        by_traversal = group_by_traversal(observations)
        return replace(
            classification,
            kind="relabelled",
            reason=f"{label_text}; {compared.reason}",
            confidence=compared.probability,
            not_before_ns=by_traversal[old.traversal_id][-1].stamp_ns,
            not_after_ns=by_traversal[new.traversal_id][0].stamp_ns,
        )

    def _with_recall(self, classification: ChangeClassification, instance: StoredInstance) -> ChangeClassification:
        """Adds to a doubted instance how much of its class the detectors find: it says what a miss is worth."""
        found = [
            f"{recall:.0%} in {side.traversal.name}"
            for side in (self.times.before, self.times.after)
            if side.traversal is not None and (recall := recall_of(side.traversal, instance.label)) is not None
        ]
        if not found:
            return classification
        told = f"of every {instance.label} in view the detector finds {', '.join(found)}"
        return replace(classification, reason=f"{classification.reason}; {told}")

    def _edges(self, instances: Sequence[StoredInstance]) -> dict[int, list[TemporalEdge]]:
        """The temporal edges of some instances, by instance; also caches the text ids of their ends."""
        touching = self.reader.temporal_edges({number for instance in instances for number in instance.numbers})
        ends = {number for edge in touching for number in (edge.from_number, edge.to_number)}
        self.reader.text_ids.of(set(self.reader.survivors.of(ends).values()) | ends)
        edges: dict[int, list[TemporalEdge]] = defaultdict(list)
        for edge in touching:
            for number in {edge.from_number, edge.to_number}:
                edges[number].append(edge)
        return {
            instance.number: [edge for number in instance.numbers for edge in edges[number]] for instance in instances
        }

    def _parts(self, comparison: StateComparison) -> list[str]:
        """What was taken for a thing of its own by one of the sides, and turned out later to be part of this one."""
        parts = {
            self.reader.text_ids[edge.from_number]: edge.not_after_ns
            for edge in comparison.edges
            if edge.kind == "merged"
            and edge.from_number != comparison.instance.number
            and (edge.not_before_ns or 0) <= self.times.after.at_ns
            and edge.not_after_ns > self.times.before.at_ns
        }
        clock = clock_of(self.reader)
        return [f"{part}, held apart until {clock.text(merged_ns)}, is part of it" for part, merged_ns in parts.items()]

    def _side_labels(
        self, observations: Sequence[LabelledObservation]
    ) -> tuple[LabelConsensus | None, LabelConsensus | None]:
        """The label consensus of each side."""
        by_traversal = group_by_traversal(observations)

        def consensus_of(side: TimePoint) -> LabelConsensus | None:
            return (
                label_consensus_at(observations, side.at_ns)
                if side.traversal is None
                else label_consensus(by_traversal.get(side.traversal.id, []))
            )

        return consensus_of(self.times.before), consensus_of(self.times.after)

    def _side_observations(
        self, side: TimePoint, observations: Sequence[LabelledObservation], state: StateRecord | None
    ) -> Sequence[LabelledObservation]:
        """The observations that count for a side: a traversal's own; for a plain time those of the state until then,
        and for the later side those since the earlier one.
        """
        if side.traversal is not None:
            return [observation for observation in observations if observation.traversal_id == side.traversal.id]
        if state is None:
            return []
        low_ns = self.times.before.at_ns + 1 if side is self.times.after else state.first_seen_ns
        return [
            observation
            for observation in observations
            if max(low_ns, state.first_seen_ns) <= observation.stamp_ns <= side.at_ns
        ]

    def _evidence(
        self, instance: StoredInstance, observations: Sequence[LabelledObservation], traversal_ids: frozenset[int]
    ) -> EvidenceView:
        visits = [visit for visit in instance.visits if visit.traversal_id in traversal_ids]
        return evidence_of(observations, visits, self.reader.traversals)

    def _candidates(self, instance: StoredInstance, edges: Iterable[TemporalEdge]) -> tuple[IdentityCandidateView, ...]:
        probabilities = {}
        for edge in edges:
            if edge.kind == "candidate":
                ends = {self.reader.survivors[edge.from_number], self.reader.survivors[edge.to_number]}
                for other in ends - {instance.number}:
                    probabilities[self.reader.text_ids[other]] = round(edge.probability, 4)
        return tuple(
            IdentityCandidateView(text_id, probability) for text_id, probability in sorted(probabilities.items())
        )


def _best_crop(side: Sequence[LabelledObservation]) -> int | None:
    """The id of the best crop of a side; a crop is stored only if it is clearly better than earlier ones."""
    return next((observation.id for observation in reversed(side) if observation.has_crop), None)


def instances_to_compare(reader: MapReader, times: ComparedTimes) -> tuple[list[int], int]:
    """The instances observed on either side, those that stood there before, and those that changed in between; and how
    many are left out of those that stood there before in a large map, where neither of two traversals looked.
    """
    traversals = [side.traversal.id for side in (times.before, times.after) if side.traversal is not None]
    observed = reader.supported_in(traversals) if traversals else ()
    changed = reader.changed_within(times.before.at_ns, times.after.at_ns)
    looked_at = {*observed, *changed}
    others = [number for number in reader.instances_placed_at(times.before.at_ns) if number not in looked_at]
    listed = others if times.before.traversal is None else others[-MAX_NOT_LOOKED_AT:]
    return sorted({*looked_at, *listed}), len(others) - len(listed)


def _choose_sides(reader: MapReader, first: str | None, second: str | None) -> tuple[TimePoint, TimePoint]:
    traversals, clock = reader.traversals, clock_of(reader)
    first_point = None if first is None else parse_time_point(first, reader, clock)
    second_point = None if second is None else parse_time_point(second, reader, clock)
    if first_point is not None and second_point is None and traversals and first_point.traversal is None:
        second_point = traversal_end(traversals[-1])
    if first_point is None or second_point is None:
        if len(traversals) < 2:
            known = f"only {traversals[0].name!r}" if traversals else "none"
            raise QueryError(
                f"a diff needs two traversals, and the map holds {known}",
                where=reader.where,
                cure="build another recording of the same place into it, or give two times",
            )
        if first_point is None:
            first_point, second_point = map(traversal_end, traversals[-2:])
        else:
            second_point = traversal_end(_newest_except(traversals, first_point.traversal))
    if first_point.at_ns == second_point.at_ns:
        raise QueryError(
            f"{first_point.text!r} differs in nothing from itself", cure="give two traversals, or two times"
        )
    return first_point, second_point


def _newest_except(traversals: Sequence[StoredTraversal], excluded: StoredTraversal | None) -> StoredTraversal:
    return next(traversal for traversal in reversed(traversals) if excluded is None or traversal.id != excluded.id)


def _side_view(side: TimePoint) -> SideView:
    return SideView(
        side.text, side.at_ns, side.since_ns, None if side.traversal is None else traversal_view(side.traversal)
    )


def _id_list(ids: Sequence[str]) -> str:
    more = f" and {len(ids) - MAX_NAMED_IDS} more" if len(ids) > MAX_NAMED_IDS else ""
    return ", ".join(ids[:MAX_NAMED_IDS]) + more
