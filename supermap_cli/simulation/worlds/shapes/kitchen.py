"""Kitchen appliances, and what is eaten and drunk from."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import (
    BLACK,
    between,
    ceramic,
    enamel,
    metal,
    pick,
    plastic,
    tinted,
)
from supermap_cli.simulation.worlds.shapes.primitives import bent_rod, block, cylinder, lathe, rounded_block, vessel


def refrigerator(rng: np.random.Generator) -> Shape:
    """A fridge with a freezer above or below."""
    width, depth, height = between(rng, 0.58, 0.68), between(rng, 0.58, 0.66), between(rng, 1.5, 1.85)
    skin, grip = enamel(rng), metal(rng)
    seam = height * pick(rng, (0.34, 0.68))
    parts = [
        block((width - 0.06, depth - 0.08, 0.05), BLACK, (0, 0.02, 0)),
        block((width, depth - 0.05, height - 0.05), skin, (0, 0.025, 0.05)),
    ]
    for low, high in ((0.06, seam), (seam + 0.012, height)):
        parts.append(rounded_block((width - 0.006, 0.05, high - low), 0.02, skin, (0, -depth / 2 + 0.025, low)))
        reach = min(0.4, (high - low) * 0.5)
        middle = seam - reach - 0.06 if low < 0.1 else low + 0.06
        parts.append(block((0.02, 0.03, reach), grip, (width / 2 - 0.06, -depth / 2 - 0.015, middle)))
    return join_shapes([*parts, block((0.09, 0.002, 0.13), plastic(rng), (-0.1, -depth / 2 - 0.001, height * 0.82))])


def microwave(rng: np.random.Generator) -> Shape:
    """A microwave oven: dark window, keypad, handle."""
    width, depth, height = between(rng, 0.45, 0.54), between(rng, 0.34, 0.4), between(rng, 0.26, 0.31)
    skin, front = enamel(rng), -depth / 2
    keys = Material((58, 60, 64), "checks", 0.022, 0.6)
    feet = [cylinder(0.015, 0.012, BLACK, (sx * width * 0.4, sy * depth * 0.4, 0), sides=6)
            for sx in (-1, 1) for sy in (-1, 1)]  # fmt: skip
    return join_shapes(
        [
            *feet,
            block((width, depth, height), skin, (0, 0, 0.012)),
            block((width * 0.64, 0.006, height * 0.72), BLACK, (-width * 0.13, front - 0.003, 0.012 + height * 0.14)),
            block((width * 0.18, 0.004, height * 0.6), keys, (width * 0.37, front - 0.002, 0.012 + height * 0.25)),
            block((0.016, 0.03, height * 0.7), metal(rng), (width * 0.23, front - 0.015, 0.012 + height * 0.15)),
        ]
    )


def mug(rng: np.random.Generator) -> Shape:
    """A mug with its handle; one can look into it."""
    radius, height, glaze = between(rng, 0.038, 0.046), between(rng, 0.088, 0.108), ceramic(rng)
    angles = np.linspace(-1.25, 1.25, 5)
    arc = np.column_stack([radius - 0.006 + 0.032 * np.cos(angles), np.zeros(5), height / 2 + 0.034 * np.sin(angles)])
    return join_shapes([vessel(radius, height, 0.005, glaze, base_radius=radius * 0.92), bent_rod(arc, 0.006, glaze)])


def bottle(rng: np.random.Generator) -> Shape:
    """A bottle with a neck, a cap and a label round it."""
    radius, height = between(rng, 0.034, 0.043), between(rng, 0.22, 0.31)
    hue: tuple[float, float, float] = pick(rng, ((52, 96, 60), (110, 66, 32), (120, 170, 205), (196, 206, 210)))
    glass = Material(tinted(rng, hue), "plain")
    neck = [(radius, 0.0), (radius, height * 0.62), (0.014, height * 0.82), (0.014, height * 0.94)]
    wrapper = Material(plastic(rng).rgb, "print", 0.02, 0.35)
    band = cylinder(radius + 0.001, height * 0.3, wrapper, (0, 0, height * 0.2))
    cap = cylinder(0.017, height * 0.06, plastic(rng), (0, 0, height * 0.94), sides=10)
    return join_shapes([lathe(neck, glass), band, cap])


def bowl(rng: np.random.Generator) -> Shape:
    """An open bowl."""
    radius, height, wall = between(rng, 0.09, 0.14), between(rng, 0.06, 0.085), 0.006
    outside = [(radius * 0.45, 0.0), (radius * 0.8, height * 0.45), (radius, height)]
    inside = [(radius - wall, height), (radius * 0.8 - wall, height * 0.5), (radius * 0.42, wall * 1.5)]
    return lathe([*outside, *inside], ceramic(rng), sides=18)
