"""When something happened to a thing, as the moment of another question: "since the plant went"."""

from __future__ import annotations

from supermap_cli.errors import QueryError
from supermap_cli.language.times import AtEvent, Event
from supermap_cli.query.answering.asking import Asking
from supermap_cli.query.answering.dating import happenings
from supermap_cli.query.answering.phrases import EVENT_VERBS, things_text
from supermap_cli.query.answering.things import ThingsFinder
from supermap_cli.query.answering.times import MomentSpan
from supermap_cli.query.time_selector import TimeSelector

_ALSO: dict[Event, tuple[Event, ...]] = {
    "disappeared": ("disappeared", "moved"),
    "changed": ("moved", "disappeared", "appeared"),
    "returned": ("returned", "appeared", "moved"),
}
"""What an event may have been instead: what "went" may have moved."""


def event_span(asking: Asking, asked: AtEvent) -> MomentSpan:
    """The bounds of the latest time that an event happened to one of the things.

    Raises `QueryError` where it is not known to have happened.
    """
    finder = ThingsFinder(asking, TimeSelector("last", "last"))
    name = things_text(asked.things, article=False)
    candidates = finder.all_candidates(asked.things)
    if not candidates:
        raise QueryError(f"there is no {name} in the map, so nothing tells when that was", cure="name another moment")
    found: list[tuple[int, int, str]] = []
    for event in _ALSO.get(asked.event, (asked.event,)):
        for candidate in candidates:
            instance = candidate.instance
            if event == "seen":
                found.append((instance.states[-1].first_seen_ns, instance.states[-1].last_seen_ns, instance.id))
            for _, low_ns, high_ns in happenings(instance, event):
                found.append((high_ns if low_ns is None else low_ns, high_ns, instance.id))
        if found:
            break
    if not found:
        verb = EVENT_VERBS[asked.event]
        raise QueryError(
            f"it is not known that {name} {verb}, so nothing tells when that was", cure="name another time"
        )
    low_ns, high_ns, text_id = max(found, key=lambda event: event[1])
    verb = "was seen" if asked.event == "seen" else EVENT_VERBS[asked.event]
    note = f"{text_id} {verb} {asking.clock.between(low_ns, high_ns)}"
    return MomentSpan(f"{text_id} {verb}", low_ns, high_ns, note=note, event_of=text_id)
