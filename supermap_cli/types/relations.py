"""What a spatial relation is, and what it is computed from: a plugin adds relations with these."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.geometry.boxes import Box3D, Reach, footprint_gap_m, footprint_overlap_m2
from supermap_cli.types.parameters import parameter

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
    on_seen_share: float = parameter(
        0.7, "1", "on: share of the other's surface below that must be seen for it to count alone", _DESIGN, at_most=1
    )
    on_cell_m: float = parameter(0.05, "m", "on: edge of the cells of that share", "coarsest voxels", at_least=0.01)
    on_higher_m: float = parameter(0.02, "m", "on: how far the subject's middle may lie below the surface", _DESIGN)
    on_slab_m: float = parameter(
        0.1, "m", "on: thickness that a board is measured with, at most", "a table top of the kitchen: 0.08 m"
    )
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
    against_gap_m: float = parameter(0.12, "m", "against: gap between the outlines, at most", "twice contact_m")
    far_gap_m: float = parameter(3.0, "m", "far from: gap between the boxes, at least", "twice near's greatest gap")


DEFAULT = PredicateParameters()


@dataclass(frozen=True)
class GraphNode:
    """A thing as relations see it: `points` (n, 3) are the centres of its solid voxels in the map frame.

    Without points only its box is known, and its surface is taken to be the box's upper face.
    """

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
        if not len(self.points):
            return np.full(int(footprint_gap_m(self.box, other) <= margin_m), self.box.z_max)
        heights: FloatArray = self.points[self._is_over(other, margin_m), 2]
        return heights

    def seen_share_over(self, other: Box3D, height_m: float, parameters: PredicateParameters = DEFAULT) -> float:
        """Share of the cells of another's footprint, and the margin about it, in which this node has points at about a
        height: the rest of a surface there nobody has seen.
        """
        margin_m, cell_m = parameters.footprint_margin_m, parameters.on_cell_m
        points = self.points[self._is_over(other, margin_m)]
        points = points[np.abs(points[:, 2] - height_m) <= parameters.contact_m]
        cells = np.unique(np.floor(points[:, :2] / cell_m), axis=0)
        return min(len(cells) / float(np.prod((other.size[:2] + 2 * margin_m) / cell_m)), 1.0)

    def _is_over(self, other: Box3D, margin_m: float) -> BoolArray:
        """(n,) which of its points lie over or under another's footprint, and a margin."""
        c, s = np.cos(other.yaw), np.sin(other.yaw)
        local = (self.points[:, :2] - other.center[:2]) @ np.array([[c, -s], [s, c]])
        within: BoolArray = (np.abs(local) <= other.size[:2] / 2 + margin_m).all(axis=1)
        return within


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
    def distance_m(self) -> float:
        """Distance between the two boxes, 0 where they touch or overlap."""
        return float(np.hypot(self.gap_m, max(-self.shared_height_m, 0.0)))

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
class EdgeForm:
    """Another relation that a relation follows from; `turned` if it holds the other way round: a table is under the
    cup that is on it.
    """

    relation: str
    turned: bool = False


UNBOUNDED = Reach(np.inf, np.inf)
"""The reach of a relation of which nothing is known."""


@dataclass(frozen=True)
class SpatialRelation:
    """A relation of two things, defined once: the scene graph stores it, and questions are answered by it.

    - `holds(pair, slack)` is its geometry: a confidence in (0, 1], or 0 where it does not hold. `slack` is 1 for a new
      relation and greater for one that held before (hysteresis, so that edges do not flicker); more slack never makes
      it fail.
    - `words`: the phrases for it by language ("en"); without any it is asked by its name.
    - `reach`: how far apart two boxes in it may be, with a slack of 1.
    - `inverse`: the relation that holds the other way round; `symmetric`: it is its own.
    - `follows_from`: it also holds where one of these does.
    - `within`: it is a kind of this stored relation, whose edges answer it together with its own geometry; such a
      relation is not stored itself. `stored`: the scene graph keeps edges of it.
    - `clear_between`: it holds only where no wall stands between the two.
    """

    name: str
    holds: Callable[[Pair, float], float]
    words: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    reach: Reach = UNBOUNDED
    inverse: str | None = None
    symmetric: bool = False
    follows_from: tuple[EdgeForm, ...] = ()
    within: str | None = None
    stored: bool = True
    clear_between: bool = False

    def phrases(self, language: str = "en") -> tuple[str, ...]:
        """The phrases for it in a language; in English at least its name."""
        spoken = self.words.get(language, ())
        return spoken or ((self.name,) if language == "en" else ())


SpatialPredicate = SpatialRelation
"""The name that plugins know it by."""
