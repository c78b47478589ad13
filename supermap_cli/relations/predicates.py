"""The geometry of spatial relations: how one thing stands to another, from their boxes and surfaces in the level map.

The class-dependent predicates of the paper's sec. IV-C. `on` departs from its definition: the lower side of A is
compared with B's surface under it instead of B's top, and the overlap is a share of A's footprint instead of an IoU.
"""

from __future__ import annotations

import numpy as np

from supermap_cli.relations.labels import has_shelves, is_upright_surface, may_contain
from supermap_cli.types.relations import Pair


def on(pair: Pair, slack: float) -> float:
    """On(A, B): the lower side of A is near the surface of B beneath it, and A's footprint lies mostly within B's.

    Of a surface that nobody has seen there (a desk full of things), the top of B's box tells the height. What stands
    within shelves is on them.
    """
    parameters = pair.parameters
    if has_shelves(pair.other.label) and (confidence := inside(pair, slack)) > 0:
        return confidence
    if pair.overlap_share < parameters.on_overlap / slack:
        return 0.0
    heights, other = pair.surface_heights, pair.other
    if len(heights):
        surface_m = float(np.percentile(heights, parameters.on_surface_percentile))
        confidence = _rests_at(pair, surface_m, slack)
        if confidence > 0:
            return confidence
    confidence = _rests_at(pair, other.box.z_max, slack)
    if confidence > 0 and len(heights):
        seen = other.seen_share_over(pair.subject.box, surface_m, parameters)
        return confidence if seen < parameters.on_seen_share else 0.0
    return confidence


def _rests_at(pair: Pair, surface_m: float, slack: float) -> float:
    """The confidence that the subject rests on a surface at a height."""
    parameters, box = pair.parameters, pair.subject.box
    highest_m = min(surface_m - parameters.on_higher_m * slack, _slab_middle_m(pair, surface_m))
    height_m = min(float(box.size[2]), parameters.on_reach_height_m)
    reach = (parameters.contact_m + parameters.on_reach_share * height_m) * slack
    return pair.falling(abs(box.z_min - surface_m), reach) if box.center[2] > highest_m else 0.0


def _slab_middle_m(pair: Pair, surface_m: float) -> float:
    """The height of the middle of the slab below a surface: a table top seems thicker than it is, and a book on it is
    then measured within.
    """
    lowest_m = surface_m - pair.parameters.on_slab_m
    layer = pair.surface_heights[(pair.surface_heights >= lowest_m) & (pair.surface_heights <= surface_m)]
    if len(pair.other.points) and len(layer):
        return float(np.median(layer))
    return max(float(pair.other.box.center[2]), lowest_m)


def under(pair: Pair, slack: float) -> float:
    """Under(A, B): B has surface above A's top, over a good part of A, and A is neither in B nor carries it."""
    parameters = pair.parameters
    if pair.overlap_share < parameters.under_overlap / slack or pair.subject.box.center[2] >= pair.other.box.center[2]:
        return 0.0
    if not len(pair.surface_heights) or on(pair.turned(), 1.0) > 0 or inside(pair, 1.0) > 0:
        return 0.0
    share = float((pair.surface_heights >= pair.subject.box.z_max - parameters.under_margin_m * slack).mean())
    return share if share >= parameters.under_covered / slack else 0.0


def inside(pair: Pair, slack: float) -> float:
    """Inside(A, B): B may contain things and its box holds most of A's."""
    if not may_contain(pair.other.label) or pair.subject.box.volume >= pair.other.box.volume:
        return 0.0
    share = pair.overlap_share * max(0.0, pair.shared_height_m) / max(float(pair.subject.box.size[2]), 1e-6)
    return min(share, 1.0) if share >= pair.parameters.inside_share / slack else 0.0


def above(pair: Pair, slack: float) -> float:
    """Above(A, B): clear of B's top and over its footprint, or the other way round for what is larger."""
    if pair.subject.box.z_min - pair.other.box.z_max < pair.parameters.above_clearance_m / slack:
        return 0.0
    shared = pair.overlap_m2 / max(min(pair.subject.base_m2, pair.other.base_m2), 1e-6)
    return min(shared, 1.0) if shared >= pair.parameters.above_overlap / slack else 0.0


def beside(pair: Pair, slack: float) -> float:
    """Beside(A, B): at about the same height, nothing but a small gap between their outlines."""
    parameters = pair.parameters
    if not _share_height(pair, slack):
        return 0.0
    if pair.overlap_m2 > parameters.beside_max_overlap * slack * min(pair.subject.base_m2, pair.other.base_m2):
        return 0.0
    return pair.falling(pair.gap_m, (parameters.beside_gap_m + parameters.beside_gap_share * pair.scale_m) * slack)


def near(pair: Pair, slack: float) -> float:
    """Near(A, B): the gap between their boxes is small against their sizes."""
    parameters = pair.parameters
    return pair.falling(pair.distance_m, (parameters.near_gap_m + parameters.near_gap_share * pair.scale_m) * slack)


def attached_to(pair: Pair, slack: float) -> float:
    """Attached(A, B): clear of the floor and touching an upright surface."""
    parameters = pair.parameters
    if not is_upright_surface(pair.other.label) or pair.subject.box.z_min < parameters.attached_clearance_m / slack:
        return 0.0
    if pair.shared_height_m < parameters.attached_shared_height * float(pair.subject.box.size[2]) / slack:
        return 0.0
    return pair.falling(pair.gap_m, parameters.attached_gap_m * slack)


def far_from(pair: Pair, slack: float) -> float:
    """Far(A, B): a room's width and more between their boxes."""
    return 1.0 if pair.distance_m >= pair.parameters.far_gap_m / slack else 0.0


def at(pair: Pair, slack: float) -> float:
    """At(A, B): beside it, or pushed in under its edge, as a chair is at a table."""
    parameters = pair.parameters
    if not _stand_side_by_side(pair, slack):
        return 0.0
    return pair.falling(pair.gap_m, (parameters.beside_gap_m + parameters.beside_gap_share * pair.scale_m) * slack)


def around(pair: Pair, slack: float) -> float:
    """Around(A, B): near it to the side, as chairs are around a table."""
    return near(pair, slack) if _stand_side_by_side(pair, slack) else 0.0


def against(pair: Pair, slack: float) -> float:
    """Against(A, B): their sides touch, as a chair's back against a cupboard."""
    if not _stand_side_by_side(pair, slack):
        return 0.0
    return pair.falling(pair.gap_m, pair.parameters.against_gap_m * slack)


def never(pair: Pair, slack: float) -> float:  # noqa: ARG001 - the geometry of a relation that only follows from others
    """No geometry of its own."""
    return 0.0


def _stand_side_by_side(pair: Pair, slack: float) -> bool:
    """Whether two things are at about the same height, and neither is on or in the other."""
    if not _share_height(pair, slack):
        return False
    stacked = (predicate(each, 1.0) > 0 for predicate in (on, inside) for each in (pair, pair.turned()))
    return pair.overlap_m2 == 0 or not any(stacked)


def _share_height(pair: Pair, slack: float) -> bool:
    parameters = pair.parameters
    lower_m = max(float(min(pair.subject.box.size[2], pair.other.box.size[2])), parameters.beside_min_height_m)
    return pair.shared_height_m >= parameters.beside_shared_height * lower_m / slack
