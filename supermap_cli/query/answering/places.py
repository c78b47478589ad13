"""Where a thing stands, in words: on, in, or beside what, and how far from it."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

from supermap_cli.geometry.boxes import Reach
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.answering.asking import Asking
from supermap_cli.query.candidates import InstanceCandidate
from supermap_cli.query.relations import box_distance_m
from supermap_cli.query.time_selector import TimeSelector, TimeSpan, state_end_ns
from supermap_cli.query.views import Vector
from supermap_cli.types.labels import DYNAMIC_CLASSES
from supermap_cli.types.memory import SpatialEdge, StateRecord

_WORDS = {
    "on": "on",
    "inside": "in",
    "attached to": "attached to",
    "under": "under",
    "beside": "beside",
    "near": "near",
}
"""Relations that tell a place, the most telling first, as they are said."""
SEARCH_M = (2.0, 8.0)
"""Distances (m) within which the nearest landmark is looked for where no relation is stored, one after the other."""


def places(asking: Asking, candidates: Sequence[InstanceCandidate], selector: TimeSelector) -> dict[int, str]:
    """The place of each candidate at the selected time, by instance number: "on desk-1", "1.20 m from couch-1"."""
    by_number = {candidate.instance.number: candidate for candidate in candidates}
    by_edges = _by_edges(asking, by_number, selector)
    missing = {number: candidate for number, candidate in by_number.items() if number not in by_edges}
    return by_edges | (_by_distance(asking, missing, selector) if missing else {})


def place_of(asking: Asking, instance: StoredInstance, state: StateRecord) -> str:
    """The place of one instance in one of its states; its position where no landmark is near."""
    selector = TimeSelector("during", "then", state.first_seen_ns, state.last_seen_ns)
    if instance.presence == "present" and state.index == instance.states[-1].index:
        selector = TimeSelector("now", "now", low_ns=asking.reader.now_ns)
    found = places(asking, [InstanceCandidate(instance, state)], selector)
    x, y, z = (float(value) for value in state.centroid_map)
    return found.get(instance.number, f"at {position_text((x, y, z))}")


def position_text(position: Vector) -> str:
    """A position as it is said."""
    x, y, z = position
    return f"({x:.2f}, {y:.2f}, {z:.2f}) m"


def _by_edges(asking: Asking, placed: dict[int, InstanceCandidate], selector: TimeSelector) -> dict[int, str]:
    edges = asking.reader.edges_of(list(placed), set(_WORDS))
    ends = {number for edge in edges for number in (edge.subject, edge.object)}
    others = {instance.number: instance for instance in asking.reader.instances_of(ends, visits=False)}
    best: dict[int, tuple[tuple[int, float], str]] = {}
    for edge in edges:
        for number in (edge.subject, edge.object):
            other = others.get(edge.object if number == edge.subject else edge.subject)
            if number not in placed or other is None or not _tells(edge, placed[number], other, selector):
                continue
            rank = (list(_WORDS).index(edge.relation), -other.box.volume)
            if number not in best or rank < best[number][0]:
                best[number] = rank, f"{_WORDS[edge.relation]} {other.id}"
    return {number: text for number, (_, text) in best.items()}


def _tells(edge: SpatialEdge, candidate: InstanceCandidate, other: StoredInstance, selector: TimeSelector) -> bool:
    """Whether an edge holds at the selected time, and tells its subject's place (or the object's, if it holds both
    ways).
    """
    if candidate.instance.number != edge.subject and edge.relation not in {"near", "beside"}:
        return False
    spans = (span for _, span in _standing_with(candidate, other, selector))
    return any(span.overlaps(edge.since_ns, edge.until_ns) for span in spans)


def _standing_with(
    candidate: InstanceCandidate, other: StoredInstance, selector: TimeSelector
) -> Iterator[tuple[StateRecord, TimeSpan]]:
    """The states in which another thing stood there while the candidate did, within the selected time. One that ended
    is not known to have held after it was last seen.
    """
    if other.presence == "doubted" or other.label in DYNAMIC_CLASSES:
        return
    for state in selector.reference_states(other):
        span = selector.span_of((candidate.state, candidate.instance), (state, other))
        ended = state_end_ns(state, other.states) < math.inf and state.last_seen_ns < selector.low_ns
        if span is not None and not ended:
            yield state, span


def _by_distance(asking: Asking, placed: dict[int, InstanceCandidate], selector: TimeSelector) -> dict[int, str]:
    """The nearest thing that stood there at the selected time."""
    found: dict[int, str] = {}
    for reach_m in SEARCH_M:
        around: dict[int, set[int]] = defaultdict(set)
        for here, there in asking.reader.search.near(placed.keys() - found.keys(), Reach(reach_m, reach_m)):
            around[here].add(there)
        others = asking.reader.instances_by_number({there for numbers in around.values() for there in numbers})
        for number, neighbours in around.items():
            near = (others[other] for other in neighbours if other in others and other != number)
            text = _nearest(placed[number], near, selector, reach_m)
            if text is not None:
                found[number] = text
        if len(found) == len(placed):
            break
    return found


def _nearest(
    candidate: InstanceCandidate, others: Iterable[StoredInstance], selector: TimeSelector, reach_m: float
) -> str | None:
    distances = [
        (box_distance_m(candidate.state.box, state.box), other.id)
        for other in others
        for state, _ in _standing_with(candidate, other, selector)
    ]
    distance_m, text_id = min(distances, default=(reach_m, None))
    return None if text_id is None or distance_m > reach_m else f"{distance_m:.2f} m from {text_id}"
