"""Which has most of others, whether there are more of one than of another, which is larger, and how far apart."""

from __future__ import annotations

from collections import defaultdict

from supermap_cli.errors import QueryError
from supermap_cli.language.questions import CompareCounts, CompareMeasure, HowFar, MostOf, Robot, Things
from supermap_cli.query.answering.document import Intent, Measurement, Reply, Truth
from supermap_cli.query.answering.finding import missing_sentence
from supermap_cli.query.answering.listing import Lister
from supermap_cli.query.answering.phrases import capitalised, counted, head_text, listing, plural, verb
from supermap_cli.query.answering.ranking import TIE_M, TIE_SHARE, measure_all, value_text
from supermap_cli.query.answering.sources import Candidates
from supermap_cli.query.answering.things import ThingsFinder
from supermap_cli.query.answering.viewpoints import robot_distance_m
from supermap_cli.query.candidates import CandidateList, InstanceCandidate
from supermap_cli.query.relations import box_distance_m

MAX_PAIRS = 10_000
"""Pairs of things whose distances are worked out for one question."""
MAX_TOLD = 8
"""Things that one sentence tells of."""
_COMPARATIVES = {
    "near": ("closer", "close"),
    "far": ("farther", "far"),
    "large": ("bigger", "big"),
    "small": ("smaller", "small"),
    "tall": ("taller", "tall"),
    "low": ("lower", "low"),
    "wide": ("wider", "wide"),
    "narrow": ("narrower", "narrow"),
    "new": ("newer", "new"),
    "old": ("older", "old"),
    "seen": ("seen later", "seen late"),
}
_LESS = {"near", "small", "low", "narrow", "old"}


def most_of(finder: ThingsFinder, question: MostOf, when: str) -> Reply:
    """Which thing has most (or fewest) others in a relation to it."""
    lister = Lister(finder)
    things = finder.all_candidates(question.things)
    if not things:
        return _missing(finder, "most of", question.things, when)
    matcher = finder.matcher_to(question.relation, CandidateList(things))
    members: dict[str, set[str]] = defaultdict(set)
    for _, candidate in matcher.matches(finder.source(question.counted)):
        for relation in candidate.relations:
            members[relation.object].add(relation.subject)
    counts = {candidate.instance.id: len(members[candidate.instance.id]) for candidate in things}
    best = min(counts.values()) if question.fewest else max(counts.values())
    chosen = [candidate for candidate in things if counts[candidate.instance.id] == best]
    noun, word = head_text(question.counted), "fewest" if question.fewest else "most"
    measures = tuple(Measurement(text_id, "count", float(number), "1") for text_id, number in sorted(counts.items()))
    if best == 0 and not question.fewest:
        sentence = f"No {head_text(question.things)} has a {noun} {question.relation} it."
        return Reply("most of", sentence, lister.views(()), lister.nearest(question.counted), measures=measures)
    ids = listing([candidate.instance.id for candidate in chosen[:MAX_TOLD]])
    names = sorted({name for candidate in chosen for name in members[candidate.instance.id]})
    which = f": {listing(names[:MAX_TOLD])}" if names else ""
    have = "have" if len(chosen) > 1 else "has"
    tie = f", {counted(best, noun)} each" if len(chosen) > 1 else f", {counted(best, noun)}"
    sentence = f"{ids} {have} the {word} {plural(noun)} {question.relation} {'them' if len(chosen) > 1 else 'it'}{tie}"
    lead = "A tie: " if len(chosen) > 1 else ""
    return Reply("most of", f"{lead}{sentence}{which}.", lister.views(chosen), measures=measures)


def compare_counts(finder: ThingsFinder, question: CompareCounts, when: str) -> Reply:
    """Whether there are more of one than of the other, or as many."""
    lister = Lister(finder)
    found = [finder.find(things, counting=True) for things in (question.first, question.second)]
    one, other = (each.certain for each in found)
    at_most = [each.certain + len(each.unsure) for each in found]
    if question.equal:
        holds, open_ = one == other, at_most != [one, other]
    else:
        holds = one < other if question.fewer else one > other
        open_ = (one < at_most[1] if question.fewer else at_most[0] > other) != holds
    verdict: Truth = "unknown" if open_ else "yes" if holds else "no"
    nouns = [counted(number, head_text(things)) for number, things in
             ((one, question.first), (other, question.second))]  # fmt: skip
    lead = {"yes": "Yes: ", "no": "No: ", "unknown": "Nobody can say: "}[verdict]
    same = ", as many of both" if one == other else ""
    when_text = "" if when == "now" else f" {when}"
    message = (
        f"{lead}there {verb('is', one, past=finder.selector.kind != 'now')} {nouns[0]} and {nouns[1]}{same}{when_text}."
    )
    measures = (
        Measurement(head_text(question.first), "count", float(one), "1"),
        Measurement(head_text(question.second), "count", float(other), "1"),
    )
    listed = [candidate for each in found for candidate in each.candidates]
    return Reply("compare", message, lister.views(listed), verdict=verdict, measures=measures)


