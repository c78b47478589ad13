"""Random numbers that are correlated from one image to the next, and for one thing over a whole recording."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np


@dataclass
class _NoiseState:
    constant: float
    lasting: float
    stamp_ns: int


class CorrelatedNoise:
    """Standard normal numbers, one stream for each key: a detector that misses a thing misses it for a while.

    Each number is made of a part that stays the same for its key (`constant` of the variance), one that changes within
    about `lasting_s` (an Ornstein-Uhlenbeck process, `lasting` of the variance) and a fresh one. Whatever the shares,
    every single number is standard normal: error rates stay the same, but errors come in runs.
    """

    def __init__(self, rng: np.random.Generator, *, lasting_s: float, lasting: float, constant: float) -> None:
        self._rng = rng
        self._lasting_s = lasting_s
        self._weights = math.sqrt(constant), math.sqrt(lasting), math.sqrt(1 - constant - lasting)
        self._states: dict[Hashable, _NoiseState] = {}

    def normal(self, key: Hashable, stamp_ns: int) -> float:
        """The number of a key at a time; times of one key ascend."""
        state = self._states.get(key)
        if state is None:
            state = self._states[key] = _NoiseState(float(self._rng.normal()), float(self._rng.normal()), stamp_ns)
        kept = math.exp(-abs(stamp_ns - state.stamp_ns) / 1e9 / self._lasting_s)
        state.lasting = kept * state.lasting + math.sqrt(1 - kept**2) * float(self._rng.normal())
        state.stamp_ns = stamp_ns
        parts = (state.constant, state.lasting, float(self._rng.normal()))
        return sum(weight * part for weight, part in zip(self._weights, parts, strict=True))

    def uniform(self, key: Hashable, stamp_ns: int) -> float:
        """The same as a number that is uniform in (0, 1): below p with probability p."""
        return 0.5 * math.erfc(-self.normal(key, stamp_ns) / math.sqrt(2))
