"""The clock of recorded detections, where it is not the camera's: found by times of recording and images' stamps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import IntArray
from supermap_cli.recordings.sensor_clocks import apart_text, known_scale_ns

_AHEAD_NS = 500_000_000
"""ns by which detections may be stamped later than images recorded with them; none is found before its image is."""

_SLOW_NS, _NEVER_SO_SLOW_NS = 1_000_000_000, 10_000_000_000
"""ns that a slow detector is late; from the second on it is another clock."""

_LEAST_JOINED, _HARDLY_JOINED = 0.5, 0.1
"""Shares of the arrays that have an image: with fewer than the first something is wrong, unless images were left out of
the recording; with fewer than the second a slow detector does not explain it.
"""

_SEARCHED_NS, _BIN_NS = 3_000_000_000, 1_000_000
"""ns around what times of recording say in which the clock's offset is looked for, and the width of what counts as one.
"""

_CLEAR = 1.5
"""Times as many arrays that must have an image at the best offset as at any other, for it to be sure. Chosen."""


@dataclass(frozen=True)
class DetectionClock:
    """`shift_ns` is added to the stamps of detections to be the camera's; `sure` that no other offset is as likely;
    `what` says how far the clock is off.
    """

    shift_ns: int
    sure: bool
    what: str

    def note(self, topic: str) -> str:
        """What is done, for a clock that is sure."""
        seconds = f"{self.shift_ns / 1e9:+.3f} s"
        return f"{self.what}; {seconds} are added to its stamps (--clock {topic}=SECONDS adds others, 0 none)"

    def cure(self, topic: str) -> str:
        """The option that mends it."""
        return f"say --clock {topic}={self.shift_ns / 1e9:.3f}, or --clock {topic}=0 if its stamps are right"


def find_detection_clock(
    stamped_ns: Sequence[tuple[int, int]], images_ns: IntArray, camera_offset_ns: int, joined: float, camera: str
) -> DetectionClock | None:
    """The clock of detections, (stamp, time of recording) each; `None` where it is the camera's.

    `camera_offset_ns` is the stamp minus the time of recording of the images of topic `camera`, `joined` the share of
    arrays that have the stamp of an image. Times of recording that do not go on with the stamps (all zero, say) tell
    nothing.
    """
    if not stamped_ns or not len(images_ns):
        return None
    stamps_ns = np.array([stamp_ns for stamp_ns, _ in stamped_ns if stamp_ns], np.int64)
    offsets_ns = np.array([stamp_ns - log_ns for stamp_ns, log_ns in stamped_ns], np.int64)
    apart_ns = int(np.median(offsets_ns)) - camera_offset_ns
    spread_ns = _quartiles_apart_ns(offsets_ns)
    stands_still = 2 * spread_ns > _quartiles_apart_ns(stamps_ns) if len(stamps_ns) else False
    ahead = apart_ns > _AHEAD_NS
    behind = -apart_ns > _NEVER_SO_SLOW_NS and joined < _LEAST_JOINED
    behind |= -apart_ns > _SLOW_NS and joined < _HARDLY_JOINED
    if not (ahead or behind) or spread_ns > _SLOW_NS or stands_still:
        return None
    what = f"its clock is {apart_text(apart_ns, camera)}, by times of recording"
    if (known_ns := known_scale_ns(apart_ns)) is not None:
        return DetectionClock(-known_ns, sure=True, what=what)
    shift_ns, clear = _best_shift(stamps_ns, images_ns, -apart_ns)
    return DetectionClock(shift_ns, sure=clear, what=what)


def _quartiles_apart_ns(times_ns: IntArray) -> int:
    return int(np.subtract(*np.percentile(times_ns, (75, 25))))


def _best_shift(stamps_ns: IntArray, images_ns: IntArray, about_ns: int) -> tuple[int, bool]:
    """The shift at which most arrays have an image, of equally many that which needs the least delay of the detector;
    and whether it is clear. `about_ns` is what times of recording say, the delay included.
    """
    moved_ns = stamps_ns + about_ns
    apart_ns = (images_ns[None, :] - moved_ns[:, None]).ravel()
    apart_ns = apart_ns[np.abs(apart_ns) <= _SEARCHED_NS]
    bins = np.round(apart_ns / _BIN_NS).astype(np.int64)
    values, counts = np.unique(bins, return_counts=True)
    if not len(values):
        return about_ns, False
    votes = np.array([counts[np.abs(values - value) <= 1].sum() for value in values])
    likely = values[votes * _CLEAR > votes.max()]
    delayed = likely[likely <= 1]
    best = int(delayed.max() if len(delayed) else likely.min())
    others = votes[np.abs(values - best) > 2]
    enough = 2 * votes[values == best][0] >= len(stamps_ns)
    clear = bool(enough and (not len(others) or votes[values == best][0] >= _CLEAR * others.max()))
    exact = int(np.median(apart_ns[np.abs(bins - best) <= 1]))
    return about_ns + exact, clear
