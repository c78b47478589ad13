"""Waypoints in a room that is known exactly: measured on the world's surfaces, not on the map."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from supermap_cli.errors import QueryError
from supermap_cli.memory.reading import MapReader
from supermap_cli.navigation.grid import OccupancyGrid
from supermap_cli.navigation.route import DrivingRobot, PlannedRoute, Waypoint, plan_route
from supermap_cli.simulation.sensors.scene import Scene
from support import driven_room, simulated
from support import memories as m

NOW_NS = simulated.CUP_LEAVES_NS + 1


def plan(reader: MapReader, grid: OccupancyGrid, text: str, **options) -> PlannedRoute:
    return plan_route(reader, text, grid=grid, **options)


def true_clearance_m(points_xy: np.ndarray) -> float:
    """From the upright axes of robots, above the reach of the floor, to the nearest surface."""
    heights = np.arange(0.3, 1.2, 0.1)
    points = np.array([[x, y, z] for x, y in points_xy for z in heights])
    return float(simulated.distance_to_surfaces(driven_room.world(), points, NOW_NS).min())


def sees(waypoint: Waypoint, thing: str) -> bool:
    """Whether a ray from the camera over the pose to the middle of the thing's box ends on the thing."""
    assert waypoint.pose is not None
    assert waypoint.thing is not None
    x, y, _ = waypoint.pose.position
    eye = np.array([x, y, driven_room.CAMERA_M])
    center = np.array(waypoint.thing.position)
    corners = center + np.array([[0, 0, 0], [0, 0, 0.1], [0.1, 0, 0.05], [-0.1, 0, 0.05], [0, 0.1, 0.05]])
    hits = Scene(driven_room.world()).cast(NOW_NS, eye, corners - eye, colour=False)
    return bool((hits.thing == driven_room.world().index[thing] + 1).any())


@pytest.mark.parametrize("radius_m", [0.15, 0.22, 0.3])
@pytest.mark.parametrize(("goal", "thing"), [("table", "table-1"), ("chair-1", "chair-1"), ("ball", "ball-1")])
def test_the_pose_is_free_reached_safely_and_sees_the_thing(
    reader: MapReader, grid: OccupancyGrid, goal: str, thing: str, radius_m: float
) -> None:
    (waypoint,) = plan(reader, grid, f"go to the {goal}", robot=DrivingRobot(radius_m)).waypoints
    assert waypoint.status == "ready", waypoint.message
    assert waypoint.pose is not None
    assert true_clearance_m(np.array([waypoint.pose.position[:2]])) >= radius_m
    way = np.array(waypoint.way)
    if len(way) > 1:
        dense = np.concatenate([a + np.linspace(0, 1, 20)[:, None] * (b - a) for a, b in pairwise(way)])
        assert true_clearance_m(dense) >= radius_m
    assert sees(waypoint, thing)


def test_the_pose_faces_the_thing_at_the_standoff(reader: MapReader, grid: OccupancyGrid) -> None:
    (waypoint,) = plan(reader, grid, "go to the ball", robot=DrivingRobot(0.2, 1.0)).waypoints
    assert waypoint.pose is not None
    assert waypoint.thing is not None
    assert waypoint.gap_m == pytest.approx(1.0, abs=0.1)
    (x, y, _), (tx, ty, _) = waypoint.pose.position, waypoint.thing.position
    assert waypoint.pose.yaw == pytest.approx(math.atan2(ty - y, tx - x), abs=0.02)
    _, _, qz, qw = waypoint.pose.orientation_xyzw
    assert 2 * math.atan2(qz, qw) == pytest.approx(waypoint.pose.yaw, abs=1e-3)


def test_goals_follow_one_another(reader: MapReader, grid: OccupancyGrid) -> None:
    route = plan(reader, grid, "go to the ball, then to the box and to the table")
    assert route.complete
    assert [waypoint.thing.id for waypoint in route.waypoints if waypoint.thing] == ["ball-1", "box-1", "table-1"]
    for before, after in pairwise(route.waypoints):
        assert before.pose is not None
        assert math.dist(before.pose.position[:2], after.way[0]) < 0.1


