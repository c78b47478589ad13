"""What things are covered with where depth cameras see little of it: black surfaces and glossy panes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from supermap_cli.simulation.world import Material, Shape

BLACK_RETURN, GLOSSY_RETURN = 0.1, 0.5
"""Shares of the pixels of black and of glossy surfaces that get a depth, as of black leather and of screens."""
_BLACK = (24.0, 24.0, 27.0)  # 0..255
_GLOSSY_LABELS = frozenset({"monitor", "tv", "laptop", "cell phone", "painting", "whiteboard"})


class Finish:
    """Gives shapes their materials, in the order in which they are made: every second one is black for its greatest
    part, or all that show something (screens, pictures, boards) are glossy there.
    """

    def __init__(self, kind: Literal["dark", "glossy"]) -> None:
        self._kind = kind
        self._made = 0

    def __call__(self, label: str, shape: Shape) -> Shape:
        """A shape of a label with its materials."""
        self._made += 1
        if self._kind == "glossy":
            return _changed(shape, lambda _, material: label in _GLOSSY_LABELS and material.pattern == "print", glossy)
        greatest = int(np.argmax(_areas_m2(shape)))
        return _changed(shape, lambda k, _: k == greatest, blackened) if self._made % 2 else shape


def blackened(material: Material) -> Material:
    """Black, with hardly any depth."""
    return replace(material, rgb=_BLACK, depth_return=BLACK_RETURN)


def glossy(material: Material) -> Material:
    """The same to look at, with half of the depth."""
    return replace(material, depth_return=GLOSSY_RETURN)


def _changed(shape: Shape, which: Callable[[int, Material], bool], change: Callable[[Material], Material]) -> Shape:
    materials = tuple(
        change(material) if which(k, material) else material for k, material in enumerate(shape.materials)
    )
    return Shape(shape.vertices, shape.triangles, shape.material, materials)


def _areas_m2(shape: Shape) -> np.ndarray:
    """Of each material (m,)."""
    a, b, c = (shape.vertices[shape.triangles[:, k]] for k in range(3))
    return np.bincount(shape.material, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, len(shape.materials))
