"""From a question to its answer: which instances fit, why, and what came nearest."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import chain

from supermap_cli.errors import QueryError
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query import wording
from supermap_cli.query.candidates import Called, Candidate, Counted, Pool, label_in
from supermap_cli.query.clock import Clock, clock_of, is_time_of_day
from supermap_cli.query.grammar import Question, RelatedTo, Things, parse
from supermap_cli.query.instants import instant_of
from supermap_cli.query.keeping import evidence_notes
from supermap_cli.query.misses import NEAREST, closest, perhaps_called
from supermap_cli.query.moments import Moment, moment_at, moment_of
from supermap_cli.query.relating import Basis, Relating
from supermap_cli.query.relations import RelationName
from supermap_cli.query.standing import Known, Standing, in_words, standing_view
from supermap_cli.query.unsure import NOBODY, NOTED, Perhaps, perhaps
from supermap_cli.query.views import (
    LISTED,
    BoxView,
    InstanceView,
    Vector,
    box_view,
    evidence_view,
    interval_view,
    support_spans,
    vector,
)
from supermap_cli.query.vocabulary import LabelMatch, match_labels
from supermap_cli.types.memory import Presence, StateRecord


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
    """The relation of the question and the instances it was measured against; `more` if there are more than listed."""

    name: RelationName
    reference: str
    references: tuple[str, ...]
    more: bool = False


@dataclass(frozen=True)
class Answer:
    """An answer; an empty one is an answer, too.

    `more` is how many fit that are not among `instances`: those seen last are. It is `None` where they were not
    counted; "how many" counts them. `count` is there for that only, and `count_at_most` where of some nobody can say
    whether they stood there.
    """

    query: str
    intent: str
    time: str
    message: str
    notes: tuple[str, ...]
    instances: tuple[InstanceView, ...]
    relation: AskedRelation | None
    nearest: tuple[NearMiss, ...]
    more: int | None = 0
    count: int | None = field(default=None, metadata={"optional": True})
    count_at_most: int | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class Found:
    """What fits: the candidates listed, with all their relations; how many instances fit besides (`None`: not counted),
    and how many of all surely stood there.
    """

    candidates: list[Candidate]
    more: int | None
    sure: int


def answer(text: str, reader: MapReader, at: str | None = None, limit: int = LISTED) -> Answer:
    """Answer a question, and list so many instances at most; `at` asks it as of a time or a traversal.

    Raises `QueryError` if it is not understood, or speaks of another time itself.
    """
    question = parse(text, [each.name for each in reader.traversals])
    clock = clock_of(reader)
    if at is not None and question.time.said:
        raise QueryError("the question names a time of its own", where=text, cure="leave out --at, or the words")
    moment = moment_of(question.time, reader, clock) if at is None else moment_at(instant_of(at, reader, clock))
    resolver = Resolver(reader, moment, clock, limit)
    counting = question.intent == "count"
    found = resolver.find(question.things, counting=counting)
    instances = resolver.views(found.candidates)
    perhaps = resolver.perhaps(question.things, instances, counting=counting)
    nearest = () if instances else resolver.nearest(question.things)
    resolver.note_time(question, found.candidates, at)
    given_up = evidence_notes((each.evidence for each in instances), clock)
    count = found.sure if counting else None
    at_most = len(instances) + (found.more or 0) + perhaps.besides
    when = moment.text if at else None
    return Answer(
        query=text,
        intent=question.intent,
        time=moment.text,
        message=wording.found(question, instances, found, when)
        if instances
        else wording.nothing(question, nearest, resolver.missing(question.things), when),
        notes=tuple(dict.fromkeys([*resolver.notes, *resolver.notes_of(perhaps), *given_up])),
        instances=instances,
        relation=resolver.asked(question.things.relation),
        nearest=nearest,
        more=found.more,
        count=count,
        count_at_most=at_most if count is not None and at_most > count else None,
    )


class Resolver:
    """Resolves noun phrases and relations at one moment of one map."""

    def __init__(self, reader: MapReader, moment: Moment, clock: Clock, limit: int = LISTED) -> None:
        self.reader = reader
        self.moment = moment
        self.clock = clock
        self.limit = limit
        self.notes: list[str] = []
        self._by_id = cache(self._find_id)
        self._labels = cache(self._find_labels)

    def find(self, things: Things, *, counting: bool) -> Found:
        """The instances that fit a phrase, as many as are listed; all of them are counted if that is asked for, or
        if the labels' index knows their number.
        """
        pool = self._called(things)
        relating = None if things.relation is None else self._relating(things.relation)
        known = self._counted(pool, relating, counting=counting)
        numbers: set[int] = set()
        listed: dict[int, Basis] = {}
        sure, complete = 0, True
        for basis, each in _matches(pool, relating):
            number = each.instance.number
            if number in numbers:
                continue
            if len(listed) == self.limit and (known is not None or not counting):
                complete = False
                break
            numbers.add(number)
            standing = self.standing(each.instance)
            sure += standing is None or standing.presence != "unknown"
            if len(listed) < self.limit:
                listed[number] = basis
        if known is not None and not complete:
            return Found(self._complete(pool, relating, listed), known.fits - len(listed), known.sure)
        more = len(numbers) - len(listed) if complete else None
        return Found(self._complete(pool, relating, listed), more, sure)

    def views(self, found: Iterable[Candidate]) -> tuple[InstanceView, ...]:
        """The candidates by instance, the newest state that fits first in charge of where it is."""
        by_instance: dict[int, list[Candidate]] = {}
        for candidate in found:
            by_instance.setdefault(candidate.instance.number, []).append(candidate)
        whole = {each.number: each for each in self.reader.instances_of(list(by_instance))}
        return tuple(self._view(whole[number], candidates) for number, candidates in sorted(by_instance.items()))

    def asked(self, related: RelatedTo | None) -> AskedRelation | None:
        """The question's relation, and what it was measured against."""
        if related is None:
            return None
        references: dict[int, str] = {}
        pool = self._pool(related.reference, as_reference=True)
        for each in chain.from_iterable(pool.parts()):
            if len(references) == self.limit and each.instance.number not in references:
                break
            references[each.instance.number] = each.instance.id
        else:
            return AskedRelation(related.name, related.reference.noun or "anything", _in_order(references))
        return AskedRelation(related.name, related.reference.noun or "anything", _in_order(references), more=True)

    def nearest(self, things: Things) -> tuple[NearMiss, ...]:
        """What nearly fits: out of the relation's reach, at another time, or perhaps of that label."""
        if (missing := self.missing(things)) is not None:
            doubtful = perhaps_called(self.reader, missing)
            return tuple(self._miss(each, each.states[-1], reason) for each, reason in doubtful)
        if things.relation is not None and (misses := self._too_far(things, things.relation)):
            return misses
        known = self._first_called(things)
        return tuple(self._miss(each, each.states[-1], self.whereabouts(each)) for each in known[:NEAREST])

    def missing(self, things: Things) -> str | None:
        """The first noun of a phrase that nothing in the map was ever called."""
        if things.noun is not None and self._by_id(things.noun) is None and not self._labels(things.noun).labels:
            return things.noun
        return None if things.relation is None else self.missing(things.relation.reference)

    def perhaps(self, things: Things, found: Iterable[InstanceView], *, counting: bool) -> Perhaps:
        """Those of a name of which nobody can say whether they stood there at the time. Of relations nothing is
        guessed.
        """
        if things.relation is not None:
            return NOBODY
        return perhaps(self._called(things, ever=True), found, counting=counting)

    def notes_of(self, perhaps: Perhaps) -> list[str]:
        """What is known of those that perhaps stood there."""
        told = [f"{each.id}: {self.whereabouts(each)}" for each in perhaps.told[:NOTED]]
        if perhaps.count > NOTED:
            of = "" if perhaps.looked_at is None else f", of the {perhaps.looked_at} seen last"
            told.append(f"the same of {perhaps.count - NOTED} more{of}")
        return told

    def standing(self, instance: StoredInstance) -> Standing | None:
        """What is known of an instance at the moment, if that is one time."""
        return self.moment.standing(instance)

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

    def _find_id(self, noun: str) -> StoredInstance | None:
        """The instance that a noun names by its id."""
        instance = self.reader.instance(noun)
        if instance is None or instance.presence == "doubted":
            return None
        if instance.id.casefold() != noun.casefold():
            self.notes.append(f"{noun} is part of {instance.id} today")
        return instance

    def _find_labels(self, noun: str) -> LabelMatch:
        match = match_labels(noun, self.reader.search.labels())
        if match.note:
            self.notes.append(match.note)
        return match

    def _called(self, things: Things, *, as_reference: bool = False, ever: bool = False) -> Called:
        """All that a noun may mean; its relation is not looked at."""
        if things.noun is None:
            return Called(self.reader, self.moment, None, None, as_reference, ever)
        if (named := self._by_id(things.noun)) is not None:
            return Called(self.reader, self.moment, None, named.number, as_reference, ever)
        return Called(self.reader, self.moment, self._labels(things.noun).labels, None, as_reference, ever)

    def _pool(self, things: Things, *, as_reference: bool = False) -> Pool:
        """All that fit a phrase."""
        called = self._called(things, as_reference=as_reference)
        return called if things.relation is None else self._relating(things.relation).among(called)

    def _relating(self, related: RelatedTo) -> Relating:
        return Relating(self.reader, self.moment, related.name, self._pool(related.reference, as_reference=True))

    def _counted(self, pool: Called, relating: Relating | None, *, counting: bool) -> Counted | None:
        """How many fit, if the database can count them: unasked only where that takes no time."""
        if relating is not None:
            return relating.counted(pool) if counting else None
        return pool.counted() if counting or self.moment.kind != "at" else None

    def _complete(self, pool: Called, relating: Relating | None, listed: dict[int, Basis]) -> list[Candidate]:
        candidates = pool.among(listed)
        return (
            candidates if relating is None or not listed else relating.complete(candidates, next(iter(listed.values())))
        )

    def _first_called(self, things: Things) -> list[StoredInstance]:
        """The first few that were ever called so, and stood somewhere."""
        if things.noun is not None and (named := self._by_id(things.noun)) is not None:
            return [named] if named.states else []
        labels = None if things.noun is None else self._labels(things.noun).labels
        numbers = self.reader.search.first_labelled(labels, NEAREST)
        numbers += [] if labels is None else self.reader.search.formerly_labelled(labels)
        return _by_number(self.reader.instances_by_number(sorted(numbers)[:NEAREST]))

    def _too_far(self, things: Things, related: RelatedTo) -> tuple[NearMiss, ...]:
        """The pairs that come closest to the relation, by their boxes' distance."""
        apart = closest(self.reader, self._called(things, ever=True), self._pool(related.reference))
        return tuple(
            self._miss(
                each.candidate.instance,
                each.candidate.state,
                f"{each.distance_m:.2f} m from {each.reference.instance.id}, not {related.name} it",
                each.distance_m,
            )
            for each in apart
        )

    def _view(self, instance: StoredInstance, candidates: list[Candidate]) -> InstanceView:
        newest = max(candidates, key=lambda each: each.state.index)
        states = tuple(each.state for each in candidates)
        spans = support_spans(states)
        of_traversal = None if self.moment.traversal is None else {self.moment.traversal.id}
        standing = self.standing(instance)
        return InstanceView(
            id=instance.id,
            label=label_in(newest.instance, newest.state),
            presence=instance.presence if standing is None else standing.presence,
            position=vector(newest.state.centroid_map),
            box=box_view(newest.state.box),
            confidence=round(newest.state.confidence, 4),
            intervals=tuple(interval_view(state) for state in states),
            relations=tuple(view for each in candidates for view in each.relations),
            evidence=evidence_view(self.reader, instance, spans, of_traversal),
            standing=None if standing is None else standing_view(standing, int(self.moment.low_ns), self.clock),
        )

    def _miss(
        self, instance: StoredInstance, state: StateRecord, reason: str, distance_m: float | None = None
    ) -> NearMiss:
        rounded = None if distance_m is None else round(distance_m, 4)
        position, box = vector(state.centroid_map), box_view(state.box)
        standing = self.standing(instance)
        presence = instance.presence if standing is None else standing.presence
        return NearMiss(instance.id, instance.label, presence, position, box, reason, rounded)


def _matches(pool: Pool, relating: Relating | None) -> Iterator[tuple[Basis, Candidate]]:
    if relating is not None:
        return relating.matches(pool)
    return (("stored", each) for each in chain.from_iterable(pool.parts()))


def _by_number(instances: dict[int, StoredInstance]) -> list[StoredInstance]:
    return [instance for _, instance in sorted(instances.items())]


def _in_order(references: dict[int, str]) -> tuple[str, ...]:
    return tuple(text_id for _, text_id in sorted(references.items()))
