"""From a question to its answer: which instances fit, why, and what came nearest."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches

from supermap_cli.errors import QueryError
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query import wording
from supermap_cli.query.clock import Clock, clock_of, is_time_of_day
from supermap_cli.query.grammar import Question, RelatedTo, Things, parse
from supermap_cli.query.instants import instant_of
from supermap_cli.query.moments import Moment, Span, moment_at, moment_of
from supermap_cli.query.relations import STORED_FORMS, RelationName, box_distance_m, holds
from supermap_cli.query.standing import Known, Standing, in_words, standing_at, standing_view
from supermap_cli.query.views import (
    BoxView,
    InstanceView,
    RelationView,
    Vector,
    box_view,
    evidence_view,
    interval_view,
    support_spans,
    vector,
)
from supermap_cli.query.vocabulary import LabelMatch, load_vocabulary, match_labels
from supermap_cli.types.memory import Presence, StateRecord

NEAREST = 3
"""How many near misses an empty answer names."""

NOTED = 5
"""Of how many things an answer says that nobody can tell."""

LABEL_DOUBT = 0.1
"""A label that an object may have with this probability makes it a near miss."""


@dataclass(frozen=True)
class NearMiss:
    """What nearly fits, and why it does not."""

    id: str
    label: str
    presence: Presence | Known
    position: Vector
    box: BoxView
    reason: str
    distance_m: float | None


@dataclass(frozen=True)
class AskedRelation:
    """The relation of the question and the instances it was measured against."""

    name: RelationName
    reference: str
    references: tuple[str, ...]


@dataclass(frozen=True)
class Answer:
    """An answer; an empty one is an answer, too.

    `count` is there for "how many" only, and `count_at_most` where of some nobody can say whether they stood there.
    """

    query: str
    intent: str
    time: str
    message: str
    notes: tuple[str, ...]
    instances: tuple[InstanceView, ...]
    relation: AskedRelation | None
    nearest: tuple[NearMiss, ...]
    count: int | None = field(default=None, metadata={"optional": True})
    count_at_most: int | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class Candidate:
    """An instance in one of its states, and the relations by which it fits."""

    instance: StoredInstance
    state: StateRecord
    relations: tuple[RelationView, ...] = ()


def answer(text: str, reader: MapReader, at: str | None = None) -> Answer:
    """Answer a question; `at` asks it as of a time or a traversal.

    Raises `QueryError` if it is not understood, or speaks of another time itself.
    """
    question = parse(text, [each.name for each in reader.traversals])
    clock = clock_of(reader)
    if at is not None and question.time.said:
        raise QueryError("the question names a time of its own", where=text, cure="leave out --at, or the words")
    moment = moment_of(question.time, reader, clock) if at is None else moment_at(instant_of(at, reader, clock))
    resolver = Resolver(reader, moment, clock)
    found = resolver.find(question.things)
    instances = resolver.views(found)
    perhaps = resolver.perhaps(question.things, instances)
    nearest = () if instances else resolver.nearest(question.things)
    resolver.note_time(question, found, at)
    count = sum(each.presence != "unknown" for each in instances) if question.intent == "count" else None
    at_most = len(instances) + len(perhaps)
    return Answer(
        query=text,
        intent=question.intent,
        time=moment.text,
        message=wording.found(question, instances, moment.text if at else None)
        if instances
        else wording.nothing(question, nearest, resolver.missing(question.things), moment.text if at else None),
        notes=tuple(dict.fromkeys([*resolver.notes, *resolver.notes_of(perhaps)])),
        instances=instances,
        relation=resolver.asked(question.things.relation),
        nearest=nearest,
        count=count,
        count_at_most=at_most if count is not None and at_most > count else None,
    )


class Resolver:
    """Resolves noun phrases and relations at one moment of one map."""

    def __init__(self, reader: MapReader, moment: Moment, clock: Clock) -> None:
        self.reader = reader
        self.moment = moment
        self.clock = clock
        self.notes: list[str] = []

    def find(self, things: Things, *, as_reference: bool = False) -> list[Candidate]:
        """Every state that fits a phrase; as a reference, states of any time (see `Moment.reference_states`)."""
        labels = self._wanted_labels(things.noun)
        states_of = self.moment.reference_states if as_reference else self.moment.states
        candidates = [
            Candidate(instance, state)
            for instance in self._called(things)
            for state in states_of(instance)
            if labels is None or label_in(instance, state) in labels
        ]
        return candidates if things.relation is None else self._related(candidates, things.relation)

    def views(self, found: Iterable[Candidate]) -> tuple[InstanceView, ...]:
        """The candidates by instance, the newest state that fits first in charge of where it is."""
        by_instance: dict[int, list[Candidate]] = {}
        for candidate in found:
            by_instance.setdefault(candidate.instance.number, []).append(candidate)
        return tuple(self._view(candidates) for _, candidates in sorted(by_instance.items()))

    def asked(self, related: RelatedTo | None) -> AskedRelation | None:
        """The question's relation, and what it was measured against."""
        if related is None:
            return None
        references = dict.fromkeys(each.instance.id for each in self.find(related.reference, as_reference=True))
        return AskedRelation(related.name, related.reference.noun or "anything", tuple(references))

    def nearest(self, things: Things) -> tuple[NearMiss, ...]:
        """What nearly fits: out of the relation's reach, at another time, or perhaps of that label."""
        if (missing := self.missing(things)) is not None:
            return self._perhaps_called(missing)
        called = self._called(things)
        if things.relation is not None and (misses := self._too_far(called, things.relation)):
            return misses
        known = [each for each in called if each.states]
        return tuple(self._miss(each, each.states[-1], self.whereabouts(each)) for each in known[:NEAREST])

    def missing(self, things: Things) -> str | None:
        """The first noun of a phrase that nothing in the map was ever called."""
        if things.noun is not None and not self._called(things):
            return things.noun
        return None if things.relation is None else self.missing(things.relation.reference)

    def perhaps(self, things: Things, found: Iterable[InstanceView]) -> list[StoredInstance]:
        """Those of a name of which nobody can say whether they stood there at the time: they were seen later, and their
        place had not been seen empty before; or they were on their way. Of relations nothing is guessed.
        """
        if self.moment.kind != "at" or things.relation is not None:
            return []
        told = {each.id for each in found}
        unsure = [each for each in self._called(things) if each.id not in told]
        return [each for each in unsure if (known := self.standing(each)) is not None and known.presence == "unknown"]

    def notes_of(self, perhaps: Sequence[StoredInstance]) -> list[str]:
        """What is known of those that perhaps stood there."""
        told = [f"{each.id}: {self.whereabouts(each)}" for each in perhaps[:NOTED]]
        return told + ([f"the same of {len(perhaps) - NOTED} more"] if len(perhaps) > NOTED else [])

    def standing(self, instance: StoredInstance) -> Standing | None:
        """What is known of an instance at the moment, if that is one time."""
        return standing_at(instance, int(self.moment.low_ns)) if self.moment.kind == "at" else None

    def note_time(self, question: Question, found: Iterable[Candidate], at: str | None = None) -> None:
        """Note what the question's time leaves open: its day, who had perhaps left, a traversal nobody knows."""
        written = at or question.time.argument or ""
        if self.moment.kind == "at":
            if is_time_of_day(written):
                self.notes.append(f"{written} was taken as {self.clock.text(int(self.moment.low_ns))}")
            if self.moment.note is not None:
                self.notes.append(self.moment.note)
            self._note_ends()
            self._note_gaps(found, written)
        self._note_unknown_traversal(question)

    def _note_ends(self) -> None:
        """Note a time at which the map knows nothing yet, or nothing more."""
        end_ns = max((each.end_ns for each in self.reader.traversals), default=None)
        if end_ns is None:
            return
        if self.moment.low_ns < self.clock.origin_ns:
            self.notes.append(f"the map begins at {self.clock.text(self.clock.origin_ns)}")
        elif self.moment.low_ns > end_ns:
            self.notes.append(f"the map ends at {self.clock.text(end_ns)}; what came after, nobody saw")

    def whereabouts(self, instance: StoredInstance) -> str:
        """What is known of an instance's presence, in words; "gone" only where that was seen."""
        if (standing := self.standing(instance)) is not None:
            return in_words(standing, int(self.moment.low_ns), self.clock)
        state = instance.states[-1]
        seen = f"last seen {self.clock.text(state.last_seen_ns)}"
        if state.gone_ns is not None:
            return f"{seen}, gone {self.clock.between(state.last_seen_ns, state.gone_ns)}"
        return f"{seen}, not seen since" if instance.presence == "absent" else seen

    def _note_gaps(self, found: Iterable[Candidate], written: str) -> None:
        """Note who left around the time asked for, those that relations were measured against among them."""
        involved = [text_id for each in found for text_id in (each.instance.id, *(at.object for at in each.relations))]
        for text_id in dict.fromkeys(involved):
            instance = self.reader.instance(text_id)
            if instance is not None and (gap := self.moment.gap(instance)) is not None:
                self.notes.append(f"{text_id} left {self.clock.between(*gap)}; nobody can say for {written}")

    def _note_unknown_traversal(self, question: Question) -> None:
        """Note which traversals there are, where "in NAME" names neither a thing nor one of them."""
        related = question.things.relation
        if related is None or related.name != "inside" or "in" not in question.text.casefold().split():
            return
        if (name := self.missing(related.reference)) is not None:
            known = ", ".join(f"{each.number} {each.name}" for each in self.reader.traversals) or "none"
            self.notes.append(f"no traversal is called '{name}' either; there are: {known}")

    def _by_id(self, noun: str) -> StoredInstance | None:
        """The instance that a noun names by its id."""
        instance = self.reader.instance(noun)
        if instance is None or instance.presence == "doubted":
            return None
        if instance.id.casefold() != noun.casefold():
            self.notes.append(f"{noun} is part of {instance.id} today")
        return instance

    def _wanted_labels(self, noun: str | None) -> frozenset[str] | None:
        """The labels a noun stands for; `None` where any will do: without a noun, or if it is an id."""
        return None if noun is None or self._by_id(noun) is not None else self._labels(noun).labels

    def _called(self, things: Things) -> list[StoredInstance]:
        if things.noun is None:
            return list(self.reader.believed)
        if (named := self._by_id(things.noun)) is not None:
            return [named]
        match = self._labels(things.noun)
        return [
            each
            for each in self.reader.believed
            if each.label in match.labels or any(state.label in match.labels for state in each.states)
        ]

    def _labels(self, noun: str) -> LabelMatch:
        labels = {each.label for each in self.reader.believed}
        labels |= {state.label for each in self.reader.believed for state in each.states}
        match = match_labels(noun, labels)
        if match.note:
            self.notes.append(match.note)
        return match

    def _related(self, candidates: list[Candidate], related: RelatedTo) -> list[Candidate]:
        """Those that stand in the relation by stored edges; only if none does, by their boxes."""
        references = self.find(related.reference, as_reference=True)
        for find_relation in (self._stored_relation, self._boxes_relation):
            found = []
            for candidate in candidates:
                views = [
                    view
                    for reference in references
                    if reference.instance.number != candidate.instance.number
                    and (span := self._together(candidate, reference)) is not None
                    and (view := find_relation(related.name, candidate, reference, span)) is not None
                ]
                if views:
                    found.append(Candidate(candidate.instance, candidate.state, tuple(views)))
            if found:
                return found
        return []

    def _together(self, candidate: Candidate, reference: Candidate) -> Span | None:
        return self.moment.span_of((candidate.state, candidate.instance), (reference.state, reference.instance))

    def _stored_relation(
        self, name: RelationName, candidate: Candidate, reference: Candidate, span: Span
    ) -> RelationView | None:
        for form in STORED_FORMS[name]:
            ends = (candidate.instance.number, reference.instance.number)
            subject, obj = ends[::-1] if form.turned else ends
            for edge in self.reader.edges_of([subject]):
                if (edge.subject, edge.relation, edge.object) != (subject, form.relation, obj):
                    continue
                if not span.touches(edge.since_ns, edge.until_ns):
                    continue
                if form.checked and not holds(name, candidate.state.box, reference.state.box):
                    continue
                return RelationView(
                    name=name,
                    subject=candidate.instance.id,
                    object=reference.instance.id,
                    basis="stored",
                    stored_as=f"{edge.relation}({self.reader.text_ids[subject]}, {self.reader.text_ids[obj]})",
                    since_ns=edge.since_ns,
                    until_ns=edge.until_ns,
                    distance_m=_distance_m(candidate.state, reference.state),
                    confidence=round(edge.confidence, 4),
                )
        return None

    def _boxes_relation(
        self, name: RelationName, candidate: Candidate, reference: Candidate, span: Span
    ) -> RelationView | None:
        if not holds(name, candidate.state.box, reference.state.box):
            return None
        since_ns = max(candidate.state.first_seen_ns, reference.state.first_seen_ns)
        return RelationView(
            name=name,
            subject=candidate.instance.id,
            object=reference.instance.id,
            basis="boxes",
            stored_as=None,
            since_ns=since_ns,
            until_ns=None if span.high_ns == float("inf") else int(span.high_ns),
            distance_m=_distance_m(candidate.state, reference.state),
            confidence=round(candidate.state.confidence * reference.state.confidence, 4),
        )

    def _view(self, candidates: list[Candidate]) -> InstanceView:
        newest = max(candidates, key=lambda each: each.state.index)
        instance, states = newest.instance, tuple(each.state for each in candidates)
        spans = support_spans(states)
        of_traversal = None if self.moment.traversal is None else {self.moment.traversal.id}
        standing = self.standing(instance)
        return InstanceView(
            id=instance.id,
            label=label_in(instance, newest.state),
            presence=instance.presence if standing is None else standing.presence,
            position=vector(newest.state.centroid_map),
            box=box_view(newest.state.box),
            confidence=round(newest.state.confidence, 4),
            intervals=tuple(interval_view(state) for state in states),
            relations=tuple(view for each in candidates for view in each.relations),
            evidence=evidence_view(self.reader, instance, spans, of_traversal),
            standing=None if standing is None else standing_view(standing, int(self.moment.low_ns), self.clock),
        )

    def _too_far(self, called: list[StoredInstance], related: RelatedTo) -> tuple[NearMiss, ...]:
        """The pairs that come closest to the relation, by their boxes' distance."""
        references = self.find(related.reference)
        pairs = [
            (box_distance_m(state.box, other.state.box), instance, state, other)
            for instance in called
            for state in self.moment.states(instance)[-1:]
            for other in references
            if other.instance.number != instance.number
        ]
        closest: dict[int, NearMiss] = {}
        for distance_m, instance, state, other in sorted(pairs, key=lambda pair: (pair[0], pair[1].number)):
            reason = f"{distance_m:.2f} m from {other.instance.id}, not {related.name} it"
            closest.setdefault(instance.number, self._miss(instance, state, reason, distance_m))
        return tuple(closest.values())[:NEAREST]

    def _perhaps_called(self, noun: str) -> tuple[NearMiss, ...]:
        """Objects that may have that label after all, and labels that are spelt nearly so."""
        vocabulary = load_vocabulary()
        names = vocabulary.names_of(vocabulary.normalise(noun))
        doubtful = [
            (share, label, each)
            for each in self.reader.believed
            for label, share in each.label_belief.items()
            if share >= LABEL_DOUBT and vocabulary.normalise(label) in names and each.states
        ]
        doubtful.sort(key=lambda entry: -entry[0])
        misses = [
            self._miss(each, each.states[-1], f"may be a {label} ({share:.0%})") for share, label, each in doubtful
        ]
        close = get_close_matches(vocabulary.normalise(noun), {each.label for each in self.reader.believed}, 1, 0.75)
        misses += [
            self._miss(each, each.states[-1], f"did you mean '{each.label}'?")
            for each in self.reader.believed
            if each.label in close and each.states
        ]
        return tuple(misses[:NEAREST])

    def _miss(
        self, instance: StoredInstance, state: StateRecord, reason: str, distance_m: float | None = None
    ) -> NearMiss:
        rounded = None if distance_m is None else round(distance_m, 4)
        position, box = vector(state.centroid_map), box_view(state.box)
        standing = self.standing(instance)
        presence = instance.presence if standing is None else standing.presence
        return NearMiss(instance.id, instance.label, presence, position, box, reason, rounded)


def label_in(instance: StoredInstance, state: StateRecord) -> str:
    """What an instance is called in one of its states: in the newest, what it is called today."""
    return instance.label if state is instance.states[-1] else state.label


def _distance_m(first: StateRecord, second: StateRecord) -> float:
    return round(box_distance_m(first.box, second.box), 4)
