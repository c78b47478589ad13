"""Furniture and partitions of clear glass, of which depth cameras measure the frames and what is behind."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import between, metal, wood
from supermap_cli.simulation.worlds.shapes.primitives import block, rod

CLEAR_GLASS = Material((176, 208, 214), "plain", 0.5, 0.02, see_through=True)
_POST_M = 0.03  # m, width of frames


def glass_table(rng: np.random.Generator) -> Shape:
    """A glass top on four metal legs."""
    width, depth, height = between(rng, 1.0, 1.5), between(rng, 0.7, 0.9), between(rng, 0.7, 0.75)
    steel, x, y = metal(rng), width / 2 - 0.08, depth / 2 - 0.08
    corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
    legs = [rod((*corner, 0.0), (*corner, height - 0.012), 0.02, steel, sides=8) for corner in corners]
    z = height - 0.035
    rails = [rod((*a, z), (*b, z), 0.012, steel) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]
    return join_shapes([block((width, depth, 0.012), CLEAR_GLASS, (0, 0, height - 0.012)), *legs, *rails])


def vitrine(rng: np.random.Generator) -> Shape:
    """A showcase: boards behind glass between four posts."""
    width, depth, height = between(rng, 0.75, 1.0), between(rng, 0.36, 0.42), between(rng, 1.3, 1.7)
    body, t = wood(rng), 0.02
    inner_x, inner_y = width - 2 * _POST_M, depth - 2 * _POST_M
    parts = [
        block((_POST_M, _POST_M, height - 0.04), body, (sx * (width - _POST_M) / 2, sy * (depth - _POST_M) / 2, 0.02))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    parts += [block((width, depth, t), body, (0, 0, z)) for z in (0.0, height - t)]
    parts += [block((inner_x, depth - 0.03, t), body, (0, 0, float(z))) for z in np.linspace(0.36, height - 0.36, 3)]
    for s in (-1, 1):
        parts.append(block((inner_x, 0.006, height - 0.04), CLEAR_GLASS, (0, s * (depth / 2 - 0.006), 0.02)))
        parts.append(block((0.006, inner_y, height - 0.04), CLEAR_GLASS, (s * (width / 2 - 0.006), 0, 0.02)))
    return join_shapes(parts)


def partition(length_m: float, height_m: float, steel: Material) -> Shape:
    """A wall of glass along x from floor to ceiling, between metal posts 1.2 m apart or less."""
    panes = max(1, int(np.ceil(length_m / 1.2)))
    parts = [block((length_m, 0.01, height_m - 0.1), CLEAR_GLASS, (0, 0, 0.05))]
    parts += [block((length_m, 0.05, 0.05), steel, (0, 0, z)) for z in (0.0, height_m - 0.05)]
    xs = np.linspace(-length_m / 2 + 0.02, length_m / 2 - 0.02, panes + 1)
    parts += [block((0.04, 0.05, height_m - 0.1), steel, (float(x), 0, 0.05)) for x in xs]
    return join_shapes(parts)
