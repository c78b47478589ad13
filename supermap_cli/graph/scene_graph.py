"""The spatial edges of the scene graph over time: intervals with hysteresis, renewed only around what changed.

The edges E_s of the paper's sec. IV-C, which clusters objects by their centroids first; here pairs are within reach of
one another's bounds.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from supermap_cli.graph.predicates import PREDICATES, GraphNode, Pair, PredicateParameters, SpatialPredicate
from supermap_cli.types.memory import SpatialEdge
from supermap_cli.types.parameters import parameter


@dataclass(frozen=True)
class SceneGraphParameters:
    """Which pairs are looked at, and the hysteresis of edges."""

    reach_m: float = parameter(
        2.0, "m", "gap between the bounds of two things beyond which no relation reaches", "above near's greatest gap"
    )
    held_slack: float = parameter(
        1.3, "1", "factor by which a relation that holds must miss its measures to end", "hysteresis", at_least=1
    )
    min_confidence_step: float = parameter(
        0.1, "1", "change of an edge's confidence, at least, for it to be written anew", "bounds the writing"
    )


DEFAULT = SceneGraphParameters()


@dataclass
class SceneGraph:
    """Which relations hold now, keyed by (subject, relation, object)."""

    predicates: Sequence[SpatialPredicate] = PREDICATES
    held: dict[tuple[int, str, int], SpatialEdge] = field(default_factory=dict)
    parameters: SceneGraphParameters = DEFAULT
    predicate_parameters: PredicateParameters = field(default_factory=PredicateParameters)
    _related: set[int] = field(default_factory=set, repr=False)
    _left_ns: Mapping[int, int] = field(default_factory=dict, repr=False)

    def resume(self, edges: Iterable[SpatialEdge]) -> None:
        """Go on from the open edges that the memory kept."""
        self.held = {(edge.subject, edge.relation, edge.object): edge for edge in edges if edge.until_ns is None}
        self._related = {number for subject, _, other in self.held for number in (subject, other)}

    def update(
        self,
        nodes: Mapping[int, GraphNode],
        changed: Collection[int],
        stamp_ns: int,
        left_ns: Mapping[int, int] | None = None,
    ) -> tuple[SpatialEdge, ...]:
        """Re-compute the edges around the changed nodes; returns those that began, ended or changed.

        `nodes` are the instances that are present now: edges of others end at `stamp_ns`, or when they left their
        place, which may be known only later (`left_ns`, by number). An edge with an empty interval never held.
        """
        self._left_ns = left_ns or {}
        altered = self._end_those_without(nodes, stamp_ns)
        for first, second in neighbours(nodes, changed, self.parameters.reach_m):
            pair = Pair(nodes[first], nodes[second], self.predicate_parameters)
            altered += self._judge_all(pair, stamp_ns)
            altered += self._judge_all(pair.turned(), stamp_ns)
        return tuple(altered)

    def _end_those_without(self, nodes: Mapping[int, GraphNode], stamp_ns: int) -> list[SpatialEdge]:
        """End the edges of what no longer stands in the map."""
        lost = self._related - nodes.keys()
        if not lost:
            return []
        self._related -= lost
        return [self._end(key, stamp_ns, lost) for key in list(self.held) if key[0] in lost or key[2] in lost]

    def _judge_all(self, pair: Pair, stamp_ns: int) -> list[SpatialEdge]:
        judged = [self._judge(predicate, pair, stamp_ns) for predicate in self.predicates]
        return [edge for edge in judged if edge is not None]

    def _judge(self, predicate: SpatialPredicate, pair: Pair, stamp_ns: int) -> SpatialEdge | None:
        subject, other = pair.subject.number, pair.other.number
        key = (subject, predicate.name, other)
        held = self.held.get(key)
        confidence = predicate.holds(pair, 1.0 if held is None else self.parameters.held_slack)
        if confidence <= 0:
            return None if held is None else self._end(key, stamp_ns)
        if held is not None and abs(held.confidence - confidence) < self.parameters.min_confidence_step:
            return None
        since_ns = stamp_ns if held is None else held.since_ns
        self._related |= {subject, other}
        self.held[key] = SpatialEdge(subject, predicate.name, other, since_ns, None, float(confidence))
        return self.held[key]

    def _end(self, key: tuple[int, str, int], stamp_ns: int, lost: Collection[int] = ()) -> SpatialEdge:
        """End an edge no later than either of its ends left its place; what came after that was not seen there."""
        edge = self.held.pop(key)
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
