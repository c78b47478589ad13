"""Furniture that reaches far beyond its foot: what a map sees of it floats above an empty floor."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import between, casing, fabric, metal, plastic, wood
from supermap_cli.simulation.worlds.shapes.primitives import bent_rod, block, cylinder, rod, rounded_block


def pedestal_table(rng: np.random.Generator) -> Shape:
    """A wide top on one central column with a small foot."""
    width, depth, height = between(rng, 1.2, 1.7), between(rng, 0.8, 1.05), between(rng, 0.72, 0.76)
    foot, top = metal(rng), wood(rng)
    return join_shapes(
        [
            rounded_block((width, depth, 0.03), 0.02, top, (0, 0, height - 0.03)),
            cylinder(between(rng, 0.035, 0.06), height - 0.05, foot, (0, 0, 0.02), sides=10),
            rounded_block((0.42, 0.42, 0.02), 0.05, foot),
        ]
    )


def cantilever_desk(rng: np.random.Generator) -> Shape:
    """A top that only feet at its back carry."""
    width, depth, height = between(rng, 1.2, 1.5), between(rng, 0.65, 0.8), between(rng, 0.72, 0.76)
    frame, back = casing(rng), depth / 2 - 0.06
    parts = [rounded_block((width, depth, 0.03), 0.02, wood(rng), (0, 0, height - 0.03))]
    for x in (-width / 2 + 0.25, width / 2 - 0.25):
        parts.append(block((0.06, 0.05, height - 0.03), frame, (x, back, 0)))
        parts.append(block((0.05, 0.3, 0.025), frame, (x, back - 0.17, 0)))
    return join_shapes(parts)


def bar_stool(rng: np.random.Generator) -> Shape:
    """A seat on one column, wider than its foot."""
    height, frame, radius = between(rng, 0.62, 0.78), metal(rng), between(rng, 0.18, 0.22)
    seat = (fabric if rng.random() < 0.5 else plastic)(rng)
    return join_shapes(
        [
            cylinder(0.15, 0.02, frame, sides=14),
            cylinder(0.022, height - 0.07, frame, (0, 0, 0.02), sides=8),
            cylinder(radius, 0.05, seat, (0, 0, height - 0.05), sides=16),
        ]
    )


def arc_lamp(rng: np.random.Generator) -> Shape:
    """A floor lamp whose shade hangs 0.7 to 1 m beside its foot."""
    reach, height, frame = between(rng, 0.7, 1.0), between(rng, 1.6, 1.85), metal(rng)
    shade = Material((238, 226, 200) if rng.random() < 0.5 else plastic(rng).rgb, "speckle", 0.03, 0.08)
    angles = np.linspace(0, np.pi / 2, 6)
    bow = np.column_stack([reach * (1 - np.cos(angles)), np.zeros(6), height * (0.55 + 0.45 * np.sin(angles))])
    return join_shapes(
        [
            cylinder(0.15, 0.03, frame, sides=14),
            rod((0, 0, 0.03), (0, 0, height * 0.55), 0.012, frame),
            bent_rod(bow, 0.012, frame),
            rod((reach, 0, height - 0.2), (reach, 0, height), 0.006, frame, sides=4),
            cylinder(0.18, 0.16, shade, (reach, 0, height - 0.36), top_radius=0.08, sides=14),
        ]
    )
