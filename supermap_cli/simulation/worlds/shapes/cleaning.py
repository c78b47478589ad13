"""What the cleaners bring and empty."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import BLACK, PAPER, between, metal, pick, plastic
from supermap_cli.simulation.worlds.shapes.primitives import ball, bent_rod, block, lathe, pitched, shifted, vessel


def trash_can(rng: np.random.Generator) -> Shape:
    """An open bin, wider above, with crumpled paper in it."""
    radius, height = between(rng, 0.13, 0.17), between(rng, 0.32, 0.46)
    skin = pick(rng, (plastic, metal))(rng)
    can = vessel(radius, height, 0.008, skin, base_radius=radius * 0.8)
    rim = [(radius, 0.0), (radius + 0.01, 0.0), (radius + 0.01, 0.02), (radius, 0.02)]
    parts = [can, shifted(_ring(rim, skin), (0, 0, height - 0.02))]
    for angle in rng.uniform(0, 2 * np.pi, int(rng.integers(2, 5))):
        x, y = 0.4 * radius * np.cos(angle), 0.4 * radius * np.sin(angle)
        parts.append(ball((0.045, 0.04, 0.035), PAPER, (float(x), float(y), height * 0.35), sides=6, rings=3))
    return join_shapes(parts)


def _ring(profile: list[tuple[float, float]], material: Material) -> Shape:
    """A ring about z: a lathe's profile that does not reach the axis, closed as it is."""
    outer = lathe(profile, material, sides=16)
    keep = (outer.triangles < 16 * len(profile)).all(axis=1)
    here, then = np.arange(16), np.roll(np.arange(16), -1)
    last = 16 * (len(profile) - 1)
    seam = np.concatenate(
        [np.column_stack([here + last, then + last, then]), np.column_stack([here + last, then, here])]
    )
    faces = np.concatenate([outer.triangles[keep], seam])
    return Shape(outer.vertices[: 16 * len(profile)], faces, np.zeros(len(faces), np.int64), (material,))


def bucket(rng: np.random.Generator) -> Shape:
    """A pail with its bail up."""
    radius, height = between(rng, 0.14, 0.17), between(rng, 0.26, 0.32)
    pail = vessel(radius, height, 0.006, plastic(rng), base_radius=radius * 0.72)
    arc = np.linspace(0, np.pi, 9)
    bow = np.column_stack([radius * np.cos(arc), np.zeros(9), height - 0.02 + radius * 0.95 * np.sin(arc)])
    return join_shapes(
        [pail, bent_rod(bow, 0.005, metal(rng)), block((0.1, 0.02, 0.02), BLACK, (0, 0, height - 0.03 + radius * 0.95))]
    )


def safety_sign(rng: np.random.Generator) -> Shape:
    """The yellow "wet floor" sign: two boards that lean against one another."""
    width, height, lean = between(rng, 0.27, 0.32), between(rng, 0.58, 0.68), between(rng, 12, 15)
    yellow = Material((246, 206, 30), "plain")
    warning = Material((40, 36, 24), "print", 0.03, 0.3)
    reach = height * np.sin(np.radians(lean))
    parts: list[Shape] = []
    for s in (-1, 1):
        board = [
            block((width, 0.012, height), yellow),
            block((width * 0.6, 0.002, height * 0.22), warning, (0, s * 0.007, height * 0.58)),
            block((width * 0.7, 0.002, height * 0.08), warning, (0, s * 0.007, height * 0.4)),
        ]
        y = s * float(reach)
        parts.extend(pitched(shifted(part, (0, y, 0)), -s * lean, (0, y, 0)) for part in board)
    top = block((0.1, 0.04, 0.03), yellow, (0, 0, height * np.cos(np.radians(lean)) - 0.01))
    return join_shapes([*parts, top])
