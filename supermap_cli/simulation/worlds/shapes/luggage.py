"""Bags and cases: what people carry about."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import BLACK, RUBBER, between, fabric, metal, pick, plastic, shaded
from supermap_cli.simulation.worlds.shapes.primitives import (
    bent_rod,
    block,
    cylinder,
    pitched,
    rod,
    rounded_block,
    wedge,
    yawed,
)


def backpack(rng: np.random.Generator) -> Shape:
    """A rucksack with a front pocket, a lid and two straps at its back."""
    width, depth, height = between(rng, 0.29, 0.35), between(rng, 0.16, 0.2), between(rng, 0.42, 0.5)
    cloth = fabric(rng)
    strap, pocket = shaded(cloth, 0.6), shaded(cloth, 0.85)
    body = rounded_block((width, depth, height * 0.85), 0.06, cloth)
    lid = wedge((width * 0.92, depth * 0.9, height * 0.15), depth * 0.5, strap, (0, 0, height * 0.85))
    pouch = rounded_block((width * 0.7, 0.07, height * 0.42), 0.03, pocket, (0, -depth / 2 - 0.02, 0.03))
    zip_line = block((width * 0.6, 0.006, 0.01), Material((200, 200, 196)), (0, -depth / 2 - 0.057, height * 0.36))
    parts = [body, lid, pouch, zip_line]
    for side in (-1, 1):
        x, y = side * width * 0.26, depth / 2
        bow = [(x, y, height * 0.8), (x, y + 0.06, height * 0.6), (x, y + 0.05, height * 0.3), (x, y, height * 0.1)]
        parts.append(bent_rod(bow, 0.014, strap))
    loop = [(-0.04, depth * 0.3, height), (-0.03, depth * 0.3, height + 0.03), (0.03, depth * 0.3, height + 0.03)]
    return join_shapes([*parts, bent_rod([*loop, (0.04, depth * 0.3, height)], 0.008, strap)])


def suitcase(rng: np.random.Generator) -> Shape:
    """A wheeled case with ribs and its handle out."""
    width, depth, height = between(rng, 0.4, 0.47), between(rng, 0.24, 0.29), between(rng, 0.56, 0.66)
    shell, frame = plastic(rng), metal(rng)
    rib = shaded(shell, 0.75)
    parts = [rounded_block((width, depth, height), 0.05, shell, (0, 0, 0.05))]
    for x in np.linspace(-0.3, 0.3, 4) * width:
        parts.extend(block((0.02, 0.008, height * 0.8), rib, (float(x), s * (depth / 2 + 0.004), 0.05 + height * 0.1))
                     for s in (-1, 1))  # fmt: skip
    for sx in (-1, 1):
        parts.extend(cylinder(0.028, 0.05, RUBBER, (sx * width * 0.38, sy * depth * 0.3, 0), sides=8) for sy in (-1, 1))
        parts.append(rod((sx * 0.1, depth * 0.3, height + 0.05), (sx * 0.1, depth * 0.3, height + 0.26), 0.009, frame))
    parts.append(block((0.24, 0.03, 0.03), BLACK, (0, depth * 0.3, height + 0.25)))
    return join_shapes([*parts, block((0.14, 0.03, 0.025), BLACK, (0, 0, height + 0.06))])


def handbag(rng: np.random.Generator) -> Shape:
    """A bag that narrows to its top, with two handles."""
    width, depth, height = between(rng, 0.3, 0.38), between(rng, 0.12, 0.16), between(rng, 0.22, 0.28)
    leather = pick(rng, (fabric, plastic))(rng)
    trim = shaded(leather, 0.6)
    halves = [yawed(wedge((width, depth / 2, height), depth * 0.2, leather, (0, -depth / 4, 0)), k * np.pi)
              for k in (0, 1)]  # fmt: skip
    parts = [*halves, block((width * 0.3, 0.006, height * 0.2), trim, (0, -depth * 0.35, height * 0.62))]
    parts[-1] = pitched(parts[-1], 12, (0, -depth * 0.35, height * 0.62))
    for side in (-1, 1):
        y = side * depth * 0.17
        arc = np.linspace(0, np.pi, 7)
        bow = np.column_stack([width * 0.24 * np.cos(arc), np.full(7, y), height - 0.02 + 0.16 * np.sin(arc)])
        parts.append(bent_rod(bow, 0.008, trim))
    return join_shapes([*parts, block((width * 0.9, 0.012, 0.012), trim, (0, 0, height))])
