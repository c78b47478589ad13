"""Where the names of things go on a picture: beside one another, near their things, none over another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray

_RINGS, _DIRECTIONS = 10, 16
"""Places that are tried: in so many directions on so many rings around a thing (chosen)."""
_GAP = 1.5
"""Points between two names (chosen)."""


@dataclass(frozen=True)
class Name:
    """A name to place: the middle (2,) of its thing, half the size (2,) of the thing and of the text, all in points."""

    middle: FloatArray
    thing_half: FloatArray
    text_half: FloatArray


def place_names(names: Sequence[Name], size: FloatArray) -> list[FloatArray | None]:
    """The middle (2,) of each name on a picture of a size (2,) in points, in the order given; `None` where there is no
    room. What comes first has the choice.
    """
    placed = np.zeros((0, 4))
    things = np.array([[*(name.middle - name.thing_half), *(name.middle + name.thing_half)] for name in names])
    places: list[FloatArray | None] = []
    for index, name in enumerate(names):
        others = np.delete(things, index, axis=0)
        best, best_cost = None, math.inf
        for rank, candidate in enumerate(_candidates(name)):
            box = np.array([*(candidate - name.text_half - _GAP), *(candidate + name.text_half + _GAP)])
            if (box[:2] < 0).any() or (box[2:] > size).any() or _overlap(box, placed).any():
                continue
            covered = float(_overlap(box, others).sum()) / max(float(np.prod(box[2:] - box[:2])), 1e-9)
            cost = rank / _DIRECTIONS + 3 * covered
            if cost < best_cost:
                best, best_cost = candidate, cost
            if rank / _DIRECTIONS > best_cost:
                break
        places.append(best)
        if best is not None:
            placed = np.vstack([placed, [*(best - name.text_half), *(best + name.text_half)]])
    return places


def _candidates(name: Name) -> list[FloatArray]:
    """On the thing, then around it, farther and farther off; above and below before left and right."""
    found = [name.middle]
    base = np.minimum(name.thing_half, 3 * name.text_half) + name.text_half
    for ring in range(_RINGS):
        reach = base + (1 + 1.3 * ring) * name.text_half[1]
        for step in range(_DIRECTIONS):
            angle = math.pi / 2 + (step + 1) // 2 * (-1) ** step * 2 * math.pi / _DIRECTIONS
            found.append(name.middle + reach * np.array([math.cos(angle), math.sin(angle)]))
    return found


def _overlap(box: FloatArray, boxes: FloatArray) -> FloatArray:
    """The area (n,) that a box (4,) shares with each of (n, 4) others."""
    low, high = np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])
    area: FloatArray = np.prod(np.clip(high - low, 0, None), axis=1)
    return area
