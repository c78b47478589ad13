"""What changed between two traversals, and what nobody can say.

Only a contradiction makes a disappearance, and only a place seen empty before makes an appearance: what was merely not
seen is "not observed again" or "first observed".
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from supermap_cli.errors import QueryError
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ObservationRef, StoredInstance, StoredTraversal
from supermap_cli.query.instants import find_traversal
from supermap_cli.query.views import (
    EvidenceView,
    TraversalView,
    Vector,
    evidence_view,
    traversal_view,
    vector,
)
from supermap_cli.types.labels import ANIMATE
from supermap_cli.types.memory import StateRecord, TemporalEdge

ChangeKind = Literal[
    "appeared", "disappeared", "moved", "relabelled", "unchanged", "not observed again", "first observed"
]
KINDS: tuple[ChangeKind, ...] = (
    "appeared",
    "disappeared",
    "moved",
    "relabelled",
    "unchanged",
    "not observed again",
    "first observed",
)
"""In the order of reports: changes, what stayed, and what cannot be told."""

MOVE_M = 0.1
"""Two states whose centroids lie closer than this are one place."""

RELABEL_SHARE = 0.6
RELABEL_OBSERVATIONS = 3
"""A label changed only where each traversal by itself was that sure, over that many observations."""


@dataclass(frozen=True)
class CandidateView:
    """An instance that may be the same thing, as far as the evidence goes."""

    id: str
    probability: float


@dataclass(frozen=True)
class Change:
    """What became of one instance from traversal `before` to traversal `after`.

    It happened within [not_before_ns, not_after_ns] (both `None` where nothing happened). `reason` says in words what
    the verdict rests on.
    """

    kind: ChangeKind
    id: str
    label: str
    reason: str
    confidence: float
    not_before_ns: int | None
    not_after_ns: int | None
    position_before: Vector | None
    position_after: Vector | None
    distance_m: float | None
    label_before: str | None
    label_after: str | None
    may_be: tuple[CandidateView, ...]
    evidence_before: EvidenceView
    evidence_after: EvidenceView


@dataclass(frozen=True)
class Diff:
    """All changes between two traversals, in the order of `KINDS` and of instances."""

    before: TraversalView
    after: TraversalView
    counts: dict[str, int]
    changes: tuple[Change, ...]


@dataclass(frozen=True)
class Verdict:
    """What happened to an instance, before evidence is gathered."""

    kind: ChangeKind
    reason: str
    confidence: float
    not_before_ns: int | None = None
    not_after_ns: int | None = None
    before: StateRecord | None = None
    after: StateRecord | None = None
    labels: tuple[str, str] | None = None


def diff(reader: MapReader, first: str | None = None, second: str | None = None) -> Diff:
    """Compare two traversals by name or number, in the order of time; without names the two newest.

    With one name: the newest traversal against it. Who walked by has not changed the place. Raises `QueryError` where
    there are not two, or for unknown names.
    """
    before, after = _choose(reader, first, second)
    comparison = Comparison(reader, before, after)
    seen = reader.instances_of(reader.supported_in([before.id, after.id]))
    things = (each for each in seen if each.presence != "doubted" and each.label not in ANIMATE)
    found = [change for each in things if (change := comparison.change(each)) is not None]
    found.sort(key=lambda change: KINDS.index(change.kind))
    tally = Counter(change.kind for change in found)
    return Diff(traversal_view(before), traversal_view(after), {kind: tally[kind] for kind in KINDS}, tuple(found))


class Comparison:
    """Two traversals of one map, the earlier first."""

    def __init__(self, reader: MapReader, before: StoredTraversal, after: StoredTraversal) -> None:
        self.reader = reader
        self.before = before
        self.after = after

    def change(self, instance: StoredInstance) -> Change | None:
        """What became of an instance; `None` if neither traversal saw it."""
        verdict = self._verdict(instance)
        if verdict is None:
            return None
        before, after = verdict.before, verdict.after
        distance_m = None if before is None or after is None else round(_distance_m(before, after), 4)
        labels = verdict.labels or (None if before is None else before.label, None if after is None else after.label)
        return Change(
            kind=verdict.kind,
            id=instance.id,
            label=instance.label,
            reason=verdict.reason,
            confidence=round(verdict.confidence, 4),
            not_before_ns=verdict.not_before_ns,
            not_after_ns=verdict.not_after_ns,
            position_before=None if before is None else vector(before.centroid_map),
            position_after=None if after is None else vector(after.centroid_map),
            distance_m=distance_m,
            label_before=labels[0],
            label_after=labels[1],
            may_be=self._candidates(instance),
            evidence_before=self._evidence(instance, self.before),
            evidence_after=self._evidence(instance, self.after),
        )

    def _verdict(self, instance: StoredInstance) -> Verdict | None:
        before, after = self._state_in(instance, self.before), self._state_in(instance, self.after)
        if before is not None and after is not None:
            return self._seen_in_both(instance, before, after)
        if before is not None:
            return self._seen_before_only(instance, before)
        if after is not None:
            return self._seen_after_only(instance, after)
        return None

    def _seen_in_both(self, instance: StoredInstance, before: StateRecord, after: StateRecord) -> Verdict:
        if _gone_by(after, self.after.end_ns) and not self._comes_back(instance, after):
            return self._disappeared(instance, before, after)
        if before.index != after.index:
            edge = self._edge(instance, "moved", after)
            distance_m = _distance_m(before, after)
            bounds = (before.last_seen_ns, after.first_seen_ns)
            if edge is not None or distance_m >= MOVE_M:
                confidence = edge.probability if edge is not None else min(before.confidence, after.confidence)
                return Verdict("moved", f"seen {distance_m:.2f} m away", confidence, *bounds, before, after)
            if before.gone_ns is not None and before.gone_ns <= self.before.end_ns:
                reason = f"had gone from its place in {self.before.name}, stands there again"
                return Verdict("appeared", reason, after.confidence, before.gone_ns, after.first_seen_ns, before, after)
        if (relabelled := self._relabelled(instance, before, after)) is not None:
            return relabelled
        reason = "seen in its place in both" + (", gone in between" if before.gone_ns is not None else "")
        return Verdict("unchanged", reason, after.confidence, None, None, before, after)

    def _seen_before_only(self, instance: StoredInstance, before: StateRecord) -> Verdict:
        if _gone_by(before, self.after.end_ns):
            return self._disappeared(instance, before, before)
        visit = instance.visit(self.after.id)
        if visit.in_view == 0:
            reason = f"its place was never in view in {self.after.name}"
        elif visit.contradicted == 0:
            reason = f"its place was in view in {visit.in_view} keyframes and never seen empty"
        else:
            reason = (
                f"its place was in view in {visit.in_view} keyframes and looked empty in {visit.contradicted}, "
                "too few to be sure"
            )
        return Verdict("not observed again", reason, before.confidence, None, None, before, None)

    def _seen_after_only(self, instance: StoredInstance, after: StateRecord) -> Verdict:
        earlier = [state for state in instance.states if state.index < after.index]
        if _gone_by(after, self.after.end_ns) and not self._comes_back(instance, after):
            return self._disappeared(instance, None, after)
        if earlier and _distance_m(earlier[-1], after) >= MOVE_M:
            reason = f"seen {_distance_m(earlier[-1], after):.2f} m from where it stood before {self.before.name}"
            edge = self._edge(instance, "moved", after)
            confidence = edge.probability if edge is not None else after.confidence
            return Verdict(
                "moved", reason, confidence, earlier[-1].last_seen_ns, after.first_seen_ns, earlier[-1], after
            )
        if after.empty_before_ns is not None and after.empty_before_ns >= self.before.start_ns:
            edge = self._edge(instance, "appeared", after)
            confidence = edge.probability if edge is not None else after.confidence
            return Verdict(
                "appeared",
                "its place had been seen empty",
                confidence,
                after.empty_before_ns,
                after.first_seen_ns,
                None,
                after,
            )
        split = self._edge(instance, "split", after)
        reason = (
            f"was one with {self.reader.text_ids[split.from_number]} until the two were told apart"
            if split is not None and split.to_number == instance.number
            else f"known from before {self.before.name}, which did not see it"
            if earlier or after.first_seen_ns < self.before.start_ns
            else f"its place had not been looked at in {self.before.name}"
            if instance.visit(self.before.id).in_view == 0
            else f"its place was in view in {self.before.name}, but never seen empty"
        )
        return Verdict("first observed", reason, after.confidence, None, None, None, after)

    def _disappeared(self, instance: StoredInstance, before: StateRecord | None, last: StateRecord) -> Verdict:
        edge = self._edge(instance, "disappeared", last)
        confidence = edge.probability if edge is not None else last.confidence
        reason = "its place was seen empty"
        return Verdict("disappeared", reason, confidence, last.last_seen_ns, last.gone_ns, before, None)

    def _relabelled(self, instance: StoredInstance, before: StateRecord, after: StateRecord) -> Verdict | None:
        """Only where each traversal by itself is sure of its label, and they differ."""
        seen = self.reader.observations(instance)
        old = _sure_label([each for each in seen if each.traversal_id == self.before.id])
        new = _sure_label([each for each in seen if each.traversal_id == self.after.id])
        if old is None or new is None or old[0] == new[0]:
            return None
        reason = f"called {old[0]} in {self.before.name} and {new[0]} in {self.after.name}"
        bounds = (min(before.last_seen_ns, self.before.end_ns), max(after.first_seen_ns, self.after.start_ns))
        return Verdict("relabelled", reason, min(old[1], new[1]), *bounds, before, after, (old[0], new[0]))

    def _state_in(self, instance: StoredInstance, traversal: StoredTraversal) -> StateRecord | None:
        """The last state that a traversal supported."""
        if instance.visit(traversal.id).supported == 0:
            return None
        supported = [
            state
            for state in instance.states
            if state.first_seen_ns <= traversal.end_ns and state.last_seen_ns >= traversal.start_ns
        ]
        return supported[-1] if supported else None

    def _comes_back(self, instance: StoredInstance, state: StateRecord) -> bool:
        """Whether a later state was seen before the later traversal's end."""
        return any(other.index > state.index and other.first_seen_ns <= self.after.end_ns for other in instance.states)

    def _edge(self, instance: StoredInstance, kind: str, state: StateRecord) -> TemporalEdge | None:
        """The temporal edge of a kind that touches a state."""
        touched = (instance.number, state.index)
        for edge in self.reader.temporal_edges(instance.numbers):
            if edge.kind == kind and touched in {(edge.from_number, edge.from_state), (edge.to_number, edge.to_state)}:
                return edge
        return None

    def _candidates(self, instance: StoredInstance) -> tuple[CandidateView, ...]:
        found = {}
        for edge in self.reader.temporal_edges(instance.numbers):
            if edge.kind == "candidate":
                ends = {self.reader.survivors[edge.from_number], self.reader.survivors[edge.to_number]}
                for other in ends - {instance.number}:
                    found[self.reader.text_ids[other]] = round(edge.probability, 4)
        return tuple(CandidateView(text_id, probability) for text_id, probability in sorted(found.items()))

    def _evidence(self, instance: StoredInstance, traversal: StoredTraversal) -> EvidenceView:
        return evidence_view(self.reader, instance, ((traversal.start_ns, traversal.end_ns),), {traversal.id})


