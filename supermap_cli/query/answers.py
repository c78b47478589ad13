"""From a question to its answer: the matching instances, their evidence, and near misses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import chain

from supermap_cli.errors import QueryError
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query import answer_text
from supermap_cli.query.candidates import (
    CandidateSource,
    InstanceCandidate,
    LabelCandidates,
    MatchCount,
    label_in_state,
    sorted_by_number,
)
from supermap_cli.query.clock import Clock, clock_of, is_time_of_day
from supermap_cli.query.grammar import NounPhrase, Question, RelationPhrase, parse
from supermap_cli.query.map_relations import MapRelations
from supermap_cli.query.near_misses import MAX_NEAR_MISSES, maybe_labelled, nearest_pairs
from supermap_cli.query.presence_at import PresenceAt, PresenceValue, describe_presence, presence_view
from supermap_cli.query.relation_matching import Basis, RelationMatcher
from supermap_cli.query.relations import RelationName
from supermap_cli.query.retention_policy import pruned_evidence_notes
from supermap_cli.query.time_points import parse_time_point, traversal_list
from supermap_cli.query.time_selector import TimeSelector, selector_at, selector_of_phrase
from supermap_cli.query.uncertain_presence import MAX_NOTED, NO_UNCERTAIN, UncertainInstances, uncertain_instances
from supermap_cli.query.views import (
    DEFAULT_LIMIT,
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
    """An instance that almost matches, and the reason why it does not."""

    id: str
    label: str
    presence: Presence | PresenceValue
    position: Vector
    box: BoxView
    reason: str
    distance_m: float | None


@dataclass(frozen=True)
class AskedRelation:
    """The relation of a question and the reference instances; `more` if there are more than listed."""

    name: RelationName
    reference: str
    references: tuple[str, ...]
    more: bool = False


@dataclass(frozen=True)
class Answer:
    """An answer, which may be empty.

    `more` is the number of matches that are not listed in `instances` (the most recently seen are listed), or `None`
    where they were not counted. `count` is set for "how many" only, and `count_at_most` where the presence of some
    instances at the time is unknown.
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
class QuestionMatches:
    """The listed candidates with all their relations, the number of further matches (`more`, `None`: not counted), and
    how many of all matches are known to have been present (`certain`).
    """

    candidates: list[InstanceCandidate]
    more: int | None
    certain: int


def answer(text: str, reader: MapReader, at: str | None = None, limit: int = DEFAULT_LIMIT) -> Answer:
    """Answer a question, listing at most `limit` instances. `at` asks it as of a time or a traversal.

    Raises `QueryError` if the question is not understood, or has its own time besides `at`.
    """
    question = parse(text, [traversal.name for traversal in reader.traversals])
    clock = clock_of(reader)
    if at is not None and question.time.explicit:
        raise QueryError("the question names a time of its own", where=text, cure="leave out --at, or the words")
    selector = (
        selector_of_phrase(question.time, reader, clock)
        if at is None
        else selector_at(parse_time_point(at, reader, clock))
    )
    resolver = QuestionResolver(reader, selector, clock, limit)
    counting = question.intent == "count"
    matches = resolver.find(question.phrase, counting=counting)
    instances = resolver.views(matches.candidates)
    uncertain_instances = resolver.uncertain_instances(question.phrase, instances, counting=counting)
    nearest = () if instances else resolver.nearest(question.phrase)
    resolver.add_time_notes(question, matches.candidates, at)
    pruned_notes = pruned_evidence_notes((instance.evidence for instance in instances), clock)
    count = matches.certain if counting else None
    at_most = len(instances) + (matches.more or 0) + uncertain_instances.unmatched
    when = selector.text if at else None
    return Answer(
        query=text,
        intent=question.intent,
        time=selector.text,
        message=answer_text.match_sentence(question, instances, matches, when)
        if instances
        else answer_text.no_match_sentence(question, nearest, resolver.unknown_noun(question.phrase), when),
        notes=tuple(dict.fromkeys([*resolver.notes, *resolver.uncertainty_notes(uncertain_instances), *pruned_notes])),
        instances=instances,
        relation=resolver.asked_relation(question.phrase.relation),
        nearest=nearest,
        more=matches.more,
        count=count,
        count_at_most=at_most if count is not None and at_most > count else None,
    )


