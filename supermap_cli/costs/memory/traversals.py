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

KEYFRAMES_PER_ROOM = 8
"""Keyframes that a traversal takes in a room."""
ROOM_SHARE = 0.13
"""Of all rooms, in a traversal: with 100 traversals, a hundred looks at every room."""
ROOMS_OF_SHORT_TRAVERSAL = 6
SHORT_TRAVERSALS = 2
"""How many of the first and of the last traversals go through `ROOMS_OF_SHORT_TRAVERSAL` rooms only, the same ones."""
_GOLDEN = 0.6180339887


@dataclass(frozen=True)
class SyntheticTraversal:
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
        return self.stamp_ns(len(self.rooms) * KEYFRAMES_PER_ROOM - 1)

    def stamp_ns(self, keyframe: int) -> int:
        """The stamp of its n-th keyframe, from 0."""
        return self.start_ns + keyframe * STEP_NS

    @cached_property
    def entered_ns(self) -> dict[int, int]:
        """When each of its rooms was looked at first."""
        return {room: self.stamp_ns(at * KEYFRAMES_PER_ROOM) for at, room in enumerate(self.rooms)}


@dataclass(frozen=True)
class Visit:
    """One traversal's looks at one room, from its first to its last keyframe there."""

    traversal: SyntheticTraversal
    first_ns: int

    @property
    def last_ns(self) -> int:
        """The last of its looks."""
        return self.first_ns + (KEYFRAMES_PER_ROOM - 1) * STEP_NS


def plan_traversals(traversals: int, rooms: int) -> tuple[SyntheticTraversal, ...]:
    """All traversals: the first and last few are short, the others start all over the building."""
    long = min(max(round(ROOM_SHARE * rooms), ROOMS_OF_SHORT_TRAVERSAL), rooms)
    planned = []
    for at in range(traversals):
        short = at < SHORT_TRAVERSALS or at >= traversals - SHORT_TRAVERSALS
        start = 0 if short else int((at * _GOLDEN) % 1 * rooms)
        length = min(ROOMS_OF_SHORT_TRAVERSAL, rooms) if short else long
        planned.append(SyntheticTraversal(at + 1, tuple((start + i) % rooms for i in range(length))))
    return tuple(planned)


def visits_by_room(planned: tuple[SyntheticTraversal, ...]) -> dict[int, list[Visit]]:
    """Every room's visits in the order of time."""
    visits: dict[int, list[Visit]] = defaultdict(list)
    for traversal in planned:
        for room, entered_ns in traversal.entered_ns.items():
            visits[room].append(Visit(traversal, entered_ns))
    return visits
