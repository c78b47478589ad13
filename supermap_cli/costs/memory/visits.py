"""When which rooms are looked at: a hundred traversals, one a day, each through a part of the building."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

S = 10**9
FIRST_DAY_NS = 1_767_603_600 * S
"""2026-01-05T09:00:00Z, a Monday."""
DAY_NS = 86_400 * S
STEP_NS = S // 3

LOOKS = 8
"""Keyframes that a traversal takes in a room."""
SHARE = 0.13
"""Of all rooms, in a traversal: with 100 traversals, a hundred looks at every room."""
SHORT_ROOMS = 6
SHORT = 2
"""How many of the first and of the last traversals go through `SHORT_ROOMS` rooms only, the same ones."""
_GOLDEN = 0.6180339887


@dataclass(frozen=True)
class Course:
    """One traversal: `number` counts from 1; `rooms` in the order of going."""

    number: int
    rooms: tuple[int, ...]

    @property
    def name(self) -> str:
        """As recordings are called."""
        return f"day-{self.number:03d}"

    @property
    def start_ns(self) -> int:
        """Its first keyframe's stamp."""
        return FIRST_DAY_NS + (self.number - 1) * DAY_NS

    @property
    def end_ns(self) -> int:
        """Its last keyframe's stamp."""
        return self.stamp_ns(len(self.rooms) * LOOKS - 1)

    def stamp_ns(self, keyframe: int) -> int:
        """The stamp of its n-th keyframe, from 0."""
        return self.start_ns + keyframe * STEP_NS

    @cached_property
    def entered_ns(self) -> dict[int, int]:
        """When each of its rooms was looked at first."""
        return {room: self.stamp_ns(at * LOOKS) for at, room in enumerate(self.rooms)}


@dataclass(frozen=True)
class Visit:
    """One traversal's looks at one room, from its first to its last keyframe there."""

    course: Course
    first_ns: int

    @property
    def last_ns(self) -> int:
        """The last of its looks."""
        return self.first_ns + (LOOKS - 1) * STEP_NS


def courses(traversals: int, rooms: int) -> tuple[Course, ...]:
    """All traversals: the first and last few are short, the others start all over the building."""
    long = min(max(round(SHARE * rooms), SHORT_ROOMS), rooms)
    planned = []
    for at in range(traversals):
        short = at < SHORT or at >= traversals - SHORT
        start = 0 if short else int((at * _GOLDEN) % 1 * rooms)
        length = min(SHORT_ROOMS, rooms) if short else long
        planned.append(Course(at + 1, tuple((start + i) % rooms for i in range(length))))
    return tuple(planned)


def visits_by_room(planned: tuple[Course, ...]) -> dict[int, list[Visit]]:
    """Every room's visits in the order of time."""
    visits: dict[int, list[Visit]] = defaultdict(list)
    for course in planned:
        for room, entered_ns in course.entered_ns.items():
            visits[room].append(Visit(course, entered_ns))
    return visits
