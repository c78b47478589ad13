"""Where a thing stands, in words: on, in, or beside what, and how far from it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

from supermap_cli.geometry.boxes import Reach
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.answering.asking import Asking
from supermap_cli.query.candidates import InstanceCandidate
from supermap_cli.query.relations import box_distance_m
from supermap_cli.query.time_selector import state_end_ns
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


def places(asking: Asking, candidates: Sequence[InstanceCandidate]) -> dict[int, str]:
    """The place of each candidate by instance number: "on desk-1", "beside tv-1", "1.20 m from couch-1"."""
    states = {candidate.instance.number: candidate.state for candidate in candidates}
    owners = {candidate.instance.number: candidate.instance for candidate in candidates}
    by_edges = _by_edges(asking, states, owners)
    missing = {number: state for number, state in states.items() if number not in by_edges}
    return by_edges | (_by_distance(asking, missing) if missing else {})


def place_of(asking: Asking, instance: StoredInstance, state: StateRecord) -> str:
    """The place of one instance in one of its states; its position where no landmark is near."""
    found = places(asking, [InstanceCandidate(instance, state)])
    x, y, z = (float(value) for value in state.centroid_map)
    return found.get(instance.number, f"at {position_text((x, y, z))}")


def position_text(position: Vector) -> str:
    """A position as it is said."""
    x, y, z = position
    return f"({x:.2f}, {y:.2f}, {z:.2f}) m"


def _by_edges(asking: Asking, states: dict[int, StateRecord], owners: dict[int, StoredInstance]) -> dict[int, str]:
    edges = asking.reader.edges_of(list(states), set(_WORDS))
    ends = {number for edge in edges for number in (edge.subject, edge.object)}
    others = {instance.number: instance for instance in asking.reader.instances_of(ends, visits=False)}
    best: dict[int, tuple[tuple[int, float], str]] = {}
    for edge in edges:
        for number in (edge.subject, edge.object):
            placed = number in states and _tells(edge, number, states[number], owners[number])
            other = others.get(edge.object if number == edge.subject else edge.subject)
            if not placed or other is None or other.presence == "doubted" or other.label in DYNAMIC_CLASSES:
                continue
            rank = (list(_WORDS).index(edge.relation), -other.box.volume)
            if number not in best or rank < best[number][0]:
                best[number] = rank, f"{_WORDS[edge.relation]} {other.id}"
    return {number: text for number, (_, text) in best.items()}


def _tells(edge: SpatialEdge, number: int, state: StateRecord, owner: StoredInstance) -> bool:
    """Whether an edge holds in a state, and tells its subject's place (or the object's, if it holds both ways)."""
    if number != edge.subject and edge.relation not in {"near", "beside"}:
        return False
    return edge.since_ns < state_end_ns(state, owner.states) and (
        edge.until_ns is None or edge.until_ns > state.first_seen_ns
    )


def _by_distance(asking: Asking, states: dict[int, StateRecord]) -> dict[int, str]:
    """The nearest thing that is present."""
    found: dict[int, str] = {}
    for reach_m in SEARCH_M:
        around: dict[int, set[int]] = defaultdict(set)
        for here, there in asking.reader.search.near(states.keys() - found.keys(), Reach(reach_m, reach_m)):
            around[here].add(there)
        others = asking.reader.instances_by_number({there for numbers in around.values() for there in numbers})
        for number, neighbours in around.items():
            text = _nearest(states[number], (others[other] for other in neighbours if other in others))
            if text is not None:
                found[number] = text
        if len(found) == len(states):
            break
    return found


def _nearest(state: StateRecord, others: Iterable[StoredInstance]) -> str | None:
    distances = [(box_distance_m(state.box, other.box), other.id) for other in others if other.presence == "present"]
    if not distances:
        return None
    distance_m, text_id = min(distances)
    return f"{distance_m:.2f} m from {text_id}"
