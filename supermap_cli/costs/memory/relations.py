"""The relations that a build would have stored between the things of a room."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from supermap_cli.costs.memory.histories import ObjectHistory
from supermap_cli.query.relations import box_distance_m, holds
from supermap_cli.types.memory import SpatialEdge, StateRecord

NEAR_M = 0.8
ON = {"monitor", "keyboard", "cup", "lamp", "vase", "globe", "laptop", "bottle", "microwave", "book"}
"""What stands on other things."""


def edges_of_room(inside: Sequence[ObjectHistory]) -> Iterator[tuple[SpatialEdge, int]]:
    """Between the newest states of things that are still there, and the traversal that wrote each."""
    known = [(history, history.states[-1]) for history in inside if history.states]
    for at, (one, state) in enumerate(known):
        for other, its in known[at + 1 :]:
            if abs(state.box.center - its.box.center)[:2].max() > 2.5:
                continue
            if box_distance_m(state.box, its.box) <= NEAR_M:
                yield from _edges(one, state, other, its)


def _edges(
    one: ObjectHistory, state: StateRecord, other: ObjectHistory, its: StateRecord
) -> Iterator[tuple[SpatialEdge, int]]:
    since_ns = max(state.first_seen_ns, its.first_seen_ns)
    ends = [gone for gone in (state.gone_ns, its.gone_ns) if gone is not None]
    until_ns = min(ends, default=None)
    if until_ns is not None and until_ns <= since_ns:
        return
    written_by = max(one.written_by[-1], other.written_by[-1])
    a, b = state.object_number, its.object_number
    yield SpatialEdge(a, "near", b, since_ns, until_ns, 0.9), written_by
    for (upper, upper_state), (lower, lower_state) in (((one, state), (other, its)), ((other, its), (one, state))):
        if upper.obj.label in ON and lower.obj.label not in ON and holds("on", upper_state.box, lower_state.box):
            edge = SpatialEdge(upper.obj.number, "on", lower.obj.number, since_ns, until_ns, 0.9)
            yield edge, written_by
