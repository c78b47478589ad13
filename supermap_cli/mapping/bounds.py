"""Where all objects are, in packed arrays: what is near a place is found without a look at every object.

`GetNeighborObjects` of the paper's algorithm 1, step (1).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray

_NOWHERE = 1e9
"""Bounds, in metres, of a row that is not in use: a million kilometres away."""

_FIRST_CAPACITY = 64
"""Rows for which there is room at first; a full array doubles."""


@dataclass
class BoundsIndex:
    """The axis-aligned bounds of numbered things, a row for each in the order in which they were added.

    `changed` holds the numbers whose row is out of date; `refresh` brings only those up to date. A row that was removed
    lies a million kilometres away, and the rows are closed up when half of them do.
    """

    numbers: list[int] = field(default_factory=list)
    row_of: dict[int, int] = field(default_factory=dict)
    changed: set[int] = field(default_factory=set)
    _low: FloatArray = field(default_factory=lambda: np.full((_FIRST_CAPACITY, 3), _NOWHERE))
    _high: FloatArray = field(default_factory=lambda: np.full((_FIRST_CAPACITY, 3), _NOWHERE))

    @property
    def low(self) -> FloatArray:
        """(n, 3) lower bounds by row."""
        return self._low[: len(self.numbers)]

    @property
    def high(self) -> FloatArray:
        """(n, 3) upper bounds by row."""
        return self._high[: len(self.numbers)]

    def add(self, number: int) -> None:
        """A new thing, whose bounds are asked for at the next refresh."""
        row = len(self.numbers)
        if row == len(self._low):
            self._low = np.concatenate([self._low, np.full_like(self._low, _NOWHERE)])
            self._high = np.concatenate([self._high, np.full_like(self._high, _NOWHERE)])
        self.row_of[number] = row
        self.numbers.append(number)
        self.changed.add(number)

    def remove(self, number: int) -> None:
        """A thing that is no more."""
        row = self.row_of.pop(number)
        self.changed.discard(number)
        self._low[row] = self._high[row] = _NOWHERE
        if 2 * len(self.row_of) < len(self.numbers) - _FIRST_CAPACITY:
            self._close_up()

    def _close_up(self) -> None:
        kept = list(self.row_of.values())
        self._low[: len(kept)], self._high[: len(kept)] = self._low[kept], self._high[kept]
        self._low[len(kept) :] = self._high[len(kept) :] = _NOWHERE
        self.numbers = list(self.row_of)
        self.row_of = {number: row for row, number in enumerate(self.numbers)}

    def refresh(self, bounds_of: Callable[[int], tuple[FloatArray, FloatArray]]) -> None:
        """Ask for the bounds of what has changed."""
        for number in self.changed:
            row = self.row_of[number]
            self._low[row], self._high[row] = bounds_of(number)
        self.changed.clear()

    def within(self, center: FloatArray, radius_m: float) -> list[int]:
        """The numbers of what comes within a distance of a point (3,), in the order of the rows."""
        gap = np.maximum(np.maximum(self.low - center, center - self.high), 0)
        return self._numbers(np.flatnonzero(np.linalg.norm(gap, axis=1) <= radius_m))

    def beside(self, numbers: Iterable[int], gap_m: float) -> list[tuple[int, int]]:
        """Pairs, in the order of the rows, of which one is among `numbers` and whose bounds lie closer than `gap_m`
        along every axis.
        """
        pairs = set()
        for number in numbers:
            row = self.row_of.get(number)
            if row is None:
                continue
            gap = np.maximum(self.low - self._high[row], self._low[row] - self.high)
            pairs |= {(min(row, other), max(row, other)) for other in np.flatnonzero(gap.max(axis=1) < gap_m).tolist()}
        return [(self.numbers[first], self.numbers[second]) for first, second in sorted(pairs) if first != second]

    def _numbers(self, rows: IntArray) -> list[int]:
        return [self.numbers[row] for row in rows.tolist()]
