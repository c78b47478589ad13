"""What becomes of things from visit to visit: they stay, are moved, go and come back, or turn out to be one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from supermap_cli.costs.memory.rooms import SyntheticObject, moved
from supermap_cli.costs.memory.traversals import STEP_NS, Visit
from supermap_cli.types.memory import Presence, StateRecord, TemporalEdge
from supermap_cli.types.memory import Visit as VisitRecord

MOVES, GOES, RETURNS = 0.01, 0.004, 0.3
"""How probable each is, from one visit to the next."""
MERGED, DOUBTED, CANDIDATE = 0.01, 0.01, 0.005
"""How many things are each, of all."""


@dataclass
class ObjectHistory:
    """One instance's life; `merged_into` is the number of another. `seen` are the visits that saw it."""

    obj: SyntheticObject
    states: list[StateRecord] = field(default_factory=list)
    written_by: list[int] = field(default_factory=list)
    visits: list[tuple[int, VisitRecord]] = field(default_factory=list)
    events: list[tuple[int, TemporalEdge]] = field(default_factory=list)
    seen: list[Visit] = field(default_factory=list)
    presence: Presence = "present"
    merged_into: int | None = None


def live(obj: SyntheticObject, visits: Sequence[Visit], rng: np.random.Generator) -> ObjectHistory:
    """A thing's life over all visits to its room; numbers of traversals stand for their ids."""
    history = ObjectHistory(obj)
    chances = rng.random((len(visits), 2))
    first_ns, empty_ns, away = visits[0].first_ns, None, False
    for visit, (move, leave) in zip(visits, chances, strict=True):
        if away:
            if move >= RETURNS:
                _append_visit(history, visit, seen=False)
                continue
            away, first_ns, empty_ns = False, visit.first_ns, visit.first_ns - STEP_NS
        elif history.seen and leave < GOES:
            _append_state(history, first_ns, empty_ns, visit.first_ns)
            away = True
            _append_visit(history, visit, seen=False)
            _append_event(history, "disappeared", visit, (0, 0))
            continue
        elif history.seen and move < MOVES:
            _append_state(history, first_ns, empty_ns, visit.first_ns)
            history.obj = moved(history.obj, history.obj.box, rng)
            first_ns, empty_ns = visit.first_ns + STEP_NS, None
            _append_event(history, "moved", visit, (0, 1), distance_m=0.8)
        history.seen.append(visit)
        _append_visit(history, visit, seen=True)
    if away:
        history.presence = "absent"
    else:
        _append_state(history, first_ns, empty_ns, None)
    _append_reappearances(history)
    return history


def merge(history: ObjectHistory, into: ObjectHistory) -> None:
    """A part that was taken for a thing of its own in its first visit."""
    history.seen = history.seen[:1]
    history.visits = history.visits[:1]
    stamp_ns = history.seen[0].last_ns
    history.states = [replace(history.states[0], last_seen_ns=stamp_ns, gone_ns=None)]
    history.written_by, history.events = history.written_by[:1], []
    history.presence = "present"
    history.merged_into = into.obj.number
    edge = TemporalEdge("merged", history.obj.number, 0, into.obj.number, 0, stamp_ns, stamp_ns, 1.0)
    history.events.append((history.seen[0].traversal.number, edge))


def link(history: ObjectHistory, other: ObjectHistory) -> None:
    """Two things of a class that may be one."""
    traversal, stamp_ns = other.seen[0].traversal.number, other.states[0].first_seen_ns
    ends = (history.obj.number, len(history.states) - 1, other.obj.number, 0)
    history.events.append((traversal, TemporalEdge("candidate", *ends, None, stamp_ns, 0.4)))


def _append_state(history: ObjectHistory, first_ns: int, empty_ns: int | None, gone_ns: int | None) -> None:
    """Enter the state that it was in; it was last seen in the last visit that saw it."""
    box = history.obj.box
    state = StateRecord(
        history.obj.number,
        len(history.states),
        first_ns,
        history.seen[-1].last_ns,
        gone_ns,
        empty_ns,
        box.center,
        box,
        history.obj.label,
        0.97,
    )
    history.states.append(state)
    history.written_by.append(next(visit.traversal.number for visit in history.seen if visit.last_ns >= first_ns))


def _append_visit(history: ObjectHistory, visit: Visit, *, seen: bool) -> None:
    looks = (visit.last_ns - visit.first_ns) // STEP_NS + 1
    first, last = (visit.first_ns, visit.last_ns) if seen else (None, None)
    counted = VisitRecord(history.obj.number, looks if seen else 0, looks, 0 if seen else looks, first, last)
    history.visits.append((visit.traversal.number, counted))


def _append_event(
    history: ObjectHistory, kind: str, visit: Visit, steps: tuple[int, int], distance_m: float | None = None
) -> None:
    """What happened to the state just closed, or between it and the one `steps` after it."""
    at, number = len(history.states) - 1, history.obj.number
    ends = (number, at + steps[0], number, at + steps[1])
    bounds = (history.states[-1].last_seen_ns, visit.first_ns + steps[1] * STEP_NS)
    history.events.append((visit.traversal.number, TemporalEdge(kind, *ends, *bounds, 0.95, distance_m)))  # type: ignore[arg-type]


def _append_reappearances(history: ObjectHistory) -> None:
    """Tell of every state after a disappearance, and of a first one that was seen to come."""
    number = history.obj.number
    for before, after, traversal in zip(history.states, history.states[1:], history.written_by[1:], strict=False):
        if after.empty_before_ns is not None:
            bounds = (after.empty_before_ns, after.first_seen_ns)
            edge = TemporalEdge("reappeared", number, before.index, number, after.index, *bounds, 0.95)
            history.events.append((traversal, edge))
