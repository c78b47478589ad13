"""Things that lean at a wall: their tops reach backwards (+y), their feet stand before it."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.luggage import suitcase
from supermap_cli.simulation.worlds.shapes.materials import between, metal, pick, plastic, wood
from supermap_cli.simulation.worlds.shapes.primitives import block, pitched, rod
from supermap_cli.simulation.worlds.shapes.wall_things import painting

_LEAN_DEG = (8.0, 16.0)  # degrees from upright: less slips under no push, more slides down


def leaning_board(rng: np.random.Generator) -> Shape:
    """A sheet of wood."""
    size = (between(rng, 0.5, 0.9), between(rng, 0.018, 0.03), between(rng, 1.0, 1.6))
    return _leaning(rng, block(size, wood(rng)))


def broom(rng: np.random.Generator) -> Shape:
    """A stick, a head and bristles."""
    height, stick, head = between(rng, 1.25, 1.45), wood(rng), plastic(rng)
    bristles = Material((86, 74, 60), "stripes", 0.01, 0.3)
    parts = [
        block((0.32, 0.05, 0.06), bristles),
        block((0.32, 0.06, 0.05), head, (0, 0, 0.06)),
        rod((0, 0, 0.11), (0, 0, height), 0.013, stick, sides=8),
    ]
    return _leaning(rng, join_shapes(parts))


def tilted_suitcase(rng: np.random.Generator) -> Shape:
    """A suitcase tipped against the wall."""
    return _leaning(rng, suitcase(rng))


def leaning_painting(rng: np.random.Generator) -> Shape:
    """A framed picture that was taken down."""
    return _leaning(rng, painting(rng))


def ladder(rng: np.random.Generator) -> Shape:
    """Two rails and their rungs."""
    width, height, steel = between(rng, 0.38, 0.46), between(rng, 1.7, 2.1), pick(rng, (metal, wood))(rng)
    rails = [block((0.03, 0.06, height), steel, (s * width / 2, 0, 0)) for s in (-1, 1)]
    rungs = [rod((-width / 2, 0, z), (width / 2, 0, z), 0.015, steel) for z in np.arange(0.28, height - 0.1, 0.28)]
    return _leaning(rng, join_shapes([*rails, *rungs]))


def _leaning(rng: np.random.Generator, shape: Shape) -> Shape:
    return pitched(shape, between(rng, *_LEAN_DEG))
