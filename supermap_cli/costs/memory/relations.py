"""Spatial edges that a build would have stored between the objects of a room."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from supermap_cli.costs.memory.histories import SyntheticHistory
from supermap_cli.query.relations import box_distance_m, holds
from supermap_cli.types.memory import SpatialEdge, StateRecord

MAX_NEAR_GAP_M = 0.8
"""Metres between two boxes up to which they are stored as near. Chosen: about as many edges as a build stores."""
MAX_CENTER_OFFSET_M = 2.5
"""Metres along x or y beyond which two boxes are not compared."""
EDGE_CONFIDENCE = 0.9
"""Confidence of every stored edge. Chosen."""
SUPPORTED_CLASSES = {"monitor", "keyboard", "cup", "lamp", "vase", "globe", "laptop", "bottle", "microwave", "book"}
"""Classes that stand on other objects."""


def edges_of_room(histories: Sequence[SyntheticHistory]) -> Iterator[tuple[SpatialEdge, int]]:
    """(edge, traversal that wrote it) between the newest states of a room's objects."""
    current = [(history, history.states[-1]) for history in histories if history.states]
    for index, (first, state) in enumerate(current):
        for second, second_state in current[index + 1 :]:
            if abs(state.box.center - second_state.box.center)[:2].max() > MAX_CENTER_OFFSET_M:
                continue
            if box_distance_m(state.box, second_state.box) <= MAX_NEAR_GAP_M:
                yield from _edges(first, state, second, second_state)


def _edges(
    first: SyntheticHistory, state: StateRecord, second: SyntheticHistory, second_state: StateRecord
) -> Iterator[tuple[SpatialEdge, int]]:
    since_ns = max(state.first_seen_ns, second_state.first_seen_ns)
    ends = [gone for gone in (state.gone_ns, second_state.gone_ns) if gone is not None]
    until_ns = min(ends, default=None)
    if until_ns is not None and until_ns <= since_ns:
        return
    written_by = max(first.written_by[-1], second.written_by[-1])
    a, b = state.object_number, second_state.object_number
    yield SpatialEdge(a, "near", b, since_ns, until_ns, EDGE_CONFIDENCE), written_by
    for (upper, upper_state), (lower, lower_state) in (
        ((first, state), (second, second_state)),
        ((second, second_state), (first, state)),
    ):
        if (
            upper.obj.label in SUPPORTED_CLASSES
            and lower.obj.label not in SUPPORTED_CLASSES
            and holds("on", upper_state.box, lower_state.box)
        ):
            edge = SpatialEdge(upper.obj.number, "on", lower.obj.number, since_ns, until_ns, EDGE_CONFIDENCE)
            yield edge, written_by
