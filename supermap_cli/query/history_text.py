"""The history of an instance in plain sentences, in chronological order."""

from __future__ import annotations

from collections.abc import Sequence

from supermap_cli.geometry.boxes import displacement_m
from supermap_cli.query.clock import Clock
from supermap_cli.query.object_history import ObjectHistory, SightingsView, SurroundingsView
from supermap_cli.query.views import EventView, IntervalView, Vector, box_of

MAX_SENTENCES = 40
"""A longer history is cut in the middle."""


def history_sentences(history: ObjectHistory, clock: Clock) -> list[str]:
    """The history, one sentence per event."""
    by_state = {surroundings.state: surroundings for surroundings in history.surroundings}
    sentences: list[str] = []
    for at, interval in enumerate(history.intervals):
        before = history.intervals[at - 1] if at else None
        relations_text = _relations_text(history.id, by_state.get(interval.state))
        sentences += [
            _arrival_sentence(interval, before, _arrival_event(history, interval.state), relations_text, clock)
        ]
        after = history.intervals[at + 1] if at + 1 < len(history.intervals) else None
        if (departure := _departure_sentence(interval, after, clock)) is not None:
            sentences.append(departure)
    sentences += [text for event in history.events if (text := _event_sentence(history, event, clock)) is not None]
    sentences += _label_sentences(history.sightings)
    sentences.append(_last_sentence(history, clock))
    return shorten_lines(sentences, MAX_SENTENCES)


def shorten_lines(lines: Sequence[str], most: int) -> list[str]:
    """The lines, or the first and last of them if there are more than `most`, with the number left out."""
    if len(lines) <= most:
        return list(lines)
    half = most // 2
    return [*lines[:half], f"... {len(lines) - 2 * half} more ...", *lines[-half:]]


def _arrival_sentence(
    interval: IntervalView,
    before: IntervalView | None,
    event: EventView | None,
    relations_text: str,
    clock: Clock,
) -> str:
    where = f"at {position_text(interval.position)}{relations_text}"
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


def _departure_sentence(interval: IntervalView, after: IntervalView | None, clock: Clock) -> str | None:
    """Its departure, unless its arrival elsewhere at the same time already implies it."""
    if interval.gone_ns is None or (after is not None and after.first_seen_ns <= interval.gone_ns):
        return None
    return (
        f"left {position_text(interval.position)} {clock.between(interval.last_seen_ns, interval.gone_ns)}: found empty"
    )


def _event_sentence(history: ObjectHistory, event: EventView, clock: Clock) -> str | None:
    """An event that involves another instance."""
    when = clock.brief(event.not_after_ns)
    own = {history.id, *history.merged_ids}
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


def _label_sentences(sightings: Sequence[SightingsView]) -> list[str]:
    """The labels it had, if they differ between traversals."""
    labelled = [(sighting.traversal, sighting.labels) for sighting in sightings if sighting.labels]
    if len({next(iter(labels)) for _, labels in labelled}) < 2:
        return []
    labels_in_order: list[tuple[str, list[str]]] = []
    for traversal, labels in labelled:
        label = next(iter(labels))
        if not labels_in_order or labels_in_order[-1][0] != label:
            labels_in_order.append((label, []))
        labels_in_order[-1][1].append(traversal)
    called = "called " + ", then ".join(f"{label} in {_name_range(names)}" for label, names in labels_in_order)
    return [called, *_detector_sentences(sightings)]


def _detector_sentences(sightings: Sequence[SightingsView]) -> list[str]:
    """Whose words these are, if several detectors called it: a name is a detector's reading of the thing."""
    names: dict[str, list[str]] = {}
    for sighting in sightings:
        if sighting.labels:
            names.setdefault(sighting.detector or "an unknown detector", []).append(sighting.traversal)
    if len(names) < 2:
        return []
    return ["read by " + ", by ".join(f"{detector} in {_name_range(own)}" for detector, own in names.items())]


def _last_sentence(history: ObjectHistory, clock: Clock) -> str:
    if history.standing is not None:
        return f"as of {history.as_of}: {history.standing.words}"
    last = clock.brief(history.last_seen_ns)
    if history.presence == "doubted":
        return f"last seen {last}; nothing says any more that it was ever real"
    if history.presence == "absent":
        gone = bool(history.intervals) and history.intervals[-1].gone_ns is not None
        return f"last seen {last}" + ("" if gone else ", not seen since")
    return f"last seen {last}; stands there as far as anybody knows"


def _relations_text(own: str, by_state: SurroundingsView | None) -> str:
    if by_state is None or not by_state.relations:
        return ""
    history = [
        f"{relation.name} {relation.object}" if relation.subject == own else f"{relation.subject} {relation.name} it"
        for relation in by_state.relations[:2]
    ]
    return ", " + " and ".join(history)


def _arrival_event(history: ObjectHistory, state: int) -> EventView | None:
    """The event by which it came into a state."""
    own = {history.id, *history.merged_ids}
    arriving = {"appeared", "moved", "reappeared"}
    fitting = [
        event for event in history.events if event.kind in arriving and event.to_state == state and event.to_id in own
    ]
    return fitting[-1] if fitting else None


def position_text(position: Vector) -> str:
    """A position (m) in words."""
    return "(" + ", ".join(f"{value:.2f}" for value in position) + ")"


def _name_range(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} to {names[-1]}"
