"""What changed between two traversals or times, and what nobody can say (the judgement itself: `verdicts`)."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from supermap_cli.errors import QueryError
from supermap_cli.memory.labelled_observations import LabelledObservations
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import LabelledObservation, StoredInstance, StoredTraversal
from supermap_cli.query.clock import clock_of
from supermap_cli.query.instants import Instant, instant_of, of_traversal
from supermap_cli.query.keeping import given_up_notes
from supermap_cli.query.naming import Name, by_traversal, name_by, sure_name
from supermap_cli.query.verdicts import KINDS, Case, ChangeKind, Ends, Verdict, distance, ends_of
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
from supermap_cli.types.labels import ANIMATE
from supermap_cli.types.memory import StateRecord, TemporalEdge

HAPPENED: frozenset[ChangeKind] = frozenset({"appeared", "disappeared", "moved", "relabelled"})
NAMED = 12
"""How many ids a note names."""


@dataclass(frozen=True)
class CandidateView:
    """An instance that may be the same thing, as far as the evidence goes."""

    id: str
    probability: float


@dataclass(frozen=True)
class EndView:
    """One side of a diff: `name` is a traversal's, or a time in words; what is said holds at `at_ns`."""

    name: str
    at_ns: int
    since_ns: int
    traversal: TraversalView | None


@dataclass(frozen=True)
class Change:
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
    may_be: tuple[CandidateView, ...]
    evidence_before: EvidenceView
    evidence_after: EvidenceView
    crop_before: int | None
    crop_after: int | None


@dataclass(frozen=True)
class Diff:
    """All changes between two sides, in the order of `KINDS` and of instances."""

    before: EndView
    after: EndView
    counts: dict[str, int]
    changes: tuple[Change, ...]
    notes: tuple[str, ...]


def diff(reader: MapReader, first: str | None = None, second: str | None = None) -> Diff:
    """Compare two traversals or times, in the order of time; without names the two newest traversals.

    With one: the newest traversal against it. Who walked by has not changed the place. Raises `QueryError` where there
    are not two, or for what is neither a time nor a traversal.
    """
    given = _choose(reader, first, second)
    before, after = sorted(given, key=lambda each: each.at_ns)
    ends = ends_of(before, after, reader.traversals)
    comparison = Comparison(reader, ends)
    found = [change for part in batches(_spoken_of(reader, ends)) for change in comparison.changes(part)]
    found.sort(key=lambda change: KINDS.index(change.kind))
    tally = Counter(change.kind for change in found)
    notes = [end.note for end in given if end.note is not None]
    notes += ["the two were put in the order of time"] if given[0] is not before else []
    named = [end.traversal for end in (before, after) if end.traversal is not None] or reader.traversals
    notes += given_up_notes(named, clock_of(reader))
    return Diff(
        before=_end_view(before),
        after=_end_view(after),
        counts={kind: tally[kind] for kind in KINDS},
        changes=tuple(found),
        notes=(*notes, *comparison.asides()),
    )


