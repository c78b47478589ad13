"""What hangs: from the ceiling on a cord, or from a hook on a wall."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import (
    BLACK,
    WHITE,
    between,
    ceramic,
    fabric,
    foliage,
    metal,
    plastic,
    shaded,
)
from supermap_cli.simulation.worlds.shapes.primitives import (
    ball,
    bent_rod,
    block,
    cylinder,
    leaf,
    rod,
    rounded_block,
    shifted,
    vessel,
)


def ceiling_lamp(rng: np.random.Generator) -> Shape:
    """A shade and a bulb on a cord."""
    cord, radius, shade_m = between(rng, 0.25, 0.5), between(rng, 0.16, 0.24), between(rng, 0.15, 0.24)
    shade = Material(plastic(rng).rgb if rng.random() < 0.6 else (240, 232, 206), "speckle", 0.03, 0.08)
    return join_shapes(
        [
            cylinder(radius, shade_m, shade, (0, 0, 0.04), top_radius=radius * 0.45, sides=16),
            ball((0.045, 0.045, 0.045), WHITE, (0, 0, 0), sides=8, rings=3),
            rod((0, 0, 0.04 + shade_m), (0, 0, 0.04 + shade_m + cord), 0.006, BLACK, sides=4),
            cylinder(0.05, 0.02, WHITE, (0, 0, 0.04 + shade_m + cord), sides=10),
        ]
    )


def hanging_plant(rng: np.random.Generator) -> Shape:
    """A pot on three cords, its leaves hanging over the rim."""
    radius, deep, cord = between(rng, 0.1, 0.14), between(rng, 0.12, 0.17), between(rng, 0.3, 0.5)
    pot = vessel(radius, deep, 0.008, ceramic(rng), base_radius=radius * 0.7)
    green, string = foliage(rng), Material((176, 160, 128))
    parts = [pot]
    for angle in np.arange(3) * 2 * np.pi / 3:
        rim = (0.97 * radius * np.cos(angle), 0.97 * radius * np.sin(angle), deep)
        parts.append(rod(rim, (0, 0, deep + cord), 0.004, string, sides=4))
    for angle in np.arange(14) * 2 * np.pi / 14:
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        start = out * radius * 0.8 + (0, 0, deep + 0.01)
        reach = out * rng.uniform(0.06, 0.14) + (0, 0, rng.uniform(-0.25, 0.12))
        parts.append(leaf(start, start + reach, rng.uniform(0.05, 0.08), green))
    lowest = min(float(part.bounds[0][2]) for part in parts)
    return shifted(join_shapes(parts), (0, 0, -lowest))


def coat(rng: np.random.Generator) -> Shape:
    """A coat on a hook; its back is at y = 0."""
    width, height, cloth = between(rng, 0.4, 0.5), between(rng, 0.8, 1.0), fabric(rng)
    seam, hook = shaded(cloth, 0.7), metal(rng)
    parts = [
        rounded_block((width, 0.14, height * 0.55), 0.05, cloth, (0, -0.08, 0)),
        rounded_block((width * 0.8, 0.12, height * 0.35), 0.05, cloth, (0, -0.07, height * 0.55)),
        rounded_block((width * 0.35, 0.08, height * 0.1), 0.03, seam, (0, -0.06, height * 0.9)),
        block((0.012, 0.004, height * 0.85), seam, (0, -0.152, 0.02)),
        block((0.05, 0.012, 0.08), hook, (0, -0.006, height * 0.98)),
        bent_rod([(0, -0.01, height * 1.03), (0, -0.07, height * 1.0), (0, -0.09, height * 1.04)], 0.006, hook),
    ]
    sleeve = rounded_block((0.1, 0.11, height * 0.62), 0.04, cloth, (0, -0.07, 0.25))
    return join_shapes([*parts, *(shifted(sleeve, (s * (width / 2 + 0.03), 0, 0)) for s in (-1, 1))])
