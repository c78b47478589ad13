"""Spatial predicates: how one thing stands to another, from their boxes and surfaces in the level map."""

from __future__ import annotations

import numpy as np

from supermap_cli.types.relations import Pair, SpatialPredicate

_BINS = frozenset({"basket", "bin", "bowl", "box", "bucket", "cart", "container", "pot", "suitcase", "trash can"})
_FURNITURE = frozenset({"bookcase", "cabinet", "cupboard", "drawer", "shelf", "wardrobe"})
_FIXTURES = frozenset(
    {"bathtub", "dishwasher", "fridge", "microwave", "oven", "refrigerator", "sink", "toaster", "washer"}
)
CONTAINERS = _BINS | _FURNITURE | _FIXTURES
UPRIGHT_SURFACES = frozenset(
    {"wall", "door", "window", "whiteboard", "cabinet", "cupboard", "bookcase", "pillar", "column"}
)

CONTACT_M = 0.06
"""How far apart two touching surfaces may be measured: voxels, drift, and the unseen underside of things."""


def on(pair: Pair, slack: float) -> float:
    """On(A, B): the lower side of A is near the surface of B beneath it, and A's footprint lies mostly within B's."""
    if pair.overlap_share < 0.5 / slack or not len(pair.surface_heights):
        return 0.0
    surface = float(np.percentile(pair.surface_heights, 90))
    box = pair.subject.box
    reach = (CONTACT_M + 0.25 * min(float(box.size[2]), 0.2)) * slack
    higher = box.center[2] > surface - 0.02 * slack
    return _falling(abs(box.z_min - surface), reach) if higher else 0.0


def under(pair: Pair, slack: float) -> float:
    """Under(A, B): B has surface above A's top, over a good part of A."""
    if pair.overlap_share < 0.3 / slack or pair.subject.box.center[2] >= pair.other.box.center[2]:
        return 0.0
    if not len(pair.surface_heights) or on(pair.turned(), 1.0) > 0:
        return 0.0
    share = float((pair.surface_heights >= pair.subject.box.z_max - 0.05 * slack).mean())
    return share if share >= 0.5 / slack else 0.0


def inside(pair: Pair, slack: float) -> float:
    """Inside(A, B): B is a container and its box holds most of A's."""
    if pair.other.label not in CONTAINERS or pair.subject.box.volume >= pair.other.box.volume:
        return 0.0
    share = pair.overlap_share * max(0.0, pair.shared_height_m) / max(float(pair.subject.box.size[2]), 1e-6)
    return min(share, 1.0) if share >= 0.6 / slack else 0.0


def above(pair: Pair, slack: float) -> float:
    """Above(A, B): clear of B's top and over its footprint, or the other way round for what is larger."""
    if pair.subject.box.z_min - pair.other.box.z_max < 2 * CONTACT_M / slack:
        return 0.0
    shared = pair.overlap_m2 / max(min(pair.subject.base_m2, pair.other.base_m2), 1e-6)
    return min(shared, 1.0) if shared >= 0.3 / slack else 0.0


def beside(pair: Pair, slack: float) -> float:
    """Beside(A, B): at about the same height, nothing but a small gap between their outlines."""
    lower = max(float(min(pair.subject.box.size[2], pair.other.box.size[2])), 0.05)
    if pair.shared_height_m < 0.2 * lower / slack:
        return 0.0
    if pair.overlap_m2 > 0.3 * slack * min(pair.subject.base_m2, pair.other.base_m2):
        return 0.0
    return _falling(pair.gap_m, (0.15 + 0.3 * pair.scale_m) * slack)


def near(pair: Pair, slack: float) -> float:
    """Near(A, B): the gap between their boxes is small against their sizes."""
    gap = float(np.hypot(pair.gap_m, max(-pair.shared_height_m, 0.0)))
    return _falling(gap, (0.5 + 0.6 * pair.scale_m) * slack)


def attached_to(pair: Pair, slack: float) -> float:
    """Attached(A, B): clear of the floor and touching an upright surface."""
    if pair.other.label not in UPRIGHT_SURFACES or pair.subject.box.z_min < 0.3 / slack:
        return 0.0
    if pair.shared_height_m < 0.5 * float(pair.subject.box.size[2]) / slack:
        return 0.0
    return _falling(pair.gap_m, 2 * CONTACT_M * slack)


def _falling(gap: float, reach: float) -> float:
    """1 at contact, 0.5 at the reach, 0 beyond."""
    return 1 - 0.5 * gap / reach if gap <= reach else 0.0


PREDICATES = (
    SpatialPredicate("on", on),
    SpatialPredicate("under", under),
    SpatialPredicate("inside", inside),
    SpatialPredicate("above", above),
    SpatialPredicate("beside", beside),
    SpatialPredicate("near", near),
    SpatialPredicate("attached to", attached_to),
)
