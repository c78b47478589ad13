"""Things to sit on. A chair is legs, a seat and a back with air between them, never a box."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import between, casing, fabric, metal, pick, plastic, shaded, wood
from supermap_cli.simulation.worlds.shapes.primitives import (
    ball,
    bent_rod,
    block,
    cylinder,
    pitched,
    rod,
    rounded_block,
    shifted,
)


def chair(rng: np.random.Generator) -> Shape:
    """A chair on four legs or an office chair that turns."""
    return pick(rng, (_four_legged, _four_legged, _swivel))(rng)


def _four_legged(rng: np.random.Generator) -> Shape:
    width, depth, seat_at = between(rng, 0.41, 0.48), between(rng, 0.42, 0.48), between(rng, 0.43, 0.46)
    frame = pick(rng, (wood, metal))(rng)
    seat = pick(rng, (fabric, plastic))(rng)
    x, y = width / 2 - 0.025, depth / 2 - 0.025
    legs = [block((0.035, 0.035, seat_at), frame, (sx * x, sy * y, 0)) for sx in (-1, 1) for sy in (-1, 1)]
    cushion = rounded_block((width, depth, 0.045), 0.04, seat, (0, 0, seat_at))
    rest = shifted(_backrest(rng, width, frame, seat), (0, y, seat_at + 0.045))
    return join_shapes([*legs, cushion, pitched(rest, 6, (0, y, seat_at))])


def _backrest(rng: np.random.Generator, width: float, frame: Material, seat: Material) -> Shape:
    x, inner, height = width / 2 - 0.025, width - 0.08, between(rng, 0.38, 0.46)
    posts = [block((0.032, 0.03, height), frame, (sx * x, 0, 0)) for sx in (-1, 1)]
    if rng.random() < 0.5:
        return join_shapes([*posts, block((inner, 0.022, height * 0.5), seat, (0, 0, height * 0.47))])
    slats = height * np.linspace(0.3, 0.86, int(rng.integers(3, 5)))
    return join_shapes([*posts, *(block((inner, 0.02, 0.05), frame, (0, 0, float(z))) for z in slats)])


def _swivel(rng: np.random.Generator) -> Shape:
    cloth, frame, seat_at = fabric(rng), casing(rng), between(rng, 0.44, 0.5)
    width, back = between(rng, 0.46, 0.5), between(rng, 0.45, 0.58)
    parts = [cylinder(0.03, seat_at - 0.1, frame, (0, 0, 0.1), sides=8)]
    for angle in np.arange(5) * 2 * np.pi / 5 + 0.3:
        toe = 0.29 * np.array([np.cos(angle), np.sin(angle)])
        parts.append(rod((0, 0, 0.12), (*toe, 0.075), 0.02, frame, sides=5))
        parts.append(ball((0.028, 0.028, 0.03), frame, (float(toe[0]), float(toe[1]), 0), sides=6, rings=3))
    parts.append(rounded_block((width, 0.48, 0.075), 0.09, cloth, (0, 0, seat_at)))
    parts.append(bent_rod([(0, 0.18, seat_at), (0, 0.28, seat_at + 0.05), (0, 0.27, seat_at + 0.25)], 0.022, frame))
    rest = rounded_block((width * 0.92, 0.06, back), 0.028, cloth, (0, 0.24, seat_at + 0.13))
    parts.append(pitched(rest, 7, (0, 0.24, seat_at + 0.13)))
    if rng.random() < 0.6:
        for side in (-1, 1):
            x = side * (width / 2 + 0.03)
            parts.append(block((0.03, 0.04, 0.25), frame, (x, 0.03, seat_at - 0.03)))
            parts.append(rounded_block((0.06, 0.25, 0.025), 0.02, frame, (x, 0, seat_at + 0.22)))
    return join_shapes(parts)


def stool(rng: np.random.Generator) -> Shape:
    """A round seat on three or four splayed legs."""
    frame, seat = wood(rng), pick(rng, (fabric, wood))(rng)
    radius, height, legs = between(rng, 0.16, 0.2), between(rng, 0.42, 0.7), int(rng.integers(3, 5))
    angles = np.arange(legs) * 2 * np.pi / legs + 0.5
    feet = np.column_stack([np.cos(angles), np.sin(angles)])
    bars = [rod((*radius * foot * 1.05, 0.0), (*radius * foot * 0.65, height), 0.017, frame) for foot in feet]
    rings = [rod((*radius * a * 0.9, height * 0.35), (*radius * b * 0.9, height * 0.35), 0.01, frame, 5)
             for a, b in zip(feet, np.roll(feet, -1, axis=0), strict=True)]  # fmt: skip
    return join_shapes([*bars, *rings, cylinder(radius, 0.04, seat, (0, 0, height), sides=16)])


def couch(rng: np.random.Generator) -> Shape:
    """A sofa of two or three cushions."""
    return _upholstered(rng, int(rng.integers(2, 4)), between(rng, 0.6, 0.68))


def armchair(rng: np.random.Generator) -> Shape:
    """A wide upholstered chair with arms."""
    return _upholstered(rng, 1, between(rng, 0.5, 0.58))


def _upholstered(rng: np.random.Generator, seats: int, seat_width: float) -> Shape:
    cloth, feet = fabric(rng), wood(rng)
    darker = shaded(cloth, 0.8)
    depth, seat_at, arm = between(rng, 0.78, 0.9), between(rng, 0.4, 0.44), between(rng, 0.12, 0.17)
    width, back_at = seats * seat_width, between(rng, 0.74, 0.86)
    total = width + 2 * arm
    parts = [rounded_block((total, depth, 0.2), 0.03, darker, (0, 0, 0.08))]
    for k in range(seats):
        x = (k - (seats - 1) / 2) * seat_width
        parts.append(rounded_block((seat_width - 0.01, depth - 0.2, seat_at - 0.28), 0.04, cloth, (x, -0.1, 0.28)))
        pillow = rounded_block(
            (seat_width - 0.02, 0.14, back_at - seat_at - 0.02), 0.04, cloth, (x, depth / 2 - 0.25, seat_at)
        )
        parts.append(pitched(pillow, 8, (0, depth / 2 - 0.25, seat_at)))
    parts.append(rounded_block((total, 0.16, back_at - 0.28), 0.04, darker, (0, depth / 2 - 0.08, 0.28)))
    for side in (-1, 1):
        x = side * (total - arm) / 2
        parts.append(rounded_block((arm, depth - 0.16, 0.34), 0.04, darker, (x, -0.08, 0.28)))
        parts.extend(cylinder(0.025, 0.08, feet, (x, y, 0), sides=6) for y in (-depth / 2 + 0.08, depth / 2 - 0.08))
    return join_shapes(parts)
