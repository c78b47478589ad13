"""Other visits of a room than a tour with stops: a turn on the spot, and one straight pass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.building_plan import BuildingPlan
from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.motion.gaze import GazePlanner, follow_gaze, room_points_of_interest
from supermap_cli.simulation.route import Route

_CLEARANCE_M = 0.33  # m, as for other routes
_SECONDS_A_TURN = 15.0  # s: 24 degrees/s, at which images of 5 Hz overlap by nine tenths
_EASE_S = 1.5  # s, chosen: from rest to the full rate, and back
_OTHER_PLACE_M = 1.0  # m, as for other second visits: from where an earlier visit was
_PASS_SPEED = 0.6  # m/s at most, a slow walk
_LINES_DRAWN = 400  # lines tried; bounds the time
_STEP_S = 0.05  # s between points of a way
_KNOT_EVERY = 5  # points: 0.25 s, as for other routes
_SHORTEST_PASS_M = 0.3  # m, chosen: a shorter pass is a stand


def turn_on_the_spot(  # noqa: PLR0917 - where, how and when
    plan: BuildingPlan,
    obstacles: Sequence[Box3D],
    rng: np.random.Generator,
    start_ns: int,
    seconds: float,
    away_from_xy: FloatArray | None = None,
) -> Route:
    """The robot stands as near to the middle of the largest room as it can and turns, once every 15 s or so.

    With `away_from_xy` it stands elsewhere, where the room allows that. Raises `ValueError` when it finds no place.
    """
    free = FreeSpace(plan, obstacles, clearance_m=_CLEARANCE_M)
    places = _places(free, plan)
    room = max(plan.rooms, key=lambda room: float(np.prod(room.high - room.low)))
    target = room.center + rng.uniform(-0.3, 0.3, 2)
    if away_from_xy is not None:
        elsewhere = places[np.linalg.norm(places - away_from_xy, axis=1) >= _OTHER_PLACE_M]
        places = elsewhere if len(elsewhere) else places
    xy = places[int(np.linalg.norm(places - target, axis=1).argmin())]
    turns = max(1, round(seconds / _SECONDS_A_TURN))
    times_s = np.linspace(0, seconds, 1 + max(4, int(seconds / 0.25)))
    yaw = rng.uniform(-np.pi, np.pi) + rng.choice([-1, 1]) * 2 * np.pi * turns * _eased(times_s)
    return Route(start_ns, times_s, np.tile(xy, (len(times_s), 1)), yaw)


def straight_pass(  # noqa: PLR0917 - where, how and when
    plan: BuildingPlan,
    obstacles: Sequence[Box3D],
    rng: np.random.Generator,
    start_ns: int,
    seconds: float,
    away_from_xy: FloatArray | None = None,
) -> Route:
    """One straight way through the rooms, the longest of many that the time allows, looking about.

    With `away_from_xy` it starts elsewhere, where the rooms allow that. Raises `ValueError` when there is no way.
    """
    free = FreeSpace(plan, obstacles, clearance_m=_CLEARANCE_M)
    start, end = _longest_line(free, _places(free, plan), _PASS_SPEED * seconds, rng, away_from_xy)
    count = 1 + max(2, int(np.ceil(seconds / _STEP_S)))
    way = start + (end - start) * _eased(np.linspace(0, seconds, count))[:, None]
    interests = {room.name: room_points_of_interest(room, obstacles, ()) for room in plan.rooms}
    yaw = follow_gaze(GazePlanner(plan, free, interests), way, seconds / (count - 1), rng)
    knots = np.unique(np.append(np.arange(0, count, _KNOT_EVERY), count - 1))
    return Route(start_ns, np.linspace(0, seconds, count)[knots], way[knots], yaw[knots])


def _places(free: FreeSpace, plan: BuildingPlan) -> FloatArray:
    """The floor that the robot can reach (n, 2)."""
    places = free.cell_centers(np.argwhere(free.reachable))
    inside = np.zeros(len(places), bool)
    for room in plan.rooms:
        inside |= ((places > room.low) & (places < room.high)).all(axis=1)
    if not inside.any():
        raise ValueError("there is no place for the robot")
    return places[inside]


def _longest_line(
    free: FreeSpace, places: FloatArray, most_m: float, rng: np.random.Generator, away_from_xy: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    best: tuple[float, FloatArray, FloatArray] | None = None
    for a, b in rng.integers(len(places), size=(_LINES_DRAWN, 2)):
        start, end = places[a], places[b]
        length_m = float(np.linalg.norm(end - start))
        near = away_from_xy is not None and float(np.linalg.norm(start - away_from_xy)) < _OTHER_PLACE_M
        worth = length_m - (most_m if near else 0.0)
        if length_m > most_m or length_m < _SHORTEST_PASS_M or (best is not None and worth <= best[0]):
            continue
        line = start + (end - start) * np.linspace(0, 1, 2 + int(length_m / 0.025))[:, None]
        if free.are_free(line).all():
            best = worth, start, end
    if best is None:
        raise ValueError("there is no straight way through the rooms")
    return best[1], best[2]


def _eased(times_s: FloatArray) -> FloatArray:
    """From 0 to 1 over the times, evenly but for a soft start and end."""
    ease_s = min(_EASE_S, float(times_s[-1]) / 3)
    pace = np.minimum(1.0, np.minimum(times_s, times_s[-1] - times_s) / ease_s)
    gone = np.concatenate([[0.0], np.cumsum((pace[1:] + pace[:-1]) / 2 * np.diff(times_s))])
    eased: FloatArray = gone / gone[-1]
    return eased
