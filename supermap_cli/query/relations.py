"""Spatial relations: their words, the stored edges that answer them, and geometric predicates on two boxes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from supermap_cli.geometry.boxes import Box3D, Reach, footprint_gap_m, footprint_overlap_m2

RelationName = Literal["near", "beside", "on", "under", "inside", "above", "attached to"]

_WORDS: dict[RelationName, tuple[str, ...]] = {
    "near": ("near", "near to", "close to", "nearby", "around", "close by"),
    "beside": ("beside", "next to", "by", "alongside", "adjacent to", "at the side of"),
    "on": ("on", "on top of", "upon", "onto"),
    "under": ("under", "below", "beneath", "underneath"),
    "inside": ("inside", "inside of", "in", "within", "into"),
    "above": ("above", "over"),
    "attached to": ("attached to", "fixed to", "mounted on", "mounted to", "hanging on", "hanging from"),
}

RELATION_WORDS: tuple[tuple[str, RelationName], ...] = tuple(
    sorted(((word, name) for name, words in _WORDS.items() for word in words), key=lambda pair: -len(pair[0].split()))
)
"""All phrases for a relation, those with more words first."""


@dataclass(frozen=True)
class EdgeForm:
    """A stored relation that answers a question; `turned` if its subject is the question's object.

    `checked` also tests the boxes: under(table, cup) implies on(cup, table) only if they touch.
    """

    relation: str
    turned: bool = False
    checked: bool = False


def _both_ways(*relations: str) -> tuple[EdgeForm, ...]:
    return tuple(EdgeForm(relation, turned) for relation in relations for turned in (False, True))


STORED_FORMS: dict[RelationName, tuple[EdgeForm, ...]] = {
    "near": _both_ways("near", "beside", "on", "inside", "attached to"),
    "beside": _both_ways("beside"),
    "on": (EdgeForm("on"), EdgeForm("under", turned=True, checked=True)),
    "under": (EdgeForm("under"), EdgeForm("on", turned=True), EdgeForm("above", turned=True)),
    "inside": (EdgeForm("inside"),),
    "above": (EdgeForm("above"), EdgeForm("on"), EdgeForm("under", turned=True)),
    "attached to": (EdgeForm("attached to"),),
}


NEAR_MIN_M, NEAR_MAX_M = 0.5, 1.5
"""Limits of the distance for "near": the largest side of the two boxes, clipped to these."""

BESIDE_SHARE = 0.4
BESIDE_MIN_M, BESIDE_MAX_M = 0.2, 0.6
"""Limits of the footprint gap for "beside": this share of the largest side of the two boxes, clipped to these."""

ON_GAP_M, ON_SINK_M, ON_SINK_SHARE = 0.1, 0.15, 0.5
"""For "on", a's bottom lies at most this far above b's top, or below it: also at most this share of b's height."""

ABOVE_OVERLAP_M = 0.1
"""For "above", a's bottom lies at most this far below b's top."""

UNDER_OVERLAP_M = 0.05
"""For "under", a's top lies at most this far above b's top."""

MIN_COVERED_SHARE = 0.3
"""Least footprint overlap for "on", "above" and "under"."""

MIN_INSIDE_SHARE = 0.7
"""Least share of a's volume within b for "inside"."""

ATTACHED_GAP_M = 0.05
"""Largest distance for "attached to"."""

REACH: dict[RelationName, Reach] = {
    "near": Reach(NEAR_MAX_M, NEAR_MAX_M),
    "beside": Reach(BESIDE_MAX_M, 0.0),
    "on": Reach(0.0, ON_GAP_M, rise_m=-ON_SINK_M),
    "under": Reach(0.0, math.inf),
    "inside": Reach(0.0, 0.0),
    "above": Reach(0.0, math.inf, rise_m=-ABOVE_OVERLAP_M),
    "attached to": Reach(ATTACHED_GAP_M, ATTACHED_GAP_M),
}
"""Largest distance (m) between two boxes in a relation."""


def box_distance_m(a: Box3D, b: Box3D) -> float:
    """The distance (m) between two upright boxes, 0 if they touch or overlap."""
    vertical = max(a.z_min - b.z_max, b.z_min - a.z_max, 0.0)
    return float(np.hypot(footprint_gap_m(a, b), vertical))


def covered_share(a: Box3D, b: Box3D) -> float:
    """The share of a's footprint that lies within b's."""
    area = float(a.size[0] * a.size[1])
    return footprint_overlap_m2(a, b) / area if area > 0 else 0.0


def holds(relation: RelationName, a: Box3D, b: Box3D) -> bool:
    """Whether the relation holds between two boxes; for "near" and "beside" the threshold scales with their size."""
    return _PREDICATES[relation](a, b)


def _near(a: Box3D, b: Box3D) -> bool:
    return box_distance_m(a, b) <= float(np.clip(_largest_side(a, b), NEAR_MIN_M, NEAR_MAX_M))


def _beside(a: Box3D, b: Box3D) -> bool:
    level = a.z_min < b.z_max and b.z_min < a.z_max
    gap = footprint_gap_m(a, b)
    apart = not any(predicate(*pair) for predicate in (_on, _inside) for pair in ((a, b), (b, a)))
    return level and apart and gap <= float(np.clip(BESIDE_SHARE * _largest_side(a, b), BESIDE_MIN_M, BESIDE_MAX_M))


def _on(a: Box3D, b: Box3D) -> bool:
    """On(A, B): z_min of A near z_max of B, and their footprints overlap (SuperMap, scene graph)."""
    low = b.z_max - min(ON_SINK_M, ON_SINK_SHARE * float(b.size[2]))
    return low <= a.z_min <= b.z_max + ON_GAP_M and covered_share(a, b) >= MIN_COVERED_SHARE


def _above(a: Box3D, b: Box3D) -> bool:
    return a.z_min >= b.z_max - ABOVE_OVERLAP_M and covered_share(a, b) >= MIN_COVERED_SHARE


def _under(a: Box3D, b: Box3D) -> bool:
    overlap = max(covered_share(a, b), covered_share(b, a))
    below = a.center[2] < b.center[2] and a.z_max <= b.z_max + UNDER_OVERLAP_M
    return bool(overlap >= MIN_COVERED_SHARE and below and not _inside(a, b))


def _inside(a: Box3D, b: Box3D) -> bool:
    height = min(a.z_max, b.z_max) - max(a.z_min, b.z_min)
    share = max(height, 0.0) / float(a.size[2]) if a.size[2] > 0 else 0.0
    return share * covered_share(a, b) >= MIN_INSIDE_SHARE and a.volume < b.volume


def _attached(a: Box3D, b: Box3D) -> bool:
    return box_distance_m(a, b) <= ATTACHED_GAP_M and not _on(a, b)


_PREDICATES: dict[RelationName, Callable[[Box3D, Box3D], bool]] = {
    "near": _near,
    "beside": _beside,
    "on": _on,
    "under": _under,
    "inside": _inside,
    "above": _above,
    "attached to": _attached,
}


def _largest_side(a: Box3D, b: Box3D) -> float:
    return float(max(a.size.max(), b.size.max()))
