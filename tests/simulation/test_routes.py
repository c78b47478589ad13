"""The robot's way: free, as long as asked for, through all rooms, looking at what matters from several sides."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.motion.routes import ROBOT_RADIUS_M, plan_route
from supermap_cli.simulation.route import Route
from support.small_office import furniture, two_rooms

START_NS = 1_700_000_000_000_000_000
FOCUS = np.array([6.2, 3.9])


def _way(seconds: float, seed: int = 0, **chosen: object) -> Route:
    rng = np.random.default_rng(seed)
    return plan_route(two_rooms(), furniture(), rng, start_ns=START_NS, seconds=seconds, **chosen)  # type: ignore[arg-type]


def _stamps_ns(route: Route, step_s: float = 0.05) -> np.ndarray:
    return np.arange(route.start_ns, route.end_ns, round(step_s * 1e9))


LONG = _way(90.0, focus=[FOCUS])


@pytest.mark.parametrize("seconds", [0.7, 6.0, 33.3])
def test_a_route_takes_exactly_the_time_asked_for_and_ends_at_rest(seconds: float) -> None:
    route = _way(seconds)
    assert route.start_ns == START_NS
    assert route.end_ns == START_NS + round(seconds * 1e9)
    assert np.allclose(route.derivative(np.array([route.start_ns, route.end_ns]), 1), 0, atol=1e-6)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_robot_touches_nothing(seed: int) -> None:
    route = _way(60.0, seed)
    free = FreeSpace(two_rooms(), furniture(), clearance_m=ROBOT_RADIUS_M)
    assert free.are_free(route.derivative(_stamps_ns(route))[:, :2]).all()


def test_it_enters_every_room_and_only_those_asked_for() -> None:
    assert _rooms(LONG) == {"corridor", "left", "right"}
    assert _rooms(_way(25.0, rooms=["left"])) == {"left"}


def test_it_is_slow_enough_for_a_robot_and_turns_fast_in_places() -> None:
    motion = LONG.derivative(_stamps_ns(LONG), 1)
    speed, turning = np.hypot(motion[:, 0], motion[:, 1]), np.degrees(np.abs(motion[:, 2]))
    assert 0.3 < np.median(speed[speed > 0.1]) < 0.9
    assert speed.max() < 1.0
    assert 60 < turning.max() < 115
    assert (turning > 60).mean() < 0.3


def test_a_focus_is_looked_at_from_near_from_several_sides_and_again_later() -> None:
    seconds, sides = _looks(LONG, FOCUS)
    assert len(seconds) > 5
    assert np.ptp(seconds) > 30
    assert len(np.unique(np.round(sides / (np.pi / 4)))) >= 3


def test_a_short_route_begins_with_the_focus() -> None:
    seconds, _ = _looks(_way(6.0, focus=[FOCUS]), FOCUS)
    assert len(seconds) > 1


def test_the_same_seed_gives_the_same_way_and_another_another() -> None:
    first, second, third = (_way(8.0, seed) for seed in (5, 5, 6))
    assert np.array_equal(first.knots_xy, second.knots_xy)
    assert np.array_equal(first.knots_yaw, second.knots_yaw)
    assert first.knots_xy.shape != third.knots_xy.shape or not np.allclose(first.knots_xy, third.knots_xy)


def test_no_time_is_an_error() -> None:
    with pytest.raises(ValueError, match="takes time"):
        _way(0.0)


def _rooms(route: Route) -> set[str]:
    places = (two_rooms().room_at(xy) for xy in route.derivative(_stamps_ns(route))[:, :2])
    return {room.name for room in places if room is not None}


def _looks(route: Route, at_xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """When, and from which side, the robot looks at a point within 30 degrees of its axis from 0.5 to 3.2 m."""
    stamps_ns = _stamps_ns(route, 0.2)
    x, y, yaw = route.derivative(stamps_ns).T
    offset = at_xy - np.column_stack([x, y])
    distance_m = np.linalg.norm(offset, axis=1)
    bearing = np.arctan2(offset[:, 1], offset[:, 0])
    aside = np.abs(np.mod(bearing - yaw + np.pi, 2 * np.pi) - np.pi)
    looks = (aside < np.radians(30)) & (distance_m > 0.5) & (distance_m < 3.2)
    return (stamps_ns[looks] - route.start_ns) / 1e9, bearing[looks]
