"""Random instances with states and visits, as the mapping engine may write them: for property tests of time."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from supermap_cli.memory.values import StoredInstance, StoredTraversal, StoredVisit
from supermap_cli.types.memory import StateRecord
from support import memories as m

PLACES: tuple[m.Point, ...] = ((0, 0, 0.5), (2, 0, 0.5), (0, 3, 0.5))
END_S = 200


@st.composite
def state_lists(draw: st.DrawFn, number: int = 1, most: int = 4) -> tuple[StateRecord, ...]:
    """Up to `most` states of one instance within [0, `END_S`] s, disjoint, with all kinds of gaps."""
    count = draw(st.integers(1, most))
    times = draw(st.lists(st.integers(1, END_S - 1), min_size=4 * count, max_size=4 * count, unique=True).map(sorted))
    places = [draw(st.sampled_from(range(len(PLACES)))) for _ in range(count)]
    states: list[StateRecord] = []
    for index in range(count):
        empty, first, last, gone = times[4 * index : 4 * index + 4]
        newest = index == count - 1
        here_before = index > 0 and places[index] == places[index - 1]
        seen_go = draw(st.booleans()) or (here_before is False and newest is False and draw(st.booleans()))
        before = states[-1].gone_ns if here_before else None
        came = before is not None or draw(st.booleans())
        states.append(
            m.state(
                number,
                index,
                (first, last),
                PLACES[places[index]],
                gone=gone if seen_go else None,
                empty_before=empty if came else None,
            )
        )
    return tuple(states)


def instance_with_states(states: tuple[StateRecord, ...], visits: tuple[StoredVisit, ...] = ()) -> StoredInstance:
    """An instance with the given states; present unless its last state was contradicted."""
    last = states[-1]
    return StoredInstance(
        number=1,
        id="cup-1",
        label="cup",
        label_belief={"cup": 1.0},
        presence="present" if last.gone_ns is None else "absent",
        existence_log_odds=1.0,
        first_seen_ns=states[0].first_seen_ns,
        last_seen_ns=last.last_seen_ns,
        centroid_map=last.centroid_map,
        box=last.box,
        observations=1,
        traversal_id=1,
        numbers=(1,),
        states=states,
        visits=visits,
    )


def instances() -> st.SearchStrategy[StoredInstance]:
    """Random instances without visits."""
    return state_lists().map(instance_with_states)


def _traversal(number: int, start_s: int, end_s: int) -> StoredTraversal:
    return StoredTraversal(
        id=number,
        number=number,
        name=f"t{number}",
        recording=f"t{number}.mcap",
        fingerprint=str(number),
        start_ns=m.ns(start_s),
        end_ns=m.ns(end_s),
        T_map_odom=np.eye(4),
        config={},
        versions={},
        status="complete",
        mapped_ns=m.ns(end_s),
        timings={},
        keyframes=1,
    )


TRAVERSALS = (_traversal(1, 0, 66), _traversal(2, 67, 133), _traversal(3, 134, END_S))
"""Three consecutive traversals, so that every support lies in one of them."""


def visited_instances() -> st.SearchStrategy[StoredInstance]:
    """Random instances with their visits in each of `TRAVERSALS`."""
    return state_lists().map(
        lambda states: instance_with_states(states, tuple(_visit(traversal, states) for traversal in TRAVERSALS))
    )


def _visit(traversal: StoredTraversal, states: tuple[StateRecord, ...]) -> StoredVisit:
    supports = [ns for state in states for ns in (state.first_seen_ns, state.last_seen_ns)]
    supported = sum(traversal.start_ns <= support_ns <= traversal.end_ns for support_ns in supports)
    return StoredVisit(traversal.id, 1, supported, supported, 0, None, None)