def compare_measure(finder: ThingsFinder, question: CompareMeasure, when: str) -> Reply:
    """Which of two things exceeds by a measure: the larger one of each side counts."""
    lister = Lister(finder)
    sides = []
    for things in (question.first, question.second):
        candidates = finder.all_candidates(things)
        if not candidates:
            return _missing(finder, "compare", things, when)
        if len(candidates) > 1:
            ids = listing([candidate.instance.id for candidate in candidates[:MAX_TOLD]], "or")
            raise QueryError(
                f"which {head_text(things)}? There are {ids}", cure=f"name one, as in '{candidates[0].instance.id}'"
            )
        measured = measure_all(finder, candidates, question.measure, question.to)
        if not measured:
            return _missing(finder, "compare", things if question.to is None else question.to, when)
        sides.append(measured[0])
    (one, first), (other, second) = sides
    comparative, word = _COMPARATIVES[question.measure]
    tolerance = {"m": TIE_M, "m3": TIE_SHARE * max(first.value, second.value)}.get(first.unit, 0.0)
    texts = [f"{each.instance.id} ({value_text(value, finder)})" for each, value in sides]
    measures = tuple(
        Measurement(each.instance.id, question.measure, round(value.value, 4), value.unit, value.other)
        for each, value in sides
    )
    if abs(first.value - second.value) <= tolerance:
        message = f"A tie: {texts[0]} and {texts[1]} are equally {word}, by what the map measures."
        return Reply("compare", message, lister.views([one, other]), verdict="unknown", measures=measures)
    exceeds = (first.value < second.value) == (question.measure in _LESS)
    winner, loser = (0, 1) if exceeds else (1, 0)
    message = f"{texts[winner]} is {comparative} than {texts[loser]}."
    return Reply(
        "compare", message, lister.views([sides[winner][0]]), verdict="yes" if exceeds else "no", measures=measures
    )


def how_far(finder: ThingsFinder, question: HowFar, when: str) -> Reply:
    """The distances between the things of two phrases, the nearest pair first."""
    lister, first = Lister(finder), question.first
    if isinstance(first.noun, Robot) and question.second is not None:
        return how_far(finder, HowFar(question.second, first), when)
    candidates = finder.all_candidates(first)
    if not candidates:
        return _missing(finder, "distance", first, when)
    second = question.second
    if second is None or isinstance(second.noun, Robot):
        distance_m = robot_distance_m(finder.asking)
        measured = sorted(((distance_m(candidate), candidate) for candidate in candidates), key=_by_distance)
        told = listing([f"{each.instance.id} {gap:.2f} m" for gap, each in measured[:MAX_TOLD]])
        message = f"From the robot's last pose: {told}."
        measures = tuple(
            Measurement(each.instance.id, "distance", round(gap, 4), "m", "robot") for gap, each in measured
        )
        return Reply("distance", message, lister.views(each for _, each in measured), measures=measures)
    others = finder.all_candidates(second)
    if not others:
        return _missing(finder, "distance", second, when)
    return _between(finder, lister, candidates, others, (first, second))


def _between(
    finder: ThingsFinder, lister: Lister, first: Candidates, second: Candidates, phrases: tuple[Things, Things]
) -> Reply:
    if len(first) * len(second) > MAX_PAIRS:
        name = head_text(phrases[0] if len(first) > len(second) else phrases[1])
        raise QueryError(f"there are too many of '{name}' to measure them all", cure="name one of them by its id")
    pairs = sorted(
        (
            (box_distance_m(one.state.box, other.state.box), one, other)
            for one in first
            for other in second
            if one.instance.number != other.instance.number
        ),
        key=lambda pair: (pair[0], pair[1].key, pair[2].key),
    )
    if not pairs:
        raise QueryError("a distance needs two things, and the two phrases name the same one", cure="name another one")
    gap_m, one, other = pairs[0]
    centres_m = float(((one.state.box.center - other.state.box.center) ** 2).sum() ** 0.5)
    touch = "touch" if gap_m < TIE_M else f"are {gap_m:.2f} m apart"
    nearest = "closest are " if len(pairs) > 1 else ""
    together = f"{one.instance.id} and {other.instance.id}"
    touch = touch if not nearest else "which touch" if gap_m < TIE_M else f"{gap_m:.2f} m apart"
    message = f"{nearest}{together}{',' if nearest else ''} {touch} ({centres_m:.2f} m from middle to middle)"
    further = [f"{each.instance.id} and {another.instance.id} {gap:.2f} m" for gap, each, another in pairs[1:MAX_TOLD]]
    more = f"; {', '.join(further)}" if further else ""
    measures = tuple(
        Measurement(each.instance.id, "distance", round(gap, 4), "m", another.instance.id)
        for gap, each, another in pairs[: finder.asking.limit]
    )
    listed = {candidate.key: candidate for candidate in (*(pair[1] for pair in pairs), *(pair[2] for pair in pairs))}
    return Reply("distance", capitalised(f"{message}{more}."), lister.views(listed.values()), measures=measures)


def _missing(finder: ThingsFinder, intent: Intent, things: Things, when: str) -> Reply:
    nearest = Lister(finder).nearest(things)
    return Reply(intent, missing_sentence(finder, things, nearest, when), (), nearest)


def _by_distance(pair: tuple[float, InstanceCandidate]) -> tuple[float, tuple[int, int]]:
    return pair[0], pair[1].key
