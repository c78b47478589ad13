"""What changed, and where things came from or went."""

from __future__ import annotations

from collections import defaultdict
from itertools import chain, pairwise

from supermap_cli.language.questions import Anything, Changes, Identified, MovedWhere, Things
from supermap_cli.language.times import Time
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.answering.document import Reply, Truth
from supermap_cli.query.answering.finding import missing_sentence
from supermap_cli.query.answering.happenings import (
    Change,
    ChangeWindow,
    changes_of,
    of_event,
    window_of,
)
from supermap_cli.query.answering.listing import Lister
from supermap_cli.query.answering.phrases import (
    PARTICIPLES,
    capitalised,
    condition_text,
    counted,
    head_text,
    listing,
    lowered,
    short_list,
    time_phrase,
)
from supermap_cli.query.answering.places import place_of
from supermap_cli.query.answering.things import ThingsFinder, conditions_of
from supermap_cli.query.change_classification import MIN_MOVE_M, state_distance_m
from supermap_cli.query.clock import Clock
from supermap_cli.query.time_selector import TimeSelector
from supermap_cli.query.views import InstanceView
from supermap_cli.types.labels import DYNAMIC_CLASSES
from supermap_cli.types.memory import StateRecord

MAX_TOLD = 12
"""Changes of one kind that the sentence names."""
_VERBS = {
    "appeared": "appeared",
    "returned": "came back",
    "disappeared": "disappeared",
    "moved": "moved",
    "relabelled": "became another thing",
}
_PARTICIPLES = {**_VERBS, "returned": "come back", "relabelled": "become another thing"}
_OPEN_TEXT = {
    "first observed": "may be new: nobody had looked at the place before",
    "not observed again": "may have gone: nobody saw the place again well enough",
    "not looked at": "was not looked at",
    "disappeared": "disappeared, and may stand elsewhere",
}


def changes(finder: ThingsFinder, question: Changes, asked: Time | None) -> Reply:
    """What changed within a time, of all things or of some."""
    asking, lister = finder.asking, Lister(finder)
    window = window_of(asking, asked)
    asking.note(window.note)
    numbers = None if question.things is None else _concerned(finder, question.things, window)
    if numbers is not None and not numbers and question.things is not None:
        nearest = lister.nearest(question.things)
        missing = missing_sentence(finder, question.things, nearest, window.text)
        return Reply("changes", missing, (), nearest, verdict="no" if question.exists else None)
    told, undecided = of_event(changes_of(asking, window, numbers), question.events)
    happened = [change for change in told if window.certain(change)]
    perhaps = [change for change in told if not window.certain(change)]
    views = _views(lister, happened)
    sentence = "" if perhaps and not happened else _sentence(happened, question, window)
    unknown = _perhaps_text(asking.clock, perhaps) + _undecided_text(undecided, window, of_some=numbers is not None)
    verdict: Truth | None = None
    lead = ""
    if question.exists:
        verdict = "yes" if happened else "unknown" if perhaps or (undecided and numbers is not None) else "no"
        lead = {"yes": "Yes: ", "no": "No: ", "unknown": "Nobody can say: "}[verdict]
        sentence = lowered(sentence)
    elif not sentence:
        lead = "Nobody can say: "
    if window.before is None and len(asking.reader.traversals) == 1:
        asking.note(
            "the map holds one traversal: there is no earlier visit to compare it with, only what it saw happen"
        )
    undecided = perhaps + undecided
    listed = happened + (undecided if numbers is not None else [])
    return Reply(
        "changes",
        f"{lead}{sentence}{unknown if sentence else unknown.lstrip()}",
        views,
        count=len(happened) if question.count else None,
        count_at_most=len(happened) + len(undecided) if question.count and undecided else None,
        verdict=verdict,
        changes=tuple(listed),
    )


