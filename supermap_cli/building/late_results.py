"""Results that come late, out of order, or never: each keyframe waits for its own, and all are mapped in their order.

A fixed lag: the map is that of a detector that answers at once, whatever the delays, as long as none is longer than the
wait; who reads the map meanwhile sees it as it was one delay ago.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from supermap_cli.config import PerceptionConfig
from supermap_cli.types.detections import Detections
from supermap_cli.types.keyframe import Keyframe

K = TypeVar("K")
R = TypeVar("R")


@dataclass
class _Waiting(Generic[K, R]):
    """A keyframe under way: `open` until its result has come."""

    stamp_ns: int
    keyframe: K
    open: bool
    result: R | None = None


@dataclass
class FixedLag(Generic[K, R]):
    """Keyframes in the order of their stamps, each with its result.

    One whose result is still awaited holds back those after it, for `wait_ns` at most; then it goes without. So no more
    keyframes are held than come in that time.
    """

    wait_ns: int
    _held: deque[_Waiting[K, R]] = field(default_factory=deque)

    def expect(self, stamp_ns: int, keyframe: K, *, awaited: bool) -> None:
        """The next keyframe, and whether a result is to come for it."""
        self._held.append(_Waiting(stamp_ns, keyframe, awaited))

    def arrive(self, stamp_ns: int, result: R) -> bool:
        """The result for the keyframe of this stamp has come. `False`: too late, it has gone without."""
        for each in self._held:
            if each.stamp_ns == stamp_ns and each.open:
                each.result, each.open = result, False
                return True
        return False

    def settled(self, now_ns: int | None) -> Iterator[tuple[K, R | None]]:
        """The keyframes that need wait no longer, each once. `now_ns` is the sensor time that has been reached; `None`:
        nothing comes any more.
        """
        while self._held and not (now_ns is not None and self._waits(self._held[0], now_ns)):
            ready = self._held.popleft()
            yield ready.keyframe, ready.result

    def _waits(self, held: _Waiting[K, R], now_ns: int) -> bool:
        return held.open and now_ns - held.stamp_ns <= self.wait_ns


@dataclass(frozen=True)
class Lateness:
    """When results come that could be had at once: drawn evenly for each image from its stamp, the same each time."""

    delay_s: float
    dropped: float

    def arrival_ns(self, stamp_ns: int) -> int | None:
        """Sensor time at which the result of an image is there; `None`: never."""
        delayed, lost = np.random.default_rng(stamp_ns).random(2)
        return None if lost < self.dropped else stamp_ns + round(delayed * self.delay_s * 1e9)


@dataclass
class LateResults:
    """Plays a detector that takes its time; `lost` counts the results that never came, `too_late` those in vain.

    Keyframes' stamps are the recording's plus `clock_shift_ns`; what is drawn for an image does not depend on that.
    """

    config: PerceptionConfig
    clock_shift_ns: int = 0
    lost: int = 0
    too_late: int = 0

    def settled(
        self, perceived: Iterable[tuple[Keyframe, Detections | None]]
    ) -> Iterator[tuple[Keyframe, Detections | None]]:
        """The same keyframes in the same order, with the detections that have come when their turn comes."""
        lateness = Lateness(self.config.delay_s, self.config.dropped)
        lag: FixedLag[Keyframe, Detections] = FixedLag(round(self.config.wait_s * 1e9))
        coming: list[tuple[int, int, Detections]] = []
        for keyframe, detections in perceived:
            now_ns = keyframe.stamp_ns
            lag.expect(now_ns, keyframe, awaited=detections is not None)
            if detections is not None:
                arrival_ns = lateness.arrival_ns(now_ns - self.clock_shift_ns)
                if arrival_ns is None:
                    self.lost += 1
                else:
                    heapq.heappush(coming, (arrival_ns + self.clock_shift_ns, now_ns, detections))
            yield from self._at(now_ns, lag, coming)
        while coming:
            yield from self._at(coming[0][0], lag, coming)
        yield from lag.settled(None)

    def _at(
        self, now_ns: int, lag: FixedLag[Keyframe, Detections], coming: list[tuple[int, int, Detections]]
    ) -> Iterator[tuple[Keyframe, Detections | None]]:
        """What is settled at a time, by what has come until then."""
        while coming and coming[0][0] <= now_ns:
            _, stamp_ns, detections = heapq.heappop(coming)
            self.too_late += not lag.arrive(stamp_ns, detections)
        yield from lag.settled(now_ns)
