"""Stamps that cannot be true: single ones far off all others, and clocks that were set back while recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, IntArray

REORDER_NS = 500_000_000
"""Messages may come so late that others with later stamps were recorded before them."""

STRAY_NS = 60 * 10**9
"""A stamp so far from where the others lie, against the time of recording, is not the sensor's time."""

_FEW = 3
_FEW_SHARE = 0.01


@dataclass(frozen=True)
class StepBack:
    """At which message a clock was set back, and by how much."""

    index: int
    by_ns: int


def strays(stamps_ns: IntArray, log_ns: IntArray) -> BoolArray:
    """(n,) which of the stamps of a stream, in the order of recording, are far off all others: a few at most.

    What is judged is the stamp against the time of recording, by which clocks may differ, and slowly drift apart.
    """
    off_ns = stamps_ns - log_ns
    order = np.argsort(off_ns, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(off_ns[order]) > STRAY_NS) + 1)
    few = max(_FEW, round(_FEW_SHARE * len(stamps_ns)))
    found = np.zeros(len(stamps_ns), bool)
    for group in groups:
        found[group] = len(group) <= few and len(group) * 2 < len(stamps_ns)
    return found


def step_back(stamps_ns: IntArray) -> StepBack | None:
    """Where stamps, in the order of recording, first go back by more than messages are late; `None` if nowhere."""
    if len(stamps_ns) < 2:
        return None
    back_ns = np.maximum.accumulate(stamps_ns)[:-1] - stamps_ns[1:]
    late = np.flatnonzero(back_ns > REORDER_NS)
    return StepBack(int(late[0]) + 1, int(back_ns[late[0]])) if len(late) else None
