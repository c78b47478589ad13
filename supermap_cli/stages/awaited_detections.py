"""Located frames and their detections, in whatever order these come: before their frame, with it, late, or never."""

from __future__ import annotations

from collections.abc import Iterator

from supermap_cli.stages.fixed_lag import FixedLag
from supermap_cli.stages.localization import LocatedFrame
from supermap_cli.types.detections import Detections

MAX_EARLY = 1000
"""Detections that are kept for images which are yet to come, or to be placed: some kB each with their masks."""


class AwaitedDetections:
    """Frames in the order of their stamps, each with its detections; stamps are the map's.

    Detections that come before their frame has a place are kept for it. `too_late` counts those that came in vain.
    """

    def __init__(self, wait_s: float) -> None:
        self.too_late = 0
        self._wait_ns = round(wait_s * 1e9)
        self._lag: FixedLag[LocatedFrame, Detections] = FixedLag(self._wait_ns)
        self._early: dict[tuple[int, str], Detections] = {}
        self._now_ns: int | None = None

    def expect(self, located: LocatedFrame) -> None:
        """The next frame."""
        keyframe = located.keyframe
        stamp_ns, camera_id = keyframe.stamp_ns, keyframe.camera_id
        self._lag.expect(stamp_ns, located, awaited=located.awaits_detections, camera_id=camera_id)
        early = self._early.pop((stamp_ns, camera_id), None)
        if early is not None:
            self._lag.arrive(stamp_ns, early, camera_id)
        for key in [key for key in self._early if key[0] < stamp_ns]:
            self._drop(key)

    def add(self, stamp_ns: int, detections: Detections) -> None:
        """Detections for the frame of that stamp, of their camera. Whether they are too late follows from what was
        pushed before them, not from what was mapped meanwhile.
        """
        if self._now_ns is not None and self._now_ns - stamp_ns > self._wait_ns:
            self.too_late += 1
            return
        if self._lag.arrive(stamp_ns, detections, detections.camera_id):
            return
        self._early[stamp_ns, detections.camera_id] = detections
        if len(self._early) > MAX_EARLY:
            self._drop(next(iter(self._early)))

    def advance(self, stamp_ns: int) -> None:
        """The time of what was pushed has gone on to a stamp."""
        self._now_ns = max(self._now_ns or 0, stamp_ns)

    def settled(self, *, closing: bool = False) -> Iterator[tuple[LocatedFrame, Detections | None]]:
        """The frames that need wait no longer; all of them when closing."""
        return self._lag.settled(None if closing else self._now_ns)

    def _drop(self, key: tuple[int, str]) -> None:
        del self._early[key]
        self.too_late += 1
