"""A route: the goals of an instruction, one after the other, each as a pose to drive to or as the reason why not."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from supermap_cli.errors import QueryError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.language.instructions import MOST_GOALS, Goal, parse_instruction
from supermap_cli.memory.reading import MapReader
from supermap_cli.navigation.approach import Approach, NoApproach, find_approach, gaps_to_box_m
from supermap_cli.navigation.goals import MOST_CANDIDATES, Meant, find_meant, target_of, telling_text
from supermap_cli.navigation.grid import OccupancyGrid
from supermap_cli.navigation.observed_space import occupancy_grid
from supermap_cli.navigation.parameters import DEFAULT, ROBOT_RADIUS_M, STANDOFF_M, NavigationParameters
from supermap_cli.navigation.ways import FreeFloor, Reachable
from supermap_cli.query.answers import known_names
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.query.views import BoxView, InstanceView, Vector, box_of, vector

Status = Literal["ready", "ambiguous", "gone", "unknown", "no free place"]
"""Whether a goal has a pose: "ready"; several things fit; what fitted has gone; nothing fits; no place to stand."""
MOST_CONSIDERED = 50
"""Things, those seen last, among which the ones are chosen that are nearest by way, where any will do."""

Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class DrivingRobot:
    """Metres: the radius of the circle around the robot's base, how far from a thing it stops, and its height (`None`:
    as high as the cameras of the recordings).
    """

    radius_m: float = ROBOT_RADIUS_M
    standoff_m: float = STANDOFF_M
    height_m: float | None = None


@dataclass(frozen=True)
class PoseView:
    """A pose on the floor of the map's frame: metres, radians about z, and the same heading as a quaternion (x, y, z,
    w).
    """

    position: Vector
    yaw: float
    orientation_xyzw: Quaternion


@dataclass(frozen=True)
class GoalThing:
    """An instance that a goal means or may mean. `place` tells where it stands in words; `gone_after_ns` and
    `gone_before_ns` are the bounds of when it went, for one that has; `distance_m` is from the place of a thing that
    has gone.
    """

    id: str
    label: str
    position: Vector
    box: BoxView
    last_seen_ns: int
    place: str | None = field(default=None, metadata={"optional": True})
    gone_after_ns: int | None = field(default=None, metadata={"optional": True})
    gone_before_ns: int | None = field(default=None, metadata={"optional": True})
    distance_m: float | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class Waypoint:
    """One goal. `pose` is set where it is "ready"; `gap_m` from there to the thing, `in_sight` the share of the thing's
    points that are seen from there; `way` are the corners of the way from the pose before, `length_m` long.

    `candidates` are the things that fit an ambiguous goal, or what stands of the same name instead of what has gone;
    `nearest` is the nearest free place for a thing without one.
    """

    goal: str
    status: Status
    message: str
    notes: tuple[str, ...]
    thing: GoalThing | None
    pose: PoseView | None
    gap_m: float | None
    in_sight: float | None
    way: tuple[tuple[float, float], ...]
    length_m: float | None
    candidates: tuple[GoalThing, ...] = ()
    nearest: PoseView | None = None


@dataclass(frozen=True)
class PlannedRoute:
    """The waypoints of an instruction in the frame `map`. `complete`: all of them have a pose; `start` is the pose that
    the first way begins at; areas are in square metres.
    """

    instruction: str
    frame_id: str
    complete: bool
    start: PoseView
    robot_radius_m: float
    robot_height_m: float
    standoff_m: float
    waypoints: tuple[Waypoint, ...]
    notes: tuple[str, ...]
    free_m2: float
    unknown_m2: float
    seen_until_ns: int


def plan_route(
    reader: MapReader,
    instruction: str,
    robot: DrivingRobot | None = None,
    start: tuple[float, float, float] | None = None,
    *,
    language: str | None = None,
    grid: OccupancyGrid | None = None,
    parameters: NavigationParameters = DEFAULT,
) -> PlannedRoute:
    """Plan an instruction; `start` is x, y in metres and yaw in radians (default: where the robot was last). `grid` may
    be one that was made before from the same map.

    Raises `QueryError` for an instruction that is not understood, a map without depth images, and a start of which no
    free floor is near.
    """
    robot = robot or DrivingRobot()
    goals = parse_instruction(instruction, known_names(reader), language)
    floor = FreeFloor(grid or occupancy_grid(reader, robot.height_m, parameters), robot.radius_m, parameters)
    return _Planner(reader, floor, robot, clock_of(reader)).plan(instruction, goals, start)


def pose_near(
    reader: MapReader,
    xy: tuple[float, float],
    robot: DrivingRobot,
    start: tuple[float, float, float] | None = None,
    *,
    grid: OccupancyGrid | None = None,
    parameters: NavigationParameters = DEFAULT,
) -> PoseView:
    """The place nearest to a point (x, y) of the map that a robot can reach from `start` (as in `plan_route`), turned
    to the point. Raises `QueryError` for a start of which no free floor is near.
    """
    floor = FreeFloor(grid or occupancy_grid(reader, robot.height_m, parameters), robot.radius_m, parameters)
    planner = _Planner(reader, floor, robot, clock_of(reader))
    x, y, yaw = planner.last_pose() if start is None else start
    reachable = planner.start_at(np.array([x, y]))
    reached = np.flatnonzero(np.isfinite(reachable.cost_m))
    places = floor.grid.centers(floor.cells[reached])
    place = places[int(np.linalg.norm(places - np.array(xy), axis=1).argmin())]
    ahead = np.array(xy) - place
    turned = float(np.arctan2(ahead[1], ahead[0])) if np.linalg.norm(ahead) > floor.grid.cell_m else yaw
    return pose_view(place, turned)


@dataclass
class _Planner:
    reader: MapReader
    floor: FreeFloor
    robot: DrivingRobot
    clock: Clock
    notes: list[str] = field(default_factory=list)

    def plan(self, instruction: str, goals: tuple[Goal, ...], start: tuple[float, float, float] | None) -> PlannedRoute:
        """Every goal from the pose before."""
        x, y, yaw = self.last_pose() if start is None else start
        if self.floor.grid.cell_m > self.floor.parameters.cell_m:
            self.notes.append(f"the map is so large that cells are {self.floor.grid.cell_m:g} m wide")
        reachable, waypoints = self.start_at(np.array([x, y])), []
        for goal in goals:
            several = goal.each or goal.any_of
            meant = find_meant(self.reader, goal, MOST_CONSIDERED if several else MOST_CANDIDATES)
            for waypoint in self._waypoints(meant, reachable):
                waypoints.append(waypoint)
                if waypoint.pose is not None:
                    reachable = self._from(waypoint.pose) or reachable
        counts = self.floor.grid.counts()
        return PlannedRoute(
            instruction=instruction,
            frame_id="map",
            complete=all(waypoint.status == "ready" for waypoint in waypoints),
            start=pose_view(np.array([x, y]), yaw),
            robot_radius_m=self.robot.radius_m,
            robot_height_m=round(self.floor.grid.robot_height_m, 3),
            standoff_m=self.robot.standoff_m,
            waypoints=tuple(waypoints),
            notes=tuple(dict.fromkeys(self.notes)),
            free_m2=round(counts["free"], 2),
            unknown_m2=round(counts["unknown"], 2),
            seen_until_ns=self.reader.now_ns,
        )

    def last_pose(self) -> tuple[float, float, float]:
        """Where the robot was last: x, y (m) and yaw (rad)."""
        T = self.reader.last_pose()
        assert T is not None  # noqa: S101 - a map with a grid has a keyframe
        return float(T[0, 3]), float(T[1, 3]), float(np.arctan2(T[1, 0], T[0, 0]))

    def start_at(self, xy: FloatArray) -> Reachable:
        """The ways from a place. Raises `QueryError` where no free floor is near."""
        within_m = self.floor.parameters.start_search_m
        reachable = self.floor.from_place(xy, within_m)
        if reachable is None:
            raise QueryError(
                f"no free floor for a robot of radius {self.robot.radius_m:g} m was seen within {within_m:g} m of "
                f"({xy[0]:.2f}, {xy[1]:.2f})",
                where=self.reader.where,
                cure="give --from 'x y yaw' on floor that was seen free, a smaller --robot-radius or --robot-height",
            )
        off_m = float(np.linalg.norm(self._first(reachable) - xy))
        if off_m > self.floor.grid.cell_m:
            self.notes.append(f"the way begins {off_m:.2f} m from the start, where the floor was seen free")
        return reachable

    def _first(self, reachable: Reachable) -> FloatArray:
        return self.floor.grid.centers(self.floor.cells[int(reachable.cost_m.argmin())])

    def _from(self, pose: PoseView) -> Reachable | None:
        return self.floor.from_place(np.array(pose.position[:2]), self.floor.parameters.start_search_m)

    def _waypoints(self, meant: Meant, reachable: Reachable) -> list[Waypoint]:
        if meant.fate == "ambiguous":
            return [self._ambiguous(meant)]
        if meant.fate == "gone":
            return [self._gone(meant)]
        if meant.fate == "unknown":
            return [self._without_thing(meant, "unknown", meant.message, _things(meant.alternatives))]
        wanted = len(meant.instances) if meant.goal.each else min(meant.goal.wanted, len(meant.instances))
        left, stops = list(meant.instances), []
        for _ in range(max(1, min(wanted, len(left), MOST_GOALS))):
            chosen, waypoint = self._nearest_of(meant, left, reachable)
            left.remove(chosen)
            stops.append(waypoint)
            if waypoint.pose is not None:
                reachable = self._from(waypoint.pose) or reachable
        if wanted > len(stops) or (meant.goal.each and meant.more):
            stops[-1] = replace(stops[-1], notes=(*stops[-1].notes, f"only the first {len(stops)} of them are planned"))
        return stops

    def _nearest_of(
        self, meant: Meant, left: list[InstanceView], reachable: Reachable
    ) -> tuple[InstanceView, Waypoint]:
        """The thing among several whose place is nearest by way; one without a place last. No way is shorter than the
        straight line to the nearest place from which a robot may face the thing.
        """
        reach_m = max(self.floor.parameters.farthest_standoff_m, self._standoff_m)
        start = self._first(reachable)[None]
        at_least = [float(gaps_to_box_m(start, box_of(each.box))[0]) - reach_m for each in left]
        best: tuple[float, InstanceView, Waypoint] | None = None
        for index in np.argsort(at_least, kind="stable").tolist():
            if best is not None and best[0] <= at_least[index]:
                break
            waypoint = self._to(meant, left[index], reachable)
            length_m = math.inf if waypoint.length_m is None else waypoint.length_m
            if best is None or length_m < best[0]:
                best = length_m, left[index], waypoint
        assert best is not None  # noqa: S101 - there is one left
        return best[1], best[2]

    def _to(self, meant: Meant, instance: InstanceView, reachable: Reachable) -> Waypoint:
        found = find_approach(reachable, target_of(self.reader, instance.id, self.floor.parameters), self._standoff_m)
        thing = _thing(instance)
        goal, notes = meant.goal.text, meant.notes
        seen = f"{instance.id}, last seen {self.clock.brief(thing.last_seen_ns)}"
        if isinstance(found, NoApproach):
            nearest = None if found.nearest is None else pose_view(found.nearest.xy, found.nearest.yaw_rad)
            where = (
                ""
                if nearest is None
                else (
                    f"; the nearest free place is ({nearest.position[0]:.2f}, {nearest.position[1]:.2f}), "
                    f"{found.nearest.gap_m:.2f} m from it"
                    if found.nearest
                    else ""
                )
            )
            message = f"{seen}: {found.reason}{where}"
            return Waypoint(goal, "no free place", message, notes, thing, None, None, None, (), None, nearest=nearest)
        return self._ready(goal, seen, notes, thing, found)

    @property
    def _standoff_m(self) -> float:
        return max(self.robot.standoff_m, self.floor.needed_m)

    def _ready(self, goal: str, seen: str, notes: tuple[str, ...], thing: GoalThing, found: Approach) -> Waypoint:
        points = [(round(float(x), 3), round(float(y), 3)) for x, y in found.way.points_xy]
        return Waypoint(
            goal=goal,
            status="ready",
            message=f"{seen}: stand {found.gap_m:.2f} m before it, {found.in_sight:.0%} of it in sight",
            notes=notes,
            thing=thing,
            pose=pose_view(found.xy, found.yaw_rad),
            gap_m=round(found.gap_m, 3),
            in_sight=round(found.in_sight, 3),
            way=tuple(points),
            length_m=round(found.way.length_m, 3),
        )

    def _ambiguous(self, meant: Meant) -> Waypoint:
        things = tuple(replace(_thing(each), place=telling_text(self.reader, each)) for each in meant.instances)
        more = f", of {len(things) + meant.more} that fit" if meant.more else ""
        message = (
            f"'{meant.goal.text}' fits {', '.join(thing.id for thing in things)}{more}: "
            "name one by its id, or say 'any' or 'all'"
        )
        return self._without_thing(meant, "ambiguous", message, things)

    def _gone(self, meant: Meant) -> Waypoint:
        gone = meant.gone[0]
        last = gone.intervals[-1]
        thing = replace(_thing(gone), gone_after_ns=last.last_seen_ns, gone_before_ns=last.gone_ns)
        others = sorted(
            (replace(_thing(each), distance_m=round(_distance_m(each, gone), 3)) for each in meant.alternatives),
            key=lambda other: other.distance_m or 0.0,
        )
        x, y, z = thing.position
        when = self.clock.span(last.last_seen_ns, last.gone_ns or self.reader.now_ns)
        message = f"{gone.id} no longer stands there: it stood at ({x:.2f}, {y:.2f}, {z:.2f}) m and went {when}"
        if others:
            message += f"; the nearest that stands is {others[0].id}, {others[0].distance_m:.2f} m from there"
        return replace(self._without_thing(meant, "gone", message, tuple(others)), thing=thing)

    @staticmethod
    def _without_thing(meant: Meant, status: Status, message: str, candidates: tuple[GoalThing, ...]) -> Waypoint:
        none = None
        return Waypoint(
            meant.goal.text, status, message, meant.notes, none, none, none, none, (), none, candidates=candidates
        )


def pose_view(xy: FloatArray, yaw_rad: float) -> PoseView:
    """A pose on the floor."""
    half = yaw_rad / 2
    return PoseView(
        vector(np.array([xy[0], xy[1], 0.0])),
        round(yaw_rad, 4),
        (0.0, 0.0, round(math.sin(half), 6), round(math.cos(half), 6)),
    )


def _thing(instance: InstanceView) -> GoalThing:
    last_ns = instance.intervals[-1].last_seen_ns
    return GoalThing(instance.id, instance.label, instance.position, instance.box, last_ns)


def _things(instances: tuple[InstanceView, ...]) -> tuple[GoalThing, ...]:
    return tuple(map(_thing, instances))


def _distance_m(first: InstanceView, second: InstanceView) -> float:
    return math.dist(first.position, second.position)
