"""Things that hold other things: open boards, boxes and trays that really have room in them."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import (
    CARDBOARD,
    RUBBER,
    between,
    metal,
    pick,
    plastic,
    tinted,
    wood,
)
from supermap_cli.simulation.worlds.shapes.primitives import bent_rod, block, lathe, pitched, rod, shifted, upright


def bookshelf(rng: np.random.Generator) -> Shape:
    """Open boards between two sides, before a thin back."""
    width, depth, height = between(rng, 0.75, 1.05), between(rng, 0.3, 0.36), between(rng, 1.5, 1.95)
    material, boards, t = wood(rng), int(rng.integers(4, 6)), 0.025
    back = Material(tinted(rng, material.rgb, 30), "grain", 0.08, 0.1)
    parts = [block((t, depth, height), material, (s * (width - t) / 2, 0, 0)) for s in (-1, 1)]
    parts.append(block((width - 2 * t, 0.01, height - 0.06), back, (0, depth / 2 - 0.005, 0.06)))
    levels = np.linspace(0.06, height - t, boards + 1)
    shelves = [block((width - 2 * t, depth - 0.01, t), material, (0, -0.005, float(z))) for z in levels]
    return join_shapes([*parts, *shelves])


def cabinet(rng: np.random.Generator) -> Shape:
    """A sideboard with two or three doors and room on its top."""
    doors = int(rng.integers(2, 4))
    width, depth, height = doors * between(rng, 0.38, 0.45), between(rng, 0.42, 0.5), between(rng, 0.75, 0.9)
    body, front, grip = pick(rng, (wood, metal))(rng), pick(rng, (wood, plastic))(rng), metal(rng)
    parts = [
        block((width - 0.06, depth - 0.06, 0.06), grip, (0, 0.02, 0)),
        block((width, depth - 0.02, height - 0.06), body, (0, 0.01, 0.06)),
    ]
    door_width = width / doors
    for k in range(doors):
        x = (k - (doors - 1) / 2) * door_width
        parts.append(block((door_width - 0.01, 0.02, height - 0.1), front, (x, -depth / 2 + 0.01, 0.08)))
        grip_x = x + door_width * (0.35 if k % 2 == 0 else -0.35)
        parts.append(block((0.015, 0.02, 0.14), grip, (grip_x, -depth / 2 - 0.01, height - 0.3)))
    return join_shapes(parts)


def cardboard_box(rng: np.random.Generator) -> Shape:
    """An open box with its four flaps turned out."""
    width, depth, height = between(rng, 0.4, 0.55), between(rng, 0.34, 0.42), between(rng, 0.26, 0.36)
    t, flap = 0.008, between(rng, 0.1, 0.14)
    paper = Material(tinted(rng, CARDBOARD.rgb, 14), CARDBOARD.pattern, CARDBOARD.scale_m, CARDBOARD.contrast)
    label = Material((228, 224, 214), "print", 0.02, 0.4)
    parts = [block((width, depth, t), paper)]
    for s in (-1, 1):
        parts.append(block((t, depth, height - t), paper, (s * (width - t) / 2, 0, t)))
        parts.append(block((width - 2 * t, t, height - t), paper, (0, s * (depth - t) / 2, t)))
        wing = block((width - 0.02, t, flap), paper, (0, s * (depth / 2 - t), height))
        parts.append(pitched(wing, s * between(rng, 25, 60), (0, s * (depth / 2 - t), height)))
    parts.append(block((width * 0.4, 0.002, height * 0.35), label, (0, -depth / 2 - 0.001, height * 0.3)))
    return join_shapes(parts)


def cart(rng: np.random.Generator) -> Shape:
    """A trolley: trays between four posts, a push bar, four wheels."""
    width, depth, height = between(rng, 0.65, 0.85), between(rng, 0.42, 0.5), between(rng, 0.78, 0.92)
    tray, frame = pick(rng, (plastic, metal))(rng), metal(rng)
    trays = (0.16, height - 0.06) if rng.random() < 0.4 else (0.16, height / 2 + 0.05, height - 0.06)
    parts: list[Shape] = []
    for z in trays:
        parts.append(block((width, depth, 0.025), tray, (0, 0, z)))
        parts.extend(block((width, 0.015, 0.035), tray, (0, s * (depth / 2 - 0.0075), z + 0.025)) for s in (-1, 1))
    x, y = width / 2 - 0.03, depth / 2 - 0.035
    for sx in (-1, 1):
        for sy in (-1, 1):
            parts.append(rod((sx * x, sy * y, 0.08), (sx * x, sy * y, height), 0.014, frame))
            parts.append(_wheel(sx * x, sy * y))
    bar = [(x, -y, height), (x + 0.1, -y, height + 0.07), (x + 0.1, y, height + 0.07), (x, y, height)]
    return join_shapes([*parts, bent_rod(bar, 0.014, frame)])


def _wheel(x: float, y: float) -> Shape:
    tyre = upright(lathe([(0.035, 0), (0.045, 0.006), (0.045, 0.022), (0.035, 0.028)], RUBBER, sides=10))
    return shifted(tyre, (x, y + 0.014, 0.045))
