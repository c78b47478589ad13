"""The spatial edges of the scene graph over time: intervals with hysteresis, renewed only around what changed.

The edges E_s of the paper's sec. IV-C, which clusters objects by their centroids first; here pairs are within reach of
one another's bounds.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from supermap_cli.graph.predicates import PREDICATES
from supermap_cli.relations.registry import NO_WALLS, Walls, needs_clear_between
from supermap_cli.types.memory import SpatialEdge
from supermap_cli.types.parameters import parameter
from supermap_cli.types.relations import GraphNode, Pair, PredicateParameters, SpatialRelation


@dataclass(frozen=True)
class SceneGraphParameters:
    """Which pairs are looked at, and the hysteresis of edges."""

    reach_m: float = parameter(
        2.0, "m", "gap between the bounds of two things beyond which no relation reaches", "above near's greatest gap"
    )
    held_slack: float = parameter(
        1.3, "1", "factor by which a relation that holds must miss its measures to end", "hysteresis", at_least=1
    )
    walls_moved_m: float = parameter(
        0.1, "m", "how far things across a wall must move for it to be looked at again", "bounds the time"
    )
    walls_growth: float = parameter(
        1.25, "1", "factor by which the views of walls must grow for the same", "bounds the time", at_least=1
    )
    min_confidence_step: float = parameter(
        0.1, "1", "change of an edge's confidence, at least, for it to be written anew", "bounds the writing"
    )


DEFAULT = SceneGraphParameters()


Key = tuple[int, str, int]
"""Subject, relation, object."""


@dataclass
class SceneGraph:
    """Which relations hold now, keyed by (subject, relation, object).

    A relation that needs no wall between its ends begins only where `walls` knows of none. `across_walls` remembers
    pairs with a wall between them: where the two stood (x and y of each) and how many views had shown walls by then.
    """

    predicates: Sequence[SpatialRelation] = PREDICATES
    held: dict[Key, SpatialEdge] = field(default_factory=dict)
    parameters: SceneGraphParameters = DEFAULT
    predicate_parameters: PredicateParameters = field(default_factory=PredicateParameters)
    walls: Walls = NO_WALLS
    across_walls: dict[tuple[int, int], tuple[float, ...]] = field(default_factory=dict)
    _held_of: dict[int, set[Key]] = field(default_factory=dict, repr=False)
    _judged: dict[int, GraphNode] = field(default_factory=dict, repr=False)
    _left_ns: Mapping[int, int] = field(default_factory=dict, repr=False)

    def resume(self, edges: Iterable[SpatialEdge], nodes: Mapping[int, GraphNode] | None = None) -> None:
        """Go on from the open edges that the memory kept, and the nodes for which they were judged."""
        self.held, self._held_of = {}, {}
        for edge in edges:
            if edge.until_ns is None:
                self._hold(edge)
        self._judged = dict(nodes or {})

    def update(
        self,
        nodes: Mapping[int, GraphNode],
        changed: Collection[int],
        stamp_ns: int,
        left_ns: Mapping[int, int] | None = None,
    ) -> tuple[SpatialEdge, ...]:
        """Re-compute the edges around the changed nodes; returns those that began, ended or changed.

        `nodes` are the instances that are present now: edges of others end at `stamp_ns`, or when they left their
        place, which may be known only later (`left_ns`, by number). What has left its place and stands elsewhere begins
        anew. An edge with an empty interval never held.
        """
        self._left_ns = left_ns or {}
        altered = self._end_those_without(nodes, stamp_ns) + self._end_those_left(stamp_ns)
        changed = {*changed, *self._changed_unnoticed(nodes)}
        pairs = neighbours(nodes, changed, self.parameters.reach_m)
        altered += self._end_out_of_reach(changed, pairs, stamp_ns)
        for first, second in pairs:
            pair = Pair(nodes[first], nodes[second], self.predicate_parameters)
            altered += self._judge_all(pair, stamp_ns)
            altered += self._judge_all(pair.turned(), stamp_ns)
        self._judged.update((number, nodes[number]) for number in changed if number in nodes)
        return tuple(altered)

    def end_across_walls(self, nodes: Mapping[int, GraphNode]) -> tuple[SpatialEdge, ...]:
        """What turned out to lie on two sides of a wall, which had not been seen when it was judged: such an edge never
        held.
        """
        by_name = {predicate.name: predicate for predicate in self.predicates}
        never = []
        for key, edge in list(self.held.items()):
            predicate = by_name.get(edge.relation)
            if predicate is not None and predicate.clear_between and {edge.subject, edge.object} <= nodes.keys():
                pair = Pair(nodes[edge.subject], nodes[edge.object], self.predicate_parameters)
                if not self._is_clear(predicate, pair, anew=True):
                    self._drop(key)
                    never.append(replace(edge, until_ns=edge.since_ns))
        return tuple(never)

    def _changed_unnoticed(self, nodes: Mapping[int, GraphNode]) -> list[int]:
        """Those with edges whose shape is another one than when they were judged, whoever has changed it."""
        return [number for number in self._held_of if self._judged.get(number, nodes[number]) is not nodes[number]]

    def _end_those_without(self, nodes: Mapping[int, GraphNode], stamp_ns: int) -> list[SpatialEdge]:
        """End the edges of what no longer stands in the map."""
        lost = self._held_of.keys() - nodes.keys()
        keys = dict.fromkeys(key for number in sorted(lost) for key in sorted(self._held_of[number]))
        for number in lost:
            self._judged.pop(number, None)
        return [self._end(key, stamp_ns, lost) for key in keys]

    def _end_those_left(self, stamp_ns: int) -> list[SpatialEdge]:
        """End the edges that began before one of their ends left its place."""
        left = sorted(self._held_of.keys() & self._left_ns.keys())
        keys = dict.fromkeys(key for number in left for key in sorted(self._held_of[number]))
        return [
            self._end(key, stamp_ns)
            for key in keys
            if any(self.held[key].since_ns < self._left_ns.get(number, 0) for number in (key[0], key[2]))
        ]

    def _end_out_of_reach(
        self, changed: Collection[int], pairs: Collection[tuple[int, int]], stamp_ns: int
    ) -> list[SpatialEdge]:
        """End the edges of changed nodes with what is not even near them any more."""
        within = set(pairs)
        keys = dict.fromkeys(key for number in sorted(changed) for key in sorted(self._held_of.get(number, ())))
        return [self._end(key, stamp_ns) for key in keys if (min(key[0], key[2]), max(key[0], key[2])) not in within]

    def _judge_all(self, pair: Pair, stamp_ns: int) -> list[SpatialEdge]:
        judged = [self._judge(predicate, pair, stamp_ns) for predicate in self.predicates]
        return [edge for edge in judged if edge is not None]

    def _judge(self, predicate: SpatialRelation, pair: Pair, stamp_ns: int) -> SpatialEdge | None:
        subject, other = pair.subject.number, pair.other.number
        key = (subject, predicate.name, other)
        held = self.held.get(key)
        confidence = predicate.holds(pair, 1.0 if held is None else self.parameters.held_slack)
        if confidence <= 0:
            return None if held is None else self._end(key, stamp_ns)
        if held is not None and abs(held.confidence - confidence) < self.parameters.min_confidence_step:
            return None
        if held is None and not self._is_clear(predicate, pair):
            return None
        since_ns = stamp_ns if held is None else held.since_ns
        edge = SpatialEdge(subject, predicate.name, other, since_ns, None, float(confidence))
        self._hold(edge)
        return edge

    def _is_clear(self, predicate: SpatialRelation, pair: Pair, *, anew: bool = False) -> bool:
        """Whether no wall keeps a relation from holding; asked again once either has moved, or more has been seen."""
        if not needs_clear_between(predicate, pair):
            return True
        first, second = sorted((pair.subject, pair.other), key=lambda node: node.number)
        key = (first.number, second.number)
        places = (*first.box.center[:2].tolist(), *second.box.center[:2].tolist())
        if not anew and self._is_known_across(key, places):
            return False
        clear = self.walls.clear_between(first.box, second.box)
        if clear:
            self.across_walls.pop(key, None)
        else:
            self.across_walls[key] = (*places, float(self.walls.views))
        return clear

    def _is_known_across(self, key: tuple[int, int], places: tuple[float, ...]) -> bool:
        """Whether a wall was between two things, and neither they nor what is known of walls have changed much."""
        known, parameters = self.across_walls.get(key), self.parameters
        if known is None or self.walls.views > parameters.walls_growth * known[4]:
            return False
        moved_m = max(abs(now - then) for now, then in zip(places, known[:4], strict=True))
        return moved_m <= parameters.walls_moved_m

    def _hold(self, edge: SpatialEdge) -> None:
        key = (edge.subject, edge.relation, edge.object)
        self.held[key] = edge
        for number in (edge.subject, edge.object):
            self._held_of.setdefault(number, set()).add(key)

    def _drop(self, key: Key) -> SpatialEdge:
        for number in (key[0], key[2]):
            self._held_of[number].discard(key)
            if not self._held_of[number]:
                del self._held_of[number]
        return self.held.pop(key)

    def _end(self, key: Key, stamp_ns: int, lost: Collection[int] = ()) -> SpatialEdge:
        """End an edge no later than either of its ends left its place; what came after that was not seen there."""
        edge = self._drop(key)
        until_ns = max(stamp_ns, edge.since_ns + 1)
        for number in (edge.subject, edge.object):
            left_ns = self._left_ns.get(number, until_ns)
            if left_ns > edge.since_ns or number in lost:
                until_ns = max(edge.since_ns, min(until_ns, left_ns))
        return replace(edge, until_ns=until_ns)


def neighbours(
    nodes: Mapping[int, GraphNode], changed: Collection[int], reach_m: float = DEFAULT.reach_m
) -> list[tuple[int, int]]:
    """Pairs of nodes within reach of one another of which at least one has changed, each pair once."""
    moved = sorted(nodes.keys() & changed)
    if not moved or len(nodes) < 2:
        return []
    numbers = list(nodes)
    centers = np.array([node.box.center for node in nodes.values()])
    radii = np.array([node.radius_m for node in nodes.values()])
    pairs = set()
    for number in moved:
        node = nodes[number]
        distances = np.linalg.norm(centers - node.box.center, axis=1) - radii - node.radius_m
        near = (numbers[i] for i in np.flatnonzero(distances <= reach_m).tolist())
        pairs |= {(min(number, other), max(number, other)) for other in near if other != number}
    return sorted(pairs)
