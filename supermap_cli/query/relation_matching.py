"""Matches candidates and references of a relation, pair by pair: by a stored edge, else by their boxes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

from supermap_cli.memory.edge_query import EdgeEnd, EdgeQuery
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.candidates import (
    BATCH_SIZE,
    CandidateList,
    CandidateSource,
    InstanceCandidate,
    LabelCandidates,
    MatchCount,
)
from supermap_cli.query.map_relations import MapRelations
from supermap_cli.query.relations import RelationName, StoredForm, box_distance_m
from supermap_cli.query.time_selector import TimeSelector, TimeSpan
from supermap_cli.query.views import RelationView
from supermap_cli.types.memory import SpatialEdge, StateRecord
from supermap_cli.types.relations import Pair

Basis = Literal["stored", "boxes"]
BASES: tuple[Basis, ...] = ("stored", "boxes")
DIRECT_READ_LIMIT = 100
"""Up to this many instances are read directly, which is faster than counting edges in the database."""


class RelatedPairs:
    """Pairs of instances to check, with the stored edges between them in the order of writing."""

    def __init__(self) -> None:
        self.partners: dict[int, set[int]] = defaultdict(set)
        self._edges: dict[tuple[int, str, int], list[SpatialEdge]] = defaultdict(list)

    def add_pair(self, one: int, other: int) -> None:
        """Add a pair, in both directions."""
        self.partners[one].add(other)
        self.partners[other].add(one)

    def add_edge(self, edge: SpatialEdge) -> None:
        """Add an edge, and its two ends as a pair."""
        self._edges[edge.subject, edge.relation, edge.object].append(edge)
        self.add_pair(edge.subject, edge.object)

    def edges(self, subject: int, relation: str, obj: int) -> list[SpatialEdge]:
        """The edges from one instance to another."""
        return self._edges.get((subject, relation, obj), [])


@dataclass(frozen=True)
class RelationMatcher:
    """One relation of a question, for one time selector. Matchers of one question share their `relations`."""

    reader: MapReader
    selector: TimeSelector
    name: RelationName
    references: CandidateSource
    relations: MapRelations | None = None

    @cached_property
    def _relations(self) -> MapRelations:
        return self.relations or MapRelations(self.reader)

    @cached_property
    def _forms(self) -> tuple[StoredForm, ...]:
        return self._relations.stored_forms(self.name)

    def matches(self, candidates: CandidateSource) -> Iterator[tuple[Basis, InstanceCandidate]]:
        """All matching candidates, some more than once, with some of their relations. The smaller of the two sets is
        iterated, and only its neighbours in the other one are read.
        """
        from_references = self.references.size() < candidates.size()
        for basis in self._bases(candidates):
            any_match = False
            outer, inner = (self.references, candidates) if from_references else (candidates, self.references)
            for numbers in outer.numbers():
                related_pairs = self._related_pairs(numbers, basis, inner, turned=from_references)
                batch = _in_order_of(
                    numbers, outer.with_numbers([number for number in numbers if number in related_pairs.partners])
                )
                partners = inner.with_numbers(
                    {partner for candidate in batch for partner in related_pairs.partners[candidate.instance.number]}
                )
                pair = (partners, batch) if from_references else (batch, partners)
                for candidate in self._with_relations(*pair, related_pairs, basis):
                    any_match = True
                    yield basis, candidate
            if any_match:
                return

    def _bases(self, candidates: CandidateSource) -> tuple[Basis, ...]:
        """What decides: stored edges alone where the scene graph keeps the relation now, which judged all that stands
        there by the same geometry; else the boxes of each pair without an edge, too.
        """
        if not self._edges_decide:
            return BASES[1:]
        return BASES[:1] if self._any_stored_edge(candidates) else ()

    @cached_property
    def _edges_decide(self) -> bool:
        return self.selector.kind == "now" and bool(self._forms) and self._relations.graph_keeps(self.name)

    def match_count(self, candidates: CandidateSource) -> MatchCount | None:
        """The number of matches where stored edges decide, if the database can count them: for one relation. Only
        instances for which an edge alone does not decide are read. `None` also if there is no match by stored edges.
        """
        counter = self._edge_counter(candidates)
        if counter is None or not self._edges_decide:
            return None
        forms = self._forms
        merged = counter.merged({form.relation for form in forms})
        matching, to_check = set[int](), merged
        for form in forms:
            numbers = counter.numbers(form.relation, turned=form.turned)
            if form.checked:
                to_check = to_check | numbers
            else:
                matching |= numbers - merged
        for batch in batches(sorted(to_check - matching), BATCH_SIZE):
            matching.update(
                candidate.instance.number
                for candidate in self.with_all_relations(candidates.with_numbers(batch), "stored")
            )
        return MatchCount(len(matching), len(matching)) if matching else None

    def _any_stored_edge(self, candidates: CandidateSource) -> bool:
        """Whether any stored edge may match; if not, none needs to be read."""
        counter = self._edge_counter(candidates)
        forms = self._forms
        if counter is None:
            return bool(forms)
        return any(counter.any(form.relation, turned=form.turned) for form in forms) or bool(
            counter.merged({form.relation for form in forms})
        )

    def _edge_counter(self, candidates: CandidateSource) -> EdgeQuery | None:
        """The counter of stored edges, if both sets are present instances by label, and both are large."""
        if (
            self.selector.kind != "now"
            or not isinstance(candidates, LabelCandidates)
            or not isinstance(self.references, LabelCandidates)
        ):
            return None
        if min(candidates.size(), self.references.size()) <= DIRECT_READ_LIMIT:
            return None
        one, other = (EdgeEnd(source.labels, source.number) for source in (candidates, self.references))
        return EdgeQuery(self.reader, one, other, int(self.selector.low_ns))

    def with_all_relations(self, candidates: list[InstanceCandidate], basis: Basis) -> list[InstanceCandidate]:
        """The matching candidates, with all their relations."""
        numbers = {candidate.instance.number for candidate in candidates}
        related_pairs = self._related_pairs(numbers, basis, self.references)
        partners = {partner for number in numbers for partner in related_pairs.partners.get(number, ())}
        return self._with_relations(candidates, self.references.with_numbers(partners), related_pairs, basis)

    def restrict(self, candidates: CandidateSource) -> CandidateList:
        """All matching candidates as a list."""
        by_key = {candidate.key: replace(candidate, relations=()) for _, candidate in self.matches(candidates)}
        return CandidateList([candidate for _, candidate in sorted(by_key.items())])

    def _related_pairs(
        self, numbers: Collection[int], basis: Basis, others: CandidateSource, *, turned: bool = False
    ) -> RelatedPairs:
        """The pairs of some candidates and the references (`turned`: some references and the candidates)."""
        related_pairs = RelatedPairs()
        if self._forms:
            for edge in self.reader.edges_of(numbers, {form.relation for form in self._forms}):
                related_pairs.add_edge(edge)
        if basis == "boxes":
            labels = others.labels if isinstance(others, LabelCandidates) else None
            for pair in self.reader.search.near(
                numbers, self._relations.registry.reach(self.name), labels, turned=turned
            ):
                related_pairs.add_pair(*pair)
        return related_pairs

    def _with_relations(
        self,
        candidates: list[InstanceCandidate],
        references: list[InstanceCandidate],
        related_pairs: RelatedPairs,
        basis: Basis,
    ) -> list[InstanceCandidate]:
        by_number: dict[int, list[InstanceCandidate]] = defaultdict(list)
        for reference in sorted(references, key=lambda reference: reference.key):
            by_number[reference.instance.number].append(reference)
        matched = []
        for candidate in candidates:
            partner_numbers = sorted(
                related_pairs.partners.get(candidate.instance.number, set()) - {candidate.instance.number}
            )
            pairs = ((candidate, reference) for number in partner_numbers for reference in by_number.get(number, ()))
            views = [view for pair in pairs if (view := self._relation_view(*pair, related_pairs, basis)) is not None]
            if views:
                matched.append(replace(candidate, relations=tuple(views)))
        return matched

    def _relation_view(
        self, candidate: InstanceCandidate, reference: InstanceCandidate, related_pairs: RelatedPairs, basis: Basis
    ) -> RelationView | None:
        """The relation of two states, if they hold at the same time within the selected time."""
        span = self.selector.span_of((candidate.state, candidate.instance), (reference.state, reference.instance))
        if span is None:
            return None
        stored = self._by_edges(candidate, reference, span, related_pairs)
        if stored is not None or basis == "stored":
            return stored
        return self._by_boxes(candidate, reference, span)

    def _by_edges(
        self, candidate: InstanceCandidate, reference: InstanceCandidate, span: TimeSpan, related_pairs: RelatedPairs
    ) -> RelationView | None:
        for form in self._forms:
            subject, obj = (reference, candidate) if form.turned else (candidate, reference)
            for edge in related_pairs.edges(subject.instance.number, form.relation, obj.instance.number):
                if not span.overlaps(edge.since_ns, edge.until_ns):
                    continue
                if form.checked and not self._holds_by_shape(candidate, reference):
                    continue
                return RelationView(
                    name=self.name,
                    subject=candidate.instance.id,
                    object=reference.instance.id,
                    basis="stored",
                    stored_as=f"{edge.relation}({subject.instance.id}, {obj.instance.id})",
                    since_ns=edge.since_ns,
                    until_ns=edge.until_ns,
                    distance_m=_distance_m(candidate.state, reference.state),
                    confidence=round(edge.confidence, 4),
                )
        return None

    def _holds_by_shape(self, candidate: InstanceCandidate, reference: InstanceCandidate) -> bool:
        """Whether a pair chosen by a stored edge is in this kind of its relation; its edge says that no wall is between
        them.
        """
        relations = self._relations
        pair = Pair(
            relations.thing(candidate.instance, candidate.state),
            relations.thing(reference.instance, reference.state),
            relations.registry.parameters,
        )
        return relations.registry[self.name].holds(pair, 1.0) > 0

    def _by_boxes(
        self, candidate: InstanceCandidate, reference: InstanceCandidate, span: TimeSpan
    ) -> RelationView | None:
        confidence = self._relations.measure(
            self.name, (candidate.instance, candidate.state), (reference.instance, reference.state)
        )
        if confidence <= 0:
            return None
        return RelationView(
            name=self.name,
            subject=candidate.instance.id,
            object=reference.instance.id,
            basis="boxes",
            stored_as=None,
            since_ns=max(candidate.state.first_seen_ns, reference.state.first_seen_ns),
            until_ns=None if span.high_ns == float("inf") else int(span.high_ns),
            distance_m=_distance_m(candidate.state, reference.state),
            confidence=round(confidence * candidate.state.confidence * reference.state.confidence, 4),
        )


def _distance_m(first: StateRecord, second: StateRecord) -> float:
    return round(box_distance_m(first.box, second.box), 4)


def _in_order_of(numbers: Collection[int], candidates: list[InstanceCandidate]) -> list[InstanceCandidate]:
    """Candidates sorted in the order of the numbers; the states of an instance stay in order."""
    position = {number: at for at, number in enumerate(numbers)}
    return sorted(candidates, key=lambda candidate: position[candidate.instance.number])
