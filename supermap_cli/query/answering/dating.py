"""When something was so: since when, until when, how long, how often. What nobody saw is dated by bounds."""

from __future__ import annotations

from itertools import pairwise

from supermap_cli.language.questions import When
from supermap_cli.language.times import Event, First
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.answering.document import Measurement, Reply
from supermap_cli.query.answering.finding import missing_sentence
from supermap_cli.query.answering.listing import Lister
from supermap_cli.query.answering.phrases import counted, listing
from supermap_cli.query.answering.sources import Candidates
from supermap_cli.query.answering.things import ThingsFinder
from supermap_cli.query.change_classification import MIN_MOVE_M, state_distance_m
from supermap_cli.query.clock import Clock
from supermap_cli.query.traversal_spans import SECOND_NS
from supermap_cli.types.labels import DYNAMIC_CLASSES
from supermap_cli.types.memory import StateRecord

MAX_DATED = 12
"""Things that one sentence dates."""
Told = tuple[str, list[Measurement]]


def when(finder: ThingsFinder, question: When, time_text: str) -> Reply:
    """The times of an event, or of a stay, of each of the things."""
    lister = Lister(finder)
    candidates = _relevant(finder, question)
    if not candidates:
        nearest = lister.nearest(question.things)
        return Reply("when", missing_sentence(finder, question.things, nearest, time_text), (), nearest)
    shown = candidates[:MAX_DATED]
    told = [_told(finder, question, candidate.instance) for candidate in shown]
    more = f"; and {len(candidates) - len(shown)} more" if len(candidates) > len(shown) else ""
    measures = tuple(measure for _, of_one in told for measure in of_one)
    sentence = "; ".join(text for text, _ in told)
    return Reply("when", f"{sentence}{more}.", lister.views(candidates), measures=measures)


def _relevant(finder: ThingsFinder, question: When) -> Candidates:
    """The things asked about: those to which the event happened come first, and alone if there are any."""
    candidates = finder.all_candidates(question.things)
    if question.event in {"moved", "disappeared", "returned"} and len(candidates) > 1:
        happened = [each for each in candidates if happenings(each.instance, question.event)]
        return happened or candidates
    return candidates


def _told(finder: ThingsFinder, question: When, instance: StoredInstance) -> Told:
    clock, state = finder.asking.clock, instance.states[-1]
    match question.what:
        case "at":
            return _at(finder, question.event, instance, first=isinstance(finder.asked_time, First))
        case "since":
            return f"{instance.id} {_since_text(clock, instance, state)}", [
                _time(instance, "since", state.first_seen_ns)
            ]
        case "until":
            return f"{instance.id} {_until_text(clock, instance, state)}", [
                _time(instance, "until", state.last_seen_ns)
            ]
        case "how long":
            return _how_long(finder, instance, state)
        case "how often":
            return _how_often(finder, question.event, instance)


def _at(finder: ThingsFinder, event: Event, instance: StoredInstance, *, first: bool) -> Told:
    clock = finder.asking.clock
    if event == "seen":
        stamp_ns = instance.states[0].first_seen_ns if first else max(s.last_seen_ns for s in instance.states)
        word = "first" if first else "last"
        return f"{instance.id} was {word} seen {clock.text(stamp_ns)}", [_time(instance, f"{word} seen", stamp_ns)]
    happened = happenings(instance, event)
    if event == "changed":
        happened = [each for kind in ("appeared", "moved", "disappeared") for each in happenings(instance, kind)]
    if not happened:
        return f"{instance.id} {_never_text(clock, event, instance)}", []
    told = listing([text.format(clock.between(low_ns, high_ns)) for text, low_ns, high_ns in happened])
    measures = [
        _time(instance, word, stamp_ns)
        for _, low_ns, high_ns in happened
        for word, stamp_ns in (("not before", low_ns), ("not after", high_ns))
        if stamp_ns is not None
    ]
    return f"{instance.id} {told}", measures


Happening = tuple[str, int | None, int]


def happenings(instance: StoredInstance, event: Event) -> list[Happening]:
    """The bounds of each time that an event happened, with the words for it."""
    states = instance.states
    match event:
        case "appeared":
            state = states[0]
            if state.empty_before_ns is None:
                return []
            return [("appeared {}", state.empty_before_ns, state.first_seen_ns)]
        case "disappeared":
            last = states[-1]
            return [] if last.gone_ns is None else [("left {}", last.last_seen_ns, last.gone_ns)]
        case "moved":
            pairs = [
                (old, new) for old, new in pairwise(states)
                if state_distance_m(old, new) >= MIN_MOVE_M
            ]  # fmt: skip
            return [
                (f"moved {state_distance_m(old, new):.2f} m {{}}", old.last_seen_ns, new.first_seen_ns)
                for old, new in pairs
            ]
        case "returned":
            pairs = [
                (old, new) for old, new in pairwise(states)
                if old.gone_ns is not None and state_distance_m(old, new) < MIN_MOVE_M
            ]  # fmt: skip
            return [("came back {}", old.gone_ns, new.first_seen_ns) for old, new in pairs]
        case _:
            return []


