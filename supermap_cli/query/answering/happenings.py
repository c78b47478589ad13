"""What happened between two visits, or within one: the changes that `diff` knows, for some things or for all.

Where the map holds an earlier visit, two visits are compared. Within the first one there is nothing to compare with:
then the moves, departures and arrivals that the traversal itself saw are told.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from supermap_cli.errors import QueryError
from supermap_cli.language.times import (
    Ago,
    AtClock,
    AtEvent,
    Before,
    BetweenTimes,
    Earlier,
    Event,
    First,
    Last,
    Now,
    Since,
    Time,
)
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.answering.attributes import Verdict
from supermap_cli.query.answering.phrases import time_phrase
from supermap_cli.query.answering.times import MomentSpan
from supermap_cli.query.candidates import InstanceCandidate
from supermap_cli.query.change_classification import MIN_MOVE_M, compared_times, state_distance_m
from supermap_cli.query.diff import DiffBuilder, IdentityCandidateView, ObjectChange, instances_to_compare
from supermap_cli.query.time_points import TimePoint, traversal_end
from supermap_cli.query.views import Vector, vector
from supermap_cli.types.labels import DYNAMIC_CLASSES
from supermap_cli.types.memory import TemporalEdge

if TYPE_CHECKING:
    from supermap_cli.query.answering.asking import Asking

KINDS_OF_EVENT: dict[Event, frozenset[str]] = {
    "appeared": frozenset({"appeared", "returned"}),
    "disappeared": frozenset({"disappeared"}),
    "moved": frozenset({"moved"}),
    "returned": frozenset({"returned"}),
    "changed": frozenset({"appeared", "returned", "disappeared", "moved", "relabelled"}),
    "seen": frozenset(),
}
OPEN_KINDS: dict[Event, frozenset[str]] = {
    "appeared": frozenset({"first observed"}),
    "disappeared": frozenset({"not observed again", "not looked at"}),
    "moved": frozenset({"not observed again", "not looked at", "disappeared"}),
    "returned": frozenset(),
    "changed": frozenset({"first observed", "not observed again", "not looked at"}),
    "seen": frozenset(),
}
"""Kinds of changes that are an event, and those of which nobody can say whether it happened."""


@dataclass(frozen=True)
class ChangeWindow:
    """The time over which changes are asked for: from one visit (`before`) to another (`after`), or, where `before` is
    `None`, what was seen to happen within [low_ns, high_ns]. `event_of` is the id of the thing whose event it starts
    with.
    """

    text: str
    before: TimePoint | None
    after: TimePoint | None
    low_ns: int
    high_ns: int
    note: str | None = None
    event_of: str | None = None

    def certain(self, change: Change) -> bool:
        """Whether a change surely fell within: both of its bounds do. Two visits are compared by what each of them saw,
        whenever it happened in between.
        """
        sides = (self.before, self.after)
        if all(side is not None and side.traversal is not None for side in sides) or change.not_after_ns is None:
            return True
        return self.low_ns <= (change.not_before_ns or 0) and change.not_after_ns <= self.high_ns


@dataclass(frozen=True)
class Change:
    """What happened to one instance, within [not_before_ns, not_after_ns] (both `None` if nothing did)."""

    kind: str
    id: str
    label: str
    reason: str
    not_before_ns: int | None
    not_after_ns: int | None
    position_before: Vector | None
    position_after: Vector | None
    distance_m: float | None
    confidence: float
    may_be: tuple[IdentityCandidateView, ...] = ()


def window_of(asking: Asking, when: Time | None) -> ChangeWindow:  # noqa: PLR0911 - one case a kind of time
    """The window of a time; without one, from the last visit but one to the last.

    Raises `QueryError` where nobody has looked since.
    """
    traversals = asking.reader.traversals
    if not traversals:
        raise QueryError("the map is empty", where=asking.reader.where, cure="build a recording into it")
    match when:
        case None | Now() | Earlier() | Last():
            return _visit(asking, len(traversals) - 1)
        case Since(moment):
            span = asking.times.moment(moment)
            return _since(asking, span.end(), span) if span.event_of is None else _since_event(asking, span)
        case First():
            return _visit(asking, 0)
        case BetweenTimes(first, second):
            one, other = sorted((asking.times.moment(first), asking.times.moment(second)), key=lambda s: s.high_ns)
            return _two(one.end(), other.end())
        case Before(moment):
            span = asking.times.moment(moment)
            earlier = [at for at, traversal in enumerate(traversals) if traversal.end_ns < span.low_ns]
            if earlier:
                return _visit(asking, earlier[-1])
            return ChangeWindow(f"before {span.text}", None, None, asking.clock.origin_ns, span.low_ns - 1, span.note)
        case AtClock() | Ago() | AtEvent():
            span = asking.times.moment(when)
            if span.traversal is None:
                word = "when" if isinstance(when, AtEvent) else "at"
                return ChangeWindow(f"{word} {span.text}", None, None, span.low_ns, span.high_ns, span.note)
    span = asking.times.interval(when)
    if span.traversal is not None:
        return _visit(asking, span.traversal.number - traversals[0].number, span.note)
    if span.low_ns <= asking.clock.origin_ns:
        return ChangeWindow(span.text, None, None, span.low_ns, span.high_ns, span.note)
    sides = (TimePoint(asking.clock.text(at_ns), at_ns, at_ns) for at_ns in (span.low_ns, span.high_ns))
    before, after = sides
    return ChangeWindow(span.text, before, after, span.low_ns, span.high_ns, span.note)


def changes_of(asking: Asking, window: ChangeWindow, numbers: Collection[int] | None = None) -> list[Change]:
    """The changes of some instances within a window, or of all (`None`); of those asked for also where nothing
    changed. People and animals come and go, and are left out.
    """
    if window.before is None or window.after is None:
        return _events(asking, window, numbers)
    before, after = sorted((window.before, window.after), key=lambda side: side.at_ns)
    times = compared_times(before, after, asking.reader.traversals)
    chosen = sorted(numbers) if numbers is not None else instances_to_compare(asking.reader, times)[0]
    builder = DiffBuilder(asking.reader, times)
    found = [change for batch in batches(chosen) for change in builder.changes(batch)]
    changes = [_of_diff(asking, change, times.before.at_ns) for change in found]
    return [change for change in changes if change.id != window.event_of or window.certain(change)]


def happened_to(
    asking: Asking, batch: Sequence[InstanceCandidate], event: Event, when: Time | None
) -> list[tuple[Verdict, str]]:
    """Whether something happened to each candidate, with the reason."""
    if event == "seen":
        asked = None if when is None else asking.times.interval(when)
        span = None if asked is None else (asked.low_ns, asked.high_ns)
        return [_seen(asking, candidate.instance, span) for candidate in batch]
    window = window_of(asking, when)
    asking.note(window.note)
    changes = changes_of(asking, window, {candidate.instance.number for candidate in batch})
    by_id = {change.id: change for change in changes}
    return [_verdict(asking, by_id.get(candidate.instance.id), event, window) for candidate in batch]


def _verdict(asking: Asking, change: Change | None, event: Event, window: ChangeWindow) -> tuple[Verdict, str]:
    if change is None:
        return "no", f"nothing is known to have happened to it {window.text}"
    reason = f"{change.kind} {window.text}: {change.reason}"
    if change.kind in KINDS_OF_EVENT[event]:
        if not window.certain(change):
            return "unsure", f"{change.kind} {asking.clock.between(change.not_before_ns, change.not_after_ns)}"
        return "yes", reason
    return ("unsure" if change.kind in OPEN_KINDS[event] else "no"), reason


def _seen(asking: Asking, instance: StoredInstance, span: tuple[int, int] | None) -> tuple[Verdict, str]:
    seen = [
        state
        for state in instance.states
        if span is None or (state.first_seen_ns <= span[1] and state.last_seen_ns >= span[0])
    ]
    last = f"last seen {asking.clock.text(instance.last_seen_ns)}"
    return ("yes" if seen else "no"), last


def _visit(asking: Asking, at: int, note: str | None = None) -> ChangeWindow:
    """What a traversal found changed since the one before it; of the first one, what happened in it."""
    traversals = asking.reader.traversals
    after = traversal_end(traversals[at])
    if at == 0:
        return ChangeWindow(f"in {after.text}", None, None, traversals[0].start_ns, after.at_ns, note)
    return _two(traversal_end(traversals[at - 1]), after, note)


def _two(before: TimePoint, after: TimePoint, note: str | None = None) -> ChangeWindow:
    return ChangeWindow(f"from {before.text} to {after.text}", before, after, before.at_ns, after.at_ns, note)


def _since(asking: Asking, before: TimePoint, span: MomentSpan) -> ChangeWindow:
    after = traversal_end(asking.reader.traversals[-1])
    if before.at_ns >= after.at_ns:
        one = len(asking.reader.traversals) == 1
        raise QueryError(
            f"the map ends with {after.text}: nobody has looked since",
            cure=f"ask 'what changed{time_phrase(f'in {after.text}')}'"
            + ("" if one else ", or since an earlier traversal"),
        )
    return ChangeWindow(f"since {span.text}", before, after, before.at_ns, after.at_ns, span.note)


def _since_event(asking: Asking, span: MomentSpan) -> ChangeWindow:
    """Since an event that nobody saw: what may have been after it is compared from its earliest time on, and only what
    was after its latest one is sure.
    """
    before = TimePoint(span.text, span.low_ns, span.low_ns)
    window = _since(asking, before, span)
    return replace(window, low_ns=span.high_ns, event_of=span.event_of)


def _of_diff(asking: Asking, change: ObjectChange, before_ns: int) -> Change:
    kind: str = change.kind
    if kind == "appeared":
        instance = asking.reader.instance(change.id)
        seen_before = instance is not None and any(state.first_seen_ns <= before_ns for state in instance.states)
        kind = "returned" if seen_before else kind
    return Change(
        kind,
        change.id,
        change.label,
        change.reason,
        change.not_before_ns,
        change.not_after_ns,
        change.position_before,
        change.position_after,
        change.distance_m,
        change.confidence,
        change.may_be,
    )


def _events(asking: Asking, window: ChangeWindow, numbers: Collection[int] | None) -> list[Change]:
    """The temporal edges within a window, as changes: the last one of each instance and kind."""
    edges = asking.reader.temporal_edges_within(window.low_ns, window.high_ns)
    ends = asking.reader.survivors.of({number for edge in edges for number in (edge.from_number, edge.to_number)})
    wanted = set(ends.values()) if numbers is None else set(numbers) & set(ends.values())
    instances = {instance.number: instance for instance in asking.reader.instances_of(wanted)}
    found: dict[tuple[int, str], Change] = {}
    moved = {(edge.from_number, edge.from_state) for edge in edges if edge.kind == "moved"}
    for edge in edges:
        instance = instances.get(ends.get(edge.to_number, -1))
        if instance is None or instance.label in DYNAMIC_CLASSES or instance.presence == "doubted":
            continue
        if edge.kind == "disappeared" and (edge.from_number, edge.from_state) in moved:
            continue
        change = _of_edge(edge, instance)
        if change is not None:
            found[instance.number, change.kind] = change
    return list(found.values())


def _of_edge(edge: TemporalEdge, instance: StoredInstance) -> Change | None:
    kinds = {"appeared": "appeared", "disappeared": "disappeared", "moved": "moved", "reappeared": "returned"}
    if edge.kind not in kinds:
        return None
    states = {state.index: state for state in instance.states}
    old = states.get(edge.from_state) if edge.from_state is not None and edge.kind != "appeared" else None
    new = states.get(edge.to_state) if edge.to_state is not None and edge.kind != "disappeared" else None
    distance_m = edge.distance_m if old is None or new is None else state_distance_m(old, new)
    if edge.kind == "moved" and (distance_m is None or distance_m < MIN_MOVE_M):
        return None
    reasons = {
        "appeared": "its place had been seen empty",
        "disappeared": "its place was seen empty",
        "moved": f"seen {distance_m or 0:.2f} m away",
        "returned": "had gone from its place, was seen there again",
    }
    return Change(
        kinds[edge.kind],
        instance.id,
        instance.label,
        reasons[kinds[edge.kind]],
        edge.not_before_ns,
        edge.not_after_ns,
        None if old is None else vector(old.centroid_map),
        None if new is None else vector(new.centroid_map),
        None if distance_m is None or edge.kind != "moved" else round(distance_m, 4),
        round(edge.probability, 4),
    )


def of_event(changes: Iterable[Change], events: Collection[Event]) -> tuple[list[Change], list[Change]]:
    """The changes that are one of some events (none: any), and those of which nobody can say."""
    any_event: tuple[Event, ...] = ("changed",)
    asked = tuple(events) or any_event
    wanted = frozenset[str]().union(*(KINDS_OF_EVENT[event] for event in asked))
    undecided = frozenset[str]().union(*(OPEN_KINDS[event] for event in asked))
    listed = list(changes)
    return (
        [change for change in listed if change.kind in wanted],
        [change for change in listed if change.kind in undecided],
    )
