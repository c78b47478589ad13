"""What things are made of: palettes of materials, drawn at random."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from supermap_cli.simulation.world import Material, Pattern

Rgb = tuple[float, float, float]
T = TypeVar("T")

WOODS: tuple[Rgb, ...] = ((196, 156, 108), (150, 104, 62), (98, 64, 40), (222, 196, 156), (170, 122, 84))
METALS: tuple[Rgb, ...] = ((178, 180, 184), (120, 122, 126), (60, 62, 66), (205, 206, 208))
LEAF_GREENS: tuple[Rgb, ...] = ((62, 128, 52), (84, 150, 66), (44, 100, 60), (120, 160, 70))

BLACK = Material((30, 31, 34))
WHITE = Material((236, 236, 232))
PAPER = Material((240, 237, 226), "print", 0.01, 0.12)
RUBBER = Material((38, 38, 40), "speckle", 0.01, 0.2)
CARDBOARD = Material((186, 146, 98), "grain", 0.03, 0.12)
SOIL = Material((70, 50, 36), "speckle", 0.02, 0.4)


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number of [low, high)."""
    return float(rng.uniform(low, high))


def pick(rng: np.random.Generator, choices: Sequence[T]) -> T:
    """One of several."""
    return choices[int(rng.integers(len(choices)))]


def tinted(rng: np.random.Generator, rgb: Rgb, spread: float = 12.0) -> Rgb:
    """A colour near another."""
    red, green, blue = (float(np.clip(round(c + rng.uniform(-spread, spread)), 4, 251)) for c in rgb)
    return red, green, blue


def shaded(material: Material, factor: float) -> Material:
    """The same material, darker or lighter."""
    red, green, blue = (min(factor * c, 255.0) for c in material.rgb)
    return replace(material, rgb=(red, green, blue))


def vivid(rng: np.random.Generator, *, saturation: tuple[float, float] = (0.5, 0.9)) -> Rgb:
    """A colour of any hue."""
    hue, full, value = rng.random(), rng.uniform(*saturation), rng.uniform(0.45, 0.92)
    red, green, blue = (round(255 * c) for c in colorsys.hsv_to_rgb(hue, full, value))
    return float(red), float(green), float(blue)


def wood(rng: np.random.Generator) -> Material:
    """Grained wood, light to dark."""
    return Material(tinted(rng, pick(rng, WOODS)), "grain", between(rng, 0.03, 0.08), 0.25)


def metal(rng: np.random.Generator) -> Material:
    """Bare or painted grey metal."""
    return Material(tinted(rng, pick(rng, METALS), 6), "grain", 0.02, 0.06)


def fabric(rng: np.random.Generator) -> Material:
    """Woven cloth of any hue, often with a pattern."""
    patterns: tuple[Pattern, ...] = ("speckle", "stripes", "checks", "speckle")
    return Material(vivid(rng, saturation=(0.2, 0.75)), pick(rng, patterns), between(rng, 0.02, 0.06), 0.22)


def plastic(rng: np.random.Generator) -> Material:
    """Coloured plastic."""
    return Material(vivid(rng), "speckle", 0.05, 0.05)


def casing(rng: np.random.Generator) -> Material:
    """The black, grey or white housing of a device."""
    greys: tuple[Rgb, ...] = ((34, 35, 38), (70, 72, 76), (214, 214, 210), (240, 240, 238))
    return Material(tinted(rng, pick(rng, greys), 6), "speckle", 0.03, 0.06)


def enamel(rng: np.random.Generator) -> Material:
    """White or silver sheet metal of kitchen appliances."""
    return Material(tinted(rng, pick(rng, ((238, 238, 234), (188, 190, 192))), 5), "grain", 0.05, 0.05)


def ceramic(rng: np.random.Generator) -> Material:
    """Glazed, of one colour or striped."""
    patterns: tuple[Pattern, ...] = ("plain", "stripes", "speckle")
    return Material(vivid(rng, saturation=(0.15, 0.85)), pick(rng, patterns), between(rng, 0.015, 0.04), 0.25)


def picture(rng: np.random.Generator) -> Material:
    """A painted or printed picture."""
    return Material(vivid(rng, saturation=(0.25, 0.7)), "print", between(rng, 0.06, 0.15), 0.55)


def screen(rng: np.random.Generator) -> Material:
    """A display, dark or showing windows."""
    shades: tuple[Rgb, ...] = ((18, 20, 26), (44, 62, 92), (30, 46, 58))
    return Material(tinted(rng, pick(rng, shades), 8), "print", between(rng, 0.03, 0.08), 0.35)


def cover(rng: np.random.Generator) -> Material:
    """A book's cover."""
    return Material(vivid(rng), "print", between(rng, 0.02, 0.05), 0.3)


def foliage(rng: np.random.Generator) -> Material:
    """Leaves."""
    return Material(tinted(rng, pick(rng, LEAF_GREENS), 10), "stripes", 0.015, 0.2)
