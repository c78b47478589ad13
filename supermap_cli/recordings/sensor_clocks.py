"""The clocks of the sensors: how far each is off the time of recording, and what brings them onto the camera's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from supermap_cli.errors import CalibrationError, ConfigError
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.survey import Topic
from supermap_cli.types.limits import LARGEST_CLOCK_OFFSET_S

OTHER_CLOCK_NS = 1_000_000_000
"""ns between the stamps of two sensors at one time of recording from which they are two clocks."""

_NEVER_SO_LATE_NS = 600 * 10**9
"""ns, ten minutes, from which a difference can only be that of clocks: at 10 Hz and 1 MB a sweep, what waits so long
before it is recorded would fill 6 GB.
"""

_LATE_VARIES = 4
"""What waits to be recorded does so for times that vary by at least a quarter."""

_AHEAD_NS = 500_000_000
"""ns that a stamp may lie beyond the time of recording; a message is never recorded before it was stamped."""

_KNOWN_NS = {37: "TAI, 37 s ahead of UTC", 18: "GPS time, 18 s ahead of UTC", 19: "TAI against GPS time"}
"""Whole seconds between time scales (IERS Bulletin C: since 2017)."""

_KNOWN_WITHIN_NS = 300_000_000
"""ns by which a difference of such time scales is told by times of recording."""

_HOUR_NS, _MOST_HOURS = 3600 * 10**9, 14
"""ns, and the most hours that a time zone is off UTC."""


ByMotion = Callable[[Topic, int], bool | None]
"""Whether the robot's motion says that so many ns must be added to a topic's stamps; `None` where it does not tell."""


def sensor_clocks(  # noqa: PLR0917 - what is known of the clocks
    reference: Topic | None,
    sensors: Sequence[Topic],
    given: Mapping[str, float],
    by_motion: ByMotion,
    where: str,
    notes: Notes,
) -> tuple[dict[str, int], list[CalibrationError]]:
    """What is added to the stamps of each topic, in ns, and what cannot be decided.

    `given` are the user's offsets in seconds, which count without a look at the times of recording. A stamp far beyond
    the time of recording, or off by a known difference of time scales, is another clock's; one seconds before it is
    another clock's or that of a message that was recorded late, which `by_motion` may tell.
    """
    shifts = {topic: round(offset_s * 1e9) for topic, offset_s in given.items() if offset_s}
    problems: list[CalibrationError] = []
    for topic in sensors if reference is not None else ():
        if topic.name in given or reference is None or topic.name == reference.name or not topic.offsets_ns:
            continue
        apart_ns = topic.clock_offset_ns - reference.clock_offset_ns
        if abs(apart_ns) < OTHER_CLOCK_NS or not (_is_steady(topic) and _is_steady(reference)):
            continue
        what = f"its clock is {apart_text(apart_ns, reference.name)}, by times of recording"
        if _is_late(topic, reference, apart_ns):
            notes.note(
                f"clock {topic.name}", f"{where}, {topic.name}: {what}; as this varies, messages are recorded late"
            )
            continue
        off = True if _is_sure(topic, reference, apart_ns) else by_motion(topic, -apart_ns)
        if off:
            shifts[topic.name] = -(known_scale_ns(apart_ns) or apart_ns)
            notes.note(
                f"clock {topic.name}",
                f"{where}, {topic.name}: {what}; {shifts[topic.name] / 1e9:+.3f} s are added to its stamps (--clock "
                f"{topic.name}=SECONDS adds others, 0 none)",
            )
        elif off is False:
            notes.note(
                f"clock {topic.name}",
                f"{where}, {topic.name}: {what}; as the robot turned at its stamps, they are right, and its messages "
                f"are recorded late (--clock {topic.name}=SECONDS adds to its stamps)",
            )
        else:
            problems.append(
                CalibrationError(
                    f"{what}, or it is recorded late",
                    where=f"{where}, {topic.name}",
                    cure=f"say --clock {topic.name}={-apart_ns / 1e9:.3f} if its stamps are off by that, or "
                    f"--clock {topic.name}=0 if they are right",
                )
            )
    return shifts, problems


def check_clocks(given: Mapping[str, float], topics: Sequence[str]) -> None:
    """Raise `ConfigError` for an offset of a topic that is not there, or that is no time."""
    for topic, offset_s in given.items():
        if topic not in topics:
            raise ConfigError(
                f"--clock {topic}: there are no messages on this topic",
                cure=f"the topics are {', '.join(sorted(topics)[:12])}",
            )
        if not abs(offset_s) <= LARGEST_CLOCK_OFFSET_S:
            raise ConfigError(
                f"--clock {topic}={offset_s:g} is no offset between two clocks",
                cure=f"write seconds, such as -37, and not more than {LARGEST_CLOCK_OFFSET_S:.0f}",
            )


def _is_late(topic: Topic, reference: Topic, apart_ns: int) -> bool:
    """Whether the messages of one waited before they were recorded: for times that vary as much as they are long."""
    later = min((topic, reference), key=lambda each: each.clock_offset_ns)
    return _spread_ns(later.offsets_ns) * _LATE_VARIES > abs(apart_ns)


def _is_sure(topic: Topic, reference: Topic, apart_ns: int) -> bool:
    """Whether a difference is that of two clocks, and not of messages that waited before they were recorded: too long
    or just as long as time scales differ, or stamped in the future by the clock of the other sensor and the recorder.
    """
    if abs(apart_ns) >= _NEVER_SO_LATE_NS or known_scale_ns(apart_ns) is not None:
        return True
    earlier_ns, later_ns = sorted((topic.clock_offset_ns, reference.clock_offset_ns))
    return later_ns > _AHEAD_NS and abs(earlier_ns) < OTHER_CLOCK_NS


def _is_steady(topic: Topic) -> bool:
    """Whether a topic's stamps are of one clock all along; one that was set while recording is another matter."""
    return _spread_ns(topic.offsets_ns) < OTHER_CLOCK_NS // 2


