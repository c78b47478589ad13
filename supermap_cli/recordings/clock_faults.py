"""Stamps that cannot be true: outliers far off all others, and clocks that were set while recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, IntArray

REORDER_NS = 500_000_000
"""ns by which messages may come late, after others with later stamps; beyond it the clock was set back. Set by
hand: several times what buffering in drivers and recorders takes.
"""

OUTLIER_NS = 60 * 10**9
"""ns; a stamp so far from the others, as compared with the time of recording, is not the sensor's time."""

LONGEST_PAUSE_NS = 24 * 3600 * 10**9
"""ns, a day; no recording pauses for so long: between two images the clock was set, as by NTP on a robot without a
battery-backed clock.
"""

_STEP_NS, _STEP_PERIODS = 1_000_000_000, 10
"""The least step forward of a clock that is reported: ns, and periods of the stream, whichever is more. Smaller ones
cannot be told from a pause.
"""

_STEP_NEIGHBOURS = 20
"""Messages before and after a step whose median offset to the log time shows that it lasts."""

_MOST_OUTLIERS, _MOST_OUTLIERS_SHARE = 3, 0.01
"""So many of a stream's stamps, or this share of them, are outliers at most; more are a clock that was set."""


@dataclass(frozen=True)
class StepBack:
    """At which message a clock was set back, and by how much."""

    index: int
    by_ns: int


@dataclass(frozen=True)
class StepForward:
    """At which message a clock was set forward, and by how much: `by_ns` more than a pause between two messages.

    `too_far` says that it can be no time in which the robot ran; `log_too` that the clock of the recording, by which
    the stretches before and after can be told apart, was set with it.
    """

    index: int
    by_ns: int
    too_far: bool = False
    log_too: bool = False


def outliers(stamps_ns: IntArray, log_ns: IntArray) -> BoolArray:
    """(n,) which of the stamps of a stream, in the order of recording, are far off all others: a few at most.

    What is judged is the stamp against the time of recording, by which clocks may differ, and slowly drift apart.
    """
    off_ns = stamps_ns - log_ns
    order = np.argsort(off_ns, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(off_ns[order]) > OUTLIER_NS) + 1)
    most = max(_MOST_OUTLIERS, round(_MOST_OUTLIERS_SHARE * len(stamps_ns)))
    found = np.zeros(len(stamps_ns), bool)
    for group in groups:
        found[group] = len(group) <= most and len(group) * 2 < len(stamps_ns)
    return found


def step_back(stamps_ns: IntArray) -> StepBack | None:
    """Where stamps, in the order of recording, first go back by more than messages are late; `None` if nowhere."""
    if len(stamps_ns) < 2:
        return None
    back_ns = np.maximum.accumulate(stamps_ns)[:-1] - stamps_ns[1:]
    late = np.flatnonzero(back_ns > REORDER_NS)
    return StepBack(int(late[0]) + 1, int(back_ns[late[0]])) if len(late) else None


def step_forward(stamps_ns: IntArray, log_ns: IntArray) -> StepForward | None:
    """Where stamps, in the order of recording, first go forward as no sensor does; `None` if nowhere.

    A pause of the recording is none; one of more than a day, by either clock, cannot be. Else the stamps must go ahead
    of the time of recording, and stay ahead: a message that was merely written late does not count.
    """
    if len(stamps_ns) < 2:
        return None
    gaps_ns, log_gaps_ns = np.diff(stamps_ns), np.diff(log_ns)
    away = np.flatnonzero(np.maximum(gaps_ns, log_gaps_ns) > LONGEST_PAUSE_NS)
    if len(away):
        at = int(away[0])
        both = abs(int(gaps_ns[at] - log_gaps_ns[at])) < OUTLIER_NS
        return StepForward(at + 1, int(max(gaps_ns[at], log_gaps_ns[at])), too_far=True, log_too=both)
    least_ns = max(_STEP_NS, _STEP_PERIODS * float(np.median(gaps_ns)))
    off_ns = stamps_ns - log_ns
    for at in np.flatnonzero(gaps_ns - log_gaps_ns > least_ns).tolist():
        before, after = off_ns[max(at + 1 - _STEP_NEIGHBOURS, 0) : at + 1], off_ns[at + 1 : at + 1 + _STEP_NEIGHBOURS]
        by_ns = int(np.median(after) - np.median(before))
        if by_ns > least_ns:
            return StepForward(at + 1, by_ns)
    return None
