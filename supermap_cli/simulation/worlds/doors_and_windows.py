"""Doors and windows, in the frame of their opening: x along the wall, y through it from the room outwards, z up from
the floor; the origin is the middle of the opening in the middle of the wall.
"""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import WHITE, between, casing, metal, pick, wood
from supermap_cli.simulation.worlds.shapes.primitives import block, rod, shifted, yawed

DOOR_TOP_M, SILL_M, HEAD_M = 2.06, 0.9, 2.2
"""Heights of a doorway's top and of a window's lower and upper edge, m: common sizes in offices."""
JAMB_M = 0.03
"""Thickness of a door's frame; the way through is twice that narrower than the opening."""
_PROUD_M = 0.015  # m that a frame stands out from the wall
_LEAF_M = 0.04  # m, thickness of a leaf
_GLASS = Material((166, 198, 224), "speckle", 0.7, 0.12)


def open_door(rng: np.random.Generator, width: float, wall: float, hinge: int) -> Shape:
    """A frame, and a leaf swung round on its hinge (on the side -1 or 1) until it nearly lies against the wall."""
    leaf_width = width - 2 * JAMB_M
    y = -(wall / 2 + _PROUD_M + 0.015)
    leaf = shifted(
        yawed(_leaf(rng, leaf_width, hinge), -hinge * np.radians(between(rng, 3, 6))), (hinge * width / 2, y, 0)
    )
    return join_shapes([*_frame(rng, width, wall), leaf])


def closed_door(rng: np.random.Generator, width: float, wall: float) -> Shape:
    """A frame and a leaf that is shut, before a wall that goes on behind it."""
    leaf = shifted(_leaf(rng, width - 2 * JAMB_M, 1), (-width / 2 + JAMB_M, -wall / 2 + _LEAF_M - _PROUD_M / 2, 0))
    return join_shapes([*_frame(rng, width, wall), leaf])


def _leaf(rng: np.random.Generator, width: float, away: int) -> Shape:
    """A door's leaf with two handles, from its hinge at x = 0 to x = `away` * width; y = 0 is its outer face."""
    slab, grip, high = pick(rng, (wood, casing))(rng), metal(rng), DOOR_TOP_M - JAMB_M - 0.015
    parts = [block((width, _LEAF_M, high), slab, (away * width / 2, -_LEAF_M / 2, 0.01))]
    x = away * (width - 0.07)
    for y, out in ((0.0, 1), (-_LEAF_M, -1)):
        parts.append(block((0.03, 0.006, 0.16), grip, (x, y + out * 0.003, 0.96)))
        if out < 0:
            parts.append(rod((x, y - 0.04, 1.05), (x - away * 0.11, y - 0.04, 1.05), 0.009, grip))
            parts.append(rod((x, y, 1.05), (x, y - 0.04, 1.05), 0.009, grip))
    return join_shapes(parts)


def _frame(rng: np.random.Generator, width: float, wall: float) -> list[Shape]:
    paint, depth = pick(rng, (wood, casing))(rng), wall + 2 * _PROUD_M
    jambs = [block((JAMB_M + 0.05, depth, DOOR_TOP_M), paint, (s * (width / 2 - JAMB_M + 0.04), 0, 0)) for s in (-1, 1)]
    return [*jambs, block((width + 0.1, depth, JAMB_M + 0.05), paint, (0, 0, DOOR_TOP_M - JAMB_M))]


def window(rng: np.random.Generator, width: float, wall: float) -> Shape:
    """Glass in a frame with a mullion, set towards the outside of its opening, and a board on the sill."""
    height, y = HEAD_M - SILL_M, wall * 0.15
    paint = WHITE if rng.random() < 0.6 else wood(rng)
    seam, bar = 0.01, 0.05
    parts = [block((width + 2 * seam, 0.01, height + 2 * seam), _GLASS, (0, y, SILL_M - seam))]
    parts.extend(block((width, 0.05, bar), paint, (0, y, z)) for z in (SILL_M, HEAD_M - bar))
    parts.extend(block((bar, 0.045, height), paint, (s * (width - bar) / 2, y, SILL_M)) for s in (-1, 0, 1))
    board = block((width - 0.002, wall / 2 + y + 0.02, 0.02), paint, (0, -(wall / 2 + 0.02 - y) / 2, SILL_M))
    return join_shapes([*parts, board])
