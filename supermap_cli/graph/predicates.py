"""Spatial predicates: how one thing stands to another, from their boxes and surfaces in the level map.

The class-dependent predicates of the paper's sec. IV-C. `on` departs from its definition: the lower side of A is
compared with B's surface under it instead of B's top, and the overlap is a share of A's footprint instead of an IoU.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D, footprint_gap_m, footprint_overlap_m2
from supermap_cli.types.parameters import parameter

_BINS = frozenset({"basket", "bin", "bowl", "box", "bucket", "cart", "container", "pot", "suitcase", "trash can"})
_FURNITURE = frozenset({"bookcase", "cabinet", "cupboard", "drawer", "shelf", "wardrobe"})
_FIXTURES = frozenset(
    {"bathtub", "dishwasher", "fridge", "microwave", "oven", "refrigerator", "sink", "toaster", "washer"}
)
CONTAINERS = _BINS | _FURNITURE | _FIXTURES
UPRIGHT_SURFACES = frozenset(
    {"wall", "door", "window", "whiteboard", "cabinet", "cupboard", "bookcase", "pillar", "column"}
)

_DESIGN = "chosen by hand, held by the cases of tests/graph"


@dataclass(frozen=True)
class PredicateParameters:
    """What the relations ask for. Shares are of the subject's footprint or height where nothing else is said."""

    contact_m: float = parameter(
        0.06, "m", "gap that two touching surfaces may be measured apart: voxels, drift, unseen undersides", _DESIGN
    )
    footprint_margin_m: float = parameter(
        0.05, "m", "margin about a footprint over which another thing's surface is looked for", _DESIGN
    )
    max_scale_m: float = parameter(1.5, "m", "size of a thing, at most, that nearness is measured by", _DESIGN)
    falling_confidence: float = parameter(
        0.5, "1", "confidence lost between contact and the greatest gap", _DESIGN, at_most=1
    )
    on_overlap: float = parameter(0.5, "1", "on: share over the other, at least", "paper sec. IV-C, gamma")
    on_surface_percentile: float = parameter(
        90.0, "%", "on: percentile of the other's heights that is its surface", _DESIGN, at_most=100
    )
    on_reach_share: float = parameter(
        0.25, "1", "on: share of the subject's height that the gap may be larger", _DESIGN
    )
    on_reach_height_m: float = parameter(0.2, "m", "on: height of the subject, at most, that this share is of", _DESIGN)
    on_higher_m: float = parameter(0.02, "m", "on: how far the subject's middle may lie below the surface", _DESIGN)
    under_overlap: float = parameter(0.3, "1", "under: share below the other, at least", _DESIGN)
    under_covered: float = parameter(0.5, "1", "under: share of the other's heights above the top, at least", _DESIGN)
    under_margin_m: float = parameter(0.05, "m", "under: how far below the top these may lie", _DESIGN)
    inside_share: float = parameter(0.6, "1", "inside: share of the subject's box in the other's, at least", _DESIGN)
    above_clearance_m: float = parameter(0.12, "m", "above: clearance, at least", "twice contact_m")
    above_overlap: float = parameter(0.3, "1", "above: share of the smaller footprint, at least", _DESIGN)
    beside_shared_height: float = parameter(0.2, "1", "beside: share of the lower height, at least", _DESIGN)
    beside_min_height_m: float = parameter(0.05, "m", "beside: height that the lower thing counts as at least", _DESIGN)
    beside_max_overlap: float = parameter(0.3, "1", "beside: share of the smaller footprint, at most", _DESIGN)
    beside_gap_m: float = parameter(0.15, "m", "beside: gap between the outlines, at most", _DESIGN)
    beside_gap_share: float = parameter(0.3, "1", "beside: the same, added by the larger thing's size", _DESIGN)
    near_gap_m: float = parameter(0.5, "m", "near: gap between the boxes, at most", _DESIGN)
    near_gap_share: float = parameter(0.6, "1", "near: the same, added by the larger thing's size", _DESIGN)
    attached_clearance_m: float = parameter(
        0.3, "m", "attached to: height of the subject's lower side, at least", _DESIGN
    )
    attached_shared_height: float = parameter(0.5, "1", "attached to: share of the height, at least", _DESIGN)
    attached_gap_m: float = parameter(0.12, "m", "attached to: gap to the upright surface, at most", "twice contact_m")


DEFAULT = PredicateParameters()


@dataclass(frozen=True)
class GraphNode:
    """An instance as the graph sees it: `points` (n, 3) are the centres of its solid voxels in the map frame."""

    number: int
    label: str
    box: Box3D
    points: FloatArray

    @cached_property
    def base_m2(self) -> float:
        """Area of the footprint."""
        return float(self.box.size[0] * self.box.size[1])

    @cached_property
    def radius_m(self) -> float:
        """Half the box's diagonal."""
        return float(np.linalg.norm(self.box.size)) / 2

    def heights_over(self, other: Box3D, margin_m: float = DEFAULT.footprint_margin_m) -> FloatArray:
        """(k,) heights of this node's points over another's footprint, and a margin: what is covered is not seen."""
        c, s = np.cos(other.yaw), np.sin(other.yaw)
        local = (self.points[:, :2] - other.center[:2]) @ np.array([[c, -s], [s, c]])
        within = (np.abs(local) <= other.size[:2] / 2 + margin_m).all(axis=1)
        heights: FloatArray = self.points[within, 2]
        return heights


