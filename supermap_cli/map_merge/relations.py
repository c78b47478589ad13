"""Merges the spatial edges of two maps: edges of both continue, those of changed objects are re-evaluated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from supermap_cli.graph.scene_graph import SceneGraph
from supermap_cli.mapping.objects import ObjectMap
from supermap_cli.mapping.walls import WallMap
from supermap_cli.stages.session_walls import SessionWalls
from supermap_cli.types.memory import SpatialEdge
from supermap_cli.types.relations import GraphNode

Key = tuple[int, str, int, int]
"""Subject, relation, object, `since_ns`."""


def merge_edges(
    held: Sequence[SpatialEdge], others: Sequence[SpatialEdge], state_ends_ns: Mapping[int, int]
) -> dict[Key, SpatialEdge]:
    """Those of this map's edges (`held`) that change, and the edges of the other map, by their keys.

    All are in this map's numbers and time. `state_ends_ns` says, by object number, when the state ended that was open
    at the end of this map.
    """
    changed: dict[Key, SpatialEdge] = {}
    open_edges = {_triple(edge): edge for edge in held if edge.until_ns is None}
    for edge in sorted(others, key=lambda other: other.since_ns):
        triple = _triple(edge)
        continues = triple in open_edges and edge.since_ns < _end_ns(edge, state_ends_ns, edge.since_ns + 1)
        merged = replace(edge, since_ns=open_edges.pop(triple).since_ns) if continues else edge
        changed[_key(merged)] = merged
    for edge in open_edges.values():
        if edge.subject in state_ends_ns or edge.object in state_ends_ns:
            changed[_key(edge)] = replace(edge, until_ns=max(_end_ns(edge, state_ends_ns, 0), edge.since_ns + 1))
    return changed


def reevaluate_edges(
    changed: dict[Key, SpatialEdge],
    held: Sequence[SpatialEdge],
    objects: ObjectMap,
    changed_objects: set[int],
    stamp_ns: int,
    *,
    walls: WallMap | None = None,
) -> None:
    """Evaluate the relations of changed objects at `stamp_ns` and enter the result in `changed`; `walls` are those that
    the views of both maps show.

    A new edge begins when both of its objects are in their present states, or when it last ended.
    """
    known = {_key(edge): edge for edge in held} | changed
    ended_ns: dict[tuple[int, str, int], int] = {}
    for edge in known.values():
        if edge.until_ns is not None:
            ended_ns[_triple(edge)] = max(edge.until_ns, ended_ns.get(_triple(edge), 0))
    nodes: dict[int, GraphNode] = {}
    graph = SceneGraph(walls=SessionWalls(walls or WallMap(), lambda: nodes))
    graph.resume(edge for edge in known.values() if edge.until_ns is None)
    present = [obj for obj in objects if obj.confirmed and obj.present and not obj.demoted]
    nodes.update((obj.number, GraphNode(obj.number, obj.label, obj.shape.box, obj.shape.points)) for obj in present)
    for edge in graph.update(nodes, changed_objects, stamp_ns):
        if edge.since_ns == stamp_ns:
            both_ns = max(objects[number].state.first_seen_ns for number in (edge.subject, edge.object))
            begun = replace(edge, since_ns=max(both_ns, ended_ns.get(_triple(edge), 0)))
            changed[_key(begun)] = begun
        else:
            changed[_key(edge)] = edge


def _end_ns(edge: SpatialEdge, state_ends_ns: Mapping[int, int], default_ns: int) -> int:
    """When the first of its objects left the state it was in."""
    ends_ns = (state_ends_ns[number] for number in (edge.subject, edge.object) if number in state_ends_ns)
    return min(ends_ns, default=default_ns)


def _triple(edge: SpatialEdge) -> tuple[int, str, int]:
    return edge.subject, edge.relation, edge.object


def _key(edge: SpatialEdge) -> Key:
    return edge.subject, edge.relation, edge.object, edge.since_ns
