"""The walls of a truth: as they are built, whichever side was seen."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.recording.true_walls import true_walls
from supermap_cli.types.truth import GroundTruth, TrueSurface


def truth(label: str = "wall", z: tuple[float, float] = (0.0, 2.5)) -> GroundTruth:
    """Both faces of a partition 12 cm thick across x = 0, a sample each 5 cm."""
    across, height = (grid.ravel() for grid in np.meshgrid(np.arange(-2, 2, 0.05), np.arange(*z, 0.05)))
    faces = [np.column_stack([np.full(across.size, x), across, height]) for x in (-0.06, 0.06)]
    surface = TrueSurface(label, np.concatenate(faces).astype(np.float32))
    return GroundTruth("room", 0, (), (), (surface,), (), ())


def box(x: float, depth: float = 0.5, y: float = 0.0) -> Box3D:
    return Box3D(np.array([x, y, 0.5]), np.array([depth, 0.6, 0.9]), 0.0)


def test_a_wall_parts_what_stands_on_its_two_sides_also_flat_on_it() -> None:
    clear = true_walls(truth())
    assert not clear(box(-0.5), box(0.5))
    assert not clear(box(-0.08, 0.04), box(0.08, 0.04))
    assert clear(box(0.5), box(1.4))
    assert clear(box(0.08, 0.04), box(0.08, 0.04, 1.0))
    assert clear(box(0.08, 0.04), box(1.2))


@pytest.mark.parametrize(("label", "z"), [("ceiling", (0.0, 2.5)), ("wall", (2.1, 2.6))])
def test_what_does_not_stand_between_parts_nothing(label: str, z: tuple[float, float]) -> None:
    assert true_walls(truth(label, z))(box(-0.5), box(0.5))