@dataclass(frozen=True)
class Pair:
    """Two nodes, and what all predicates ask of them, worked out once."""

    subject: GraphNode
    other: GraphNode
    parameters: PredicateParameters = DEFAULT

    @cached_property
    def overlap_m2(self) -> float:
        """Area that the footprints share."""
        return footprint_overlap_m2(self.subject.box, self.other.box)

    @cached_property
    def gap_m(self) -> float:
        """Horizontal distance between the footprints, 0 where they overlap."""
        return 0.0 if self.overlap_m2 > 0 else footprint_gap_m(self.subject.box, self.other.box)

    @cached_property
    def surface_heights(self) -> FloatArray:
        """(k,) heights of the other's points over the subject's footprint."""
        return self.other.heights_over(self.subject.box, self.parameters.footprint_margin_m)

    @property
    def overlap_share(self) -> float:
        """Share of the subject's footprint that lies within the other's."""
        return self.overlap_m2 / max(self.subject.base_m2, 1e-6)

    @property
    def shared_height_m(self) -> float:
        """Height over which both stand side by side; negative: the clearance between them."""
        a, b = self.subject.box, self.other.box
        return min(a.z_max, b.z_max) - max(a.z_min, b.z_min)

    @property
    def scale_m(self) -> float:
        """The larger thing's size on the floor, within bounds: nearness is measured with the things themselves."""
        larger_m = max(float(self.subject.box.size[:2].max()), float(self.other.box.size[:2].max()))
        return min(larger_m, self.parameters.max_scale_m)

    def falling(self, gap: float, reach: float) -> float:
        """A confidence: 1 at contact, 0.5 at the reach, 0 beyond."""
        return 1 - self.parameters.falling_confidence * gap / reach if gap <= reach else 0.0

    def turned(self) -> Pair:
        """The same two the other way round."""
        pair = Pair(self.other, self.subject, self.parameters)
        pair.__dict__.update({name: self.__dict__[name] for name in ("overlap_m2", "gap_m") if name in self.__dict__})
        return pair


@dataclass(frozen=True)
class SpatialPredicate:
    """A named relation: `holds(pair, slack)` gives a confidence in (0, 1], or 0 where it does not hold.

    `slack` is 1 for a relation that begins and more for one that held before: hysteresis, so that edges do not flicker.
    """

    name: str
    holds: Callable[[Pair, float], float]


def on(pair: Pair, slack: float) -> float:
    """On(A, B): the lower side of A is near the surface of B beneath it, and A's footprint lies mostly within B's."""
    parameters = pair.parameters
    if pair.overlap_share < parameters.on_overlap / slack or not len(pair.surface_heights):
        return 0.0
    surface = float(np.percentile(pair.surface_heights, parameters.on_surface_percentile))
    box = pair.subject.box
    height_m = min(float(box.size[2]), parameters.on_reach_height_m)
    reach = (parameters.contact_m + parameters.on_reach_share * height_m) * slack
    higher = box.center[2] > surface - parameters.on_higher_m * slack
    return pair.falling(abs(box.z_min - surface), reach) if higher else 0.0


def under(pair: Pair, slack: float) -> float:
    """Under(A, B): B has surface above A's top, over a good part of A."""
    parameters = pair.parameters
    if pair.overlap_share < parameters.under_overlap / slack or pair.subject.box.center[2] >= pair.other.box.center[2]:
        return 0.0
    if not len(pair.surface_heights) or on(pair.turned(), 1.0) > 0:
        return 0.0
    share = float((pair.surface_heights >= pair.subject.box.z_max - parameters.under_margin_m * slack).mean())
    return share if share >= parameters.under_covered / slack else 0.0


def inside(pair: Pair, slack: float) -> float:
    """Inside(A, B): B is a container and its box holds most of A's."""
    if pair.other.label not in CONTAINERS or pair.subject.box.volume >= pair.other.box.volume:
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
    lower = max(float(min(pair.subject.box.size[2], pair.other.box.size[2])), parameters.beside_min_height_m)
    if pair.shared_height_m < parameters.beside_shared_height * lower / slack:
        return 0.0
    if pair.overlap_m2 > parameters.beside_max_overlap * slack * min(pair.subject.base_m2, pair.other.base_m2):
        return 0.0
    return pair.falling(pair.gap_m, (parameters.beside_gap_m + parameters.beside_gap_share * pair.scale_m) * slack)


def near(pair: Pair, slack: float) -> float:
    """Near(A, B): the gap between their boxes is small against their sizes."""
    gap = float(np.hypot(pair.gap_m, max(-pair.shared_height_m, 0.0)))
    parameters = pair.parameters
    return pair.falling(gap, (parameters.near_gap_m + parameters.near_gap_share * pair.scale_m) * slack)


def attached_to(pair: Pair, slack: float) -> float:
    """Attached(A, B): clear of the floor and touching an upright surface."""
    parameters = pair.parameters
    if pair.other.label not in UPRIGHT_SURFACES or pair.subject.box.z_min < parameters.attached_clearance_m / slack:
        return 0.0
    if pair.shared_height_m < parameters.attached_shared_height * float(pair.subject.box.size[2]) / slack:
        return 0.0
    return pair.falling(pair.gap_m, parameters.attached_gap_m * slack)


PREDICATES = (
    SpatialPredicate("on", on),
    SpatialPredicate("under", under),
    SpatialPredicate("inside", inside),
    SpatialPredicate("above", above),
    SpatialPredicate("beside", beside),
    SpatialPredicate("near", near),
    SpatialPredicate("attached to", attached_to),
)
