"""Screens, keyboards and what else stands on desks with a cable."""

from __future__ import annotations

import numpy as np

from supermap_cli.simulation.world import Material, Shape, join_shapes
from supermap_cli.simulation.worlds.shapes.materials import (
    BLACK,
    PAPER,
    WHITE,
    between,
    casing,
    pick,
    plastic,
    screen,
    shaded,
)
from supermap_cli.simulation.worlds.shapes.primitives import (
    Point,
    ball,
    bent_rod,
    block,
    cylinder,
    pitched,
    rod,
    rounded_block,
    shifted,
)


def monitor(rng: np.random.Generator) -> Shape:
    """A screen on a foot."""
    width, case = between(rng, 0.5, 0.62), casing(rng)
    foot = rounded_block((0.24, 0.18, 0.015), 0.04, case)
    neck = block((0.06, 0.025, 0.26), case, (0, 0.03, 0.015))
    return join_shapes([foot, neck, *_panel((width, 0.04, width * 0.6), case, screen(rng), foot=0.12)])


def tv(rng: np.random.Generator) -> Shape:
    """A flat television to hang on a wall."""
    width = between(rng, 1.0, 1.35)
    bracket = block((0.3, 0.03, 0.25), BLACK, (0, 0.045, width * 0.18))
    return join_shapes([bracket, *_panel((width, 0.06, width * 0.58), BLACK, screen(rng), foot=0.0)])


def _panel(size: Point, case: Material, picture: Material, *, foot: float) -> list[Shape]:
    width, depth, height = size
    rim = 0.014
    return [
        block((width, depth, height), case, (0, 0, foot)),
        block((width - 2 * rim, 0.004, height - 2 * rim), picture, (0, -depth / 2 - 0.002, foot + rim)),
    ]


def laptop(rng: np.random.Generator) -> Shape:
    """A laptop, open."""
    width, depth, case = between(rng, 0.31, 0.37), between(rng, 0.21, 0.25), casing(rng)
    keys = Material((40, 41, 44), "checks", 0.018, 0.5)
    lid = [
        block((width, 0.01, depth), case),
        block((width - 0.02, 0.002, depth - 0.025), screen(rng), (0, -0.006, 0.012)),
    ]
    base = block((width, depth, 0.018), case)
    deck = block((width - 0.04, depth * 0.5, 0.002), keys, (0, depth * 0.16, 0.018))
    hinge, tilt = (0.0, depth / 2, 0.012), between(rng, 8, 28)
    return join_shapes([base, deck, *(pitched(shifted(part, hinge), tilt, hinge) for part in lid)])


def keyboard(rng: np.random.Generator) -> Shape:
    """Keys on a flat board, a little higher at the back."""
    width, depth, case = between(rng, 0.4, 0.45), between(rng, 0.125, 0.15), casing(rng)
    keys = Material(shaded(case, 0.7).rgb if case.rgb[0] > 100 else (92, 94, 98), "checks", 0.019, 0.5)
    board = [block((width, depth, 0.018), case)]
    for row in range(4):
        y = (row - 1.5) * (depth - 0.02) / 4
        board.append(block((width - 0.02, (depth - 0.02) / 4 - 0.003, 0.008), keys, (0, y, 0.018)))
    return join_shapes([*board, block((width * 0.8, 0.012, 0.004), case, (0, depth / 2 - 0.015, -0.004))])


def mouse(rng: np.random.Generator) -> Shape:
    """A computer mouse with its wheel."""
    case, half = casing(rng), between(rng, 0.05, 0.06)
    body = ball((between(rng, 0.029, 0.034), half, 0.02), case, sides=12, rings=5)
    wheel = block((0.008, 0.018, 0.012), Material((110, 112, 116)), (0, -half / 2, 0.029))
    return join_shapes([body, wheel])


def cell_phone(rng: np.random.Generator) -> Shape:
    """A phone lying on its back."""
    size = (between(rng, 0.07, 0.078), between(rng, 0.145, 0.16))
    return join_shapes(
        [
            rounded_block((*size, 0.009), 0.009, pick(rng, (casing, plastic))(rng)),
            block((size[0] - 0.008, size[1] - 0.012, 0.001), screen(rng), (0, 0, 0.009)),
        ]
    )


def printer(rng: np.random.Generator) -> Shape:
    """A desktop printer with paper in its tray."""
    width, depth, height = between(rng, 0.38, 0.46), between(rng, 0.26, 0.3), between(rng, 0.2, 0.3)
    case = casing(rng)
    lid, slot = shaded(case, 0.75), Material((20, 20, 22))
    return join_shapes(
        [
            rounded_block((width, depth, height), 0.03, case),
            rounded_block((width * 0.92, depth * 0.8, 0.03), 0.03, lid, (0, 0.02, height)),
            block((width * 0.6, 0.004, 0.06), slot, (0, -depth / 2 - 0.002, height * 0.35)),
            block((width * 0.55, 0.08, 0.012), lid, (0, -depth / 2 - 0.04, height * 0.3)),
            block((0.21, 0.07, 0.008), PAPER, (0, -depth / 2 - 0.037, height * 0.3 + 0.012)),
            block((0.1, 0.006, 0.035), screen(rng), (width * 0.28, -depth / 2 - 0.003, height * 0.75)),
        ]
    )


def lamp(rng: np.random.Generator) -> Shape:
    """A floor lamp: foot, pole and shade."""
    height, frame = between(rng, 1.4, 1.7), casing(rng)
    shade = Material((244, 226, 178) if rng.random() < 0.5 else plastic(rng).rgb, "stripes", 0.03, 0.12)
    low, radius = height - 0.28, between(rng, 0.16, 0.21)
    hood = cylinder(radius, 0.28, shade, (0, 0, low), top_radius=radius * 0.65, sides=16)
    bulb = ball((0.04, 0.04, 0.05), WHITE, (0, 0, low - 0.06), sides=8, rings=3)
    pole = rod((0, 0, 0.025), (0, 0, low + 0.02), 0.014, frame, sides=8)
    chain = bent_rod([(radius * 0.4, 0, low - 0.12), (radius * 0.4, 0, low + 0.01)], 0.004, frame, sides=4)
    return join_shapes([cylinder(between(rng, 0.13, 0.16), 0.025, frame, sides=16), pole, hood, bulb, chain])
