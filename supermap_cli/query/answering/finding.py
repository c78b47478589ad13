"""Which things there are, where, how many, and whether there are any."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from supermap_cli.errors import QueryError
from supermap_cli.language.questions import (
    And,
    Anything,
    Between,
    Condition,
    Count,
    Directed,
    Except,
    Exists,
    Find,
    Happened,
    Having,
    Not,
    Or,
    Related,
    Robot,
    Things,
    Union,
    Usable,
)
from supermap_cli.language.times import Now
from supermap_cli.query.answering.conditions import Judgement
from supermap_cli.query.answering.document import NearMiss, Reply, Truth
from supermap_cli.query.answering.listing import Lister
from supermap_cli.query.answering.nouns import noun_text
from supermap_cli.query.answering.phrases import (
    EVENT_VERBS,
    PARTICIPLES,
    capitalised,
    condition_text,
    counted,
    head_text,
    listing,
    lowered,
    plural,
    short_list,
    superlative_text,
    things_text,
    time_phrase,
    verb,
)
from supermap_cli.query.answering.places import places
from supermap_cli.query.answering.ranking import value_text
from supermap_cli.query.answering.things import Found, ThingsFinder, conditions_of
from supermap_cli.query.views import InstanceView

MAX_PLACED = 12
"""Things whose places one sentence tells."""
MAX_NAMED = 20
"""Ids that one sentence lists."""
MAX_GROUPS = 4
"""References that one sentence tells apart."""


def find(finder: ThingsFinder, question: Find, when: str) -> Reply:
    """Which things, and where."""
    if isinstance(question.things.noun, Robot):
        return _robot(finder, question.things)
    things, lister = question.things, Lister(finder)
    found = finder.find(things)
    instances = lister.views(found.candidates)
    uncertain = lister.uncertain(things, instances, counting=False)
    lister.note_uncertain(uncertain)
    nearest = () if instances else lister.nearest(things, found.dropped)
    if instances:
        finder.asking.note(*_without_match(finder, things, when))
    sentence = (
        _found_sentence(finder, things, instances, found, when, place=question.place)
        if instances
        else missing_sentence(finder, things, () if found.unsure else nearest, when)
    )
    return Reply(
        "find",
        sentence + unsure_text(found.unsure),
        instances,
        nearest,
        lister.asked_relation(things),
        more=found.more,
        measures=finder.measurements(),
    )


def _robot(finder: ThingsFinder, things: Things) -> Reply:
    """Where the robot was last. Raises `QueryError` for another time, or where no pose of it is known."""
    position = finder.asking.robot_position
    if position is None or things != Things(Robot()) or finder.selector.kind not in {"now", "last"}:
        raise QueryError("of the robot only its last place is known", cure="ask 'where are you'")
    x, y, z = (float(value) for value in position)
    return Reply("find", f"The robot was last at ({x:.2f}, {y:.2f}, {z:.2f}) m, at the end of the map.", (), ())


def count(finder: ThingsFinder, question: Count, when: str) -> Reply:
    """How many."""
    things, lister = question.things, Lister(finder)
    found = finder.find(things, counting=True)
    instances = lister.views(found.candidates)
    uncertain = lister.uncertain(things, instances, counting=True)
    lister.note_uncertain(uncertain)
    nearest = () if instances else lister.nearest(things, found.dropped)
    number = found.certain
    at_most = len(instances) + (found.more or 0) + uncertain.unmatched + len(found.unsure)
    return Reply(
        "count",
        (
            _count_sentence(finder, things, instances, found, when)
            if instances and not finder.asking.is_dynamic(things.noun)
            else _dynamic_sentence(finder, found)
            if instances
            else missing_sentence(finder, things, nearest, when)
        )
        + unsure_text(found.unsure),
        instances,
        nearest,
        lister.asked_relation(things),
        more=found.more,
        count=number,
        count_at_most=at_most if at_most > number else None,
    )


def exists(finder: ThingsFinder, question: Exists, when: str) -> Reply:
    """Whether there are any, or as many as asked for."""
    if members := each_of(question.things):
        return _each_exists([exists(finder, replace(question, things=member), when) for member in members])
    things, lister = question.things, Lister(finder)
    wanted = things.number or 1
    found = finder.find(things, counting=wanted > 1 or things.quantity == "only")
    instances = lister.views(found.candidates)
    uncertain = lister.uncertain(things, instances, counting=False)
    lister.note_uncertain(uncertain)
    nearest = () if instances else lister.nearest(things, found.dropped)
    negated = things.quantity == "no"
    verdict = _existence(finder, things, found, wanted, uncertain=bool(uncertain.count), nearest=nearest)
    if instances:
        sentence = _found_sentence(finder, things, instances, found, when, place=False)
    else:
        sentence = missing_sentence(finder, things, nearest, when)
    if negated and verdict != "unknown":
        verdict = "no" if verdict == "yes" else "yes"
    if isinstance(finder.asked_time, Now) and instances and finder.asking.is_dynamic(things.noun):
        verdict = "unknown"
        sentence = f"nobody is known to be here now, what moves is only known when it is seen. {sentence}"
    lead = {"yes": "Yes: ", "no": "No: ", "unknown": "Nobody can say: "}[verdict]
    return Reply(
        "exists",
        lead + lowered(sentence) + unsure_text(found.unsure),
        instances,
        nearest,
        lister.asked_relation(things),
        more=found.more,
        verdict=verdict,
    )


def _existence(
    finder: ThingsFinder, things: Things, found: Found, wanted: int, *, uncertain: bool, nearest: Sequence[NearMiss]
) -> Truth:
    """Whether so many exist. What was lost without being seen to leave, or is doubted, may be there."""
    if things.quantity == "only" and things.number is not None and found.certain > wanted:
        return "no"
    if found.certain >= wanted:
        return "yes"
    if found.unsure or uncertain or len(found.candidates) > found.certain:
        return "unknown"
    if conditions_of(things):
        return "no"
    lost = finder.selector.kind == "now" and any(
        miss.presence == "doubted" or (miss.presence == "absent" and "not seen since" in miss.reason)
        for miss in nearest
    )
    return "unknown" if lost else "no"


def each_of(things: Things) -> tuple[Things, ...]:
    """The phrases of "a cup and a bottle on the table", each with what is said of all; nothing for other phrases."""
    if not isinstance(things.noun, Union) or not things.noun.every or things.superlative is not None:
        return ()
    members = []
    for member in things.noun.members:
        conditions = [each for each in (member.condition, things.condition) if each is not None]
        condition = And(tuple(conditions)) if len(conditions) > 1 else next(iter(conditions), None)
        members.append(replace(member, condition=condition, attributes=(*things.attributes, *member.attributes)))
    return tuple(members)


def _without_match(finder: ThingsFinder, things: Things, when: str) -> list[str]:
    """The sentences for those phrases of several that nothing matches."""
    return [
        missing_sentence(finder, member, (), when).removesuffix(".")
        for member in each_of(things)
        if not finder.find(member).candidates
    ]


def _each_exists(replies: Sequence[Reply]) -> Reply:
    """Whether all of several exist."""
    verdicts = [reply.verdict for reply in replies]
    verdict: Truth = "no" if "no" in verdicts else "unknown" if "unknown" in verdicts else "yes"
    lead = {"yes": "Yes: ", "no": "No: ", "unknown": "Nobody can say: "}[verdict]
    told = [reply.message.partition(": ")[2] for reply in sorted(replies, key=lambda each: each.verdict != verdict)]
    instances = tuple({view.id: view for reply in replies for view in reply.instances}.values())
    nearest = tuple(miss for reply in replies for miss in reply.nearest)
    return Reply("exists", lead + " ".join(told), instances, nearest, verdict=verdict)


def missing_sentence(finder: ThingsFinder, things: Things, nearest: Sequence[NearMiss], when: str) -> str:
    """The sentence for a phrase without a match: a noun that the map never held is denied, else this phrase now."""
    unknown = Lister(finder).unknown_noun(things)
    reasons = "; ".join(f"{miss.id}: {miss.reason}" for miss in nearest)
    if unknown is not None and any(miss.presence == "doubted" for miss in nearest):
        sentence = f"the map believes in no {noun_text(unknown)} any more"
    elif unknown is not None:
        none = f"nothing to {unknown.use}" if isinstance(unknown, Usable) else f"no {noun_text(unknown)}"
        sentence = f"there is {none} in the map"
    else:
        noun = head_text(things)
        subject = "nothing" if isinstance(things.noun, Anything) else f"no {noun}"
        if isinstance(things.noun, Usable):
            subject = f"nothing to {things.noun.use}"
        if things.superlative is not None:
            subject = f"no {superlative_text(things.superlative)} {noun}"
        sentence = f"{subject} {_told(things, finder)}{'' if _happened(things) else time_phrase(when)}"
    return capitalised(sentence) + (f" ({reasons})." if reasons else ".")


def _told(things: Things, finder: ThingsFinder) -> str:
    """What is not so of a phrase without a match."""
    match things.condition:
        case None:
            return "is known"
        case Happened(event, _):
            return f"is known to have {PARTICIPLES[event]}"
        case condition:
            return clause_text(condition, 1, past=finder.selector.kind != "now")


def unsure_text(unsure: Sequence[Judgement]) -> str:
    """What may match, and why nobody can say."""
    if not unsure:
        return ""
    by_reason: dict[str, list[str]] = {}
    for each in unsure:
        by_reason.setdefault(each.reason, []).append(each.candidate.instance.id)
    groups = [(short_list(ids, MAX_GROUPS), reason) for reason, ids in by_reason.items()]
    told = "; ".join(f"{ids}: {reason}" for ids, reason in groups[:MAX_PLACED])
    more = f"; and {len(groups) - MAX_PLACED} more" if len(groups) > MAX_PLACED else ""
    return f" Nobody can say of {told}{more}."


def _found_sentence(
    finder: ThingsFinder, things: Things, instances: tuple[InstanceView, ...], found: Found, when: str, *, place: bool
) -> str:
    past = finder.selector.kind != "now"
    if finder.asking.is_dynamic(things.noun):
        return _dynamic_sentence(finder, found)
    if things.superlative is not None:
        return _superlative_sentence(finder, things, instances, found, past=past)
    if (place and things.condition is None) or not conditions_of(things):
        placed = _placed_sentence(finder, things, found, when, past=past) if place or len(instances) == 1 else None
        if placed is not None:
            return placed
    return _related_sentence(things, instances, found, when, past=past)


def _placed_sentence(finder: ThingsFinder, things: Things, found: Found, when: str, *, past: bool) -> str | None:
    """Each thing with its place: "cup-1 stands on desk-1"."""
    newest = {candidate.instance.number: candidate for candidate in found.candidates}
    if not 0 < len(newest) <= MAX_PLACED or found.more != 0:
        return None
    told = places(finder.asking, list(newest.values()), finder.selector)
    parts = []
    for number, candidate in sorted(newest.items()):
        x, y, z = (float(value) for value in candidate.state.centroid_map)
        at = f"at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        parts.append((candidate.instance.id, f"{told[number]}, {at}" if number in told else at))
    if len(parts) == 1:
        stand = verb("stand", 1, past=past)
        return f"{parts[0][0]} {stand} {parts[0][1]}{time_phrase(when)}."
    lead = f"{counted(len(parts), head_text(things))} {verb('is', len(parts), past=past)} known{time_phrase(when)}"
    return capitalised(f"{lead}: {'; '.join(f'{text_id} {place}' for text_id, place in parts)}.")


def _dynamic_sentence(finder: ThingsFinder, found: Found) -> str:
    """People and animals: when and where each was seen; they are not said to be anywhere now."""
    newest = {candidate.instance.number: candidate for candidate in found.candidates}
    shown = list(newest.values())[:MAX_PLACED]
    told, clock = places(finder.asking, shown, finder.selector), finder.asking.clock
    parts = []
    for candidate in shown:
        state = candidate.state
        place = told.get(candidate.instance.number)
        times = f"{clock.text(state.first_seen_ns)} to {clock.text(state.last_seen_ns)}"
        parts.append(f"{candidate.instance.id} from {times}{f', {place}' if place else ''}")
    more = len(newest) - len(shown) + (found.more or 0)
    labels = {candidate.instance.label for candidate in newest.values()}
    noun = labels.pop() if len(labels) == 1 else "living being"
    were = verb("is", len(newest), past=True)
    lead = f"{counted(len(newest) + (found.more or 0), noun)} {were} seen"
    return capitalised(f"{lead}: {'; '.join(parts)}{f'; and {more} more' if more else ''}.")


def _related_sentence(
    things: Things, instances: tuple[InstanceView, ...], found: Found, when: str, *, past: bool
) -> str:
    """How many there are, with their condition and ids: "Two cups stand on desk-1: cup-1 and cup-2."."""
    certain = [view for view in instances if view.presence != "unknown"]
    number = len(certain) + (found.more or 0)
    clause, ids = _clause(things, instances, found, max(number, 1), past=past)
    rest = f"{'' if _happened(things) else time_phrase(when)}{_basis_text(instances)}"
    if len(instances) == 1 and certain and found.more == 0:
        return f"{instances[0].id} {clause.replace(' known that is ', ' ', 1)}{rest}."
    noun = counted(number, head_text(things)) + ("" if found.more is not None else " and more")
    lead = f"{noun} {clause}" if certain else "perhaps"
    return capitalised(f"{lead}{rest}: {ids}.")


def _count_sentence(
    finder: ThingsFinder, things: Things, instances: tuple[InstanceView, ...], found: Found, when: str
) -> str:
    past = finder.selector.kind != "now"
    clause, ids = _clause(things, instances, found, found.certain, past=past)
    noun = counted(found.certain, head_text(things))
    return capitalised(f"{noun} {clause}{time_phrase(when)}{_basis_text(instances)}: {ids}.")


def _clause(
    things: Things, instances: tuple[InstanceView, ...], found: Found, number: int, *, past: bool
) -> tuple[str, str]:
    """What is said of the things, and their ids, by the reference of each where they have different ones."""
    pairs = _own_relations(things, instances)
    more = ", and more" if found.more is None else ""
    ids = _ids(instances, found, more)
    if pairs is None:
        if things.condition is None:
            return f"{verb('is', number, past=past)} in the map", ids
        return clause_text(things.condition, number, past=past), ids
    by_place: dict[str, list[str]] = {}
    for text_id, place in pairs.items():
        by_place.setdefault(place, []).append(text_id)
    stand = verb("stand", number, past=past)
    if len(by_place) == 1:
        return f"{stand} {next(iter(by_place))}", ids
    related = next(each for each in conditions_of(things) if isinstance(each, Related | Directed | Between))
    split = len(by_place) <= MAX_GROUPS and len(instances) <= MAX_NAMED and not found.more and found.more is not None
    grouped = "; ".join(f"{listing(names)} {place}" for place, names in by_place.items())
    return f"{stand} {condition_text(related)}", grouped if split else ids


def _happened(things: Things) -> bool:
    return isinstance(things.condition, Happened)


def clause_text(condition: Condition, number: int, *, past: bool) -> str:
    """What a condition says of its subject: "is on a desk", "are known that moved"."""
    is_or_are = verb("is", number, past=past)
    match condition:
        case Happened(event, _):
            return f"{verb('is', number, past=True)} seen" if event == "seen" else EVENT_VERBS[event]
        case Not(Related(inverse=True) | Or((Related(inverse=True), *_))) | Except():
            return f"{is_or_are} known {condition_text(condition)}"
        case Or((Related("on", reference, True), *_, Related("at", _, True))):
            have = "had" if past else "has" if number == 1 else "have"
            return f"{have} {things_text(reference)} on, in or at {'it' if number == 1 else 'them'}"
        case Not() | And() | Or() | Having():
            return f"{is_or_are} known that {verb('is', number, past=past)} {condition_text(condition)}"
        case Related(relation, reference, True):
            have = ("had" if past else "has") if number == 1 else ("had" if past else "have")
            return f"{have} {things_text(reference)} {relation} {'it' if number == 1 else 'them'}"
        case _:
            return f"{is_or_are} {condition_text(condition)}"


def is_carrying(condition: Condition) -> bool:
    """Whether a condition says what things have on, in or at them."""
    match condition:
        case Related(inverse=True) | Or((Related("on", _, True), *_, Related("at", _, True))):
            return True
    return False


def _own_relations(things: Things, instances: Sequence[InstanceView]) -> dict[str, str] | None:
    """The place of each thing by its id: "on desk-1"; `None` where the phrase has not one relation that tells it."""
    conditions = [each for each in conditions_of(things) if not isinstance(each, Having)]
    if len(conditions) != 1 or not isinstance(conditions[0], Related | Directed | Between):
        return None
    told = {}
    for view in instances:
        own = list(dict.fromkeys((each.name, each.object) for each in view.relations if each.subject == view.id))
        if not own or (len(own) > 1 and isinstance(conditions[0], Between)):
            return None
        name = "in" if own[0][0] == "inside" else own[0][0]
        others = listing(["the robot" if other == "robot" else other for _, other in own[:MAX_GROUPS]])
        told[view.id] = f"{name} {others}{' and more' if len(own) > MAX_GROUPS else ''}"
    return told


def _superlative_sentence(
    finder: ThingsFinder, things: Things, instances: tuple[InstanceView, ...], found: Found, *, past: bool
) -> str:
    assert things.superlative is not None  # noqa: S101 - its caller has asked
    rank, noun = superlative_text(things.superlative), head_text(things)
    measures = finder.asking.measures
    told = [f"{view.id} ({value_text(measures[view.id], finder)})" for view in instances if view.id in measures]
    rest = "" if things.condition is None else f" {condition_text(things.condition)}"
    is_or_are = verb("is", len(told), past=past)
    if found.tied:
        return capitalised(
            f"{listing(told)} tie: they {is_or_are} the {rank} {plural(noun)}{rest}, by what the map measures."
        )
    most = f"{rank} {noun}" if len(told) == 1 else f"{counted(len(told), noun).replace(' ', f' {rank} ', 1)}"
    return f"{listing(told)} {is_or_are} the {most}{rest}."


def _ids(instances: Sequence[InstanceView], found: Found, more: str) -> str:
    certain = [view.id for view in instances if view.presence != "unknown"]
    uncertain = [view.id for view in instances if view.presence == "unknown"]
    shown = certain[:MAX_NAMED]
    left = len(certain) - len(shown) + (found.more or 0)
    text = f"{', '.join(shown)} and {left} more" if left else listing(shown)
    if uncertain:
        perhaps = f"perhaps {listing(uncertain[:MAX_NAMED])}"
        text = f"{text}; {perhaps}" if text else perhaps
    return text + more


def _basis_text(instances: Sequence[InstanceView]) -> str:
    """Says where no edge of the graph decided a relation that the graph stores."""
    relations = [relation for view in instances for relation in view.relations]
    stored = {"near", "beside", "on", "under", "inside", "above", "attached to"}
    by_boxes = relations and all(relation.basis == "boxes" and relation.name in stored for relation in relations)
    return " (judged by their boxes; no such relation is stored)" if by_boxes else ""
