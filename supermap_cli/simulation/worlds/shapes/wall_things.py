"""Things that hang on walls: flat, their backs at y = 0."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import (
    BLACK,
    WHITE,
    between,
    casing,
    metal,
    pick,
    picture,
    plastic,
    wood,
)
from supermap_cli.simulation.worlds.shapes.primitives import (
    Point,
    ball,
    bent_rod,
    block,
    cylinder,
    lathe,
    pitched,
    rod,
    shifted,
    upright,
)


def whiteboard(rng: np.random.Generator) -> Shape:
    """A white board in a metal frame, with scribbles and a tray of pens."""
    width, height = between(rng, 1.2, 1.8), between(rng, 0.9, 1.1)
    rail = Material((168, 170, 174), "grain", 0.02, 0.06)
    parts = [*_framed((width, 0.025, height), 0.03, rail, Material((244, 245, 244), "print", 0.25, 0.05))]
    parts.append(block((width * 0.4, 0.06, 0.012), rail, (0, -0.055, 0.0)))
    for k in range(int(rng.integers(2, 4))):
        x = -0.15 + 0.13 * k
        parts.append(rod((x, -0.06, 0.02), (x + 0.11, -0.06, 0.02), 0.008, plastic(rng)))
    for _ in range(int(rng.integers(2, 5))):
        x, z = between(rng, -0.35, 0.35) * width, between(rng, 0.3, 0.8) * height
        ink = Material(plastic(rng).rgb, "print", 0.03, 0.6)
        parts.append(block((between(rng, 0.12, 0.3), 0.002, between(rng, 0.05, 0.15)), ink, (x, -0.026, z)))
    return join_shapes(parts)


def painting(rng: np.random.Generator) -> Shape:
    """A framed picture with a horizon and something before it."""
    width, height = between(rng, 0.5, 1.0), between(rng, 0.45, 0.75)
    parts = _framed((width, 0.03, height), 0.035, pick(rng, (wood, casing))(rng), picture(rng))
    parts.append(block((width - 0.08, 0.002, height * between(rng, 0.2, 0.4)), picture(rng), (0, -0.031, 0.04)))
    disc = cylinder(between(rng, 0.05, 0.1), 0.003, picture(rng), sides=14)
    parts.append(shifted(upright(disc), (between(rng, -0.2, 0.2) * width, -0.03, height * 0.65)))
    return join_shapes(parts)


def _framed(size: Point, rim: float, frame: Material, face: Material) -> list[Shape]:
    """A face in a frame whose mouldings stand 5 mm before it; the back is at y = 0."""
    width, depth, height = size
    y, thick = -(depth + 0.005) / 2, depth + 0.005
    return [
        block((width - 2 * rim, depth, height - 2 * rim), face, (0, -depth / 2, rim)),
        block((width, thick, rim), frame, (0, y, 0)),
        block((width, thick, rim), frame, (0, y, height - rim)),
        *(block((rim, thick, height - 2 * rim), frame, (s * (width - rim) / 2, y, rim)) for s in (-1, 1)),
    ]


def clock(rng: np.random.Generator) -> Shape:
    """A round wall clock with twelve marks and two hands."""
    radius, rim = between(rng, 0.14, 0.19), casing(rng)
    case = lathe([(radius, 0), (radius, 0.045), (radius - 0.015, 0.045), (radius - 0.015, 0.03)], rim, sides=20)
    parts = [case, cylinder(radius - 0.016, 0.031, WHITE, sides=20)]
    for angle in np.arange(12) * np.pi / 6:
        at = (radius - 0.035) * np.array([np.sin(angle), np.cos(angle)])
        parts.append(block((0.009, 0.009, 0.003), BLACK, (float(at[0]), float(at[1]), 0.031)))
    for length, angle in ((0.5, between(rng, 0, 6.28)), (0.72, between(rng, 0, 6.28))):
        tip = length * radius * np.array([np.sin(angle), np.cos(angle)])
        parts.append(rod((0, 0, 0.036), (*tip, 0.036), 0.004, BLACK, sides=4))
    return shifted(upright(join_shapes(parts)), (0, 0, radius))


def fire_extinguisher(rng: np.random.Generator) -> Shape:
    """A red cylinder with valve, hose and nozzle, on its bracket."""
    radius, height = between(rng, 0.065, 0.08), between(rng, 0.36, 0.44)
    red = Material((198, 32, 30), "plain")
    label = Material((232, 226, 206), "print", 0.02, 0.4)
    tank = lathe([(radius, 0), (radius, height), (0.03, height + 0.05), (0.02, height + 0.07)], red, sides=14)
    band = cylinder(radius + 0.001, height * 0.35, label, (0, 0, height * 0.4), sides=14)
    valve = block((0.03, 0.05, 0.04), metal(rng), (0, 0, height + 0.07))
    lever = pitched(block((0.02, 0.11, 0.012), BLACK, (0, -0.05, height + 0.11)), -12, (0, 0, height + 0.11))
    hose = [(0.02, 0, height + 0.08), (radius + 0.02, 0, height + 0.02), (radius + 0.03, -0.01, height * 0.4)]
    nozzle = cylinder(0.012, 0.1, BLACK, (radius + 0.03, -0.01, height * 0.4 - 0.1), top_radius=0.02, sides=8)
    grip = ball((0.012, 0.012, 0.012), BLACK, (0, -0.03, height + 0.12), sides=6, rings=3)
    body = join_shapes([tank, band, valve, lever, bent_rod(hose, 0.01, BLACK), nozzle, grip])
    bracket = block((0.09, 0.012, height * 0.7), metal(rng), (0, -0.006, height * 0.15))
    return join_shapes([shifted(body, (0, -radius - 0.014, 0)), bracket])
