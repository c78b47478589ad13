"""Which image recorded detections belong to: by their stamp, else by what they say themselves, else the nearest."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.arrays import IntArray
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.detection_clock import DetectionClock, find_detection_clock
from supermap_cli.recordings.detection_readers import own_stamp_ns
from supermap_cli.recordings.messages import peek_stamp_ns
from supermap_cli.recordings.storage import RawMessage
from supermap_cli.recordings.survey import Topic

_LEAST_JOINED = 0.5
"""Share of the arrays that must have an image by their own stamps; with fewer, other ways are tried."""

_LATE_NS = 1_000_000_000
"""ns beyond the images' own span in which arrays count as theirs."""

_TRIED = 200
"""Arrays that are looked at to find out by what they belong to their images."""


@dataclass(frozen=True)
class DetectionStamps:
    """Gives every detection array and mask the stamp of its image.

    `images_ns` are the stamps of all images, ascending; `own` says that the stamp is not the header's but what the
    array says of its image; `shift_ns` is added to it; beyond `tolerance_ns` an array belongs to no image and keeps
    its stamp. `clock` is the detections' own, where they have one; only where it is sure it is in `shift_ns`.
    """

    images_ns: IntArray
    tolerance_ns: int
    own: bool = False
    shift_ns: int = 0
    clock: DetectionClock | None = None

    def of(self, raw: RawMessage, decoder: Decoder) -> int:
        """The stamp of the image that a message belongs to. Raises `MessageError` for one without a whole header."""
        stamp_ns = peek_stamp_ns(raw, decoder)
        if self.own:
            stamp_ns = decoder.read_strictly(raw, _own) or stamp_ns
        stamp_ns += self.shift_ns
        nearest = self._nearest_ns(stamp_ns)
        return nearest if nearest is not None and abs(nearest - stamp_ns) <= self.tolerance_ns else stamp_ns

    def is_joined(self, stamp_ns: int) -> bool:
        """Whether an image has this stamp."""
        return self._nearest_ns(stamp_ns) == stamp_ns

    def apart_ns(self, stamp_ns: int) -> int:
        """How far a stamp is from that of the nearest image, in ns; 0 without images."""
        nearest = self._nearest_ns(stamp_ns)
        return 0 if nearest is None else abs(nearest - stamp_ns)

    def _nearest_ns(self, stamp_ns: int) -> int | None:
        if not len(self.images_ns):
            return None
        after = int(np.searchsorted(self.images_ns, stamp_ns))
        near = self.images_ns[max(after - 1, 0) : after + 1].tolist()
        return int(min(near, key=lambda each: abs(each - stamp_ns)))


def _own(message: Any, _: int) -> int | None:
    return own_stamp_ns(message) if any(hasattr(message, name) for name in _LISTS) else 0


_LISTS = ("detections", "bounding_boxes", "objects")
"""The fields that hold detections; an image of masks has none."""


def find_stamps(
    raws: Iterable[RawMessage], by_header: DetectionStamps, decoder: Decoder, camera: Topic | None = None
) -> DetectionStamps:
    """By what the arrays belong to their images: whichever of header and own stamps joins more of them, the header's
    where both do. With the images' topic `camera`, a clock of the detections' own is looked for.
    """
    tried = [raw for raw, _ in zip(raws, range(_TRIED), strict=False)]
    if not tried:
        return by_header
    by_own, header = replace(by_header, own=True), _joined(tried, by_header, decoder) / len(tried)
    own = _joined(tried, by_own, decoder) / len(tried) if header < _LEAST_JOINED else 0.0
    better = by_own if own > header else by_header
    if camera is None or own >= _LEAST_JOINED:
        return better
    stamped_ns = [(stamp_ns, raw.log_ns) for stamp_ns, raw in decoder.stamped(tried, peek_stamp_ns)]
    clock = find_detection_clock(
        stamped_ns, by_header.images_ns, camera.clock_offset_ns - by_header.shift_ns, header, camera.name
    )
    if clock is None:
        return better
    return replace(by_header, shift_ns=clock.shift_ns if clock.sure else by_header.shift_ns, clock=clock)


def _joined(raws: Iterable[RawMessage], stamps: DetectionStamps, decoder: Decoder) -> int:
    return sum(stamps.is_joined(stamp_ns) for stamp_ns, _ in decoder.stamped(raws, stamps.of))


def unjoined(
    raws: Iterable[RawMessage], stamps: DetectionStamps, decoder: Decoder, where: str
) -> RecordingError | None:
    """The error for arrays that fall between the images and of which none belongs to one; `None` where one does, or
    there is none.
    """
    if not len(stamps.images_ns):
        return None
    if stamps.clock is not None and not stamps.clock.sure:
        topic = where.rpartition(", ")[2]
        return RecordingError(
            f"{stamps.clock.what}: which image each array belongs to cannot be told",
            where=where,
            cure=stamps.clock.cure(topic),
        )
    first_ns, last_ns = int(stamps.images_ns[0]) - _LATE_NS, int(stamps.images_ns[-1]) + _LATE_NS
    apart_ns = [
        stamps.apart_ns(stamp_ns) for stamp_ns, _ in decoder.stamped(raws, stamps.of) if first_ns <= stamp_ns <= last_ns
    ]
    count, least_ns = len(apart_ns), min(apart_ns, default=0)
    if not least_ns:
        return None
    apart_s = least_ns / 1e9
    return RecordingError(
        f"{count} detection arrays, none has the stamp of an image; the nearest is {apart_s:.3f} s off",
        where=where,
        cure=f"say --detection-tolerance {np.ceil(apart_s * 110) / 100:g} to take the nearest image in so many "
        "seconds, or use --detector onnx",
    )
