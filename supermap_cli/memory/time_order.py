"""When a recording took place in the map's time, which goes forward in the order of building.

Clocks cannot be trusted for that: a robot's may start at zero, be set back, or differ from another robot's. The order
in which recordings are given counts. One that begins, by its stamps, before the end of what is in the map has all its
times moved on by whole minutes, so that it begins after that end, and that is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from supermap_cli.memory.values import StoredTraversal
from supermap_cli.protocols import Recording

MINUTE_NS = 60 * 10**9
"""Shifts are whole minutes, so that a stamp's seconds stay those in the recording, and no less than one lies between
two traversals, longer than anything that the engine takes for one moment.
"""


@dataclass(frozen=True)
class TimeShift:
    """Times in the map are the recording's own plus `shift_ns`; `warning` says so, and is `None` where it is 0."""

    shift_ns: int = 0
    warning: str | None = None


def shift_to_follow(name: str, first_ns: int, earlier: Sequence[StoredTraversal]) -> TimeShift:
    """The shift of a traversal that begins at `first_ns`, by its own clock, after those that are in the map.

    A keyframe may not be older than, or of the same instant as, one that is in the map. What was recorded after the
    last keyframe, and is part of no map, does not count: a recording that is built in parts goes on where it stopped.
    """
    mapped = [traversal for traversal in earlier if traversal.mapped_ns is not None]
    last = max(mapped, key=lambda traversal: traversal.mapped_ns or 0, default=None)
    if last is None or last.mapped_ns is None or first_ns > last.mapped_ns:
        return TimeShift()
    end_ns = max(max(traversal.end_ns, traversal.mapped_ns or 0) for traversal in mapped)
    shift_ns = -(-(end_ns + MINUTE_NS - first_ns) // MINUTE_NS) * MINUTE_NS
    return TimeShift(
        shift_ns,
        f"{name}'s clock starts before {last.name}'s end: the order given is kept; in the map, {name}'s times are its "
        f"own and {duration_text(shift_ns)}",
    )


def follow_in_time(recording: Recording, name: str, earlier: Sequence[StoredTraversal]) -> TimeShift:
    """The shift of a recording that will be the traversal of that name."""
    return shift_to_follow(name, recording.start_ns, earlier)


def duration_text(duration_ns: int) -> str:
    """Whole minutes in words: "3 min", "1 d 2 h 3 min"."""
    minutes = abs(duration_ns) // MINUTE_NS
    parts = [(minutes // 1440, "d"), (minutes // 60 % 24, "h"), (minutes % 60, "min")]
    return " ".join(f"{count} {unit}" for count, unit in parts if count) or "0 min"
