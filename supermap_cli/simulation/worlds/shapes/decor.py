"""What makes a room lived in: plants, vases, books."""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import PAPER, SOIL, between, ceramic, cover, foliage, pick, tinted
from supermap_cli.simulation.worlds.shapes.primitives import ball, block, cylinder, lathe, leaf, rod, vessel


def potted_plant(rng: np.random.Generator) -> Shape:
    """A pot with earth, several stems and many leaves."""
    radius, pot_height = between(rng, 0.12, 0.17), between(rng, 0.22, 0.32)
    pot = vessel(radius, pot_height, 0.012, ceramic(rng), base_radius=radius * 0.75)
    earth = cylinder(radius * 0.9, 0.01, SOIL, (0, 0, pot_height - 0.04), sides=14)
    green, stalk = foliage(rng), Material(tinted(rng, (92, 82, 48)), "grain", 0.02, 0.2)
    height, spread = between(rng, 0.55, 1.0), between(rng, 0.18, 0.3)
    parts = [pot, earth]
    stems = int(rng.integers(5, 8))
    for k in range(stems):
        angle = 2 * np.pi * (k + rng.uniform(-0.3, 0.3)) / stems
        outwards = np.array([np.cos(angle), np.sin(angle), 0.0])
        root = outwards * 0.03 + (0, 0, pot_height - 0.04)
        crown = outwards * spread * rng.uniform(0.45, 0.85) + (0, 0, pot_height + height * rng.uniform(0.5, 1.0))
        parts.append(rod(root, crown, 0.007, stalk, sides=4))
        parts.extend(_leaves(rng, root, crown, green))
    return join_shapes(parts)


def _leaves(rng: np.random.Generator, root: FloatArray, crown: FloatArray, green: Material) -> list[Shape]:
    leaves = []
    for along in np.linspace(0.35, 1.0, 9):
        start = root + along * (crown - root)
        angle, rise = rng.uniform(0, 2 * np.pi), rng.uniform(-0.5, 0.6)
        reach = rng.uniform(0.11, 0.2) * np.array([np.cos(angle), np.sin(angle), rise])
        leaves.append(leaf(start, start + reach, rng.uniform(0.05, 0.09), green))
    return leaves


def vase(rng: np.random.Generator) -> Shape:
    """A bellied vase with a few flowers."""
    radius, height = between(rng, 0.055, 0.08), between(rng, 0.2, 0.28)
    outside = [(radius * 0.6, 0.0), (radius, height * 0.4), (radius * 0.45, height * 0.85), (radius * 0.6, height)]
    inside = [(radius * 0.52, height), (radius * 0.36, height * 0.85), (radius * 0.36, height * 0.6)]
    parts = [lathe([*outside, *inside], ceramic(rng), sides=14)]
    stalk, petals = foliage(rng), Material(pick(rng, ((226, 64, 80), (240, 200, 60), (236, 150, 190))), "plain")
    for angle in rng.uniform(0, 2 * np.pi, int(rng.integers(4, 7))):
        lean = radius * rng.uniform(0.8, 1.6) * np.array([np.cos(angle), np.sin(angle)])
        head = (float(lean[0]), float(lean[1]), height + rng.uniform(0.1, 0.2))
        parts.append(rod((0, 0, height * 0.62), head, 0.003, stalk, sides=4))
        parts.append(ball((0.022, 0.022, 0.016), petals, head, sides=7, rings=3))
    return join_shapes(parts)


def book(rng: np.random.Generator) -> Shape:
    """A book standing or lying: two boards and a spine around the pages."""
    if rng.random() < 0.5:
        return _closed_book(rng)
    width, height, thick, binding = *_format(rng), cover(rng)
    boards = [block((0.003, width, height), binding, (s * (thick / 2 - 0.0015), 0, 0)) for s in (-1, 1)]
    pages = block((thick - 0.008, width - 0.01, height - 0.008), PAPER, (0, 0.001, 0.004))
    spine = block((thick - 0.006, 0.003, height), binding, (0, -width / 2 + 0.0015, 0))
    return join_shapes([*boards, pages, spine])


def _closed_book(rng: np.random.Generator) -> Shape:
    width, height, thick, binding = *_format(rng), cover(rng)
    boards = [block((width, height, 0.003), binding, (0, 0, z)) for z in (0.0, thick - 0.003)]
    pages = block((width - 0.01, height - 0.008, thick - 0.006), PAPER, (0.001, 0, 0.003))
    spine = block((0.003, height, thick - 0.006), binding, (-width / 2 + 0.0015, 0, 0.003))
    return join_shapes([*boards, pages, spine])


def _format(rng: np.random.Generator) -> tuple[float, float, float]:
    return between(rng, 0.15, 0.2), between(rng, 0.21, 0.27), between(rng, 0.025, 0.05)
