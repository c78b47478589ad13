"""Synthetic histories of objects from visit to visit: static, moved, removed, returned, merged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from supermap_cli.costs.memory.rooms import SyntheticObject, move_in_room
from supermap_cli.costs.memory.traversals import KEYFRAME_PERIOD_NS, RoomVisit
from supermap_cli.types.existence import probability_of
from supermap_cli.types.memory import Presence, StateRecord, TemporalEdge, Visit

P_MOVED, P_REMOVED, P_RETURNED = 0.01, 0.004, 0.3
"""Probabilities from one visit to the next: an object is moved; is removed; a removed one is returned. Chosen, not
measured.
"""
MERGED_SHARE, DOUBTED_SHARE, CANDIDATE_SHARE = 0.01, 0.01, 0.005
"""Shares of all objects that end merged into a neighbour, doubted, and linked as an identity candidate. Chosen, not
measured.
"""
EXISTENCE_LOG_ODDS, CHANGE_PROBABILITY, CANDIDATE_PROBABILITY = 6.0, 0.95, 0.4
"""Existence of present objects, which gives the confidence of all states; probability of changes and of identity
candidates. Chosen, not measured.
"""
MOVE_DISTANCE_M = 0.8
"""Distance in metres stored with every move; the boxes move by 0.4 to 1.7 m (`rooms.move_in_room`)."""


@dataclass
class SyntheticHistory:
    """All that the memory stores of one instance.

    `seen` are the visits that observed it, `written_by` the traversal of each state, `merged_into` the number of the
    instance that it became a part of.
    """

    obj: SyntheticObject
    states: list[StateRecord] = field(default_factory=list)
    written_by: list[int] = field(default_factory=list)
    visits: list[tuple[int, Visit]] = field(default_factory=list)
    events: list[tuple[int, TemporalEdge]] = field(default_factory=list)
    seen: list[RoomVisit] = field(default_factory=list)
    presence: Presence = "present"
    merged_into: int | None = None


def simulate_history(obj: SyntheticObject, visits: Sequence[RoomVisit], rng: np.random.Generator) -> SyntheticHistory:
    """Draw an object's history over all visits to its room; numbers of traversals stand for their ids."""
    history = SyntheticHistory(obj)
    draws = rng.random((len(visits), 2))
    first_ns, empty_ns, absent = visits[0].first_ns, None, False
    for visit, (movement, removal) in zip(visits, draws, strict=True):
        if absent:
            if movement >= P_RETURNED:
                _append_visit(history, visit, seen=False)
                continue
            absent, first_ns, empty_ns = False, visit.first_ns, visit.first_ns - KEYFRAME_PERIOD_NS
        elif history.seen and removal < P_REMOVED:
            _append_state(history, first_ns, empty_ns, visit.first_ns)
            absent = True
            _append_visit(history, visit, seen=False)
            _append_event(history, "disappeared", visit, (0, 0))
            continue
        elif history.seen and movement < P_MOVED:
            _append_state(history, first_ns, empty_ns, visit.first_ns)
            history.obj = move_in_room(history.obj, history.obj.box, rng)
            first_ns, empty_ns = visit.first_ns + KEYFRAME_PERIOD_NS, None
            _append_event(history, "moved", visit, (0, 1), distance_m=MOVE_DISTANCE_M)
        history.seen.append(visit)
        _append_visit(history, visit, seen=True)
    if absent:
        history.presence = "absent"
    else:
        _append_state(history, first_ns, empty_ns, None)
    _append_reappearances(history)
    return history


def merge(history: SyntheticHistory, into: SyntheticHistory) -> None:
    """Make one instance a part of another, which was taken for an object of its own in its first visit."""
    history.seen = history.seen[:1]
    history.visits = history.visits[:1]
    stamp_ns = history.seen[0].last_ns
    history.states = [replace(history.states[0], last_seen_ns=stamp_ns, gone_ns=None)]
    history.written_by, history.events = history.written_by[:1], []
    history.presence = "present"
    history.merged_into = into.obj.number
    edge = TemporalEdge("merged", history.obj.number, 0, into.obj.number, 0, stamp_ns, stamp_ns, 1.0)
    history.events.append((history.seen[0].traversal.number, edge))


def link_candidates(history: SyntheticHistory, other: SyntheticHistory) -> None:
    """Store that two instances of a class may be the same object."""
    traversal, stamp_ns = other.seen[0].traversal.number, other.states[0].first_seen_ns
    ends = (history.obj.number, len(history.states) - 1, other.obj.number, 0)
    history.events.append((traversal, TemporalEdge("candidate", *ends, None, stamp_ns, CANDIDATE_PROBABILITY)))


def _append_state(history: SyntheticHistory, first_ns: int, empty_ns: int | None, gone_ns: int | None) -> None:
    """Append the state that ends here; it was last seen in the last visit that observed it."""
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
        probability_of(EXISTENCE_LOG_ODDS),
    )
    history.states.append(state)
    history.written_by.append(next(visit.traversal.number for visit in history.seen if visit.last_ns >= first_ns))


def _append_visit(history: SyntheticHistory, visit: RoomVisit, *, seen: bool) -> None:
    keyframes = (visit.last_ns - visit.first_ns) // KEYFRAME_PERIOD_NS + 1
    first, last = (visit.first_ns, visit.last_ns) if seen else (None, None)
    record = Visit(history.obj.number, keyframes if seen else 0, keyframes, 0 if seen else keyframes, first, last)
    history.visits.append((visit.traversal.number, record))


def _append_event(
    history: SyntheticHistory, kind: str, visit: RoomVisit, steps: tuple[int, int], distance_m: float | None = None
) -> None:
    """Append a temporal edge from the state just closed, or between it and the one `steps` after it."""
    at, number = len(history.states) - 1, history.obj.number
    ends = (number, at + steps[0], number, at + steps[1])
    bounds = (history.states[-1].last_seen_ns, visit.first_ns + steps[1] * KEYFRAME_PERIOD_NS)
    history.events.append((visit.traversal.number, TemporalEdge(kind, *ends, *bounds, CHANGE_PROBABILITY, distance_m)))  # type: ignore[arg-type]


def _append_reappearances(history: SyntheticHistory) -> None:
    """Append a reappearance for every state whose place had been seen empty before."""
    number = history.obj.number
    for before, after, traversal in zip(history.states, history.states[1:], history.written_by[1:], strict=False):
        if after.empty_before_ns is not None:
            bounds = (after.empty_before_ns, after.first_seen_ns)
            edge = TemporalEdge("reappeared", number, before.index, number, after.index, *bounds, CHANGE_PROBABILITY)
            history.events.append((traversal, edge))