def _choose(reader: MapReader, first: str | None, second: str | None) -> tuple[StoredTraversal, StoredTraversal]:
    traversals = reader.traversals
    if len(traversals) < 2:
        known = f"only {traversals[0].name!r}" if traversals else "none"
        raise QueryError(
            f"a diff needs two traversals, and the map holds {known}",
            where=reader.where,
            cure="build another recording of the same place into it",
        )
    if first is None:
        chosen = traversals[-2:]
    else:
        a = find_traversal(traversals, first)
        b = find_traversal(traversals, second) if second is not None else _newest_but(traversals, a)
        chosen = (a, b)
    if chosen[0].id == chosen[1].id:
        raise QueryError(f"traversal {chosen[0].name!r} differs in nothing from itself", cure="name two traversals")
    earlier, later = sorted(chosen, key=lambda each: (each.start_ns, each.number))
    return earlier, later


def _newest_but(traversals: Sequence[StoredTraversal], one: StoredTraversal) -> StoredTraversal:
    return next(each for each in reversed(traversals) if each.id != one.id)


def _gone_by(state: StateRecord, end_ns: int) -> bool:
    return state.gone_ns is not None and state.gone_ns <= end_ns


def _distance_m(first: StateRecord, second: StateRecord) -> float:
    return float(np.linalg.norm(first.centroid_map - second.centroid_map))


def _sure_label(seen: list[ObservationRef]) -> tuple[str, float] | None:
    """The label that one traversal's observations agree on, weighed by score, and its share."""
    weights: Counter[str] = Counter()
    for each in seen:
        weights[each.label] += each.score  # type: ignore[assignment]  # Counter's stubs know integers only
    if len(seen) < RELABEL_OBSERVATIONS:
        return None
    label, weight = weights.most_common(1)[0]
    share = weight / sum(weights.values())
    return (label, share) if share >= RELABEL_SHARE else None