def moved_where(finder: ThingsFinder, question: MovedWhere, when: str) -> Reply:
    """Where things came from, or went to."""
    lister = Lister(finder)
    ever = ThingsFinder(finder.asking, TimeSelector("last", "last"))
    candidates = ever.all_candidates(question.things)
    if not candidates:
        nearest = lister.nearest(question.things)
        return Reply("moved where", missing_sentence(finder, question.things, nearest, when), (), nearest)
    instances = [candidate.instance for candidate in candidates]
    left = [instance for instance in instances if _last_move(instance) is not None or _is_gone(instance)]
    chosen = left or instances
    told = [
        _came_from(finder, instance) if question.what == "from" else _went_to(finder, instance)
        for instance in chosen[:MAX_TOLD]
    ]
    return Reply("moved where", f"{'; '.join(told)}.", Lister(ever).instances(chosen))


# -- changes


def _concerned(finder: ThingsFinder, things: Things, window: ChangeWindow) -> set[int]:
    """The instances that a phrase names before or after the window."""
    selectors = [TimeSelector("last", "last")]
    if conditions_of(things):
        ends_ns = [window.low_ns, window.high_ns]
        if window.before is not None and window.after is not None:
            ends_ns = [window.before.at_ns, window.after.at_ns]
        selectors = [TimeSelector("at", "then", at_ns, at_ns) for at_ns in ends_ns]
        selectors.append(TimeSelector("during", "then", window.low_ns, window.high_ns))
    found: set[int] = set()
    for selector in selectors:
        batches = ThingsFinder(finder.asking, selector).source(things).batches()
        found |= {candidate.instance.number for candidate in chain.from_iterable(batches)}
    return found


def _views(lister: Lister, happened: list[Change]) -> tuple[InstanceView, ...]:
    found = [lister.reader.instance(change.id) for change in happened[: lister.asking.limit]]
    return lister.instances({each.number: each for each in found if each is not None}.values())


def _sentence(happened: list[Change], question: Changes, window: ChangeWindow) -> str:
    if not happened:
        subject = "nothing" if question.things is None else _subject(question.things)
        if question.things is not None and isinstance(question.things.noun, Identified):
            verbs = listing([PARTICIPLES[event] for event in question.events], "or") or "changed"
            return f"{question.things.noun.id} is not known to have {verbs} {time_phrase(window.text).strip()}."
        verbs = listing([PARTICIPLES[event] for event in question.events], "or") or "changed"
        return capitalised(f"{subject} is known to have {verbs} {time_phrase(window.text).strip()}.")
    by_kind: dict[str, list[Change]] = defaultdict(list)
    for change in happened:
        by_kind[change.kind].append(change)
    parts = []
    for kind, of_kind in by_kind.items():
        ids = [_change_text(change) for change in of_kind[:MAX_TOLD]]
        more = f", and {len(of_kind) - MAX_TOLD} more" if len(of_kind) > MAX_TOLD else ""
        parts.append(f"{counted(len(of_kind), 'thing')} {_VERBS[kind]} ({', '.join(ids)}{more})")
    return (
        capitalised(f"{time_phrase(window.text).strip()}, {listing(parts)}.")
        if len(parts) > 1
        else capitalised(f"{parts[0]} {time_phrase(window.text).strip()}.")
    )


def _subject(things: Things) -> str:
    """What did not change, in words."""
    rest = "" if things.condition is None else f" {condition_text(things.condition)}"
    return f"nothing{rest}" if isinstance(things.noun, Anything) else f"no {head_text(things)}{rest}"


def _change_text(change: Change) -> str:
    distance = f" by {change.distance_m:.2f} m" if change.kind == "moved" and change.distance_m is not None else ""
    candidates = ", ".join(f"{each.id} {each.probability:.0%}" for each in change.may_be)
    return f"{change.id}{distance}{f', may be {candidates}' if candidates else ''}"


def _perhaps_text(clock: Clock, perhaps: list[Change]) -> str:
    """What happened between two times that do not both lie within the time asked for."""
    if not perhaps:
        return ""
    told = [
        f"{change.id} may have {_PARTICIPLES[change.kind]} then, some time "
        f"{clock.between(change.not_before_ns, change.not_after_ns)}"
        for change in perhaps[:MAX_TOLD]
    ]
    more = f"; and {len(perhaps) - MAX_TOLD} more" if len(perhaps) > MAX_TOLD else ""
    return f" {'; '.join(told)}{more}."


