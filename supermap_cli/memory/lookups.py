"""Values of instances by their numbers, read when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from typing import Generic, TypeVar

from supermap_cli.memory.numbers import batches

V = TypeVar("V")


class LazyLookup(dict[int, V], Generic[V]):
    """A value of instances by their numbers, read on first use and cached."""

    def __init__(self, read: Callable[[Collection[int]], dict[int, V]]) -> None:
        super().__init__()
        self._read = read

    def __missing__(self, number: int) -> V:
        self.update(self._read([number]))
        return self[number]

    def of(self, numbers: Iterable[int]) -> dict[int, V]:
        """The values of many numbers, read together."""
        wanted = set(numbers)
        for batch in batches(sorted(wanted - self.keys())):
            self.update(self._read(batch))
        return {number: self[number] for number in wanted if number in self}
