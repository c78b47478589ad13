"""Spatial relations as questions use them: their phrases, the stored edges that answer them, and whether they hold.

All of it comes from the registry of relations (`supermap_cli.relations`), which the scene graph is built from, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.boxes import Box3D, Reach, footprint_gap_m, footprint_overlap_m2
from supermap_cli.relations.registry import NO_CONTEXT, RELATIONS, RelationContext, RelationRegistry
from supermap_cli.types.relations import GraphNode

RelationName = str
"""The name of a relation in the registry."""

RELATION_WORDS: tuple[tuple[str, RelationName], ...] = RELATIONS.phrases("en")
"""All English phrases for a built-in relation, those with more words first."""


@dataclass(frozen=True)
class StoredForm:
    """A stored relation that answers a question; `turned` if its subject is the question's object.

    `checked`: it only chooses the pairs, whose geometry is asked besides.
    """

    relation: str
    turned: bool = False
    checked: bool = False


def stored_forms(registry: RelationRegistry, name: RelationName) -> tuple[StoredForm, ...]:
    """The stored relations that answer a relation; none where it is always computed."""
    checked = registry[name].within is not None
    return tuple(StoredForm(form.relation, form.turned, checked) for form in registry.stored_forms(name))


STORED_FORMS: dict[RelationName, tuple[StoredForm, ...]] = {
    relation.name: stored_forms(RELATIONS, relation.name) for relation in RELATIONS
}
REACH: dict[RelationName, Reach] = {relation.name: RELATIONS.reach(relation.name) for relation in RELATIONS}
"""Of the built-in relations: the largest distance (m) between two boxes."""


def holds(
    relation: RelationName, a: Box3D | GraphNode, b: Box3D | GraphNode, context: RelationContext = NO_CONTEXT
) -> bool:
    """Whether a built-in relation holds between two boxes, or two things with labels and surfaces."""
    return RELATIONS.holds(relation, a, b, context) > 0


def box_distance_m(a: Box3D, b: Box3D) -> float:
    """The distance (m) between two upright boxes, 0 if they touch or overlap."""
    vertical = max(a.z_min - b.z_max, b.z_min - a.z_max, 0.0)
    return float(np.hypot(footprint_gap_m(a, b), vertical))


def covered_share(a: Box3D, b: Box3D) -> float:
    """The share of a's footprint that lies within b's."""
    area = float(a.size[0] * a.size[1])
    return footprint_overlap_m2(a, b) / area if area > 0 else 0.0