def _spread_ns(offsets_ns: Sequence[int]) -> int:
    """The range of all but the extreme samples."""
    ordered = sorted(offsets_ns)
    inner = ordered[1:-1] if len(ordered) > 4 else ordered
    return inner[-1] - inner[0]


def known_scale_ns(apart_ns: int) -> int | None:
    """The difference of time scales, or of time zones, that is meant, in ns; `None` where it is none."""
    for seconds in _KNOWN_NS:
        if abs(abs(apart_ns) - seconds * 10**9) < _KNOWN_WITHIN_NS:
            return int(np.sign(apart_ns)) * seconds * 10**9
    hours = round(apart_ns / _HOUR_NS)
    zone = 0 < abs(hours) <= _MOST_HOURS and abs(apart_ns - hours * _HOUR_NS) < _KNOWN_WITHIN_NS
    return hours * _HOUR_NS if zone else None


def apart_text(apart_ns: int, other: str) -> str:
    """How far apart, and which known scales of time that tells: "37.0 s ahead of (TAI ...)"."""
    side = "ahead of" if apart_ns > 0 else "behind"
    seconds = abs(apart_ns) / 1e9
    known = next((text for each, text in _KNOWN_NS.items() if abs(seconds - each) < _KNOWN_WITHIN_NS / 1e9), None)
    if seconds > 10 * 365 * 86400:
        counted = "it counts since it was switched on" if apart_ns < 0 else "which counts since it was switched on"
        return f"{seconds / 86400:.0f} days {side} that of {other} ({counted})"
    hours = round(seconds / 3600)
    if known is None and 0 < hours <= _MOST_HOURS and abs(seconds - hours * 3600) < 1:
        known = f"{hours} h of time zone"
    return f"{seconds:.1f} s {side} that of {other}" + (f" ({known})" if known else "")
