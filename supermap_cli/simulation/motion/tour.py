"""Where a robot stops on its rounds through a building, so that every room's contents are seen from several sides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.simulation.building_plan import BuildingPlan, Room
from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.motion.gaze import PointsOfInterest

_MEAN_SPEED = 0.62
"""m/s of the routes that `routes._drive` makes, measured."""
_CANDIDATE_SPACING_M = 0.4
"""m between places where the robot may stop; chosen so that a room of 4 m x 5 m has about a hundred."""
_EFFORTS = ((5, 0.5), (4, 0.5), (3, 0.5), (4, 1.0), (3, 1.0), (2, 1.0), (1, 1.0))
"""Stops a room at most, and the share of the time that one round may take: the first pair that fits is used."""
_HURRY = 0.5
"""Factor on the dwell times where not even one stop a room fits; chosen so that a stop still shows something."""


@dataclass(frozen=True)
class Stop:
    """A view point (2,) and how long the robot looks around there."""

    xy: FloatArray
    dwell_s: float


@dataclass(frozen=True)
class Tour:
    """Stops in their order and the ways (k, 2) between them, one fewer."""

    stops: tuple[Stop, ...] = ()
    legs: tuple[FloatArray, ...] = ()

    @property
    def duration_s(self) -> float:
        """How long it takes, roughly."""
        length_m = sum(float(np.linalg.norm(np.diff(leg, axis=0), axis=1).sum()) for leg in self.legs)
        return sum(stop.dwell_s for stop in self.stops) + length_m / _MEAN_SPEED


def plan_tour(
    free: FreeSpace,
    rooms: Sequence[Room],
    interests: Mapping[str, PointsOfInterest],
    seconds: float,
    rng: np.random.Generator,
) -> Tour:
    """A tour of at least `seconds` through rooms in the order given, round after round.

    Each room gets as many stops as let two rounds fit into the time, or else one. When that is too short for all rooms,
    only some are visited, those with a focus first.
    """
    planner = _StopPlanner(free, rooms, interests, rng)
    efforts = (most for most, share in _EFFORTS if planner.first_round(rooms, most).duration_s <= share * seconds)
    most = next(efforts, None)
    if most is None:
        planner.hurry = _HURRY
        rooms, most = sorted(rooms, key=lambda room: not interests[room.name].focused), 1
        while len(rooms) > 1 and planner.first_round(rooms, most).duration_s > seconds:
            rooms, most = rooms[:-1], 2
    if len(rooms) == 1:
        most = _EFFORTS[0][0]
    tour = planner.first_round(rooms, most)
    while tour.duration_s < seconds + 2:
        tour = planner.another_round(tour, rooms, most)
    return tour


def rooms_to_stop_in(
    plan: BuildingPlan, rooms: Sequence[Room], interests: Mapping[str, PointsOfInterest]
) -> list[Room]:
    """All of the rooms but those that one comes through anyway and that hold next to nothing (corridors)."""
    ways_through = [name for doorway in plan.doorways for name in (doorway.first, doorway.second)]

    def is_worth_it(room: Room) -> bool:
        here = interests[room.name]
        return ways_through.count(room.name) < 2 or here.things > 3 or here.focused

    return [room for room in rooms if is_worth_it(room)] or list(rooms)


def ordered_round(free: FreeSpace, rooms: Sequence[Room], first: Room) -> list[Room]:
    """A short round through all rooms that begins with `first`: the shortest of all for up to seven rooms, else always
    to the nearest one left.
    """
    others = [k for k, room in enumerate(rooms) if room is not first]
    start = next(k for k, room in enumerate(rooms) if room is first)
    ways_m = free.ways_m(np.array([_inside(free, room) for room in rooms]))

    def round_m(order: Sequence[int]) -> float:
        return float(sum(ways_m[a, b] for a, b in pairwise((start, *order, start))))

    if len(others) < 7:
        return [rooms[k] for k in (start, *min(permutations(others), key=round_m))]
    order = [start]
    while others:
        order.append(min(others, key=lambda k: float(ways_m[order[-1], k])))
        others.remove(order[-1])
    return [rooms[k] for k in order]


def _inside(free: FreeSpace, room: Room) -> FloatArray:
    """The free place nearest to a room's middle. Raises `ValueError` when the room cannot be entered."""
    places = _places(free, room)
    nearest: FloatArray = places[int(np.linalg.norm(places - room.center, axis=1).argmin())]
    return nearest


def _places(free: FreeSpace, room: Room) -> FloatArray:
    """Where the robot can stop in a room: reachable points (n, 2), `_CANDIDATE_SPACING_M` apart."""
    spacing = _CANDIDATE_SPACING_M
    while spacing > 0.04:
        x, y = (np.arange(room.low[k] + 0.3, room.high[k] - 0.3, spacing) for k in (0, 1))
        grid = np.column_stack([coordinates.ravel() for coordinates in np.meshgrid(x, y, indexing="ij")])
        places = grid[free.are_reachable(grid)]
        if len(places):
            return places
        spacing /= 2
    raise ValueError(f"the room {room.name!r} cannot be entered")


class _StopPlanner:
    """Chooses stops greedily by what they show that was not yet seen, and keeps what has been seen."""

    def __init__(
        self,
        free: FreeSpace,
        rooms: Sequence[Room],
        interests: Mapping[str, PointsOfInterest],
        rng: np.random.Generator,
    ) -> None:
        self.hurry = 1.0
        self._free = free
        self._interests = interests
        self._rng = rng
        self._places = {room.name: _places(free, room) for room in rooms}
        self._shows = {
            name: np.array([interests[name].shown_from(free, xy) for xy in places])
            for name, places in self._places.items()
        }
        self._seen: dict[str, FloatArray] = {}

    def first_round(self, rooms: Sequence[Room], most: int) -> Tour:
        """A round by someone who has seen nothing yet."""
        self._seen = {name: interests.unseen() for name, interests in self._interests.items()}
        return self.another_round(Tour(), rooms, most)

    def another_round(self, tour: Tour, rooms: Sequence[Room], most: int) -> Tour:
        """The tour and a further round through the rooms, with up to `most` stops in each."""
        stops, legs = list(tour.stops), list(tour.legs)
        for room in rooms:
            for stop in self._stops(room.name, most):
                if stops:
                    legs.append(self._free.path(stops[-1].xy, stop.xy))
                stops.append(stop)
        return Tour(tuple(stops), tuple(legs))

    def _stops(self, room: str, most: int) -> list[Stop]:
        """Places found greedily: each shows most, given all before; the more that is, the longer the stop. A room with
        little in it gets fewer. After the best one the nearest follow.
        """
        interests, shows, places = self._interests[room], self._shows[room], self._places[room]
        roomy = np.clip(self._free.room_to_move_m(places) / 0.6, 0.4, 1.0)
        chosen: list[Stop] = []
        for _ in range(min(most, 1 + interests.things // 2)):
            worth = interests.weights[:, None] / (0.5 + self._seen[room])
            gains = (worth * shows).sum(axis=(1, 2))
            best = int(np.argmax(gains * roomy * self._rng.uniform(0.85, 1.0, len(places))))
            dwell_s = float(np.clip(0.8 + 0.15 * gains[best], 1.0, 4.5)) * float(self._rng.uniform(0.8, 1.2))
            self._seen[room] += shows[best]
            chosen.append(Stop(places[best], self.hurry * dwell_s))
        order = [chosen.pop(0)]
        while chosen:
            distances = [float(np.linalg.norm(stop.xy - order[-1].xy)) for stop in chosen]
            order.append(chosen.pop(int(np.argmin(distances))))
        return order
