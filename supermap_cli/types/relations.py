"""Spatial predicates of the scene graph and what they are computed from: a plugin adds predicates with these."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D, footprint_gap_m, footprint_overlap_m2

SURFACE_MARGIN_M = 0.05
"""Metres around a footprint within which surface counts as beneath it: the part that an object covers is not seen.
Tuned on seeds 1-3.
"""
LARGEST_SCALE_M = 1.5
"""Metres: objects with a longer side count as this long. Tuned on seeds 1-3."""
_LEAST_AREA_M2 = 1e-6
"""Square metres: keeps the division by a footprint finite."""


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

    def heights_over(self, other: Box3D) -> FloatArray:
        """(k,) heights of this node's points over another's footprint, `SURFACE_MARGIN_M` wider."""
        c, s = np.cos(other.yaw), np.sin(other.yaw)
        local = (self.points[:, :2] - other.center[:2]) @ np.array([[c, -s], [s, c]])
        within = (np.abs(local) <= other.size[:2] / 2 + SURFACE_MARGIN_M).all(axis=1)
        heights: FloatArray = self.points[within, 2]
        return heights


@dataclass(frozen=True)
class Pair:
    """Two nodes and the measures that predicates share, each computed once."""

    subject: GraphNode
    other: GraphNode

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
        return self.other.heights_over(self.subject.box)

    @property
    def overlap_share(self) -> float:
        """Share of the subject's footprint that lies within the other's."""
        return self.overlap_m2 / max(self.subject.base_m2, _LEAST_AREA_M2)

    @property
    def shared_height_m(self) -> float:
        """Height over which both stand side by side; negative: the clearance between them."""
        a, b = self.subject.box, self.other.box
        return min(a.z_max, b.z_max) - max(a.z_min, b.z_min)

    @property
    def scale_m(self) -> float:
        """The longer side of the larger footprint, at most `LARGEST_SCALE_M`: "near" depends on the objects' size."""
        return min(max(float(self.subject.box.size[:2].max()), float(self.other.box.size[:2].max())), LARGEST_SCALE_M)

    def turned(self) -> Pair:
        """The same two with subject and object swapped."""
        pair = Pair(self.other, self.subject)
        pair.__dict__.update({name: self.__dict__[name] for name in ("overlap_m2", "gap_m") if name in self.__dict__})
        return pair


@dataclass(frozen=True)
class SpatialPredicate:
    """A named relation: `holds(pair, slack)` returns a confidence in (0, 1], or 0 where the relation does not hold.

    `slack` is 1 for a new relation and greater for one that held before: hysteresis, so that edges do not flicker.
    """

    name: str
    holds: Callable[[Pair, float], float]