def test_a_thing_that_has_gone_is_told_with_where_and_when(reader: MapReader, grid: OccupancyGrid) -> None:
    route = plan(reader, grid, "go to the cup")
    (waypoint,) = route.waypoints
    assert (waypoint.status, waypoint.pose, route.complete) == ("gone", None, False)
    assert waypoint.thing is not None
    assert waypoint.thing.position[:2] == pytest.approx((0.3, 0.1), abs=0.05)
    assert (waypoint.thing.gone_after_ns, waypoint.thing.gone_before_ns) == (m.ns(driven_room.LAST_S), m.ns(100))


def test_a_goal_after_one_that_has_gone_is_planned_from_the_pose_before(reader: MapReader, grid: OccupancyGrid) -> None:
    first, gone, last = plan(reader, grid, "go to the ball, to the cup, and to the box").waypoints
    assert (first.status, gone.status, last.status) == ("ready", "gone", "ready")
    assert first.pose is not None
    assert math.dist(first.pose.position[:2], last.way[0]) < 0.1


def test_one_of_several_is_never_guessed(reader: MapReader, grid: OccupancyGrid) -> None:
    (waypoint,) = plan(reader, grid, "go to the chair").waypoints
    assert (waypoint.status, waypoint.pose) == ("ambiguous", None)
    assert {thing.id for thing in waypoint.candidates} == {"chair-1", "chair-2"}
    assert all(thing.place for thing in waypoint.candidates)


def test_any_one_is_the_one_with_the_shortest_way_and_all_are_all(reader: MapReader, grid: OccupancyGrid) -> None:
    (any_one,) = plan(reader, grid, "go to a chair").waypoints
    each = [plan(reader, grid, f"go to chair-{k}").waypoints[0].length_m for k in (1, 2)]
    assert any_one.length_m == min(length for length in each if length is not None)
    both = plan(reader, grid, "visit all chairs").waypoints
    assert {waypoint.thing.id for waypoint in both if waypoint.thing} == {"chair-1", "chair-2"}


def test_a_thing_where_nobody_has_been_has_the_nearest_seen_place(reader: MapReader, grid: OccupancyGrid) -> None:
    (waypoint,) = plan(reader, grid, "go to the piano").waypoints
    assert (waypoint.status, waypoint.pose) == ("no free place", None)
    assert waypoint.nearest is not None
    assert waypoint.nearest.position[0] > 1.5
    assert "no free floor within" in waypoint.message


def test_what_the_map_does_not_know_is_said(reader: MapReader, grid: OccupancyGrid) -> None:
    (waypoint,) = plan(reader, grid, "go to the fire extinguisher").waypoints
    assert waypoint.status == "unknown"
    assert "fire extinguisher" in waypoint.message


@pytest.mark.parametrize("start", [(50.0, 50.0, 0.0), (0.0, 0.0, 0.0)], ids=["outside", "in the table"])
def test_a_start_without_free_floor_is_refused(
    reader: MapReader, grid: OccupancyGrid, start: tuple[float, float, float]
) -> None:
    robot = DrivingRobot(0.45)
    with pytest.raises(QueryError, match=r"no free floor.*--from"):
        plan(reader, grid, "go to the ball", start=start, robot=robot)


def test_a_robot_too_large_for_the_room_is_told_so(reader: MapReader, grid: OccupancyGrid) -> None:
    with pytest.raises(QueryError, match="smaller --robot-radius"):
        plan(reader, grid, "go to the ball", robot=DrivingRobot(4.0), start=(1.9, 0.0, 0.0))


@pytest.mark.parametrize(
    "text", ["bring the cup to the table", "go to how many chairs", "don't go to the ball", "", "go to"]
)
def test_what_is_no_goal_is_refused(reader: MapReader, grid: OccupancyGrid, text: str) -> None:
    with pytest.raises(QueryError):
        plan(reader, grid, text)
