"""Perception runs one keyframe ahead of mapping, in a thread of its own: two cores are kept busy by one build."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from types import TracebackType
from typing import Generic, Self, TypeVar

T = TypeVar("T")

_PATIENCE_S = 0.1


class LookAhead(Generic[T]):
    """The same items in the same order, made in a thread that is at most one ahead of their use.

    An error raised while making an item is raised where that item would have come. On leaving, the thread has ended.
    """

    def __init__(self, items: Iterator[T]) -> None:
        self._items = items
        self._ready: queue.Queue[tuple[T] | BaseException | None] = queue.Queue(maxsize=1)
        self._unwanted = threading.Event()
        self._thread = threading.Thread(target=self._make, name="perception", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._unwanted.set()
        self._thread.join()

    def __iter__(self) -> Iterator[T]:
        while True:
            made = self._ready.get()
            if made is None:
                return
            if isinstance(made, BaseException):
                raise made
            yield made[0]

    def _make(self) -> None:
        try:
            for item in self._items:
                self._hand_over((item,))
                if self._unwanted.is_set():
                    return
        except BaseException as error:  # it is raised again in the thread that asks for the item
            self._hand_over(error)
        else:
            self._hand_over(None)

    def _hand_over(self, made: tuple[T] | BaseException | None) -> None:
        while not self._unwanted.is_set():
            try:
                self._ready.put(made, timeout=_PATIENCE_S)
            except queue.Full:
                continue
            return
