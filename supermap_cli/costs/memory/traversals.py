"""The traversals of a synthetic building, one a day, and the rooms that each visits."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

SECOND_NS = 10**9
"""Nanoseconds."""
FIRST_START_NS = 1_767_603_600 * SECOND_NS
"""2026-01-05T09:00:00Z, a Monday."""
TRAVERSAL_PERIOD_NS = 86_400 * SECOND_NS
"""One traversal starts a day after the other."""
KEYFRAME_PERIOD_NS = SECOND_NS // 3
"""3 Hz, the mapping rate of the paper SuperMap."""

KEYFRAMES_PER_ROOM = 8
"""Keyframes that a traversal takes in each room it visits."""
ROOM_SHARE = 0.13
"""Share of all rooms that a long traversal visits: 100 traversals take a hundred keyframes of every room."""
ROOMS_OF_SHORT_TRAVERSAL = 6
"""Chosen."""
SHORT_TRAVERSALS = 2
"""How many of the first and of the last traversals visit only `ROOMS_OF_SHORT_TRAVERSAL` rooms, the same ones: answers
about them do not grow with the building.
"""
_GOLDEN_RATIO_FRACTION = 0.6180339887
"""(sqrt(5) - 1) / 2: multiples of it modulo 1 are spread evenly (Weyl), so that starts are spread over the building."""


@dataclass(frozen=True)
class SyntheticTraversal:
    """One traversal: `number` counts from 1; `rooms` in the order of visiting."""

    number: int
    rooms: tuple[int, ...]

    @property
    def name(self) -> str:
        """The traversal's name in the map."""
        return f"day-{self.number:03d}"

    @property
    def start_ns(self) -> int:
        """Its first keyframe's stamp."""
        return FIRST_START_NS + (self.number - 1) * TRAVERSAL_PERIOD_NS

    @property
    def end_ns(self) -> int:
        """Its last keyframe's stamp."""
        return self.stamp_ns(len(self.rooms) * KEYFRAMES_PER_ROOM - 1)

    def stamp_ns(self, keyframe: int) -> int:
        """The stamp of its n-th keyframe, from 0."""
        return self.start_ns + keyframe * KEYFRAME_PERIOD_NS

    @cached_property
    def entered_ns(self) -> dict[int, int]:
        """Room -> stamp of its first keyframe."""
        return {room: self.stamp_ns(index * KEYFRAMES_PER_ROOM) for index, room in enumerate(self.rooms)}


@dataclass(frozen=True)
class RoomVisit:
    """One traversal's stay in one room, from its first to its last keyframe there."""

    traversal: SyntheticTraversal
    first_ns: int

    @property
    def last_ns(self) -> int:
        """Stamp of its last keyframe."""
        return self.first_ns + (KEYFRAMES_PER_ROOM - 1) * KEYFRAME_PERIOD_NS


def plan_traversals(traversals: int, rooms: int) -> tuple[SyntheticTraversal, ...]:
    """Plan all traversals: the first and last few are short, the others start in rooms spread over the building."""
    long_length = min(max(round(ROOM_SHARE * rooms), ROOMS_OF_SHORT_TRAVERSAL), rooms)
    planned = []
    for index in range(traversals):
        short = index < SHORT_TRAVERSALS or index >= traversals - SHORT_TRAVERSALS
        start = 0 if short else int((index * _GOLDEN_RATIO_FRACTION) % 1 * rooms)
        length = min(ROOMS_OF_SHORT_TRAVERSAL, rooms) if short else long_length
        planned.append(SyntheticTraversal(index + 1, tuple((start + offset) % rooms for offset in range(length))))
    return tuple(planned)


def visits_by_room(planned: tuple[SyntheticTraversal, ...]) -> dict[int, list[RoomVisit]]:
    """Every room's visits in the order of time."""
    visits: dict[int, list[RoomVisit]] = defaultdict(list)
    for traversal in planned:
        for room, entered_ns in traversal.entered_ns.items():
            visits[room].append(RoomVisit(traversal, entered_ns))
    return visits