class Comparison:
    """Two ends in one map, and what became of the things that they may speak of, read a part at a time.

    Of two traversals only their own observations matter; of a plain time all that came before it may.
    """

    def __init__(self, reader: MapReader, ends: Ends) -> None:
        self.reader = reader
        self.ends = ends
        heard = [end.traversal.id for end in (ends.before, ends.after) if end.traversal is not None]
        self._hearing = LabelledObservations(reader, heard if len(heard) == 2 else None)
        self._aside: dict[str, list[str]] = defaultdict(list)

    def changes(self, numbers: Sequence[int]) -> Iterator[Change]:
        """What became of each of some instances, if either end speaks of it; who walked by is left out."""
        looked = self.ends.looked_before | self.ends.looked_after
        found = self.reader.instances_of(numbers, traversal_ids=looked)
        things = [each for each in found if each.presence != "doubted" and each.label not in ANIMATE]
        edges = self._edges(things)
        cases = [Case(each, self.ends, edges[each.number], self.reader.text_ids) for each in things]
        verdicts = [(case, verdict) for case in cases if (verdict := self._verdict(case)) is not None]
        said = self._hearing.of([case.instance for case, _ in verdicts])
        for case, verdict in verdicts:
            yield self._change(case, verdict, said.get(case.instance.number, []))

    def _verdict(self, case: Case) -> Verdict | None:
        """The judgement of one case; where there is none, what happened all the same is kept for the notes."""
        verdict = case.verdict()
        if verdict is None and (aside := case.aside()) is not None:
            self._aside[aside].append(case.instance.id)
        return verdict

    def _change(self, case: Case, verdict: Verdict, seen: Sequence[LabelledObservation]) -> Change:
        """A verdict with its evidence."""
        instance = case.instance
        names = self._names(seen)
        verdict = _relabelled(verdict, names, seen, self.ends)
        before, after = verdict.before, verdict.after
        sides = self._side(self.ends.before, seen, before), self._side(self.ends.after, seen, after)
        labels = [
            None if state is None else state.label if name is None else name.label
            for state, name in zip((before, after), names, strict=True)
        ]
        low_ns = verdict.not_before_ns
        return Change(
            kind=verdict.kind,
            id=instance.id,
            label=instance.label,
            reason=verdict.reason,
            confidence=round(verdict.confidence, 4),
            not_before_ns=low_ns,
            not_after_ns=verdict.not_after_ns,
            perhaps_before=verdict.kind in HAPPENED and low_ns is not None and low_ns < self.ends.before.since_ns,
            position_before=None if before is None else vector(before.centroid_map),
            position_after=None if after is None else vector(after.centroid_map),
            distance_m=None if before is None or after is None else round(distance(before, after), 4),
            label_before=labels[0],
            label_after=labels[1],
            interval_before=None if before is None else interval_view(before),
            interval_after=None if after is None else interval_view(after),
            may_be=self._candidates(instance, case.edges),
            evidence_before=self._evidence(instance, sides[0], self.ends.looked_before),
            evidence_after=self._evidence(instance, sides[1], self.ends.looked_after),
            crop_before=_best_crop(sides[0]),
            crop_after=_best_crop(sides[1]),
        )

    def asides(self) -> list[str]:
        """What is no difference between the two ends, and yet happened."""
        before, after = self.ends.before.text, self.ends.after.text
        words = {
            "came and went": f"came and went between {before} and {after}",
            "left": f"seen by {before}, and gone again before its end",
        }
        return [f"{words[aside]}: {_named(ids)}" for aside, ids in sorted(self._aside.items())]

    def _edges(self, things: Sequence[StoredInstance]) -> dict[int, list[TemporalEdge]]:
        """The temporal edges that touch some instances, by instance; the names of all their ends are known then."""
        touching = self.reader.temporal_edges({part for each in things for part in each.numbers})
        ends = {number for edge in touching for number in (edge.from_number, edge.to_number)}
        self.reader.text_ids.of(set(self.reader.survivors.of(ends).values()) | ends)
        edges: dict[int, list[TemporalEdge]] = defaultdict(list)
        for edge in touching:
            for number in {edge.from_number, edge.to_number}:
                edges[number].append(edge)
        return {each.number: [edge for part in each.numbers for edge in edges[part]] for each in things}

    def _names(self, seen: Sequence[LabelledObservation]) -> tuple[Name | None, Name | None]:
        """What it was surely called at either end."""
        own = by_traversal(seen)

        def name(end: Instant) -> Name | None:
            return name_by(seen, end.at_ns) if end.traversal is None else sure_name(own.get(end.traversal.id, []))

        return name(self.ends.before), name(self.ends.after)

    def _side(
        self, end: Instant, seen: Sequence[LabelledObservation], state: StateRecord | None
    ) -> Sequence[LabelledObservation]:
        """The observations that speak for an end: a traversal's own; of a plain time those of the state until then, or
        for the later end those since the earlier one.
        """
        if end.traversal is not None:
            return [each for each in seen if each.traversal_id == end.traversal.id]
        if state is None:
            return []
        low_ns = self.ends.before.at_ns + 1 if end is self.ends.after else state.first_seen_ns
        return [each for each in seen if max(low_ns, state.first_seen_ns) <= each.stamp_ns <= end.at_ns]

    def _evidence(
        self, instance: StoredInstance, seen: Sequence[LabelledObservation], traversal_ids: frozenset[int]
    ) -> EvidenceView:
        visits = [each for each in instance.visits if each.traversal_id in traversal_ids]
        return evidence_of(seen, visits, self.reader.traversals)

    def _candidates(self, instance: StoredInstance, edges: Iterable[TemporalEdge]) -> tuple[CandidateView, ...]:
        found = {}
        for edge in edges:
            if edge.kind == "candidate":
                ends = {self.reader.survivors[edge.from_number], self.reader.survivors[edge.to_number]}
                for other in ends - {instance.number}:
                    found[self.reader.text_ids[other]] = round(edge.probability, 4)
        return tuple(CandidateView(text_id, probability) for text_id, probability in sorted(found.items()))