class QuestionResolver:
    """Resolves noun phrases and relations for one time selector and one map."""

    def __init__(self, reader: MapReader, selector: TimeSelector, clock: Clock, limit: int = DEFAULT_LIMIT) -> None:
        self.reader = reader
        self.selector = selector
        self.clock = clock
        self.limit = limit
        self.relations = MapRelations(reader)
        self.notes: list[str] = []
        self._instance_by_id = cache(self._find_id)
        self._labels = cache(self._find_labels)

    def find(self, phrase: NounPhrase, *, counting: bool) -> QuestionMatches:
        """The matches of a phrase, at most `limit` of them listed. All are counted if `counting`, or if the label index
        gives their number.
        """
        source = self._candidates(phrase)
        matcher = None if phrase.relation is None else self._matcher(phrase.relation)
        count = self._count(source, matcher, counting=counting)
        numbers: set[int] = set()
        listed: dict[int, Basis] = {}
        certain, complete = 0, True
        for basis, candidate in _matches(source, matcher):
            number = candidate.instance.number
            if number in numbers:
                continue
            if len(listed) == self.limit and (count is not None or not counting):
                complete = False
                break
            numbers.add(number)
            presence = self.presence(candidate.instance)
            certain += presence is None or presence.value != "unknown"
            if len(listed) < self.limit:
                listed[number] = basis
        if count is not None and not complete:
            return QuestionMatches(
                self._with_all_relations(source, matcher, listed), count.total - len(listed), count.certain
            )
        more = len(numbers) - len(listed) if complete else None
        return QuestionMatches(self._with_all_relations(source, matcher, listed), more, certain)

    def views(self, matches: Iterable[InstanceCandidate]) -> tuple[InstanceView, ...]:
        """The candidates grouped by instance; the newest matching state gives position and label."""
        by_instance: dict[int, list[InstanceCandidate]] = {}
        for candidate in matches:
            by_instance.setdefault(candidate.instance.number, []).append(candidate)
        instances = {instance.number: instance for instance in self.reader.instances_of(list(by_instance))}
        return tuple(self._view(instances[number], candidates) for number, candidates in sorted(by_instance.items()))

    def asked_relation(self, related: RelationPhrase | None) -> AskedRelation | None:
        """The relation of a question with the reference instances."""
        if related is None:
            return None
        references: dict[int, str] = {}
        source = self._candidate_source(related.reference, as_reference=True)
        for candidate in chain.from_iterable(source.batches()):
            if len(references) == self.limit and candidate.instance.number not in references:
                break
            references[candidate.instance.number] = candidate.instance.id
        else:
            return AskedRelation(related.name, related.reference.noun or "anything", _in_order(references))
        return AskedRelation(related.name, related.reference.noun or "anything", _in_order(references), more=True)

    def nearest(self, phrase: NounPhrase) -> tuple[NearMiss, ...]:
        """Near misses: out of the relation's reach, absent at the selected time, or possibly of that label."""
        if (unknown_noun := self.unknown_noun(phrase)) is not None:
            possible = maybe_labelled(self.reader, unknown_noun)
            return tuple(self._near_miss(instance, instance.states[-1], reason) for instance, reason in possible)
        if phrase.relation is not None and (out_of_reach := self._out_of_reach(phrase, phrase.relation)):
            return out_of_reach
        instances = self._first_labelled(phrase)
        return tuple(
            self._near_miss(instance, instance.states[-1], self.presence_text(instance))
            for instance in instances[:MAX_NEAR_MISSES]
        )

    def unknown_noun(self, phrase: NounPhrase) -> str | None:
        """The first noun of a phrase that matches no label and no id in the map."""
        if (
            phrase.noun is not None
            and self._instance_by_id(phrase.noun) is None
            and not self._labels(phrase.noun).labels
        ):
            return phrase.noun
        return None if phrase.relation is None else self.unknown_noun(phrase.relation.reference)

    def uncertain_instances(
        self, phrase: NounPhrase, matches: Iterable[InstanceView], *, counting: bool
    ) -> UncertainInstances:
        """Instances of that label whose presence at the selected time is unknown; none for a phrase with a relation."""
        if phrase.relation is not None:
            return NO_UNCERTAIN
        return uncertain_instances(self._candidates(phrase, any_state=True), matches, counting=counting)

    def uncertainty_notes(self, uncertain_instances: UncertainInstances) -> list[str]:
        """What is known of the instances whose presence is unknown."""
        notes = [
            f"{instance.id}: {self.presence_text(instance)}" for instance in uncertain_instances.instances[:MAX_NOTED]
        ]
        if uncertain_instances.count > MAX_NOTED:
            of = "" if uncertain_instances.searched is None else f", of the {uncertain_instances.searched} seen last"
            notes.append(f"the same of {uncertain_instances.count - MAX_NOTED} more{of}")
        return notes

    def presence(self, instance: StoredInstance) -> PresenceAt | None:
        """The presence of an instance if the selector is a single time, else `None`."""
        return self.selector.presence(instance)

    def add_time_notes(self, question: Question, matches: Iterable[InstanceCandidate], at: str | None = None) -> None:
        """Add notes on how the time was understood: its day, limits of the map, departures within a gap, unknown
        traversals.
        """
        written = at or question.time.argument or ""
        if self.selector.kind == "at":
            if is_time_of_day(written):
                self.notes.append(f"{written} was taken as {self.clock.text(int(self.selector.low_ns))}")
            if self.selector.note is not None:
                self.notes.append(self.selector.note)
            self._note_map_limits()
            self._note_departures(matches, written)
        self._note_unknown_traversal(question)

    def _note_map_limits(self) -> None:
        """Add a note for a time before the first or after the last traversal."""
        end_ns = max((traversal.end_ns for traversal in self.reader.traversals), default=None)
        if end_ns is None:
            return
        if self.selector.low_ns < self.clock.origin_ns:
            self.notes.append(f"the map begins at {self.clock.text(self.clock.origin_ns)}")
        elif self.selector.low_ns > end_ns:
            self.notes.append(f"the map ends at {self.clock.text(end_ns)}; what came after, nobody saw")

    def presence_text(self, instance: StoredInstance) -> str:
        """What is known of an instance's presence, in words; "gone" only after a contradiction."""
        if (presence := self.presence(instance)) is not None:
            return describe_presence(presence, int(self.selector.low_ns), self.clock)
        state = instance.states[-1]
        seen = f"last seen {self.clock.text(state.last_seen_ns)}"
        if state.gone_ns is not None:
            return f"{seen}, gone {self.clock.between(state.last_seen_ns, state.gone_ns)}"
        return f"{seen}, not seen since" if instance.presence == "absent" else seen

    def _note_departures(self, matches: Iterable[InstanceCandidate], written: str) -> None:
        """Add a note for each matched or reference instance that left in a gap around the time."""
        involved = [
            text_id
            for candidate in matches
            for text_id in (candidate.instance.id, *(relation.object for relation in candidate.relations))
        ]
        for text_id in dict.fromkeys(involved):
            instance = self.reader.instance(text_id)
            if instance is not None and (gap := self.selector.departure_gap(instance)) is not None:
                self.notes.append(f"{text_id} left {self.clock.between(*gap)}; nobody can say for {written}")

    def _note_unknown_traversal(self, question: Question) -> None:
        """List the traversals where "in NAME" names neither an object nor a traversal."""
        related = question.phrase.relation
        if related is None or related.name != "inside" or "in" not in question.text.casefold().split():
            return
        if (name := self.unknown_noun(related.reference)) is not None:
            known = traversal_list(self.reader.traversals)
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

    def _candidates(
        self, phrase: NounPhrase, *, as_reference: bool = False, any_state: bool = False
    ) -> LabelCandidates:
        """The candidates for a phrase's noun; its relation is ignored."""
        if phrase.noun is None:
            return LabelCandidates(self.reader, self.selector, None, None, as_reference, any_state)
        if (named := self._instance_by_id(phrase.noun)) is not None:
            return LabelCandidates(self.reader, self.selector, None, named.number, as_reference, any_state)
        return LabelCandidates(
            self.reader, self.selector, self._labels(phrase.noun).labels, None, as_reference, any_state
        )

    def _candidate_source(self, phrase: NounPhrase, *, as_reference: bool = False) -> CandidateSource:
        """The candidates for a phrase, including its relation."""
        candidates = self._candidates(phrase, as_reference=as_reference)
        return candidates if phrase.relation is None else self._matcher(phrase.relation).restrict(candidates)

    def _matcher(self, related: RelationPhrase) -> RelationMatcher:
        return RelationMatcher(
            self.reader,
            self.selector,
            related.name,
            self._candidate_source(related.reference, as_reference=True),
            self.relations,
        )

    def _count(self, source: LabelCandidates, matcher: RelationMatcher | None, *, counting: bool) -> MatchCount | None:
        """The number of matches if the database can count them; unless `counting`, only where that is cheap."""
        if matcher is not None:
            return matcher.match_count(source) if counting else None
        return source.match_count() if counting or self.selector.kind != "at" else None

    def _with_all_relations(
        self, source: LabelCandidates, matcher: RelationMatcher | None, listed: dict[int, Basis]
    ) -> list[InstanceCandidate]:
        candidates = source.with_numbers(listed)
        return (
            candidates
            if matcher is None or not listed
            else matcher.with_all_relations(candidates, next(iter(listed.values())))
        )

    def _first_labelled(self, phrase: NounPhrase) -> list[StoredInstance]:
        """The first few instances that ever had such a label and have a state."""
        if phrase.noun is not None and (named := self._instance_by_id(phrase.noun)) is not None:
            return [named] if named.states else []
        labels = None if phrase.noun is None else self._labels(phrase.noun).labels
        numbers = self.reader.search.first_labelled(labels, MAX_NEAR_MISSES)
        numbers += [] if labels is None else self.reader.search.formerly_labelled(labels)
        return sorted_by_number(self.reader.instances_by_number(sorted(numbers)[:MAX_NEAR_MISSES]))

    def _out_of_reach(self, phrase: NounPhrase, related: RelationPhrase) -> tuple[NearMiss, ...]:
        """The pairs closest to fulfilling the relation, by box distance."""
        pairs = nearest_pairs(
            self.reader, self._candidates(phrase, any_state=True), self._candidate_source(related.reference)
        )
        return tuple(
            self._near_miss(
                pair.candidate.instance,
                pair.candidate.state,
                f"{pair.distance_m:.2f} m from {pair.reference.instance.id}, not {related.name} it",
                pair.distance_m,
            )
            for pair in pairs
        )

    def _view(self, instance: StoredInstance, candidates: list[InstanceCandidate]) -> InstanceView:
        newest = max(candidates, key=lambda candidate: candidate.state.index)
        states = tuple(candidate.state for candidate in candidates)
        spans = support_spans(states)
        of_traversal = None if self.selector.traversal is None else {self.selector.traversal.id}
        presence = self.presence(instance)
        return InstanceView(
            id=instance.id,
            label=label_in_state(newest.instance, newest.state),
            presence=instance.presence if presence is None else presence.value,
            position=vector(newest.state.centroid_map),
            box=box_view(newest.state.box),
            confidence=round(newest.state.confidence, 4),
            intervals=tuple(interval_view(state) for state in states),
            relations=tuple(view for candidate in candidates for view in candidate.relations),
            evidence=evidence_view(self.reader, instance, spans, of_traversal),
            standing=None if presence is None else presence_view(presence, int(self.selector.low_ns), self.clock),
        )

    def _near_miss(
        self, instance: StoredInstance, state: StateRecord, reason: str, distance_m: float | None = None
    ) -> NearMiss:
        rounded = None if distance_m is None else round(distance_m, 4)
        position, box = vector(state.centroid_map), box_view(state.box)
        presence_then = self.presence(instance)
        presence = instance.presence if presence_then is None else presence_then.value
        return NearMiss(instance.id, instance.label, presence, position, box, reason, rounded)


def _matches(source: CandidateSource, matcher: RelationMatcher | None) -> Iterator[tuple[Basis, InstanceCandidate]]:
    if matcher is not None:
        return matcher.matches(source)
    return (("stored", candidate) for candidate in chain.from_iterable(source.batches()))


def _in_order(references: dict[int, str]) -> tuple[str, ...]:
    return tuple(text_id for _, text_id in sorted(references.items()))
