"""Judges candidates by the conditions of a question: yes, no, or unsure where the map cannot tell."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING

from supermap_cli.errors import QueryError
from supermap_cli.geometry.boxes import Reach
from supermap_cli.language.questions import (
    And,
    Anything,
    Between,
    Condition,
    Directed,
    Distant,
    Except,
    Happened,
    Having,
    Not,
    Noun,
    Or,
    Related,
    Robot,
    Things,
)
from supermap_cli.query.answering.attributes import Verdict
from supermap_cli.query.answering.phrases import condition_text, things_text
from supermap_cli.query.answering.sources import Candidates
from supermap_cli.query.answering.viewpoints import between, in_direction, robot_distance_m
from supermap_cli.query.candidates import CandidateList, CandidateSource, InstanceCandidate
from supermap_cli.query.relation_matching import BASES, Basis, RelationMatcher
from supermap_cli.query.relations import REACH, box_distance_m
from supermap_cli.query.views import RelationView
from supermap_cli.relations.registry import DEFAULT

if TYPE_CHECKING:
    from supermap_cli.query.answering.things import ThingsFinder

FAR_M = DEFAULT.far_gap_m
"""What is far from a thing is so from all that its noun names: a distance, not a relation to any one of them."""

MAX_REFERENCES = 100
"""References of a direction or of "between", at most: with more, everything lies between some two."""


@dataclass(frozen=True)
class Judgement:
    """A verdict on a candidate, with the relations by which it holds, and the reason."""

    candidate: InstanceCandidate
    verdict: Verdict
    reason: str


class ConditionJudge:
    """Judges the candidates of one noun; `everything` is all that the noun names."""

    def __init__(self, finder: ThingsFinder, everything: CandidateSource, noun: Noun) -> None:
        self.finder = finder
        self.everything = everything
        self.noun = noun
        self._bases: dict[Related, tuple[RelationMatcher, Basis]] = {}
        self._references: dict[Things, Candidates] = {}
        self._excepted: dict[Things, set[int]] = {}

    def all_of(self, conditions: Sequence[Condition], batch: Candidates) -> list[Judgement]:
        """Candidates judged by all of the conditions: "no" by any of them, else "unsure" by any, else "yes". Later
        conditions are not judged for those that an earlier one denies.
        """
        judgements = {candidate.key: Judgement(candidate, "yes", "") for candidate in batch}
        for condition in conditions:
            open_ones = [judgement.candidate for judgement in judgements.values() if judgement.verdict != "no"]
            for judgement in self.judge(condition, open_ones):
                before = judgements[judgement.candidate.key]
                stays_unsure = judgement.verdict == "yes" and before.verdict == "unsure"
                now = replace(before, candidate=judgement.candidate) if stays_unsure else judgement
                judgements[judgement.candidate.key] = now
        self._trace(conditions, judgements.values())
        return list(judgements.values())

    def judge(  # noqa: PLR0911 - one case a kind of condition
        self, condition: Condition, batch: Candidates
    ) -> list[Judgement]:
        """Candidates judged by one condition."""
        match condition:
            case And(conditions):
                return self.all_of(conditions, batch)
            case Or(conditions):
                return self._any_of(conditions, batch)
            case Not(negated):
                return self._negated(negated, batch)
            case Except(things):
                return self._except(things, batch)
            case Having(attribute):
                readings = self.finder.attributes.readings(batch, attribute, self.noun, self.everything)
                judged = zip(batch, readings, strict=True)
                return [Judgement(candidate, reading.verdict, reading.reason) for candidate, reading in judged]
            case Related("far from", reference):
                return self._distant(Distant(FAR_M, farther=True, reference=reference), batch)
            case Related():
                return self._related(condition, batch)
            case Distant():
                return self._distant(condition, batch)
            case Directed():
                return self._directed(condition, batch)
            case Between():
                return self._between(condition, batch)
            case Happened():
                return self._happened(condition, batch)

    def _any_of(self, conditions: Sequence[Condition], batch: Candidates) -> list[Judgement]:
        """Candidates judged by any of the conditions: "yes" by one, else "unsure" by one, else "no"."""
        order = {"no": 0, "unsure": 1, "yes": 2}
        best = {candidate.key: Judgement(candidate, "no", "") for candidate in batch}
        for condition in conditions:
            for judgement in self.judge(condition, batch):
                key = judgement.candidate.key
                if order[judgement.verdict] > order[best[key].verdict] or not best[key].reason:
                    best[key] = judgement
                elif judgement.verdict == "yes":
                    both = best[key].candidate.relations + judgement.candidate.relations
                    best[key] = replace(best[key], candidate=replace(best[key].candidate, relations=both))
        return list(best.values())

    def _negated(self, condition: Condition, batch: Candidates) -> list[Judgement]:
        turned: dict[Verdict, Verdict] = {"yes": "no", "no": "yes", "unsure": "unsure"}
        by_key = {candidate.key: candidate for candidate in batch}
        return [
            Judgement(by_key[judgement.candidate.key], turned[judgement.verdict], judgement.reason)
            for judgement in self.judge(condition, batch)
        ]

    def _except(self, things: Things, batch: Candidates) -> list[Judgement]:
        if things not in self._excepted:
            found = chain.from_iterable(self.finder.source(things).batches())
            self._excepted[things] = {candidate.instance.number for candidate in found}
        excepted = self._excepted[things]
        return [
            Judgement(
                candidate, "no" if candidate.instance.number in excepted else "yes", condition_text(Except(things))
            )
            for candidate in batch
        ]

    def _happened(self, condition: Happened, batch: Candidates) -> list[Judgement]:
        from supermap_cli.query.answering.happenings import happened_to  # noqa: PLC0415 - most questions compare nothing

        told = happened_to(self.finder.asking, batch, condition.event, condition.when)
        return [Judgement(candidate, verdict, reason) for candidate, (verdict, reason) in zip(batch, told, strict=True)]

    # -- relations

    def _related(self, related: Related, batch: Candidates) -> list[Judgement]:
        if isinstance(related.reference.noun, Robot):
            return self._near_robot(related, batch)
        if related.inverse:
            kept = self._inverse(related, batch)
        else:
            matcher, basis = self._matcher(related)
            kept = {candidate.key: candidate for candidate in matcher.with_all_relations(batch, basis)}
        reason = condition_text(related)
        return [
            Judgement(
                replace(kept[candidate.key], relations=candidate.relations + kept[candidate.key].relations),
                "yes",
                reason,
            )
            if candidate.key in kept
            else Judgement(candidate, "no", f"not {reason}")
            for candidate in batch
        ]

    def _matcher(self, related: Related) -> tuple[RelationMatcher, Basis]:
        """The matcher of a relation, and what decides it."""
        if related not in self._bases:
            matcher = self.finder.matcher(related)
            first = next(iter(matcher.matches(self.everything)), None)
            self._bases[related] = matcher, BASES[-1] if first is None else first[0]
        return self._bases[related]

    def _inverse(self, related: Related, batch: Candidates) -> dict[tuple[int, int], InstanceCandidate]:
        """The candidates to which a reference stands in the relation."""
        finder = self.finder
        matcher = finder.matcher_to(related.relation, CandidateList(batch))
        views: dict[str, list[RelationView]] = defaultdict(list)
        for _, reference in matcher.matches(finder.source(related.reference)):
            for view in reference.relations:
                views[view.object].append(view)
        return {
            candidate.key: replace(candidate, relations=tuple(dict.fromkeys(views[candidate.instance.id])))
            for candidate in batch
            if candidate.instance.id in views
        }

    def _near_robot(self, related: Related, batch: Candidates) -> list[Judgement]:
        if related.relation not in {"near", "beside"}:
            raise QueryError(
                f"the map knows the robot's last place only, not what is {related.relation} it",
                cure="ask what is near it, or how far something is from it",
            )
        return self._distances(batch, REACH["near"].floor_m, robot_distance_m(self.finder.asking), farther=False)

    # -- distances

    def _distant(self, condition: Distant, batch: Candidates) -> list[Judgement]:
        reference = condition.reference
        if reference is None or isinstance(reference.noun, Robot):
            distance_m = robot_distance_m(self.finder.asking)
            return self._distances(batch, condition.metres, distance_m, farther=condition.farther)
        nearest = self._nearest_within(reference, condition.metres, batch)
        numbers = {candidate.instance.number for candidate in batch} if isinstance(self.noun, Anything) else set[int]()
        own = {each.instance.number for each in self.finder.references(reference).with_numbers(numbers)}
        judged = []
        for candidate in batch:
            if candidate.instance.number in own:
                judged.append(Judgement(candidate, "no", "it is what the distance is from"))
                continue
            view = nearest.get(candidate.key)
            if view is None:
                reason, verdict = f"nothing of it within {condition.metres:g} m", condition.farther
            else:
                reason, verdict = f"{view.distance_m:.2f} m from {view.object}", not condition.farther
            told = candidate if view is None else replace(candidate, relations=(*candidate.relations, view))
            judged.append(Judgement(told, "yes" if verdict else "no", reason))
        return judged

    def _nearest_within(
        self, reference: Things, metres: float, batch: Candidates
    ) -> dict[tuple[int, int], RelationView]:
        """The nearest reference within a distance of each candidate that has one."""
        source = self.finder.references(reference)
        pairs = self.finder.reader.search.near(
            {candidate.instance.number for candidate in batch}, Reach(metres, metres)
        )
        around: dict[int, set[int]] = defaultdict(set)
        for here, there in pairs:
            around[here].add(there)
        others = source.with_numbers({number for numbers in around.values() for number in numbers})
        by_number = {other.instance.number: other for other in others}
        found = {}
        for candidate in batch:
            near = [by_number[number] for number in around[candidate.instance.number] if number in by_number]
            distances = [(box_distance_m(candidate.state.box, other.state.box), other) for other in near]
            distance_m, other = min(distances, key=lambda pair: (pair[0], pair[1].key), default=(metres, None))
            if other is not None and distance_m <= metres:
                found[candidate.key] = measured_relation("within", candidate, other.instance.id, distance_m)
        return found

    def _distances(
        self, batch: Candidates, metres: float, distance_m: Callable[[InstanceCandidate], float], *, farther: bool
    ) -> list[Judgement]:
        """Candidates judged by their distance from the robot."""
        judged = []
        for candidate in batch:
            away_m = distance_m(candidate)
            verdict: Verdict = "yes" if (away_m > metres) == farther else "no"
            view = measured_relation("near", candidate, "robot", away_m)
            judged.append(
                Judgement(
                    replace(candidate, relations=(*candidate.relations, view)) if verdict == "yes" else candidate,
                    verdict,
                    f"{away_m:.2f} m from the robot at its last pose",
                )
            )
        return judged

    # -- directions

    def _directed(self, condition: Directed, batch: Candidates) -> list[Judgement]:
        references = self._reference_list(condition.reference)
        return [
            _judged(candidate, in_direction(self.finder, condition, candidate, references), condition)
            for candidate in batch
        ]

    def _between(self, condition: Between, batch: Candidates) -> list[Judgement]:
        first = self._reference_list(condition.first)
        second = first if condition.second is None else self._reference_list(condition.second)
        return [_judged(candidate, between(candidate, first, second), condition) for candidate in batch]

    def _reference_list(self, things: Things) -> Candidates:
        if things not in self._references:
            found: Candidates = []
            for batch in self.finder.source(things).batches():
                found += batch
                if len(found) > MAX_REFERENCES:
                    raise QueryError(
                        f"there are more than {MAX_REFERENCES} of '{things_text(things, article=False)}' to look from",
                        cure="name one of them by its id",
                    )
            self._references[things] = found
        return self._references[things]

    def _trace(self, conditions: Sequence[Condition], judgements: Iterable[Judgement]) -> None:
        trace = self.finder.asking.trace
        if trace is None:
            return
        for judgement in judgements:
            reason = judgement.reason or "named so" + ("" if not conditions else ", and fulfils all conditions")
            unsure = "" if judgement.verdict != "unsure" else "nobody can say: "
            trace.add(judgement.candidate.instance.id, f"{unsure}{reason}", kept=judgement.verdict == "yes")


def measured_relation(name: str, candidate: InstanceCandidate, other: str, distance_m: float) -> RelationView:
    """A relation that was measured between boxes, as a view."""
    return RelationView(
        name=name,
        subject=candidate.instance.id,
        object=other,
        basis="boxes",
        stored_as=None,
        since_ns=candidate.state.first_seen_ns,
        until_ns=None,
        distance_m=round(distance_m, 4),
        confidence=round(candidate.state.confidence, 4),
    )


def _judged(candidate: InstanceCandidate, views: tuple[RelationView, ...], condition: Condition) -> Judgement:
    if not views:
        return Judgement(candidate, "no", f"not {condition_text(condition)}")
    reason = f"{views[0].name} {views[0].object}, {views[0].distance_m:.2f} m away"
    return Judgement(replace(candidate, relations=(*candidate.relations, *views)), "yes", reason)
