"""The spatial edges of the scene graph over time: intervals with hysteresis, renewed only around what changed."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from supermap_cli.graph.predicates import PREDICATES, GraphNode, Pair, SpatialPredicate
from supermap_cli.types.memory import SpatialEdge

REACH_M = 2.0
"""No relation reaches farther than this between the bounds of two things."""

HELD_SLACK = 1.3
"""A relation that holds is given up only when its measures are missed by this factor."""


@dataclass
class SceneGraph:
    """Which relations hold now, keyed by (subject, relation, object)."""

    predicates: Sequence[SpatialPredicate] = PREDICATES
    held: dict[tuple[int, str, int], SpatialEdge] = field(default_factory=dict)

    def resume(self, edges: Iterable[SpatialEdge]) -> None:
        """Go on from the open edges that the memory kept."""
        self.held = {(e.subject, e.relation, e.object): e for e in edges if e.until_ns is None}

    def update(
        self, nodes: Mapping[int, GraphNode], changed: Collection[int], stamp_ns: int
    ) -> tuple[SpatialEdge, ...]:
        """Re-compute the edges around the changed nodes; returns those that began, ended or changed.

        `nodes` are the instances that are present now: edges of others end at `stamp_ns`.
        """
        altered = [self._end(key, stamp_ns) for key in list(self.held) if key[0] not in nodes or key[2] not in nodes]
        for first, second in neighbours(nodes, changed):
            pair = Pair(nodes[first], nodes[second])
            for one in (pair, pair.turned()):
                for predicate in self.predicates:
                    edge = self._judge(predicate, one, stamp_ns)
                    if edge is not None:
                        altered.append(edge)
        return tuple(altered)

    def _judge(self, predicate: SpatialPredicate, pair: Pair, stamp_ns: int) -> SpatialEdge | None:
        subject, other = pair.subject.number, pair.other.number
        key = (subject, predicate.name, other)
        held = self.held.get(key)
        confidence = predicate.holds(pair, 1.0 if held is None else HELD_SLACK)
        if confidence <= 0:
            return None if held is None else self._end(key, stamp_ns)
        if held is not None and abs(held.confidence - confidence) < 0.1:
            return None
        since_ns = stamp_ns if held is None else held.since_ns
        self.held[key] = SpatialEdge(subject, predicate.name, other, since_ns, None, float(confidence))
        return self.held[key]

    def _end(self, key: tuple[int, str, int], stamp_ns: int) -> SpatialEdge:
        edge = self.held.pop(key)
        return replace(edge, until_ns=max(stamp_ns, edge.since_ns + 1))


def neighbours(nodes: Mapping[int, GraphNode], changed: Collection[int]) -> list[tuple[int, int]]:
    """Pairs of nodes within reach of one another of which at least one has changed, each pair once."""
    numbers = sorted(nodes)
    if len(numbers) < 2:
        return []
    centers = np.array([nodes[n].box.center for n in numbers])
    radii = np.array([np.linalg.norm(nodes[n].box.size) / 2 for n in numbers])
    pairs = set()
    for i, number in enumerate(numbers):
        if number not in changed:
            continue
        distances = np.linalg.norm(centers - centers[i], axis=1) - radii - radii[i]
        pairs |= {tuple(sorted((number, numbers[int(j)]))) for j in np.flatnonzero(distances <= REACH_M) if j != i}
    return sorted(pairs)  # type: ignore[arg-type]  # sorted() of two ints is a pair of ints
