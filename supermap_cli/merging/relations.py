"""Spatial edges of two memories, joined: what held in both goes on, what stands now is judged anew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from supermap_cli.graph.scene_graph import SceneGraph
from supermap_cli.mapping.objects import ObjectMap
from supermap_cli.types.memory import SpatialEdge
from supermap_cli.types.relations import GraphNode

Key = tuple[int, str, int, int]


def join_edges(
    held: Sequence[SpatialEdge], others: Sequence[SpatialEdge], ends_ns: Mapping[int, int]
) -> dict[Key, SpatialEdge]:
    """Of the map's edges those that end or go on, and the other memory's, by their keys; in the map's numbers and time.

    `ends_ns`: when the state ended in which an object stood at the map's end, where it did.
    """
    changed: dict[Key, SpatialEdge] = {}
    going_on = {_ends(each): each for each in held if each.until_ns is None}
    for edge in sorted(others, key=lambda each: each.since_ns):
        ends = _ends(edge)
        known = going_on.get(ends)
        goes_on = known is not None and edge.since_ns < _end_ns(edge, ends_ns, edge.since_ns + 1)
        joined = replace(edge, since_ns=going_on.pop(ends).since_ns) if goes_on else edge
        changed[_key(joined)] = joined
    for edge in going_on.values():
        if edge.subject in ends_ns or edge.object in ends_ns:
            changed[_key(edge)] = replace(edge, until_ns=max(_end_ns(edge, ends_ns, 0), edge.since_ns + 1))
    return changed


def judge_anew(
    changed: dict[Key, SpatialEdge], held: Sequence[SpatialEdge], objects: ObjectMap, met: set[int], stamp_ns: int
) -> None:
    """Relations around the objects that were met, as all that is known of them now has them; what is new holds since
    both stand there, or since it last did not hold.
    """
    known = {_key(each): each for each in held} | changed
    ended_ns: dict[tuple[int, str, int], int] = {}
    for each in known.values():
        if each.until_ns is not None:
            ended_ns[_ends(each)] = max(each.until_ns, ended_ns.get(_ends(each), 0))
    graph = SceneGraph()
    graph.resume(each for each in known.values() if each.until_ns is None)
    standing = [each for each in objects if each.confirmed and each.present and not each.demoted]
    nodes = {each.number: GraphNode(each.number, each.label, each.shape.box, each.shape.points) for each in standing}
    for edge in graph.update(nodes, met, stamp_ns):
        if edge.since_ns == stamp_ns:
            both_ns = max(objects[each].state.first_seen_ns for each in (edge.subject, edge.object))
            begun = replace(edge, since_ns=max(both_ns, ended_ns.get(_ends(edge), 0)))
            changed[_key(begun)] = begun
        else:
            changed[_key(edge)] = edge


def _end_ns(edge: SpatialEdge, ends_ns: Mapping[int, int], default_ns: int) -> int:
    return min((ends_ns[each] for each in (edge.subject, edge.object) if each in ends_ns), default=default_ns)


def _ends(edge: SpatialEdge) -> tuple[int, str, int]:
    return edge.subject, edge.relation, edge.object


def _key(edge: SpatialEdge) -> Key:
    return edge.subject, edge.relation, edge.object, edge.since_ns
