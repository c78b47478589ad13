"""How long every stage takes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class StageTiming:
    """One stage over a whole build: seconds in all, times run, milliseconds a run (mean and 95th percentile)."""

    stage: str
    total_s: float
    runs: int
    mean_ms: float
    p95_ms: float


@dataclass
class StageClock:
    """Measures stages by name, in the order in which they first ran."""

    durations_s: dict[str, list[float]] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure one run of a stage."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.durations_s.setdefault(name, []).append(time.perf_counter() - start)

    def timings(self) -> tuple[StageTiming, ...]:
        """What was measured."""
        rows = []
        for stage, durations in list(self.durations_s.items()):  # another thread may add stages
            ms = np.array(durations) * 1000
            rows.append(
                StageTiming(stage, float(ms.sum() / 1000), len(ms), float(ms.mean()), float(np.percentile(ms, 95)))
            )
        return tuple(rows)
