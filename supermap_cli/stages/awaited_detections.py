"""Located frames and their detections, in whatever order these come: before their frame, with it, late, or never."""

from __future__ import annotations

from collections.abc import Iterator

from supermap_cli.stages.fixed_lag import FixedLag
from supermap_cli.stages.localization import LocatedFrame
from supermap_cli.types.detections import Detections

MAX_EARLY = 1000
"""Detections that are kept for images which are yet to come, or to be placed: some kB each with their masks."""

MAX_ANNOUNCED = 10_000
"""Images that are remembered while their detections have not come, to tell late ones from those of no image."""


class AwaitedDetections:
    """Frames in the order of their stamps, each with its detections; stamps are the map's.

    Detections that come before their frame has a place are kept for it. `too_late` counts those that came after the
    wait; `unmatched` those for which no image waited: none of their stamp and camera was pushed, or it awaits none, or
    has its own already; `crowded_out` those that were too many to keep. All of it follows from what was pushed before
    them, not from what was mapped meanwhile.
    """

    def __init__(self, wait_s: float) -> None:
        self.too_late = 0
        self.unmatched = 0
        self.crowded_out = 0
        self._wait_s = wait_s
        self._wait_ns = round(wait_s * 1e9)
        self._lag: FixedLag[LocatedFrame, Detections] = FixedLag(self._wait_ns)
        self._early: dict[tuple[int, str], Detections] = {}
        self._announced: dict[tuple[int, str], None] = {}
        self._first_ns: int | None = None
        self._forgotten_ns: int | None = None
        self._now_ns: int | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was left out, one line for each cause."""
        causes = {
            f"images had detections that came over {self._wait_s:g} s late (build.perception.wait_s)": self.too_late,
            "detections belong to no image that waited for them: push them with its stamp and camera": self.unmatched,
            "images had detections that were too many to keep until the images have a place": self.crowded_out,
        }
        return tuple(f"{count} {what}" for what, count in causes.items() if count)

    def announce(self, stamp_ns: int, camera_id: str, *, awaits: bool) -> None:
        """An image was pushed, which may await detections; it has no place yet, and may never have one."""
        self.advance(stamp_ns)
        if not awaits:
            return
        self._first_ns = stamp_ns if self._first_ns is None else self._first_ns
        self._announced[stamp_ns, camera_id] = None
        if len(self._announced) > MAX_ANNOUNCED:
            oldest = next(iter(self._announced))
            del self._announced[oldest]
            self._forgotten_ns = oldest[0]

    def expect(self, located: LocatedFrame) -> None:
        """The next frame that has a place."""
        key = stamp_ns, camera_id = located.keyframe.stamp_ns, located.keyframe.camera_id
        self.announce(stamp_ns, camera_id, awaits=located.awaits_detections)
        self._lag.expect(stamp_ns, located, awaited=located.awaits_detections, camera_id=camera_id)
        early = self._early.pop(key, None)
        if early is not None and not self._arrive(key, early):
            self.unmatched += 1
        for earlier in [earlier for earlier in self._early if earlier[0] < stamp_ns]:
            self._drop(earlier)

    def add(self, stamp_ns: int, detections: Detections) -> None:
        """Detections for the frame of that stamp, of their camera."""
        key = stamp_ns, detections.camera_id
        if self._now_ns is not None and self._now_ns - stamp_ns > self._wait_ns:
            late = self._was_announced(key)
            self._announced.pop(key, None)
            self.too_late += late
            self.unmatched += not late
        elif key in self._early:
            self.unmatched += 1
        elif not self._arrive(key, detections):
            self._early[key] = detections
            if len(self._early) > MAX_EARLY:
                del self._early[next(iter(self._early))]
                self.crowded_out += 1

    def advance(self, stamp_ns: int) -> None:
        """The time of what was pushed has gone on to a stamp."""
        self._now_ns = max(self._now_ns or 0, stamp_ns)

    def settled(self, *, closing: bool = False) -> Iterator[tuple[LocatedFrame, Detections | None]]:
        """The frames that need wait no longer; all of them when closing."""
        return self._lag.settled(None if closing else self._now_ns)

    def finish(self) -> None:
        """No frame comes any more: what was kept for one came in vain."""
        for key in list(self._early):
            self._drop(key)

    def _arrive(self, key: tuple[int, str], detections: Detections) -> bool:
        arrived = self._lag.arrive(key[0], detections, key[1])
        if arrived:
            self._announced.pop(key, None)
        return arrived

    def _was_announced(self, key: tuple[int, str]) -> bool:
        """Of an image that is forgotten it is taken for granted."""
        if self._first_ns is not None and self._forgotten_ns is not None:
            return key in self._announced or self._first_ns <= key[0] <= self._forgotten_ns
        return key in self._announced

    def _drop(self, key: tuple[int, str]) -> None:
        """Detections whose image has no place: where it was pushed, it is counted as left out itself."""
        del self._early[key]
        if key not in self._announced:
            self.unmatched += 1
