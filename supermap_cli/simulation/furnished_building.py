"""A furnished building, the ways through it, and the random draws it is made from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.simulation.motion.bystanders import Bystanders, PersonMotion
from supermap_cli.simulation.motion.route_visibility import RouteVisibility
from supermap_cli.simulation.motion.routes import plan_route
from supermap_cli.simulation.rigs import SimulatedRig
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.scenario import Scenario, SimulatedTraversal
from supermap_cli.simulation.world import Fixture, Stay, World
from supermap_cli.simulation.worlds.building import CORRIDOR, make_building
from supermap_cli.simulation.worlds.furnishing import Interior, RecipeLine

MONDAY_NS = 1_767_603_600_000_000_000
"""2026-01-05 09:00 UTC."""
DAY_NS = 86_400_000_000_000
_ROUTES_DRAWN = 6  # for a second day that starts elsewhere
_OTHER_START_M = 1.0  # m between the starts of two traversals
_STILL = 0.02  # m/s below which the robot stands still

Recipes = Callable[[np.random.Generator], Mapping[str, Sequence[RecipeLine]]]


class Stream(IntEnum):
    """What is drawn at random, each from a generator of its own, so that one does not change another."""

    BUILDING = 0
    FURNITURE = 1
    CHANGES = 2
    ROUTES = 3
    PEOPLE = 4


@dataclass(frozen=True)
class RandomStreams:
    """All randomness of one attempt at a world."""

    seed: int
    attempt: int

    def of(self, stream: Stream, number: int = 0) -> np.random.Generator:
        """The generator of one stream; another `number`, other draws."""
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(stream, number, self.attempt)))


class FurnishedBuilding:
    """A furnished building, and the routes of the robot and of people in it."""

    def __init__(self, streams: RandomStreams, fixtures: tuple[Fixture, ...], interior: Interior) -> None:
        self.streams, self.fixtures, self.interior = streams, fixtures, interior

    @classmethod
    def of_recipes(cls, streams: RandomStreams, recipes: Recipes) -> FurnishedBuilding:
        """A building whose rooms hold exactly what recipes say."""
        furniture = streams.of(Stream.FURNITURE)
        by_room = recipes(furniture)
        plan, fixtures = make_building(streams.of(Stream.BUILDING), [name for name in by_room if name != CORRIDOR])
        interior = Interior(plan, fixtures)
        interior.furnish(by_room, furniture)
        return cls(streams, fixtures, interior)

    def traversal(
        self, name: str, start_ns: int, seconds: float, *, focus: Sequence[FloatArray] = (), number: int = 0
    ) -> SimulatedTraversal:
        """A traversal whose odometry starts where the robot does; another `number`, another way."""
        return starting_with(name, self.route(start_ns, seconds, focus, number))

    def route(self, start_ns: int, seconds: float, focus: Sequence[FloatArray], number: int) -> Route:
        """A way for the robot."""
        plan, obstacles, rng = self.interior.plan, self.interior.obstacles, self.streams.of(Stream.ROUTES, number)
        try:
            return plan_route(plan, obstacles, rng, start_ns=start_ns, seconds=seconds, focus=focus)
        except ValueError as error:  # whatever stands in the robot's way stands elsewhere in another world
            raise SimulationError(f"the robot cannot get about: {error}", cure="choose another --seed") from error

    def bystanders(self, traversal: SimulatedTraversal, rig: SimulatedRig, number: int = 0) -> Bystanders:
        """Those who come by on a traversal."""
        plan, obstacles = self.interior.plan, self.interior.obstacles
        camera = rig.cameras[0].model
        panoramic = isinstance(camera, EquirectangularCamera)
        view_rad = 2 * np.pi if panoramic else 2 * np.arctan(camera.width / 2 / camera.focal_px())
        route_visibility = RouteVisibility(plan, obstacles, traversal.route, float(view_rad))
        return Bystanders(plan, obstacles, route_visibility, self.streams.of(Stream.PEOPLE, number))

    def scenario(
        self,
        name: str,
        rig: SimulatedRig,
        traversals: Sequence[SimulatedTraversal],
        stays: Sequence[Stay],
        walks: Sequence[PersonMotion],
    ) -> Scenario:
        """All of it together."""
        things = (*self.interior.things, *(walk.person for walk in walks))
        motions = tuple(motion for walk in walks for motion in walk.motions)
        world = World(self.fixtures, things, tuple(stays), motions)
        return Scenario(name, self.streams.seed, self.interior.plan, world, rig, tuple(traversals))


def starting_with(name: str, route: Route) -> SimulatedTraversal:
    """A traversal whose odometry starts where the robot does."""
    return SimulatedTraversal(name, route, route.T_world_base(np.array([route.start_ns]))[0])


def traversal_from_elsewhere(
    building: FurnishedBuilding, first: SimulatedTraversal, name: str, seconds: float, focus: Sequence[FloatArray]
) -> SimulatedTraversal:
    """A traversal on the next day that starts in another place: a way whose beginning, if need be, is left out."""
    start_ns, start_xy = first.route.start_ns + DAY_NS, first.T_world_odom[:2, 3]
    for number in range(1, 1 + _ROUTES_DRAWN):
        route = building.route(start_ns, seconds, focus, number)
        left_out_s = _first_rest_s(route, start_xy)
        if left_out_s is None:
            continue
        if left_out_s > 0:
            route = _without_beginning(building.route(start_ns, seconds + left_out_s, focus, number), left_out_s)
        traversal = starting_with(name, route)
        if np.linalg.norm(traversal.T_world_odom[:2, 3] - start_xy) >= _OTHER_START_M:
            return traversal
    raise SimulationError("both traversals start in the same place", cure="choose another --seed")


def _first_rest_s(route: Route, away_from_xy: FloatArray) -> float | None:
    """When the robot first stands still somewhere else; `None` if it does not."""
    stamps_ns = route.start_ns + np.round(route.times_s * 1e9).astype(np.int64)
    still = np.linalg.norm(route.derivative(stamps_ns, 1)[:, :2], axis=1) < _STILL
    elsewhere = np.linalg.norm(route.knots_xy - away_from_xy, axis=1) >= _OTHER_START_M
    found = np.flatnonzero(still & elsewhere)
    return float(route.times_s[found[0]]) if len(found) and found[0] < len(still) - 1 else None


def _without_beginning(route: Route, left_out_s: float) -> Route:
    """The way from its knot nearest to a time on, from the old start time, for exactly as much shorter."""
    first = int(np.argmin(np.abs(route.times_s - left_out_s)))
    times_s = route.times_s[first:] - route.times_s[first]
    times_s *= (route.times_s[-1] - left_out_s) / times_s[-1]
    return Route(route.start_ns, times_s, route.knots_xy[first:], route.knots_yaw[first:])