def _undecided_text(undecided: list[Change], window: ChangeWindow, *, of_some: bool) -> str:
    """What may have changed: each thing asked about; of all things, those that may be new, and between two visits
    those that may be gone.
    """
    visits = window.before is not None and window.before.traversal is not None
    kinds = {"first observed", "not observed again"} if visits else {"first observed"}
    told = [change for change in undecided if of_some or change.kind in kinds]
    if not told:
        return ""
    by_kind: dict[str, list[str]] = defaultdict(list)
    for change in told:
        by_kind[change.kind].append(change.id)
    parts = [f"{short_list(ids, MAX_TOLD)} {_OPEN_TEXT[kind]}" for kind, ids in by_kind.items()]
    return f" {'; '.join(parts)}."


# -- ways


def _last_move(instance: StoredInstance) -> tuple[StateRecord, StateRecord] | None:
    """The last two places of an instance that differ."""
    pairs = list(pairwise(instance.states))
    for old, new in reversed(pairs):
        if state_distance_m(old, new) >= MIN_MOVE_M:
            return old, new
    return None


def _is_gone(instance: StoredInstance) -> bool:
    return instance.presence == "absent"


def _came_from(finder: ThingsFinder, instance: StoredInstance) -> str:
    clock, moved = finder.asking.clock, _last_move(instance)
    if moved is not None:
        old, new = moved
        place = place_of(finder.asking, instance, old)
        metres = state_distance_m(old, new)
        return (
            f"{instance.id} came from {metres:.2f} m away, where it stood {place}; it was moved "
            f"{clock.between(old.last_seen_ns, new.first_seen_ns)}"
        )
    state = instance.states[0]
    if instance.label in DYNAMIC_CLASSES:
        return f"nobody saw where {instance.id} came from: it was first seen {clock.text(state.first_seen_ns)}"
    if state.empty_before_ns is not None:
        came = f"it appeared {clock.between(state.empty_before_ns, state.first_seen_ns)}"
        return f"nobody saw where {instance.id} came from: {came}{_candidates_text(finder, instance)}"
    return f"{instance.id} is not known to have stood anywhere else: first seen {clock.text(state.first_seen_ns)}"


def _went_to(finder: ThingsFinder, instance: StoredInstance) -> str:
    clock, state, moved = finder.asking.clock, instance.states[-1], _last_move(instance)
    if instance.presence == "absent":
        left = (
            f"it left {clock.between(state.last_seen_ns, state.gone_ns)}"
            if state.gone_ns is not None
            else f"it was last seen {clock.text(state.last_seen_ns)}"
        )
        return f"nobody saw where {instance.id} went: {left}{_candidates_text(finder, instance)}"
    if instance.label in DYNAMIC_CLASSES:
        return (
            f"{instance.id} was last seen {clock.text(state.last_seen_ns)}, {place_of(finder.asking, instance, state)}"
        )
    place = place_of(finder.asking, instance, state)
    if moved is None:
        return f"{instance.id} is not known to have moved: it stands {place}"
    old, new = moved
    metres, when = state_distance_m(old, new), clock.between(old.last_seen_ns, new.first_seen_ns)
    return f"{instance.id} went {metres:.2f} m, {when}, and stands {place}"


def _candidates_text(finder: ThingsFinder, instance: StoredInstance) -> str:
    """What it may be, or have become, by the map's links between what went and what came."""
    edges = [edge for edge in finder.reader.temporal_edges(instance.numbers) if edge.kind == "candidate"]
    ends = {number for edge in edges for number in (edge.from_number, edge.to_number)} - set(instance.numbers)
    survivors = finder.reader.survivors.of(ends)
    probabilities = {
        survivors[number]: edge.probability
        for edge in edges
        for number in (edge.from_number, edge.to_number)
        if number in survivors
    }
    names = finder.reader.text_ids.of(probabilities)
    told = [f"{names[number]} ({share:.0%})" for number, share in sorted(probabilities.items())]
    return f"; it may be {listing(told, 'or')}" if told else ""
