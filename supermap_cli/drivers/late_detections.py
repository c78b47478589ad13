"""Plays a detector that takes its time, by sensor time: the same each time, whatever the machine's load."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.types.detections import Detections


@dataclass(frozen=True)
class DelayModel:
    """When results come that could be had at once: drawn evenly for each image from its stamp, the same each time."""

    delay_s: float
    dropped: float

    def arrival_ns(self, stamp_ns: int) -> int | None:
        """Sensor time at which the result of an image is there; `None`: never."""
        delayed, lost = np.random.default_rng(stamp_ns).random(2)
        return None if lost < self.dropped else stamp_ns + round(delayed * self.delay_s * 1e9)


@dataclass
class LateDetections:
    """Detections on their way; `lost` counts those that never came."""

    lateness: DelayModel
    lost: int = 0
    _coming: list[tuple[int, int, int, Detections]] = field(default_factory=list)
    _sent: int = 0

    def send(self, detections: Detections) -> None:
        """Detections set out when their image was taken."""
        arrival_ns = self.lateness.arrival_ns(detections.stamp_ns)
        self._sent += 1
        if arrival_ns is None:
            self.lost += 1
        else:
            heapq.heappush(self._coming, (arrival_ns, detections.stamp_ns, self._sent, detections))

    def arrived(self, now_ns: int) -> Iterator[Detections]:
        """Those that have come by a sensor time, in the order of their arrival."""
        while self._coming and self._coming[0][0] <= now_ns:
            yield heapq.heappop(self._coming)[-1]

    @property
    def next_arrival_ns(self) -> int | None:
        """When the next of them comes; `None` where none is on its way."""
        return self._coming[0][0] if self._coming else None
