"""The walls of a truth: what stands between two things is known from the building, not from what a map made of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.mapping.structure import Structure, StructureParameters, structure_of_points
from supermap_cli.mapping.walls import DEFAULT, WallMap
from supermap_cli.types.truth import GroundTruth

BUILDING = frozenset({"wall", "door", "window"})
"""Labels of the parts of a building that stand upright."""

EXACT = replace(DEFAULT, before_m=-0.01, behind_m=0.01, object_margin_m=0.0, near_m=0.2, least_slope=0.0)
"""A true box lies before a wall or behind it, with its middle a centimetre off it at least: nothing is measured."""

_SAMPLES = StructureParameters(min_range_m=0.0, max_range_m=np.inf, voxel_m=0.05, neighbours=6)
"""For samples of surfaces (`truth.FIXTURE_SPACING_M`), which no sensor has seen from anywhere."""


def true_walls(truth: GroundTruth) -> Callable[[Box3D, Box3D], bool]:
    """Whether no wall stands between two boxes in the world; the samples of its surfaces are looked at when asked."""
    walls: list[WallMap] = []

    def clear_between(first: Box3D, second: Box3D) -> bool:
        if not walls:
            walls.append(_walls(truth))
        return walls[0].clear_between(first, second)

    return clear_between


def _walls(truth: GroundTruth) -> WallMap:
    """Samples do not say which side of a surface is the air: each face looks both ways."""
    found = WallMap(EXACT)
    for surface in truth.surfaces:
        if surface.label in BUILDING and len(surface.points_world):
            faces = structure_of_points(surface.points_world.astype(np.float64), parameters=_SAMPLES)
            found.add_surfaces(faces)
            found.add_surfaces(Structure(faces.points, -faces.normals))
    return found