def _relabelled(
    verdict: Verdict, names: tuple[Name | None, Name | None], seen: Sequence[LabelledObservation], ends: Ends
) -> Verdict:
    """Only where each end by itself is sure of its label, and they differ; a thing that moved, too, has moved."""
    old, new = names
    if old is None or new is None or old.label == new.label or old.traversal_id == new.traversal_id:
        return verdict
    called = f"called {old.label} in {ends.before.text} and {new.label} in {ends.after.text}"
    if verdict.kind != "unchanged":
        return replace(verdict, reason=f"{verdict.reason}; {called}") if verdict.kind == "moved" else verdict
    own = by_traversal(seen)
    bounds = own[old.traversal_id][-1].stamp_ns, own[new.traversal_id][0].stamp_ns
    return replace(
        verdict,
        kind="relabelled",
        reason=called,
        confidence=min(old.share, new.share),
        not_before_ns=bounds[0],
        not_after_ns=bounds[1],
    )


def _best_crop(side: Sequence[LabelledObservation]) -> int | None:
    """The best crop of one side; one is only kept where it is clearly better than those before."""
    return next((each.id for each in reversed(side) if each.has_crop), None)


def _spoken_of(reader: MapReader, ends: Ends) -> list[int]:
    """The instances that either end may speak of: those that it saw, and those that came, went or stood in between."""
    traversals = [end.traversal.id for end in (ends.before, ends.after) if end.traversal is not None]
    seen = reader.supported_in(traversals) if traversals else ()
    standing = reader.instances_placed_at(ends.before.at_ns) if ends.before.traversal is None else ()
    changed = reader.changed_within(ends.before.at_ns, ends.after.at_ns)
    return sorted({*seen, *standing, *changed})


def _choose(reader: MapReader, first: str | None, second: str | None) -> tuple[Instant, Instant]:
    traversals, clock = reader.traversals, clock_of(reader)
    a = None if first is None else instant_of(first, reader, clock)
    b = None if second is None else instant_of(second, reader, clock)
    if a is not None and b is None and traversals and a.traversal is None:
        b = of_traversal(traversals[-1])
    if a is None or b is None:
        if len(traversals) < 2:
            known = f"only {traversals[0].name!r}" if traversals else "none"
            raise QueryError(
                f"a diff needs two traversals, and the map holds {known}",
                where=reader.where,
                cure="build another recording of the same place into it, or give two times",
            )
        if a is None:
            a, b = map(of_traversal, traversals[-2:])
        else:
            b = of_traversal(_newest_but(traversals, a.traversal))
    if a.at_ns == b.at_ns:
        raise QueryError(f"{a.text!r} differs in nothing from itself", cure="give two traversals, or two times")
    return a, b


def _newest_but(traversals: Sequence[StoredTraversal], one: StoredTraversal | None) -> StoredTraversal:
    return next(each for each in reversed(traversals) if one is None or each.id != one.id)


def _end_view(end: Instant) -> EndView:
    return EndView(end.text, end.at_ns, end.since_ns, None if end.traversal is None else traversal_view(end.traversal))


def _named(ids: Sequence[str]) -> str:
    more = f" and {len(ids) - NAMED} more" if len(ids) > NAMED else ""
    return ", ".join(ids[:NAMED]) + more
