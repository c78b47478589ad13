"""Lists of row numbers, split so that one SQL statement can take them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

BATCH = 500
"""Numbers in one statement; SQLite takes 32,766 parameters (before 3.32: 999)."""


def batches(numbers: Sequence[int], size: int = BATCH) -> Iterator[Sequence[int]]:
    """The numbers, at most `size` at a time."""
    for start in range(0, len(numbers), size):
        yield numbers[start : start + size]
