"""Things to work and eat at: a top with room for knees under it."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import between, casing, metal, pick, wood
from supermap_cli.simulation.worlds.shapes.primitives import block, rod, rounded_block


def table(rng: np.random.Generator) -> Shape:
    """A table for four to six."""
    width, depth, height = between(rng, 1.4, 1.9), between(rng, 0.8, 1.0), between(rng, 0.72, 0.76)
    top, frame = wood(rng), pick(rng, (wood, metal))(rng)
    return join_shapes([_top(width, depth, height, 0.035, top), *_legs(width, depth, height - 0.035, frame)])


def desk(rng: np.random.Generator) -> Shape:
    """A desk on legs or panels, with drawers on one side and a panel at the back."""
    width, depth, height = between(rng, 1.3, 1.6), between(rng, 0.68, 0.8), between(rng, 0.72, 0.76)
    top, frame = wood(rng), pick(rng, (wood, metal, casing))(rng)
    under = height - 0.03
    parts = [_top(width, depth, height, 0.03, top)]
    if rng.random() < 0.5:
        parts.extend(_legs(width, depth, under, frame))
    else:
        parts.extend(block((0.03, depth - 0.06, under), frame, (s * (width / 2 - 0.05), 0, 0)) for s in (-1, 1))
    parts.append(block((width - 0.16, 0.015, 0.3), frame, (0, depth / 2 - 0.06, under - 0.3)))
    parts.extend(_drawers(pick(rng, (-1.0, 1.0)) * (width / 2 - 0.3), depth, under, frame))
    return join_shapes(parts)


def _top(width: float, depth: float, height: float, thickness: float, material: Material) -> Shape:
    return rounded_block((width, depth, thickness), 0.02, material, (0, 0, height - thickness))


def _legs(width: float, depth: float, height: float, material: Material) -> list[Shape]:
    corners = [(sx * (width / 2 - 0.06), sy * (depth / 2 - 0.06)) for sx in (-1, 1) for sy in (-1, 1)]
    if material.pattern == "speckle":
        return [rod((x, y, 0), (x, y, height), 0.028, material, sides=8) for x, y in corners]
    return [block((0.05, 0.05, height), material, (x, y, 0)) for x, y in corners]


def _drawers(x: float, depth: float, under: float, material: Material) -> list[Shape]:
    body, front = depth - 0.2, -depth / 2 + 0.08
    parts = [block((0.38, body, 0.5), material, (x, front + body / 2, under - 0.5))]
    for z in under - 0.5 + np.array([0.02, 0.18, 0.34]):
        parts.append(block((0.35, 0.015, 0.145), material, (x, front - 0.0075, float(z))))
        parts.append(block((0.12, 0.015, 0.012), Material((90, 90, 92)), (x, front - 0.0225, float(z) + 0.1)))
    return parts
