"""What becomes of things from visit to visit: they stay, are moved, go and come back, or turn out to be one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from supermap_cli.costs.memory.building import Thing, moved
from supermap_cli.costs.memory.visits import STEP_NS, Visit
from supermap_cli.types.memory import Presence, StateRecord, TemporalEdge
from supermap_cli.types.memory import Visit as VisitRecord

MOVES, GOES, RETURNS = 0.01, 0.004, 0.3
"""How probable each is, from one visit to the next."""
MERGED, DOUBTED, CANDIDATE = 0.01, 0.01, 0.005
"""How many things are each, of all."""


@dataclass
class Life:
    """One instance's life; `merged_into` is the number of another. `seen` are the visits that saw it."""

    thing: Thing
    states: list[StateRecord] = field(default_factory=list)
    written_by: list[int] = field(default_factory=list)
    visits: list[tuple[int, VisitRecord]] = field(default_factory=list)
    events: list[tuple[int, TemporalEdge]] = field(default_factory=list)
    seen: list[Visit] = field(default_factory=list)
    presence: Presence = "present"
    merged_into: int | None = None


def live(thing: Thing, visits: Sequence[Visit], rng: np.random.Generator) -> Life:
    """A thing's life over all visits to its room; numbers of traversals stand for their ids."""
    life = Life(thing)
    chances = rng.random((len(visits), 2))
    first_ns, empty_ns, away = visits[0].first_ns, None, False
    for visit, (move, leave) in zip(visits, chances, strict=True):
        if away:
            if move >= RETURNS:
                _count(life, visit, seen=False)
                continue
            away, first_ns, empty_ns = False, visit.first_ns, visit.first_ns - STEP_NS
        elif life.seen and leave < GOES:
            _close(life, first_ns, empty_ns, visit.first_ns)
            away = True
            _count(life, visit, seen=False)
            _event(life, "disappeared", visit, (0, 0))
            continue
        elif life.seen and move < MOVES:
            _close(life, first_ns, empty_ns, visit.first_ns)
            life.thing = moved(life.thing, life.thing.box, rng)
            first_ns, empty_ns = visit.first_ns + STEP_NS, None
            _event(life, "moved", visit, (0, 1), distance_m=0.8)
        life.seen.append(visit)
        _count(life, visit, seen=True)
    if away:
        life.presence = "absent"
    else:
        _close(life, first_ns, empty_ns, None)
    _come_back(life)
    return life


def merge(life: Life, into: Life) -> None:
    """A part that was taken for a thing of its own in its first visit."""
    life.seen = life.seen[:1]
    life.visits = life.visits[:1]
    stamp_ns = life.seen[0].last_ns
    life.states = [replace(life.states[0], last_seen_ns=stamp_ns, gone_ns=None)]
    life.written_by, life.events = life.written_by[:1], []
    life.presence = "present"
    life.merged_into = into.thing.number
    edge = TemporalEdge("merged", life.thing.number, 0, into.thing.number, 0, stamp_ns, stamp_ns, 1.0)
    life.events.append((life.seen[0].course.number, edge))


def link(life: Life, other: Life) -> None:
    """Two things of a class that may be one."""
    course, stamp_ns = other.seen[0].course.number, other.states[0].first_seen_ns
    ends = (life.thing.number, len(life.states) - 1, other.thing.number, 0)
    life.events.append((course, TemporalEdge("candidate", *ends, None, stamp_ns, 0.4)))


def _close(life: Life, first_ns: int, empty_ns: int | None, gone_ns: int | None) -> None:
    """Enter the state that it was in; it was last seen in the last visit that saw it."""
    box = life.thing.box
    state = StateRecord(
        life.thing.number,
        len(life.states),
        first_ns,
        life.seen[-1].last_ns,
        gone_ns,
        empty_ns,
        box.center,
        box,
        life.thing.label,
        0.97,
    )
    life.states.append(state)
    life.written_by.append(next(visit.course.number for visit in life.seen if visit.last_ns >= first_ns))


def _count(life: Life, visit: Visit, *, seen: bool) -> None:
    looks = (visit.last_ns - visit.first_ns) // STEP_NS + 1
    first, last = (visit.first_ns, visit.last_ns) if seen else (None, None)
    counted = VisitRecord(life.thing.number, looks if seen else 0, looks, 0 if seen else looks, first, last)
    life.visits.append((visit.course.number, counted))


def _event(life: Life, kind: str, visit: Visit, steps: tuple[int, int], distance_m: float | None = None) -> None:
    """What happened to the state just closed, or between it and the one `steps` after it."""
    at, number = len(life.states) - 1, life.thing.number
    ends = (number, at + steps[0], number, at + steps[1])
    bounds = (life.states[-1].last_seen_ns, visit.first_ns + steps[1] * STEP_NS)
    life.events.append((visit.course.number, TemporalEdge(kind, *ends, *bounds, 0.95, distance_m)))  # type: ignore[arg-type]


def _come_back(life: Life) -> None:
    """Tell of every state after a disappearance, and of a first one that was seen to come."""
    number = life.thing.number
    for before, after, course in zip(life.states, life.states[1:], life.written_by[1:], strict=False):
        if after.empty_before_ns is not None:
            bounds = (after.empty_before_ns, after.first_seen_ns)
            edge = TemporalEdge("reappeared", number, before.index, number, after.index, *bounds, 0.95)
            life.events.append((course, edge))
