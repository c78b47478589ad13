"""Boxes and books that stack, and square baskets and bins that hold one another.

Each comes in sizes of which every smaller one fits onto or into every larger one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import (
    CARDBOARD,
    PAPER,
    between,
    cover,
    pick,
    plastic,
    tinted,
    wood,
)
from supermap_cli.simulation.worlds.shapes.primitives import block

Builder = Callable[[np.random.Generator], Shape]
_BOXES_M = {"large": (0.5, 0.42, 0.32), "medium": (0.38, 0.32, 0.25), "small": (0.26, 0.225, 0.17)}
_BOOKS_M = {"large": (0.27, 0.34, 0.04), "medium": (0.235, 0.29, 0.035), "small": (0.16, 0.22, 0.03)}
_BINS_M = {"outer": (0.36, 0.36, 0.36), "inner": (0.26, 0.26, 0.28)}


def closed_box(size: str) -> Builder:
    """A cardboard box that is taped shut."""

    def build(rng: np.random.Generator) -> Shape:
        width, depth, height = (side * between(rng, 0.96, 1.04) for side in _BOXES_M[size])
        paper = Material(tinted(rng, CARDBOARD.rgb, 20), CARDBOARD.pattern, CARDBOARD.scale_m, CARDBOARD.contrast)
        tape, label = Material((206, 178, 124)), Material((228, 224, 214), "print", 0.02, 0.4)
        return join_shapes(
            [
                block((width, depth, height), paper),
                block((width * 0.98, 0.003, height * 0.5), label, (0, -depth / 2 - 0.0015, height * 0.25)),
                *(block((0.003, 0.05, height), tape, (s * (width / 2 + 0.0015), 0, 0)) for s in (-1, 1)),
            ]
        )

    return build


def lying_book(size: str) -> Builder:
    """A large book on its back."""

    def build(rng: np.random.Generator) -> Shape:
        width, height, thick = (side * between(rng, 0.97, 1.03) for side in _BOOKS_M[size])
        binding = cover(rng)
        boards = [block((width, height, 0.003), binding, (0, 0, z)) for z in (0.0, thick - 0.003)]
        pages = block((width - 0.01, height - 0.008, thick - 0.006), PAPER, (0.001, 0, 0.003))
        spine = block((0.003, height, thick - 0.006), binding, (-width / 2 + 0.0015, 0, 0.003))
        return join_shapes([*boards, pages, spine])

    return build


def basket(rng: np.random.Generator) -> Shape:
    """A square basket for one bag."""
    size = (between(rng, 0.56, 0.62), between(rng, 0.4, 0.46), between(rng, 0.28, 0.34))
    weave = Material(wood(rng).rgb, "checks", 0.02, 0.35)
    return open_box(size, 0.012, weave)


def square_bin(size: str) -> Builder:
    """A square bin with nothing in it yet."""

    def build(rng: np.random.Generator) -> Shape:
        return open_box(
            tuple(side * between(rng, 0.97, 1.03) for side in _BINS_M[size]), 0.006, pick(rng, (plastic, wood))(rng)
        )

    return build


def open_box(size: tuple[float, ...], wall: float, material: Material) -> Shape:
    """Four walls and a bottom."""
    width, depth, height = size
    parts = [block((width, depth, wall), material)]
    for s in (-1, 1):
        parts.append(block((wall, depth, height - wall), material, (s * (width - wall) / 2, 0, wall)))
        parts.append(block((width - 2 * wall, wall, height - wall), material, (0, s * (depth - wall) / 2, wall)))
    return join_shapes(parts)
