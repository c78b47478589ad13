"""All spatial relations, each with its geometry, words, reach and inverse: the scene graph keeps them, questions use
them.

    holds("on", cup, table)                       # two boxes or two nodes: a confidence, 0 where it does not hold
    RELATIONS.phrases("en")                       # (("on top of", "on"), ..., ("on", "on"), ...), the longest first
    RELATIONS["above"].inverse                    # "below"
    RELATIONS.with_further(from_a_plugin)         # what a plugin defines is asked and stored like the others
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from supermap_cli.geometry.boxes import Box3D, Reach, footprint_gap_m
from supermap_cli.relations import predicates
from supermap_cli.types import relations
from supermap_cli.types.relations import EdgeForm, GraphNode, Pair, PredicateParameters, SpatialRelation

DEFAULT = relations.DEFAULT

ClearBetween = Callable[[Box3D, Box3D], bool]
"""Whether no wall stands between two boxes, as far as anybody knows."""


def nothing_known(_first: Box3D, _second: Box3D) -> bool:
    """No wall is known."""
    return True


class Walls(Protocol):
    """Where walls are known to stand, and from how many `views`."""

    @property
    def views(self) -> int:
        """It grows with what is known."""

    def clear_between(self, first: Box3D, second: Box3D) -> bool:
        """Whether no wall is known to stand between two boxes."""


@dataclass(frozen=True)
class NoWalls:
    """Nothing is known of any wall."""

    views: int = 0

    def clear_between(self, first: Box3D, second: Box3D) -> bool:
        """Always."""
        return nothing_known(first, second)


NO_WALLS = NoWalls()


@dataclass(frozen=True)
class RelationContext:
    """What a relation is judged by besides the two things.

    `clear_between` knows the walls; `slack` is 1 for a new relation, greater for one that held before.
    """

    clear_between: ClearBetween = nothing_known
    parameters: PredicateParameters = DEFAULT
    slack: float = 1.0


NO_CONTEXT = RelationContext()


def _reaches(parameters: PredicateParameters) -> dict[str, Reach]:
    """How far apart two boxes in each relation may be."""
    p = parameters
    near_m = p.near_gap_m + p.near_gap_share * p.max_scale_m
    beside_m = p.beside_gap_m + p.beside_gap_share * p.max_scale_m
    on_m = p.contact_m + p.on_reach_share * p.on_reach_height_m
    return {
        "near": Reach(near_m, near_m),
        "around": Reach(near_m, 0.0),
        "beside": Reach(beside_m, 0.0),
        "at": Reach(beside_m, 0.0),
        "against": Reach(p.against_gap_m, 0.0),
        "attached to": Reach(p.attached_gap_m, 0.0),
        "on": Reach(0.0, on_m, covered=p.on_overlap),
        "supporting": Reach(0.0, on_m),
        "inside": Reach(0.0, 0.0, covered=p.inside_share),
        "containing": Reach(0.0, 0.0),
        "above": Reach(0.0, math.inf),
        "under": Reach(0.0, math.inf),
        "below": Reach(0.0, math.inf),
        "far from": Reach(math.inf, math.inf),
    }


_REACH = _reaches(DEFAULT)


def _english(*phrases: str) -> Mapping[str, tuple[str, ...]]:
    return {"en": phrases}


def _both_ways(*names: str) -> tuple[EdgeForm, ...]:
    return tuple(EdgeForm(name, turned) for name in names for turned in (False, True))


_COVERED = (EdgeForm("on", turned=True), EdgeForm("above", turned=True))
_COVERING = (EdgeForm("on"), EdgeForm("under", turned=True))

BUILT_IN: tuple[SpatialRelation, ...] = (
    SpatialRelation(
        "on", predicates.on, _english("on", "on top of", "upon", "onto", "atop"), _REACH["on"], inverse="supporting"
    ),
    SpatialRelation(
        "supporting",
        predicates.never,
        _english("supporting", "carrying", "holding up"),
        _REACH["supporting"],
        inverse="on",
        follows_from=(EdgeForm("on", turned=True),),
        stored=False,
    ),
    SpatialRelation(
        "under",
        predicates.under,
        _english("under", "underneath", "beneath"),
        _REACH["under"],
        inverse="above",
        follows_from=_COVERED,
    ),
    SpatialRelation(
        "inside",
        predicates.inside,
        _english("inside", "inside of", "in", "within", "into"),
        _REACH["inside"],
        inverse="containing",
    ),
    SpatialRelation(
        "containing",
        predicates.never,
        _english("containing"),
        _REACH["containing"],
        inverse="inside",
        follows_from=(EdgeForm("inside", turned=True),),
        stored=False,
    ),
    SpatialRelation(
        "above", predicates.above, _english("above", "over"), _REACH["above"], inverse="below", follows_from=_COVERING
    ),
    SpatialRelation(
        "below",
        predicates.never,
        _english("below", "lower than"),
        _REACH["below"],
        inverse="above",
        follows_from=(EdgeForm("under"), *_COVERED),
        stored=False,
    ),
    SpatialRelation(
        "beside",
        predicates.beside,
        _english("beside", "next to", "by", "alongside", "adjacent to", "at the side of"),
        _REACH["beside"],
        symmetric=True,
        clear_between=True,
    ),
    SpatialRelation(
        "near",
        predicates.near,
        _english("near", "near to", "close to", "nearby", "close by", "in the vicinity of"),
        _REACH["near"],
        symmetric=True,
        follows_from=_both_ways("beside", "on", "inside", "attached to"),
        clear_between=True,
    ),
    SpatialRelation(
        "around",
        predicates.around,
        _english("around", "surrounding", "all around"),
        _REACH["around"],
        symmetric=True,
        within="near",
        stored=False,
        clear_between=True,
    ),
    SpatialRelation(
        "at",
        predicates.at,
        _english("at"),
        _REACH["at"],
        symmetric=True,
        within="near",
        stored=False,
        clear_between=True,
    ),
    SpatialRelation(
        "against",
        predicates.against,
        _english("against", "touching", "up against", "leaning against", "leaning on"),
        _REACH["against"],
        symmetric=True,
        within="near",
        stored=False,
        clear_between=True,
    ),
    SpatialRelation(
        "attached to",
        predicates.attached_to,
        _english("attached to", "fixed to", "mounted on", "mounted to", "hanging on", "hanging from"),
        _REACH["attached to"],
    ),
    SpatialRelation(
        "far from",
        predicates.far_from,
        _english("far from", "far away from", "a long way from"),
        _REACH["far from"],
        symmetric=True,
        stored=False,
    ),
)


@dataclass(frozen=True)
class RelationRegistry:
    """The relations that are known, by name: the built-in ones, and those of plugins."""

    relations: tuple[SpatialRelation, ...] = BUILT_IN
    parameters: PredicateParameters = field(default=DEFAULT)

    @cached_property
    def by_name(self) -> Mapping[str, SpatialRelation]:
        """The relations under their names."""
        return {relation.name: relation for relation in self.relations}

    def __getitem__(self, name: str) -> SpatialRelation:
        return self.by_name[name]

    def __contains__(self, name: object) -> bool:
        return name in self.by_name

    def __iter__(self) -> Iterator[SpatialRelation]:
        return iter(self.relations)

    def with_further(self, further: Iterable[SpatialRelation]) -> RelationRegistry:
        """With the relations of plugins; one with a name that is taken is left out."""
        new = {relation.name: relation for relation in further if relation.name not in self}
        return RelationRegistry((*self.relations, *new.values()), self.parameters)

    @property
    def stored(self) -> tuple[SpatialRelation, ...]:
        """Those that the scene graph keeps edges of."""
        return tuple(relation for relation in self.relations if relation.stored)

    def phrases(self, language: str = "en") -> tuple[tuple[str, str], ...]:
        """All (phrase, relation's name) of a language, those with more words first."""
        spoken = [(phrase, relation.name) for relation in self.relations for phrase in relation.phrases(language)]
        return tuple(sorted(spoken, key=lambda pair: -len(pair[0].split())))

    def inverse(self, name: str) -> str | None:
        """The relation that holds the other way round; `None` where it has no name."""
        return name if self[name].symmetric else self[name].inverse

    def stored_forms(self, name: str) -> tuple[EdgeForm, ...]:
        """The stored relations that answer a relation. Those of a relation `within` another only choose the pairs."""
        relation = self[name]
        own = EdgeForm(relation.within or name)
        forms = [own] if relation.stored or relation.within else []
        if relation.symmetric and forms:
            forms.append(EdgeForm(own.relation, turned=True))
        return (*forms, *(form for form in relation.follows_from if self[form.relation].stored))

    def reach(self, name: str) -> Reach:
        """How far apart two boxes in a relation may be, with a slack of 1."""
        return _reaches(self.parameters).get(name, self[name].reach)

    def measure(self, name: str, pair: Pair, slack: float = 1.0, clear_between: ClearBetween = nothing_known) -> float:
        """A confidence in (0, 1] that the relation holds, by its own geometry or because one holds that it follows
        from; else 0.
        """
        relation = self[name]
        best = self._own(relation, pair, slack, clear_between)
        for form in relation.follows_from:
            if best < 1:
                turned = pair.turned() if form.turned else pair
                best = max(best, self._own(self[form.relation], turned, slack, clear_between))
        return best

    def _own(self, relation: SpatialRelation, pair: Pair, slack: float, clear_between: ClearBetween) -> float:
        """The confidence by a relation's own geometry, within the relation that it is a kind of, and without walls."""
        confidence = relation.holds(pair, slack)
        if confidence <= 0 or (relation.within is not None and self[relation.within].holds(pair, slack) <= 0):
            return 0.0
        if needs_clear_between(relation, pair) and not clear_between(pair.subject.box, pair.other.box):
            return 0.0
        return confidence

    def holds(
        self, name: str, first: GraphNode | Box3D, second: GraphNode | Box3D, context: RelationContext = NO_CONTEXT
    ) -> float:
        """The same for two things, or two boxes without labels."""
        pair = Pair(node_of(first, 0), node_of(second, 1), context.parameters)
        return self.measure(name, pair, context.slack, context.clear_between)


def needs_clear_between(relation: SpatialRelation, pair: Pair) -> bool:
    """Whether a wall could stand between two things that are in a relation: not where one is over the other."""
    return relation.clear_between and pair.overlap_m2 == 0


def node_of(thing: GraphNode | Box3D, number: int) -> GraphNode:
    """A box as a thing without label, of which only the box is known."""
    return GraphNode(number, "", thing, np.zeros((0, 3))) if isinstance(thing, Box3D) else thing


def possible(reach: Reach, first: Box3D, second: Box3D, slack: float, tolerance_m: float) -> bool:
    """Whether two boxes are close enough for a relation with this reach, widened by a factor and a tolerance."""
    height_m = max(first.z_min - second.z_max, second.z_min - first.z_max, 0.0)
    return height_m <= reach.height_m * slack + tolerance_m and (
        math.isinf(reach.floor_m) or footprint_gap_m(first, second) <= reach.floor_m * slack + tolerance_m
    )


RELATIONS = RelationRegistry()
"""The built-in relations."""


def holds(
    name: str, first: GraphNode | Box3D, second: GraphNode | Box3D, context: RelationContext = NO_CONTEXT
) -> float:
    """A confidence in (0, 1] that a built-in relation holds between two things or boxes; else 0."""
    return RELATIONS.holds(name, first, second, context)
