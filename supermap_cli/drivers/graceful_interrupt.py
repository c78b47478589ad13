"""Ctrl-C, or a polite `kill`, lets a build finish the batch that it is at."""

from __future__ import annotations

import os
import signal
import threading
from types import FrameType, TracebackType
from typing import Any, Self

_STOPS = (signal.SIGINT, signal.SIGTERM)


class GracefulInterrupt:
    """While it is entered, the first SIGINT or SIGTERM only sets `requested`; a second one is a `KeyboardInterrupt`.

    Outside the main thread, which alone gets signals, it changes nothing.
    """

    def __init__(self) -> None:
        self.requested = False
        self._former: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._former = {stop: signal.signal(stop, self._ask) for stop in _STOPS}
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for each, former in self._former.items():
            signal.signal(each, former)
        self._former = {}

    def _ask(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002 - what a signal's receiver is given
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
        os.write(2, b"\nstopping after this batch of keyframes (once more: at once)\n")