def _never_text(clock: Clock, event: Event, instance: StoredInstance) -> str:
    state = instance.states[-1]
    if event == "appeared":
        first = clock.text(instance.states[0].first_seen_ns)
        return f"was first seen {first}; nobody had seen its place empty before, so it may have stood there longer"
    if event == "disappeared":
        lost = "not seen since; its place was never seen empty" if instance.presence == "absent" else "and still stands"
        return f"is not known to have gone: last seen {clock.text(state.last_seen_ns)}, {lost}"
    return {
        "moved": "is not known to have moved",
        "returned": "is not known to have left and come back",
    }.get(event, "is not known to have changed")


def _since_text(clock: Clock, instance: StoredInstance, state: StateRecord) -> str:
    stands = "stands there" if instance.presence == "present" else "stood there"
    if instance.label in DYNAMIC_CLASSES:
        return f"was seen there from {clock.text(state.first_seen_ns)} to {clock.text(state.last_seen_ns)}"
    if state.index > 0 and len(instance.states) > 1:
        low_ns = state.empty_before_ns or instance.states[-2].last_seen_ns
        return f"{stands} since some time {clock.between(low_ns, state.first_seen_ns)}"
    if state.empty_before_ns is not None:
        return f"{stands} since some time {clock.between(state.empty_before_ns, state.first_seen_ns)}"
    return f"{stands} since {clock.text(state.first_seen_ns)} at the latest, when its place was first seen"


def _until_text(clock: Clock, instance: StoredInstance, state: StateRecord) -> str:
    if instance.label in DYNAMIC_CLASSES:
        return f"was seen until {clock.text(state.last_seen_ns)}"
    if instance.presence == "present":
        return f"still stands there, last seen {clock.text(state.last_seen_ns)}"
    if state.gone_ns is None:
        return f"was seen until {clock.text(state.last_seen_ns)}, and nobody saw whether it left"
    return f"stood there until some time {clock.between(state.last_seen_ns, state.gone_ns)}"


def _how_long(finder: ThingsFinder, instance: StoredInstance, state: StateRecord) -> Told:
    """The least and, where both ends are bounded, the greatest length of its last stay."""
    least_s = (state.last_seen_ns - state.first_seen_ns) / SECOND_NS
    came_ns = state.empty_before_ns
    end_ns = state.gone_ns if instance.presence != "present" else finder.asking.times.end_ns
    stood = "has stood" if instance.presence == "present" else "stood"
    text = f"{instance.id} {stood} there for at least {duration_text(least_s)}"
    measures = [Measurement(instance.id, "at least", round(least_s, 3), "s")]
    if came_ns is not None and end_ns is not None:
        most_s = (end_ns - came_ns) / SECOND_NS
        text += f" and at most {duration_text(most_s)}"
        measures.append(Measurement(instance.id, "at most", round(most_s, 3), "s"))
    seen = (
        f"seen from {finder.asking.clock.text(state.first_seen_ns)} to {finder.asking.clock.text(state.last_seen_ns)}"
    )
    return f"{text} ({seen})", measures


def _how_often(finder: ThingsFinder, event: Event, instance: StoredInstance) -> Told:
    if event == "seen":
        visits = [visit for visit in finder.reader.instances_of([instance.number])[0].visits if visit.supported]
        names = {traversal.id: traversal.name for traversal in finder.reader.traversals}
        seen_in = listing([names[visit.traversal_id] for visit in visits])
        keyframes = sum(visit.supported for visit in visits)
        text = f"{instance.id} was seen in {counted(len(visits), 'visit')} ({seen_in}), in {keyframes} keyframes"
        return text, [Measurement(instance.id, "visits", float(len(visits)), "1")]
    number = len(happenings(instance, event))
    verbs = {"moved": "moved", "disappeared": "left", "appeared": "appeared", "returned": "came back"}
    times = {1: "once", 2: "twice"}.get(number, f"{number} times")
    known = ", as far as anybody saw"
    measures = [Measurement(instance.id, "times", float(number), "1")]
    verb = verbs.get(event, "changed")
    told = f"never {verb}" if number == 0 else f"{verb} {times}"
    return f"{instance.id} {told}{known}", measures


def _time(instance: StoredInstance, what: str, stamp_ns: int) -> Measurement:
    return Measurement(instance.id, what, float(stamp_ns), "ns")


def duration_text(seconds: float) -> str:
    """A length of time in the largest unit that fits it."""
    for unit, length_s in (("days", 86_400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2 * length_s:
            return f"{seconds / length_s:.1f} {unit}"
    return f"{seconds:.0f} s"
