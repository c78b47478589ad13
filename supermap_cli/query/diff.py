"""What changed between two traversals or times, and what nobody can say (the judgement itself: `verdicts`)."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from supermap_cli.errors import QueryError
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.said import Hearing
from supermap_cli.memory.values import Said, StoredInstance, StoredTraversal
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
from supermap_cli.query.label_consensus import LabelConsensus, group_by_traversal, label_consensus, label_consensus_at
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
"""How many ids a note names."""


@dataclass(frozen=True)
class IdentityCandidateView:
    """An instance that may be the same thing, as far as the evidence goes."""

    id: str
    probability: float


@dataclass(frozen=True)
class SideView:
    """One side of a diff: `name` is a traversal's, or a time in words; what is said holds at `at_ns`."""

    name: str
    at_ns: int
    since_ns: int
    traversal: TraversalView | None


@dataclass(frozen=True)
class ObjectChange:
    """What became of one instance between the two sides.

    It happened within [not_before_ns, not_after_ns] (both `None` where nothing happened); `perhaps_before` where these
    reach back behind the earlier side, so that it may have happened before that. `reason` says in words what the
    verdict rests on, the crops are ids of observations.
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
    """All changes between two sides, in the order of `KINDS` and of instances."""

    before: SideView
    after: SideView
    counts: dict[str, int]
    changes: tuple[ObjectChange, ...]
    notes: tuple[str, ...]


def diff(reader: MapReader, first: str | None = None, second: str | None = None) -> Diff:
    """Compare two traversals or times, in the order of time; without names the two newest traversals.

    With one: the newest traversal against it. Who walked by has not changed the place. Raises `QueryError` where there
    are not two, or for what is neither a time nor a traversal.
    """
    given = _choose_sides(reader, first, second)
    before, after = sorted(given, key=lambda side: side.at_ns)
    ends = compared_times(before, after, reader.traversals)
    builder = DiffBuilder(reader, ends)
    found = [change for part in batches(_instances_to_compare(reader, ends)) for change in builder.changes(part)]
    found.sort(key=lambda change: CHANGE_KINDS.index(change.kind))
    tally = Counter(change.kind for change in found)
    notes = [side.note for side in given if side.note is not None]
    notes += ["the two were put in the order of time"] if given[0] is not before else []
    named = [side.traversal for side in (before, after) if side.traversal is not None] or reader.traversals
    notes += pruned_data_notes(named, clock_of(reader))
    return Diff(
        before=_side_view(before),
        after=_side_view(after),
        counts={kind: tally[kind] for kind in CHANGE_KINDS},
        changes=tuple(found),
        notes=(*notes, *builder.transient_notes()),
    )


class DiffBuilder:
    """Two ends in one map, and what became of the things that they may speak of, read a part at a time.

    Of two traversals only their own observations matter; of a plain time all that came before it may.
    """

    def __init__(self, reader: MapReader, ends: ComparedTimes) -> None:
        self.reader = reader
        self.times = ends
        compared = [side.traversal.id for side in (ends.before, ends.after) if side.traversal is not None]
        self._observations = Hearing(reader, compared if len(compared) == 2 else None)
        self._transient_ids: dict[str, list[str]] = defaultdict(list)

    def changes(self, numbers: Sequence[int]) -> Iterator[ObjectChange]:
        """What became of each of some instances, if either end speaks of it; who walked by is left out."""
        observers = self.times.observers_before | self.times.observers_after
        found = self.reader.instances_of(numbers, traversal_ids=observers)
        things = [
            instance for instance in found if instance.presence != "doubted" and instance.label not in DYNAMIC_CLASSES
        ]
        edges = self._edges(things)
        comparisons = [
            StateComparison(instance, self.times, edges[instance.number], self.reader.text_ids) for instance in things
        ]
        classified = [
            (comparison, classification)
            for comparison in comparisons
            if (classification := self._classify(comparison)) is not None
        ]
        observations = self._observations.of([comparison.instance for comparison, _ in classified])
        for comparison, classification in classified:
            yield self._change(comparison, classification, observations.get(comparison.instance.number, []))

    def _classify(self, comparison: StateComparison) -> ChangeClassification | None:
        """The judgement of one case; where there is none, what happened all the same is kept for the notes."""
        classification = comparison.classify()
        if classification is None and (transient := comparison.transient()) is not None:
            self._transient_ids[transient].append(comparison.instance.id)
        return classification

    def _change(
        self, comparison: StateComparison, classification: ChangeClassification, seen: Sequence[Said]
    ) -> ObjectChange:
        """A verdict with its evidence."""
        instance = comparison.instance
        names = self._side_labels(seen)
        classification = _with_relabelling(classification, names, seen, self.times)
        before, after = classification.before, classification.after
        sides = (
            self._side_observations(self.times.before, seen, before),
            self._side_observations(self.times.after, seen, after),
        )
        labels = [
            None if state is None else state.label if name is None else name.label
            for state, name in zip((before, after), names, strict=True)
        ]
        low_ns = classification.not_before_ns
        return ObjectChange(
            kind=classification.kind,
            id=instance.id,
            label=instance.label,
            reason=classification.reason,
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
            evidence_before=self._evidence(instance, sides[0], self.times.observers_before),
            evidence_after=self._evidence(instance, sides[1], self.times.observers_after),
            crop_before=_best_crop(sides[0]),
            crop_after=_best_crop(sides[1]),
        )

    def transient_notes(self) -> list[str]:
        """What is no difference between the two ends, and yet happened."""
        before, after = self.times.before.text, self.times.after.text
        words = {
            "came and went": f"came and went between {before} and {after}",
            "left": f"seen by {before}, and gone again before its end",
        }
        return [f"{words[transient]}: {_id_list(ids)}" for transient, ids in sorted(self._transient_ids.items())]

    def _edges(self, things: Sequence[StoredInstance]) -> dict[int, list[TemporalEdge]]:
        """The temporal edges that touch some instances, by instance; the names of all their ends are known then."""
        touching = self.reader.temporal_edges({part for instance in things for part in instance.numbers})
        ends = {number for edge in touching for number in (edge.from_number, edge.to_number)}
        self.reader.text_ids.of(set(self.reader.survivors.of(ends).values()) | ends)
        edges: dict[int, list[TemporalEdge]] = defaultdict(list)
        for edge in touching:
            for number in {edge.from_number, edge.to_number}:
                edges[number].append(edge)
        return {instance.number: [edge for part in instance.numbers for edge in edges[part]] for instance in things}

    def _side_labels(self, seen: Sequence[Said]) -> tuple[LabelConsensus | None, LabelConsensus | None]:
        """What it was surely called at either end."""
        own = group_by_traversal(seen)

        def name(side: TimePoint) -> LabelConsensus | None:
            return (
                label_consensus_at(seen, side.at_ns)
                if side.traversal is None
                else label_consensus(own.get(side.traversal.id, []))
            )

        return name(self.times.before), name(self.times.after)

    def _side_observations(self, side: TimePoint, seen: Sequence[Said], state: StateRecord | None) -> Sequence[Said]:
        """The observations that speak for an end: a traversal's own; of a plain time those of the state until then, or
        for the later end those since the earlier one.
        """
        if side.traversal is not None:
            return [observation for observation in seen if observation.traversal_id == side.traversal.id]
        if state is None:
            return []
        low_ns = self.times.before.at_ns + 1 if side is self.times.after else state.first_seen_ns
        return [
            observation
            for observation in seen
            if max(low_ns, state.first_seen_ns) <= observation.stamp_ns <= side.at_ns
        ]

    def _evidence(self, instance: StoredInstance, seen: Sequence[Said], traversal_ids: frozenset[int]) -> EvidenceView:
        visits = [visit for visit in instance.visits if visit.traversal_id in traversal_ids]
        return evidence_of(seen, visits, self.reader.traversals)

    def _candidates(self, instance: StoredInstance, edges: Iterable[TemporalEdge]) -> tuple[IdentityCandidateView, ...]:
        found = {}
        for edge in edges:
            if edge.kind == "candidate":
                ends = {self.reader.survivors[edge.from_number], self.reader.survivors[edge.to_number]}
                for other in ends - {instance.number}:
                    found[self.reader.text_ids[other]] = round(edge.probability, 4)
        return tuple(IdentityCandidateView(text_id, probability) for text_id, probability in sorted(found.items()))


def _with_relabelling(
    classification: ChangeClassification,
    names: tuple[LabelConsensus | None, LabelConsensus | None],
    seen: Sequence[Said],
    ends: ComparedTimes,
) -> ChangeClassification:
    """Only where each end by itself is sure of its label, and they differ; a thing that moved, too, has moved."""
    old, new = names
    if old is None or new is None or old.label == new.label or old.traversal_id == new.traversal_id:
        return classification
    called = f"called {old.label} in {ends.before.text} and {new.label} in {ends.after.text}"
    if classification.kind != "unchanged":
        return (
            replace(classification, reason=f"{classification.reason}; {called}")
            if classification.kind == "moved"
            else classification
        )
    own = group_by_traversal(seen)
    bounds = own[old.traversal_id][-1].stamp_ns, own[new.traversal_id][0].stamp_ns
    return replace(
        classification,
        kind="relabelled",
        reason=called,
        confidence=min(old.share, new.share),
        not_before_ns=bounds[0],
        not_after_ns=bounds[1],
    )


def _best_crop(side: Sequence[Said]) -> int | None:
    """The best crop of one side; one is only kept where it is clearly better than those before."""
    return next((observation.id for observation in reversed(side) if observation.cropped), None)


def _instances_to_compare(reader: MapReader, ends: ComparedTimes) -> list[int]:
    """The instances that either end may speak of: those that it saw, and those that came, went or stood in between."""
    traversals = [side.traversal.id for side in (ends.before, ends.after) if side.traversal is not None]
    seen = reader.supported_in(traversals) if traversals else ()
    standing = reader.standing_at(ends.before.at_ns) if ends.before.traversal is None else ()
    changed = reader.changed_within(ends.before.at_ns, ends.after.at_ns)
    return sorted({*seen, *standing, *changed})


def _choose_sides(reader: MapReader, first: str | None, second: str | None) -> tuple[TimePoint, TimePoint]:
    traversals, clock = reader.traversals, clock_of(reader)
    a = None if first is None else parse_time_point(first, reader, clock)
    b = None if second is None else parse_time_point(second, reader, clock)
    if a is not None and b is None and traversals and a.traversal is None:
        b = traversal_end(traversals[-1])
    if a is None or b is None:
        if len(traversals) < 2:
            known = f"only {traversals[0].name!r}" if traversals else "none"
            raise QueryError(
                f"a diff needs two traversals, and the map holds {known}",
                where=reader.where,
                cure="build another recording of the same place into it, or give two times",
            )
        if a is None:
            a, b = map(traversal_end, traversals[-2:])
        else:
            b = traversal_end(_newest_except(traversals, a.traversal))
    if a.at_ns == b.at_ns:
        raise QueryError(f"{a.text!r} differs in nothing from itself", cure="give two traversals, or two times")
    return a, b


def _newest_except(traversals: Sequence[StoredTraversal], one: StoredTraversal | None) -> StoredTraversal:
    return next(traversal for traversal in reversed(traversals) if one is None or traversal.id != one.id)


def _side_view(side: TimePoint) -> SideView:
    return SideView(
        side.text, side.at_ns, side.since_ns, None if side.traversal is None else traversal_view(side.traversal)
    )


def _id_list(ids: Sequence[str]) -> str:
    more = f" and {len(ids) - MAX_NAMED_IDS} more" if len(ids) > MAX_NAMED_IDS else ""
    return ", ".join(ids[:MAX_NAMED_IDS]) + more
