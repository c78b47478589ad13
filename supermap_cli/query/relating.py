"""Which candidates stand in a relation to which references: by stored edges, and only if none does, by their boxes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import Literal

from supermap_cli.memory.edge_query import EdgeEnd, EdgeQuery
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.candidates import PART, Called, Candidate, Counted, Listed, Pool
from supermap_cli.query.moments import Moment, Span
from supermap_cli.query.relations import REACH, STORED_FORMS, RelationName, box_distance_m, holds
from supermap_cli.query.views import RelationView
from supermap_cli.types.memory import SpatialEdge, StateRecord

Basis = Literal["stored", "boxes"]
BASES: tuple[Basis, ...] = ("stored", "boxes")
FEW = 100
"""So many are read sooner than the database finds a way from the many to them."""


class Links:
    """Which pairs of instances are worth a look, and the stored edges between each of them, in the order of writing."""

    def __init__(self) -> None:
        self.partners: dict[int, set[int]] = defaultdict(set)
        self._edges: dict[tuple[int, str, int], list[SpatialEdge]] = defaultdict(list)

    def add_pair(self, one: int, other: int) -> None:
        """Both ways."""
        self.partners[one].add(other)
        self.partners[other].add(one)

    def add_edge(self, edge: SpatialEdge) -> None:
        """With its two ends as a pair."""
        self._edges[edge.subject, edge.relation, edge.object].append(edge)
        self.add_pair(edge.subject, edge.object)

    def edges(self, subject: int, relation: str, obj: int) -> list[SpatialEdge]:
        """Those between two instances."""
        return self._edges.get((subject, relation, obj), [])


@dataclass(frozen=True)
class Relating:
    """One relation of a question, at one moment of a map."""

    reader: MapReader
    moment: Moment
    name: RelationName
    references: Pool

    def matches(self, candidates: Pool) -> Iterator[tuple[Basis, Candidate]]:
        """All that fit, some more than once, with some of their relations: whichever pool is smaller is gone through,
        and the other is asked for its neighbours only.
        """
        from_references = self.references.size() < candidates.size()
        for basis in BASES if self._any_stored(candidates) else BASES[1:]:
            found = False
            one, other = (self.references, candidates) if from_references else (candidates, self.references)
            for numbers in one.numbers():
                links = self._links(numbers, basis, other, turned=from_references)
                part = _in_order_of(numbers, one.among([number for number in numbers if number in links.partners]))
                partners = other.among({it for each in part for it in links.partners[each.instance.number]})
                pair = (partners, part) if from_references else (part, partners)
                for each in self._related(*pair, links, basis):
                    found = True
                    yield basis, each
            if found:
                return

    def counted(self, candidates: Pool) -> Counted | None:
        """How many fit by stored edges, where the database can count them: of what is present, in one relation.

        Only those are read of which an edge alone does not say so. `None`, too, where none fits so.
        """
        linked = self._linked(candidates)
        if linked is None:
            return None
        forms = STORED_FORMS[self.name]
        merged = linked.merged({form.relation for form in forms})
        fits, unsure = set[int](), merged
        for form in forms:
            numbers = linked.numbers(form.relation, turned=form.turned)
            if form.checked:
                unsure = unsure | numbers
            else:
                fits |= numbers - merged
        for part in batches(sorted(unsure - fits), PART):
            fits.update(each.instance.number for each in self.complete(candidates.among(part), "stored"))
        return Counted(len(fits), len(fits)) if fits else None

    def _any_stored(self, candidates: Pool) -> bool:
        """Whether a stored edge may relate any: if not, none need be read to know it."""
        linked = self._linked(candidates)
        if linked is None:
            return True
        forms = STORED_FORMS[self.name]
        return any(linked.any(form.relation, turned=form.turned) for form in forms) or bool(
            linked.merged({form.relation for form in forms})
        )

    def _linked(self, candidates: Pool) -> EdgeQuery | None:
        """The stored edges in question, if they are about what is present and called by names, and many are."""
        if self.moment.kind != "now" or not isinstance(candidates, Called) or not isinstance(self.references, Called):
            return None
        if min(candidates.size(), self.references.size()) <= FEW:
            return None
        one, other = (EdgeEnd(each.labels, each.number) for each in (candidates, self.references))
        return EdgeQuery(self.reader, one, other, int(self.moment.low_ns))

    def complete(self, candidates: list[Candidate], basis: Basis) -> list[Candidate]:
        """Those of the candidates that fit, with all their relations."""
        numbers = {each.instance.number for each in candidates}
        links = self._links(numbers, basis, self.references)
        partners = {partner for number in numbers for partner in links.partners.get(number, ())}
        return self._related(candidates, self.references.among(partners), links, basis)

    def among(self, candidates: Pool) -> Listed:
        """All that fit, as a pool of its own."""
        found = {each.key: replace(each, relations=()) for _, each in self.matches(candidates)}
        return Listed([each for _, each in sorted(found.items())])

    def _links(self, numbers: Collection[int], basis: Basis, others: Pool, *, turned: bool = False) -> Links:
        """Between some candidates and the references (`turned`: some references and the candidates)."""
        links = Links()
        if basis == "boxes":
            labels = others.labels if isinstance(others, Called) else None
            for pair in self.reader.search.near(numbers, REACH[self.name], labels, turned=turned):
                links.add_pair(*pair)
        else:
            for edge in self.reader.edges_of(numbers, {form.relation for form in STORED_FORMS[self.name]}):
                links.add_edge(edge)
        return links

    def _related(
        self, candidates: list[Candidate], references: list[Candidate], links: Links, basis: Basis
    ) -> list[Candidate]:
        by_number: dict[int, list[Candidate]] = defaultdict(list)
        for each in sorted(references, key=lambda each: each.key):
            by_number[each.instance.number].append(each)
        found = []
        for candidate in candidates:
            linked = sorted(links.partners.get(candidate.instance.number, set()) - {candidate.instance.number})
            pairs = ((candidate, reference) for number in linked for reference in by_number.get(number, ()))
            views = [view for pair in pairs if (view := self._view(*pair, links, basis)) is not None]
            if views:
                found.append(replace(candidate, relations=tuple(views)))
        return found

    def _view(self, candidate: Candidate, reference: Candidate, links: Links, basis: Basis) -> RelationView | None:
        """The relation of two states that hold together at some time of the moment."""
        span = self.moment.span_of((candidate.state, candidate.instance), (reference.state, reference.instance))
        if span is None:
            return None
        if basis == "boxes":
            return self._by_boxes(candidate, reference, span)
        return self._by_edges(candidate, reference, span, links)

    def _by_edges(self, candidate: Candidate, reference: Candidate, span: Span, links: Links) -> RelationView | None:
        for form in STORED_FORMS[self.name]:
            subject, obj = (reference, candidate) if form.turned else (candidate, reference)
            for edge in links.edges(subject.instance.number, form.relation, obj.instance.number):
                if not span.touches(edge.since_ns, edge.until_ns):
                    continue
                if form.checked and not holds(self.name, candidate.state.box, reference.state.box):
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

    def _by_boxes(self, candidate: Candidate, reference: Candidate, span: Span) -> RelationView | None:
        if not holds(self.name, candidate.state.box, reference.state.box):
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
            confidence=round(candidate.state.confidence * reference.state.confidence, 4),
        )


def _distance_m(first: StateRecord, second: StateRecord) -> float:
    return round(box_distance_m(first.box, second.box), 4)


def _in_order_of(numbers: Collection[int], candidates: list[Candidate]) -> list[Candidate]:
    """Candidates as their numbers come; the states of each stay in order."""
    place = {number: at for at, number in enumerate(numbers)}
    return sorted(candidates, key=lambda each: place[each.instance.number])
