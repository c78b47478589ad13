"""The worlds that `supermap simulate` offers, each made from a name and a seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.simulation.motion.bystanders import Bystanders, PersonMotion
from supermap_cli.simulation.motion.route_visibility import RouteVisibility
from supermap_cli.simulation.motion.routes import plan_route
from supermap_cli.simulation.rigs import SimulatedRig, make_rig, panorama_rig, rgbd_rig
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.scenario import Scenario, SimulatedTraversal
from supermap_cli.simulation.world import Stay, World
from supermap_cli.simulation.worlds.building import CORRIDOR, make_building
from supermap_cli.simulation.worlds.furnishing import Interior, RecipeLine
from supermap_cli.simulation.worlds.interior_changes import ChangedInterior, change_interior, stays_with
from supermap_cli.simulation.worlds.places import PlacedPiece
from supermap_cli.simulation.worlds.room_recipes import (
    BUCKET,
    DEMO_CHANGES,
    DEMO_ROOM,
    OFFICE_CHANGES,
    ON_FLOOR_OR_WALL,
    PANORAMA_BUCKET_ROOMS,
    PANORAMA_ROOMS,
    TINY_ROOM,
    InteriorChange,
    office_recipes,
)

SCENARIOS: dict[str, str] = {
    "office": "three rooms and a corridor, 41 objects, one visit; people walk through",
    "office-twice": "the same rooms on two days: three things gone, three new, two moved by metres, one by 0.25 m",
    "panorama": "360-degree camera and LiDAR: a bag is carried; out of view a trash can vanishes, a bucket appears",
    "demo": "one room on two days, 16 objects: one gone, one new, one moved by metres, one by 0.25 m",
    "tiny": "one room, 9 objects, a few seconds; one person walks up and down",
}
"""What each scenario is, by name."""

MONDAY_NS = 1_767_603_600_000_000_000
"""2026-01-05 09:00 UTC."""
DAY_NS = 86_400_000_000_000
_ATTEMPTS = 6  # at a world that has room for everything; then the seed is given up
_ROUTES_DRAWN = 6  # for a second day that starts elsewhere
_PANORAMAS_DRAWN = 3  # routes on which the robot is to be away when something happens
_OTHER_START_M = 1.0  # m between the starts of two traversals
_STILL = 0.02  # m/s below which the robot stands still

Recipes = Callable[[np.random.Generator], Mapping[str, Sequence[RecipeLine]]]


class _Stream(IntEnum):
    """What is drawn at random, each from a generator of its own, so that one does not change another."""

    BUILDING = 0
    FURNITURE = 1
    CHANGES = 2
    ROUTES = 3
    PEOPLE = 4


@dataclass(frozen=True)
class _RandomStreams:
    """All randomness of one attempt at a world."""

    seed: int
    attempt: int

    def of(self, stream: _Stream, number: int = 0) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(stream, number, self.attempt)))


class _FurnishedBuilding:
    """A furnished building, and the routes of the robot and of people in it."""

    def __init__(self, streams: _RandomStreams, recipes: Recipes) -> None:
        self.streams = streams
        furniture = streams.of(_Stream.FURNITURE)
        by_room = recipes(furniture)
        plan, self.fixtures = make_building(
            streams.of(_Stream.BUILDING), [name for name in by_room if name != CORRIDOR]
        )
        self.interior = Interior(plan, self.fixtures)
        self.interior.furnish(by_room, furniture)

    def traversal(
        self, name: str, start_ns: int, seconds: float, *, focus: Sequence[FloatArray] = (), number: int = 0
    ) -> SimulatedTraversal:
        """A traversal whose odometry starts where the robot does; another `number`, another way."""
        return _starting_with(name, self.route(start_ns, seconds, focus, number))

    def route(self, start_ns: int, seconds: float, focus: Sequence[FloatArray], number: int) -> Route:
        """A way for the robot."""
        plan, obstacles, rng = self.interior.plan, self.interior.obstacles, self.streams.of(_Stream.ROUTES, number)
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
        return Bystanders(plan, obstacles, route_visibility, self.streams.of(_Stream.PEOPLE, number))

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


def make_scenario(name: str, seed: int, *, seconds: float | None = None, rig: str | None = None) -> Scenario:
    """The scenario of a name, the same for the same seed; its traversals last `seconds` each (default: its own length).

    `rig` names another rig of `rigs.RIGS` than the scenario's own. World and drive stay the same whatever the rig, so
    that maps of different rigs can be compared.

    Raises `SimulationError` for an unknown name or rig, a negative seed, or a time too short for what should happen.
    """
    other_rig = None if rig is None else make_rig(rig)
    if name not in _MAKERS:
        raise SimulationError(f"there is no scenario {name!r}", cure=f"choose one of {', '.join(SCENARIOS)}")
    if seed < 0:
        raise SimulationError(f"a seed is not negative: {seed}", cure="choose a --seed of 0 or more")
    if seconds is not None and seconds <= 0:
        raise SimulationError(f"a traversal takes time, not {seconds} s", cure="choose --seconds above 0")
    scenario = _drawn(*_MAKERS[name], seed, seconds)
    return scenario if other_rig is None else replace(scenario, rig=other_rig)


def _drawn(maker: Maker, usual_s: float, seed: int, seconds: float | None) -> Scenario:
    """The first attempt at a world that has room for all that should be in it, and a route through it."""
    for attempt in range(_ATTEMPTS - 1):
        with suppress(SimulationError):
            return maker(_RandomStreams(seed, attempt), seconds or usual_s)
    return maker(_RandomStreams(seed, _ATTEMPTS - 1), seconds or usual_s)


def _office(streams: _RandomStreams, seconds: float) -> Scenario:
    building, rig = _FurnishedBuilding(streams, office_recipes), rgbd_rig()
    traversal = building.traversal("office", MONDAY_NS, seconds)
    bystanders = building.bystanders(traversal, rig)
    people = [bystanders.pass_through(f"person-{number}") for number in (1, 2)]
    return building.scenario("office", rig, [traversal], stays_with(building.interior, ChangedInterior(), None), people)


def _office_twice(streams: _RandomStreams, seconds: float) -> Scenario:
    return _twice(
        "office-twice", _FurnishedBuilding(streams, office_recipes), OFFICE_CHANGES, seconds, with_people=True
    )


def _demo(streams: _RandomStreams, seconds: float) -> Scenario:
    return _twice(
        "demo", _FurnishedBuilding(streams, lambda _: {"office": DEMO_ROOM}), DEMO_CHANGES, seconds, with_people=False
    )


def _twice(
    name: str, building: _FurnishedBuilding, changes: Sequence[InteriorChange], seconds: float, *, with_people: bool
) -> Scenario:
    """Two traversals a day apart, and the changes half way between them."""
    rig = rgbd_rig()
    changed = change_interior(building.interior, changes, building.streams.of(_Stream.CHANGES))
    focus = changed.places_xy(building.interior)
    monday = building.traversal("monday", MONDAY_NS, seconds, focus=focus)
    tuesday = _from_elsewhere(building, monday, "tuesday", seconds, focus)
    change_ns = (monday.route.end_ns + tuesday.route.start_ns) // 2
    traversals = [monday, tuesday]
    people = [
        building.bystanders(traversal, rig, number).pass_through(f"person-{number}")
        for number, traversal in enumerate(traversals if with_people else [], start=1)
    ]
    return building.scenario(name, rig, traversals, stays_with(building.interior, changed, change_ns), people)


def _from_elsewhere(
    building: _FurnishedBuilding, first: SimulatedTraversal, name: str, seconds: float, focus: Sequence[FloatArray]
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
        traversal = _starting_with(name, route)
        if np.linalg.norm(traversal.T_world_odom[:2, 3] - start_xy) >= _OTHER_START_M:
            return traversal
    raise SimulationError("both traversals start in the same place", cure="choose another --seed")


def _starting_with(name: str, route: Route) -> SimulatedTraversal:
    return SimulatedTraversal(name, route, route.T_world_base(np.array([route.start_ns]))[0])


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


def _panorama(streams: _RandomStreams, seconds: float) -> Scenario:
    """Someone carries the backpack elsewhere in its room; while the robot is somewhere else, a trash can goes and a
    bucket comes. The places of all of them are free before and after.
    """
    building = _FurnishedBuilding(streams, lambda _: PANORAMA_ROOMS)
    interior = building.interior
    bag = next(placed for placed in interior.placed if placed.piece.label == "backpack")
    interior.another_place(bag, ON_FLOOR_OR_WALL, bag.room, streams.of(_Stream.CHANGES), at_least_m=1.8)
    arriving = streams.of(_Stream.CHANGES, 1)
    for room in PANORAMA_BUCKET_ROOMS:
        interior.add(BUCKET, room, arriving)
    for number in range(_PANORAMAS_DRAWN - 1):
        with suppress(SimulationError):  # on this way the robot is not where it should be when things happen
            return _panorama_on_a_way(building, seconds, number)
    return _panorama_on_a_way(building, seconds, _PANORAMAS_DRAWN - 1)


def _panorama_on_a_way(building: _FurnishedBuilding, seconds: float, number: int) -> Scenario:
    """What happens while the robot takes one of its ways."""
    interior, rig = building.interior, panorama_rig()
    (bag, bag_after), bins, buckets = (
        [placed for placed in interior.placed if placed.piece.label == label]
        for label in ("backpack", "trash can", "bucket")
    )
    focus = [placed.T_world_thing[:2, 3] for placed in (bag, bag_after, *bins)]
    traversal = building.traversal("panorama", MONDAY_NS, seconds, focus=focus, number=number)
    bystanders = building.bystanders(traversal, rig, number)
    vanishing, vanished_ns = _unobserved(bins, bystanders.route_visibility)
    appearing, appeared_ns = _unobserved(buckets, bystanders.route_visibility)
    carrying = bystanders.carry("person-1", interior.thing(bag.thing_id), bag.T_world_thing, bag_after.T_world_thing)
    walking = bystanders.pass_through("person-2")
    taken_ns, put_ns = carrying.carried_between_ns
    special = (bag.thing_id, vanishing.thing_id, appearing.thing_id)
    stays = [
        *(stay for stay in stays_with(interior, ChangedInterior(), None) if stay.thing_id not in special),
        Stay(bag.thing_id, bag.T_world_thing, until_ns=taken_ns),
        Stay(bag.thing_id, bag_after.T_world_thing, since_ns=put_ns),
        Stay(vanishing.thing_id, vanishing.T_world_thing, until_ns=vanished_ns),
        Stay(appearing.thing_id, appearing.T_world_thing, since_ns=appeared_ns),
    ]
    return building.scenario("panorama", rig, [traversal], stays, [carrying, walking])


def _unobserved(things: Sequence[PlacedPiece], route_visibility: RouteVisibility) -> tuple[PlacedPiece, int]:
    """The first of these whose place the robot sees, loses from view and sees again, and the middle of meanwhile."""
    for placed in things[:-1]:
        with suppress(SimulationError):
            return placed, route_visibility.unobserved_ns(placed.T_world_thing[:2, 3])
    return things[-1], route_visibility.unobserved_ns(things[-1].T_world_thing[:2, 3])


def _tiny(streams: _RandomStreams, seconds: float) -> Scenario:
    building, rig = _FurnishedBuilding(streams, lambda _: {"office": TINY_ROOM}), rgbd_rig()
    table = building.interior.placed[0].T_world_thing[:2, 3]
    traversal = building.traversal("tiny", MONDAY_NS, seconds, focus=[table])
    person = building.bystanders(traversal, rig).pass_through("person-1")
    return building.scenario("tiny", rig, [traversal], stays_with(building.interior, ChangedInterior(), None), [person])


Maker = Callable[[_RandomStreams, float], Scenario]
"""Makes a scenario whose traversals last so many seconds."""

_MAKERS: Mapping[str, tuple[Maker, float]] = {
    "office": (_office, 100.0),
    "office-twice": (_office_twice, 110.0),
    "panorama": (_panorama, 70.0),
    "demo": (_demo, 20.0),
    "tiny": (_tiny, 4.0),
}
