"""The part of a recording that is read, in sensor time, and how sensor time relates to the time of recording."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.errors import ConfigError, RecordingError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import Storage
from supermap_cli.recordings.survey import Topic, usual_offset_ns
from supermap_cli.types.limits import LATEST_S

MARGIN_NS = 2_000_000_000
"""ns by which poses, sweeps and IMU reach beyond the window, so that images at its ends have them on both sides."""

_SKEWED_CLOCK_NS = 1_000_000_000
"""ns between sensor time and log time from which they are two clocks, and not a message under way."""


@dataclass(frozen=True)
class Window:
    """The part of the recording to read, in sensor time [start_ns, end_ns]; sides the user did not set, or set to no
    effect, are `open`: every image counts there, though its stamp lies before or beyond the time of recording.

    `offset_ns` is sensor time minus log time where the two clocks differ by a second or more, else 0.
    """

    start_ns: int
    end_ns: int
    start_open: bool
    end_open: bool
    offset_ns: int

    def log_range(self, margin_ns: int) -> tuple[int | None, int | None]:
        """[start, end) in log time, widened by a margin on both sides; `None` on an open side."""
        start_ns = None if self.start_open else self.start_ns - self.offset_ns - margin_ns
        end_ns = None if self.end_open else self.end_ns - self.offset_ns + margin_ns + 1
        return start_ns, end_ns

    def holds(self, stamp_ns: int, margin_ns: int = 0) -> bool:
        """Whether a stamp lies in the window, widened by a margin."""
        return (self.start_open or stamp_ns >= self.start_ns - margin_ns) and (
            self.end_open or stamp_ns <= self.end_ns + margin_ns
        )


@dataclass(frozen=True)
class RecordedData:
    """An opened container and how the user wants it read; `where` is the path, for errors."""

    storage: Storage
    decoder: Decoder
    request: RecordingRequest
    where: str


def find_window(data: RecordedData, leading: Topic | None, notes: Notes) -> Window:
    """Seconds of `--start` and `--end` count from the first message, in log time; streams follow the sensors' clock."""
    storage, request, where = data.storage, data.request, data.where
    for option, given_s in (("--start", request.start_s), ("--end", request.end_s)):
        if given_s is not None and not (0 if option == "--start" else -LATEST_S) <= given_s <= LATEST_S:
            raise ConfigError(
                f"{option} {given_s:g} lies in no recording",
                cure=f"give seconds from the recording's first message, from 0 to {LATEST_S:g}",
            )
    offset_ns = leading.clock_offset_ns if leading else 0
    if leading is not None and abs(offset_ns) >= _SKEWED_CLOCK_NS:
        offset_ns = usual_offset_ns(storage, leading, data.decoder)
    if abs(offset_ns) < _SKEWED_CLOCK_NS:
        offset_ns = 0
    else:
        notes.note(
            "clock", f"{where}: sensor stamps are {offset_ns / 1e9:+.1f} s off the time of recording, stamps count"
        )
    first, last = storage.start_ns + offset_ns, storage.end_ns + offset_ns
    start_ns = first if request.start_s is None else first + round(request.start_s * 1e9)
    end_ns = last if request.end_s is None else first + round(request.end_s * 1e9) - 1
    if start_ns > last or end_ns < max(first, start_ns):
        raise RecordingError(
            f"nothing between --start {request.start_s or 0:g} and --end "
            f"{'the end' if request.end_s is None else f'{request.end_s:g}'}",
            where=where,
            cure=f"the recording lasts {(last - first) / 1e9:.1f} s",
        )
    return Window(max(start_ns, first), min(end_ns, last), start_ns <= first, end_ns >= last, offset_ns)
