"""Numbers of rows, in parts that one statement can hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

BATCH = 500


def batches(numbers: Sequence[int], size: int = BATCH) -> Iterator[Sequence[int]]:
    """The numbers, at most `size` at a time."""
    for start in range(0, len(numbers), size):
        yield numbers[start : start + size]
