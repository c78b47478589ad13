"""Which images of a recording are mapped, and of which the detector is asked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.config import BuildConfig
from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.protocols import Detector, Recording
from supermap_cli.stages.checked_answers import checked_stamps

_SLACK_NS = 1e6


@dataclass(frozen=True)
class KeyframeChoice:
    """Stamps (ns) of the images to map, and of those among them to perceive; of the others only the depth speaks."""

    mapped: frozenset[int]
    perceived: frozenset[int]

    def after(self, stamp_ns: int) -> KeyframeChoice:
        """Those later than a stamp."""
        mapped, perceived = (
            frozenset(stamp for stamp in which if stamp > stamp_ns) for which in (self.mapped, self.perceived)
        )
        return KeyframeChoice(mapped, perceived)


def choose_keyframes(
    frame_stamps_ns: IntArray, detected_stamps_ns: IntArray | None, rate_hz: float, perception_rate_hz: float | None
) -> KeyframeChoice:
    """Evenly `rate_hz` images a second to map, of which `perception_rate_hz` (all, if `None`) are perceived.

    The perceived ones are taken among the images that the detector can speak of; where these are farther apart than
    keyframes should be, images between them are mapped by their depth alone. Nothing perceived is nothing to map.
    """
    able = frame_stamps_ns
    if detected_stamps_ns is not None:
        able = np.intersect1d(frame_stamps_ns, detected_stamps_ns)
    perceived = evenly(able, min(rate_hz, perception_rate_hz or rate_hz))
    chosen = frozenset(perceived)
    if not perceived or len(perceived) >= len(evenly(frame_stamps_ns, rate_hz)):
        return KeyframeChoice(chosen, chosen)
    return KeyframeChoice(chosen | fill_gaps(frame_stamps_ns, np.array(perceived), 1e9 / rate_hz), chosen)


def choose_frames(recording: Recording, detector: Detector, config: BuildConfig) -> dict[str, KeyframeChoice]:
    """The images of each camera to map and to perceive: evenly the same number of each, together no more a second than
    `keyframes.total_rate_hz`.
    """
    rate_hz = config.keyframes.rate_hz
    if len(recording.cameras) > 1:
        rate_hz = min(rate_hz, config.keyframes.total_rate_hz / len(recording.cameras))
    return {
        camera_id: choose_keyframes(
            recording.frame_stamps_ns(camera_id),
            checked_stamps(detector.image_stamps_ns(camera_id), detector),
            rate_hz,
            config.perception.rate_hz,
        )
        for camera_id in recording.cameras
    }


def evenly(stamps_ns: IntArray, rate_hz: float) -> list[int]:
    """Evenly `rate_hz` of ascending stamps."""
    period_ns = 1e9 / rate_hz
    selected: list[int] = []
    due_ns = -np.inf
    for stamp_ns in stamps_ns.tolist():
        if stamp_ns >= due_ns - _SLACK_NS:
            selected.append(stamp_ns)
            on_time = due_ns > stamp_ns - period_ns
            due_ns = (due_ns if on_time else stamp_ns) + period_ns
    return selected


def fill_gaps(stamps_ns: IntArray, chosen_ns: IntArray, period_ns: float) -> frozenset[int]:
    """The stamps that come nearest to an even spacing of about `period_ns` before, between and after the chosen ones.

    Both are ascending, and not empty. Between two chosen ones a gap counts from one and a half periods on.
    """
    first_ns, last_ns = chosen_ns[0], chosen_ns[-1]
    before = first_ns - period_ns * _steps_near((first_ns - stamps_ns) / period_ns)
    after = last_ns + period_ns * _steps_near((stamps_ns - last_ns) / period_ns)
    wanted = [before[before >= stamps_ns[0] - _SLACK_NS], after[after <= stamps_ns[-1] + _SLACK_NS]]
    edges = np.searchsorted(stamps_ns, chosen_ns)
    for start_ns, gap_ns, begin, end in zip(chosen_ns[:-1], np.diff(chosen_ns), edges[:-1], edges[1:], strict=True):
        steps = max(round(gap_ns / period_ns), 1)
        near = _steps_near((stamps_ns[begin:end] - start_ns) * (steps / gap_ns))
        wanted.append(start_ns + gap_ns * near[near < steps] / steps)
    wanted_ns = np.concatenate(wanted)
    right = np.searchsorted(stamps_ns, wanted_ns).clip(1, max(len(stamps_ns) - 1, 1))
    pairs = stamps_ns[np.stack([right - 1, right % len(stamps_ns)])]
    nearest = np.where(wanted_ns - pairs[0] <= pairs[1] - wanted_ns, pairs[0], pairs[1])
    return frozenset(nearest[np.abs(nearest - wanted_ns) < period_ns / 2].tolist())


def _steps_near(places: FloatArray) -> IntArray:
    """The whole numbers from 1 on next to some places: a gap of years has as few as there are stamps in it."""
    nearest = np.rint(places).astype(np.int64)
    steps = np.unique(nearest[:, None] + np.array([-1, 0, 1]))
    return steps[steps >= 1]
