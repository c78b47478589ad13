"""Finds the things of a noun phrase, for one time: candidates by label or id, judged by attributes and conditions.

A phrase of a noun, alone or in one relation, is answered through the indexes of the map, and its matches are counted
there where that can be done; anything else is judged batch by batch.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

from supermap_cli.geometry.boxes import Reach
from supermap_cli.language.questions import (
    And,
    Anything,
    Attribute,
    Condition,
    Distant,
    Having,
    Identified,
    Noun,
    Or,
    Related,
    Robot,
    Superlative,
    Things,
    Union,
)
from supermap_cli.language.times import Time
from supermap_cli.memory.instance_search import SizeMeasure
from supermap_cli.query.answering.asking import Asking
from supermap_cli.query.answering.attributes import AttributeReader
from supermap_cli.query.answering.conditions import ConditionJudge, Judgement
from supermap_cli.query.answering.document import Measurement
from supermap_cli.query.answering.ranking import ranked
from supermap_cli.query.answering.sources import Candidates, DynamicSource, FilteredSource, UnionSource
from supermap_cli.query.candidates import (
    CandidateList,
    CandidateSource,
    InstanceCandidate,
    LabelCandidates,
    MatchCount,
)
from supermap_cli.query.relation_matching import Basis, RelationMatcher
from supermap_cli.query.time_selector import TimeSelector
from supermap_cli.types.labels import DYNAMIC_CLASSES

AT_ONE_PLACE = frozenset({"on", "inside", "attached to"})
"""Relations that a thing is in to one other thing: "on the desk and the table" asks for what is on either."""
SIZE_MEASURES: dict[str, SizeMeasure] = {
    "large": "volume",
    "small": "volume",
    "tall": "height",
    "low": "height",
    "wide": "width",
    "narrow": "width",
}
MAX_TIED = 50
"""Things of the same size that are told to tie, at most."""
SEARCH_REACHES_M = (2.0, 8.0, 32.0)
"""Distances (m) within which the closest is looked for, one after the other, before all are measured."""
MAX_DROPPED = 3
"""Things that the conditions deny, told where nothing matches."""


@dataclass(frozen=True)
class Found:
    """The listed candidates with all their relations, the number of further matches (`more`, `None`: not counted), how
    many of all matches are known to have been present (`certain`), and those of which the map cannot tell whether they
    match (`unsure`, with the reason). `tied` are the ones between which a superlative could not choose; `dropped` are a
    few that the conditions deny, where nothing matches.
    """

    candidates: Candidates
    more: int | None
    certain: int
    unsure: tuple[Judgement, ...] = ()
    tied: tuple[str, ...] = ()
    dropped: tuple[Judgement, ...] = ()


class ThingsFinder:
    """Finds things in the states that one time selector picks."""

    def __init__(self, asking: Asking, selector: TimeSelector, asked_time: Time | None = None) -> None:
        self.asking = asking
        self.asked_time = asked_time
        self.reader = asking.reader
        self.selector = selector
        self.attributes = AttributeReader(asking)

    # -- sources

    def named(  # noqa: PLR0911 - one case a kind of noun
        self, noun: Noun, *, as_reference: bool = False, any_state: bool = False
    ) -> CandidateSource:
        """The candidates that a noun names, whatever else is said of them."""
        match noun:
            case Union(members):
                parts = (self.source(member, as_reference=as_reference, any_state=any_state) for member in members)
                return UnionSource(tuple(parts))
            case Robot():
                return CandidateList([])
            case Anything():
                return LabelCandidates(self.reader, self.selector, None, None, as_reference, any_state)
            case Identified(text_id):
                instance = self.asking.instance(text_id)
                if instance is None:
                    return CandidateList([])
                if instance.label in DYNAMIC_CLASSES:
                    return DynamicSource(self.reader, self.selector, DYNAMIC_CLASSES, instance.number)
                return LabelCandidates(self.reader, self.selector, None, instance.number, as_reference, any_state)
            case _:
                match = self.asking.labels(noun)
                if match.dynamic and match.labels:
                    return DynamicSource(self.reader, self.selector, match.labels)
                return LabelCandidates(self.reader, self.selector, match.labels, None, as_reference, any_state)

    def source(self, things: Things, *, as_reference: bool = False, any_state: bool = False) -> CandidateSource:
        """The candidates for a whole noun phrase."""
        source = self.named(things.noun, as_reference=as_reference, any_state=any_state)
        conditions = conditions_of(things)
        if things.superlative is not None:
            return CandidateList(list(self._superlative(things, source, conditions).candidates))
        relation, others = self._driving_relation(conditions)
        if relation is not None:
            source = self.matcher(relation).restrict(source)
        return self._filtered(things.noun, source, others) if others else source

    def references(self, things: Things) -> CandidateSource:
        """The candidates that others may be related to."""
        return self.source(things, as_reference=True)

    def matcher(self, related: Related) -> RelationMatcher:
        """The matcher of a relation to its references."""
        return self.matcher_to(related.relation, self.references(related.reference))

    def matcher_to(self, relation: str, references: CandidateSource) -> RelationMatcher:
        """The matcher of a relation to these references."""
        return RelationMatcher(self.reader, self.selector, relation, references, self.asking.relations)

    def judge(self, noun: Noun) -> ConditionJudge:
        """Judges candidates of a noun by conditions."""
        return ConditionJudge(self, self.named(noun), noun)

    # -- finding

    def find(self, things: Things, *, counting: bool = False) -> Found:
        """The matches of a phrase, at most `limit` of them listed. All are counted if `counting`, or if the label index
        gives their number.
        """
        source, conditions = self.named(things.noun), conditions_of(things)
        if things.superlative is not None:
            return self._superlative(things, source, conditions)
        relation, others = self._driving_relation(conditions)
        if others or not isinstance(source, LabelCandidates) or self.asking.trace is not None:
            return self._find_judged(things.noun, source, conditions, counting=counting)
        return self._find_indexed(source, None if relation is None else self.matcher(relation), counting=counting)

    def _find_indexed(self, source: LabelCandidates, matcher: RelationMatcher | None, *, counting: bool) -> Found:
        """A noun, alone or in one relation."""
        count = self._count(source, matcher, counting=counting)
        limit = self.asking.limit
        numbers: set[int] = set()
        listed: dict[int, Basis] = {}
        certain, complete = 0, True
        for basis, candidate in _matches(source, matcher):
            number = candidate.instance.number
            if number in numbers:
                continue
            if len(listed) == limit and (count is not None or not counting):
                complete = False
                break
            numbers.add(number)
            certain += self._is_certain(candidate)
            if len(listed) < limit:
                listed[number] = basis
        candidates = source.with_numbers(listed)
        if matcher is not None and listed:
            candidates = matcher.with_all_relations(candidates, next(iter(listed.values())))
        if count is not None and not complete:
            return Found(candidates, count.total - len(listed), count.certain)
        return Found(candidates, len(numbers) - len(listed) if complete else None, certain)

    def _find_judged(
        self, noun: Noun, source: CandidateSource, conditions: tuple[Condition, ...], *, counting: bool
    ) -> Found:
        """Any other phrase: its candidates judged batch by batch."""
        judge = ConditionJudge(self, source, noun)
        source = self._within_reach(source, conditions)
        listed: dict[int, Candidates] = {}
        unsure: dict[int, Judgement] = {}
        dropped: dict[int, Judgement] = {}
        numbers: set[int] = set()
        certain, complete = 0, True
        for batch in source.batches():
            for judgement in judge.all_of(conditions, batch):
                candidate, number = judgement.candidate, judgement.candidate.instance.number
                if judgement.verdict == "no" and len(dropped) < MAX_DROPPED:
                    dropped[number] = judgement
                if judgement.verdict == "unsure":
                    unsure.setdefault(number, judgement)
                if judgement.verdict != "yes":
                    continue
                certain += number not in numbers and self._is_certain(candidate)
                numbers.add(number)
                if number in listed or len(listed) < self.asking.limit:
                    listed.setdefault(number, []).append(candidate)
            if len(numbers) > self.asking.limit and not counting and self.asking.trace is None:
                complete = False
                break
        candidates = [candidate for _, of_one in sorted(listed.items()) for candidate in of_one]
        kept = tuple(judgement for number, judgement in sorted(unsure.items()) if number not in numbers)
        denied = () if numbers else tuple(dropped.values())
        return Found(candidates, len(numbers) - len(listed) if complete else None, certain, kept, dropped=denied)

    def _superlative(self, things: Things, source: CandidateSource, conditions: tuple[Condition, ...]) -> Found:
        """The one that a superlative chooses among those that fulfil the conditions; several where they tie."""
        assert things.superlative is not None  # noqa: S101 - callers have asked
        judge = ConditionJudge(self, source, things.noun)
        number, anything = things.number or 1, isinstance(things.noun, Anything)
        before = dict(self.asking.measures)
        extremes = () if conditions else self._extremes(source, things.superlative, number)
        for part, reach_m in extremes or self._nearest_first(source, things.superlative):
            self.asking.measures = dict(before)
            fulfilling = [
                judgement.candidate
                for batch in part.batches()
                for judgement in judge.all_of(conditions, batch)
                if judgement.verdict == "yes"
            ]
            chosen = ranked(self, fulfilling, things.superlative, number, anything=anything)
            if len(chosen.candidates) >= number and chosen.farthest_m <= reach_m:
                break
        certain = sum(self._is_certain(candidate) for candidate in chosen.candidates)
        return Found(chosen.candidates, 0, certain, tied=chosen.tied)

    def all_candidates(self, things: Things) -> Candidates:
        """All matches of a phrase in memory, the newest state of each."""
        newest: dict[int, InstanceCandidate] = {}
        for candidate in chain.from_iterable(self.source(things).batches()):
            before = newest.get(candidate.instance.number)
            if before is None or before.state.index < candidate.state.index:
                newest[candidate.instance.number] = candidate
        return [candidate for _, candidate in sorted(newest.items())]

    def measurements(self) -> tuple[Measurement, ...]:
        """What superlatives measured of the things that they chose."""
        return tuple(
            Measurement(text_id, "superlative", round(value.value, 4), value.unit, value.other)
            for text_id, value in self.asking.measures.items()
        )

    # -- parts

    def _within_reach(self, source: CandidateSource, conditions: tuple[Condition, ...]) -> CandidateSource:
        """The candidates that can be within the distance of a condition: found from its references where these are
        fewer.
        """
        for condition in conditions:
            if isinstance(condition, Distant) and not condition.farther and condition.reference is not None:
                references = self.references(condition.reference)
                if references.size() < source.size() and not isinstance(condition.reference.noun, Robot):
                    numbers = self._near(references, condition.metres)
                    return CandidateList(source.with_numbers(numbers))
        return source

    def _nearest_first(
        self, source: CandidateSource, superlative: Superlative
    ) -> Iterator[tuple[CandidateSource, float]]:
        """Ever more of the candidates, with the distance (m) up to which they are all; at last all of them."""
        to = superlative.to
        if superlative.measure == "near" and to is not None and not isinstance(to.noun, Robot):
            references = self.references(to)
            if references.size() < source.size():
                for reach_m in SEARCH_REACHES_M:
                    yield CandidateList(source.with_numbers(self._near(references, reach_m))), reach_m
        yield source, math.inf

    def _extremes(
        self, source: CandidateSource, superlative: Superlative, number: int
    ) -> tuple[tuple[CandidateSource, float], ...]:
        """The largest or smallest of what a noun names now, found by the database; nothing for other superlatives."""
        measure = SIZE_MEASURES.get(superlative.measure)
        plain = isinstance(source, LabelCandidates) and source.number is None and self.selector.kind == "now"
        if measure is None or not plain or self.asking.trace is not None:
            return ()
        assert isinstance(source, LabelCandidates)  # noqa: S101 - told above
        largest = superlative.measure in {"large", "tall", "wide"}
        limit = superlative.rank + number + MAX_TIED
        numbers = self.reader.search.by_size(source.labels, measure, limit, largest=largest)
        return ((CandidateList(source.with_numbers(numbers)), math.inf),)

    def _near(self, references: CandidateSource, reach_m: float) -> set[int]:
        """The instances whose boxes may be within a distance of a reference's."""
        reach = Reach(reach_m, reach_m)
        return {there for batch in references.numbers() for _, there in self.reader.search.near(batch, reach)}

    def _driving_relation(self, conditions: tuple[Condition, ...]) -> tuple[Related | None, tuple[Condition, ...]]:
        """The first relation, by which candidates are found instead of judged, and the other conditions."""
        for at, condition in enumerate(conditions):
            if (
                isinstance(condition, Related)
                and not condition.inverse
                and condition.relation != "far from"
                and not isinstance(condition.reference.noun, Robot)
            ):
                return condition, conditions[:at] + conditions[at + 1 :]
        return None, conditions

    def _filtered(self, noun: Noun, source: CandidateSource, conditions: tuple[Condition, ...]) -> CandidateSource:
        judge = ConditionJudge(self, self.named(noun), noun)

        def keep(batch: Candidates) -> Candidates:
            judgements = judge.all_of(conditions, batch)
            return [judgement.candidate for judgement in judgements if judgement.verdict == "yes"]

        return FilteredSource(source, keep)

    def _count(self, source: LabelCandidates, matcher: RelationMatcher | None, *, counting: bool) -> MatchCount | None:
        """The number of matches if the database can count them; unless `counting`, only where that is cheap."""
        if matcher is not None:
            return matcher.match_count(source) if counting else None
        return source.match_count() if counting or self.selector.kind != "at" else None

    def _is_certain(self, candidate: InstanceCandidate) -> bool:
        presence = self.selector.presence(candidate.instance)
        return presence is None or presence.value != "unknown"


def conditions_of(things: Things) -> tuple[Condition, ...]:
    """Attributes and conditions of a phrase, all of which must hold."""
    attributes: Iterable[Attribute] = things.attributes
    condition = things.condition
    parts = () if condition is None else condition.conditions if isinstance(condition, And) else (condition,)
    if len(parts) > 1 and all(isinstance(part, Related) and part.relation in AT_ONE_PLACE for part in parts):
        parts = (Or(parts),) if len({part.relation for part in parts if isinstance(part, Related)}) == 1 else parts
    return (*map(Having, attributes), *parts)


def without_conditions(things: Things) -> Things:
    """A phrase without its condition."""
    return replace(things, condition=None)


def _matches(source: LabelCandidates, matcher: RelationMatcher | None) -> Iterator[tuple[Basis, InstanceCandidate]]:
    if matcher is not None:
        return matcher.matches(source)
    return (("stored", candidate) for candidate in chain.from_iterable(source.batches()))
