"""Furniture of rods of 2 cm: little of it is hit by a depth camera's rays, and one sees through the rest."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import between, fabric, metal, plastic, wood
from supermap_cli.simulation.worlds.shapes.primitives import Point, bent_rod, block, cylinder, rod

_ROD_M = 0.01  # m, radius: tubes of 2 cm, as of folding chairs
_BOARD_M = 0.012  # m, thickness of tops and seats


def thin_table(rng: np.random.Generator) -> Shape:
    """A thin top on a frame of rods."""
    width, depth, height = between(rng, 1.0, 1.5), between(rng, 0.6, 0.8), between(rng, 0.71, 0.76)
    frame, top = metal(rng), wood(rng)
    return join_shapes(
        [
            block((width, depth, _BOARD_M), top, (0, 0, height - _BOARD_M)),
            *_frame(width - 0.06, depth - 0.06, height - _BOARD_M, frame, (0.12, height - 0.03)),
        ]
    )


def thin_stool(rng: np.random.Generator) -> Shape:
    """A thin round seat on four rods."""
    side, height, frame = between(rng, 0.3, 0.36), between(rng, 0.44, 0.68), metal(rng)
    seat = cylinder(side * 0.55, _BOARD_M, wood(rng), (0, 0, height - _BOARD_M), sides=16)
    return join_shapes([seat, *_frame(side, side, height - _BOARD_M, frame, (0.15,))])


def thin_chair(rng: np.random.Generator) -> Shape:
    """A thin seat and three bars as a back, between rods."""
    width, depth, seat_at, high = between(rng, 0.4, 0.46), between(rng, 0.4, 0.46), 0.45, between(rng, 0.8, 0.9)
    frame, seat = metal(rng), (fabric if rng.random() < 0.5 else plastic)(rng)
    x, y = width / 2, depth / 2
    parts = [block((width, depth, _BOARD_M), seat, (0, 0, seat_at)), *_frame(width, depth, seat_at, frame, (0.2,))]
    parts += [_bar((s * x, y, seat_at), (s * x, y + 0.06, high), frame) for s in (-1, 1)]
    for share in (0.4, 0.7, 1.0):
        z = seat_at + share * (high - seat_at) - 0.01
        parts.append(_bar((-x, y + 0.06 * share, z), (x, y + 0.06 * share, z), frame))
    return join_shapes(parts)


def wire_shelf(rng: np.random.Generator) -> Shape:
    """Shelves of wires between four posts: nothing in it is a closed board."""
    width, depth, height = between(rng, 0.7, 0.95), between(rng, 0.32, 0.4), between(rng, 1.3, 1.75)
    steel, levels = metal(rng), 4
    parts = _frame(width, depth, height, steel, ())
    for z in np.linspace(0.12, height - 0.02, levels):
        for y in np.linspace(-depth / 2, depth / 2, 6):
            parts.append(rod((-width / 2, y, z), (width / 2, y, z), 0.004, steel, sides=4))
        parts.extend(_bar((s * width / 2, -depth / 2, z), (s * width / 2, depth / 2, z), steel) for s in (-1, 1))
    return join_shapes(parts)


def tripod_lamp(rng: np.random.Generator) -> Shape:
    """A floor lamp on three thin legs."""
    height, radius, frame = between(rng, 1.35, 1.65), between(rng, 0.12, 0.16), metal(rng)
    shade = Material((240, 228, 196), "stripes", 0.03, 0.12)
    crown = (0.0, 0.0, height - 0.25)
    feet = [(0.28 * np.cos(a), 0.28 * np.sin(a), 0.0) for a in np.arange(3) * 2 * np.pi / 3 + 0.4]
    hood = cylinder(radius, 0.26, shade, (0, 0, height - 0.26), top_radius=radius * 0.8, sides=14)
    return join_shapes([*(rod(foot, crown, _ROD_M, frame, sides=5) for foot in feet), hood])


def clothes_rack(rng: np.random.Generator) -> Shape:
    """An open frame: two uprights on feet, a bar above and one below."""
    width, height, frame = between(rng, 0.9, 1.3), between(rng, 1.4, 1.65), metal(rng)
    parts = [_bar((-width / 2, 0, z), (width / 2, 0, z), frame) for z in (0.15, height)]
    for s in (-1, 1):
        x = s * width / 2
        parts += [_bar((x, 0, 0.01), (x, 0, height), frame), _bar((x, -0.24, 0.01), (x, 0.24, 0.01), frame)]
    hook = [(0.1, 0, height), (0.1, 0, height - 0.12), (-0.05, 0, height - 0.2), (0.25, 0, height - 0.2)]
    return join_shapes([*parts, bent_rod(hook, 0.004, frame, sides=4)])


def _frame(width: float, depth: float, height: float, material: Material, rails_at: tuple[float, ...]) -> list[Shape]:
    """Four upright rods, and rods all round at some heights."""
    x, y = width / 2, depth / 2
    corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
    bars = [_bar((*corner, 0.0), (*corner, height), material) for corner in corners]
    for z in rails_at:
        ends = zip(corners, [*corners[1:], corners[0]], strict=True)
        bars += [_bar((*a, z), (*b, z), material) for a, b in ends]
    return bars


def _bar(start: Point, end: Point, material: Material) -> Shape:
    return rod(start, end, _ROD_M, material, sides=5)
