"""The life of an instance in plain sentences, in the order of time."""

from __future__ import annotations

from collections.abc import Sequence

from supermap_cli.geometry.boxes import displacement_m
from supermap_cli.query.clock import Clock
from supermap_cli.query.object_history import History, SightingsView, SurroundingsView
from supermap_cli.query.views import EventView, IntervalView, Vector, box_of

MOST_SENTENCES = 40
"""A longer story is told from its beginning and its end."""


def story(told: History, clock: Clock) -> list[str]:
    """What happened to it, a sentence each."""
    around = {surroundings.state: surroundings for surroundings in told.surroundings}
    sentences: list[str] = []
    for at, interval in enumerate(told.intervals):
        before = told.intervals[at - 1] if at else None
        next_to = _next_to(told.id, around.get(interval.state))
        sentences += [_came(interval, before, _event_to(told, interval.state), next_to, clock)]
        after = told.intervals[at + 1] if at + 1 < len(told.intervals) else None
        if (left := _left(interval, after, clock)) is not None:
            sentences.append(left)
    sentences += [text for event in told.events if (text := _beside(told, event, clock)) is not None]
    sentences += _called(told.sightings)
    sentences.append(_stands(told, clock))
    return shortened(sentences, MOST_SENTENCES)


def shortened(lines: Sequence[str], most: int) -> list[str]:
    """Lines, or the first and last of them where there are more than `most`, with how many are left out."""
    if len(lines) <= most:
        return list(lines)
    half = most // 2
    return [*lines[:half], f"... {len(lines) - 2 * half} more ...", *lines[-half:]]


def _came(
    interval: IntervalView,
    before: IntervalView | None,
    event: EventView | None,
    next_to: str,
    clock: Clock,
) -> str:
    where = f"at {place(interval.position)}{next_to}"
    since = clock.brief(interval.first_seen_ns)
    if before is None:
        if interval.empty_before_ns is None:
            return f"first seen {since} {where}; nobody had seen its place empty before"
        return f"came {clock.between(interval.empty_before_ns, interval.first_seen_ns)}: stands {where}"
    bounds = clock.between(before.last_seen_ns, interval.first_seen_ns)
    if event is not None and event.kind == "reappeared":
        return f"back {clock.between(before.gone_ns, interval.first_seen_ns)} {where}"
    how = f"moved {displacement_m(box_of(before.box), box_of(interval.box)):.2f} m"
    if event is not None and event.kind == "moved" and event.not_before_ns is not None:
        bounds = clock.between(event.not_before_ns, event.not_after_ns)
    return f"{how} {bounds}: stands {where}"


def _left(interval: IntervalView, after: IntervalView | None, clock: Clock) -> str | None:
    """That it was seen to have left, where that is not told by where it turned up at the same time."""
    if interval.gone_ns is None or (after is not None and after.first_seen_ns <= interval.gone_ns):
        return None
    return f"left {place(interval.position)} {clock.between(interval.last_seen_ns, interval.gone_ns)}: found empty"


def _beside(told: History, event: EventView, clock: Clock) -> str | None:
    """What other instances have to do with it."""
    when = clock.brief(event.not_after_ns)
    own = {told.id, *told.merged_ids}
    match event.kind:
        case "merged":
            return f"{event.from_id} turned out to be it ({when})"
        case "split" if event.to_id in own:
            return f"was one with {event.from_id} until {when}"
        case "split":
            return f"{event.to_id} was split off it ({when})"
        case "candidate":
            other = event.to_id if event.from_id in own else event.from_id
            return f"may be {other} as well ({event.probability:.0%}): the evidence does not single it out"
    return None


def _called(sightings: Sequence[SightingsView]) -> list[str]:
    """What it was called, where that differs between traversals, or any of them was unsure."""
    called = [(sighting.traversal, sighting.labels) for sighting in sightings if sighting.labels]
    if len({next(iter(labels)) for _, labels in called}) < 2:
        return []
    said: list[tuple[str, list[str]]] = []
    for traversal, labels in called:
        label = next(iter(labels))
        if not said or said[-1][0] != label:
            said.append((label, []))
        said[-1][1].append(traversal)
    return ["called " + ", then ".join(f"{label} in {_names(names)}" for label, names in said)]


def _stands(told: History, clock: Clock) -> str:
    if told.standing is not None:
        return f"as of {told.as_of}: {told.standing.words}"
    last = clock.brief(told.last_seen_ns)
    if told.presence == "doubted":
        return f"last seen {last}; nothing says any more that it was ever real"
    if told.presence == "absent":
        gone = bool(told.intervals) and told.intervals[-1].gone_ns is not None
        return f"last seen {last}" + ("" if gone else ", not seen since")
    return f"last seen {last}; stands there as far as anybody knows"


def _next_to(own: str, around: SurroundingsView | None) -> str:
    if around is None or not around.relations:
        return ""
    told = [f"{r.name} {r.object}" if r.subject == own else f"{r.subject} {r.name} it" for r in around.relations[:2]]
    return ", " + " and ".join(told)


def _event_to(told: History, state: int) -> EventView | None:
    """How it came into a state."""
    own = {told.id, *told.merged_ids}
    arriving = {"appeared", "moved", "reappeared"}
    fitting = [e for e in told.events if e.kind in arriving and e.to_state == state and e.to_id in own]
    return fitting[-1] if fitting else None


def place(position: Vector) -> str:
    """A place in words, metres."""
    return "(" + ", ".join(f"{value:.2f}" for value in position) + ")"


def _names(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} to {names[-1]}"
