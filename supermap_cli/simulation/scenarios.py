"""The worlds that `supermap simulate` offers, each made from a name and a seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

from supermap_cli.errors import SimulationError
from supermap_cli.simulation.domains.axes import AXES, apply_levels
from supermap_cli.simulation.domains.domain import Domain
from supermap_cli.simulation.domains.room import make_room
from supermap_cli.simulation.furnished_building import (
    DAY_NS,
    MONDAY_NS,
    FurnishedBuilding,
    RandomStreams,
    Stream,
    traversal_from_elsewhere,
)
from supermap_cli.simulation.motion.route_visibility import RouteVisibility
from supermap_cli.simulation.rigs import make_rig, panorama_rig, rgbd_rig, small_rgbd_rig
from supermap_cli.simulation.scenario import Scenario
from supermap_cli.simulation.world import Stay
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

__all__ = ["DAY_NS", "MONDAY_NS", "SCENARIOS", "make_scenario"]

SCENARIOS: dict[str, str] = {
    "office": "three rooms and a corridor, 41 objects, one visit; people walk through",
    "office-twice": "the same rooms on two days: three things gone, three new, two moved by metres, one by 0.25 m",
    "panorama": "360-degree camera and LiDAR: a bag is carried; out of view a trash can vanishes, a bucket appears",
    "demo": "one room on two days, 16 objects: one gone, one new, one moved by metres, one by 0.25 m",
    "tiny": "one room, 9 objects, a few seconds; one person walks up and down",
    "room": "one room of which --domain may vary everything",
}
"""What each scenario is, by name."""

ROOM = "room"
"""The scenario whose world is made from a domain."""

_ATTEMPTS = 6  # at a world that has room for everything; then the seed is given up
_PANORAMAS_DRAWN = 3  # routes on which the robot is to be away when something happens


def make_scenario(
    name: str,
    seed: int,
    *,
    seconds: float | None = None,
    rig: str | None = None,
    levels: Mapping[str, str] | None = None,
) -> Scenario:
    """The scenario of a name, the same for the same seed; its traversals last `seconds` each (default: its own length).

    `rig` names another rig of `rigs.RIGS` than the scenario's own. World and drive stay the same whatever the rig, so
    that maps of different rigs can be compared. `levels` (axis -> level, see `domains.axes`) varies the rig, the
    detector and, of the scenario `room`, the world.

    Raises `SimulationError` for an unknown name, rig or level, a negative seed, a time too short for what should
    happen, or a level of the world for a scenario whose world is fixed.
    """
    other_rig = None if rig is None else make_rig(rig)
    if name not in SCENARIOS:
        raise SimulationError(f"there is no scenario {name!r}", cure=f"choose one of {', '.join(SCENARIOS)}")
    if seed < 0:
        raise SimulationError(f"a seed is not negative: {seed}", cure="choose a --seed of 0 or more")
    if seconds is not None and seconds <= 0:
        raise SimulationError(f"a traversal takes time, not {seconds} s", cure="choose --seconds above 0")
    levels = dict(levels or {})
    if name == ROOM:
        domain = apply_levels(Domain(other_rig or small_rgbd_rig()), levels)
        made = _drawn(
            lambda streams, length_s: make_room(streams, domain, length_s), domain.world.seconds, seed, seconds
        )
        return _in_domain(made, domain, levels)
    if fixed := [axis for axis in levels if AXES[axis].of_world]:
        cure = f"vary the scenario {ROOM}"
        raise SimulationError(f"the world of {name} is fixed: --domain {fixed[0]} cannot change it", cure=cure)
    made = _drawn(*_MAKERS[name], seed, seconds)
    domain = apply_levels(Domain(other_rig or made.rig), levels)
    return _in_domain(made, domain, levels)


def _in_domain(made: Scenario, domain: Domain, levels: Mapping[str, str]) -> Scenario:
    """The scenario with the robot and the detector of a domain; a robot that is carried sways on its way."""
    carried_m, traversals = domain.rig.carried_m, made.traversals
    if carried_m is not None:
        traversals = tuple(
            traversal.carried(carried_m, (made.seed, number)) for number, traversal in enumerate(traversals)
        )
    return replace(made, rig=domain.rig, errors=domain.errors, traversals=traversals, levels=levels)


def _drawn(maker: Maker, usual_s: float, seed: int, seconds: float | None) -> Scenario:
    """The first attempt at a world that has room for all that should be in it, and a route through it."""
    for attempt in range(_ATTEMPTS - 1):
        with suppress(SimulationError):
            return maker(RandomStreams(seed, attempt), seconds or usual_s)
    return maker(RandomStreams(seed, _ATTEMPTS - 1), seconds or usual_s)


def _office(streams: RandomStreams, seconds: float) -> Scenario:
    building, rig = FurnishedBuilding.of_recipes(streams, office_recipes), rgbd_rig()
    traversal = building.traversal("office", MONDAY_NS, seconds)
    bystanders = building.bystanders(traversal, rig)
    people = [bystanders.pass_through(f"person-{number}") for number in (1, 2)]
    return building.scenario("office", rig, [traversal], stays_with(building.interior, ChangedInterior(), None), people)


def _office_twice(streams: RandomStreams, seconds: float) -> Scenario:
    return _twice(
        "office-twice", FurnishedBuilding.of_recipes(streams, office_recipes), OFFICE_CHANGES, seconds, with_people=True
    )


def _demo(streams: RandomStreams, seconds: float) -> Scenario:
    return _twice(
        "demo",
        FurnishedBuilding.of_recipes(streams, lambda _: {"office": DEMO_ROOM}),
        DEMO_CHANGES,
        seconds,
        with_people=False,
    )


def _twice(
    name: str, building: FurnishedBuilding, changes: Sequence[InteriorChange], seconds: float, *, with_people: bool
) -> Scenario:
    """Two traversals a day apart, and the changes half way between them."""
    rig = rgbd_rig()
    changed = change_interior(building.interior, changes, building.streams.of(Stream.CHANGES))
    focus = changed.places_xy(building.interior)
    monday = building.traversal("monday", MONDAY_NS, seconds, focus=focus)
    tuesday = traversal_from_elsewhere(building, monday, "tuesday", seconds, focus)
    change_ns = (monday.route.end_ns + tuesday.route.start_ns) // 2
    traversals = [monday, tuesday]
    people = [
        building.bystanders(traversal, rig, number).pass_through(f"person-{number}")
        for number, traversal in enumerate(traversals if with_people else [], start=1)
    ]
    return building.scenario(name, rig, traversals, stays_with(building.interior, changed, change_ns), people)


def _panorama(streams: RandomStreams, seconds: float) -> Scenario:
    """Someone carries the backpack elsewhere in its room; while the robot is somewhere else, a trash can goes and a
    bucket comes. The places of all of them are free before and after.
    """
    building = FurnishedBuilding.of_recipes(streams, lambda _: PANORAMA_ROOMS)
    interior = building.interior
    bag = next(placed for placed in interior.placed if placed.piece.label == "backpack")
    interior.another_place(bag, ON_FLOOR_OR_WALL, bag.room, streams.of(Stream.CHANGES), at_least_m=1.8)
    arriving = streams.of(Stream.CHANGES, 1)
    for room in PANORAMA_BUCKET_ROOMS:
        interior.add(BUCKET, room, arriving)
    for number in range(_PANORAMAS_DRAWN - 1):
        with suppress(SimulationError):  # on this way the robot is not where it should be when things happen
            return _panorama_on_a_way(building, seconds, number)
    return _panorama_on_a_way(building, seconds, _PANORAMAS_DRAWN - 1)


def _panorama_on_a_way(building: FurnishedBuilding, seconds: float, number: int) -> Scenario:
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


def _tiny(streams: RandomStreams, seconds: float) -> Scenario:
    building, rig = FurnishedBuilding.of_recipes(streams, lambda _: {"office": TINY_ROOM}), rgbd_rig()
    table = building.interior.placed[0].T_world_thing[:2, 3]
    traversal = building.traversal("tiny", MONDAY_NS, seconds, focus=[table])
    person = building.bystanders(traversal, rig).pass_through("person-1")
    return building.scenario("tiny", rig, [traversal], stays_with(building.interior, ChangedInterior(), None), [person])


Maker = Callable[[RandomStreams, float], Scenario]
"""Makes a scenario whose traversals last so many seconds."""

_MAKERS: Mapping[str, tuple[Maker, float]] = {
    "office": (_office, 100.0),
    "office-twice": (_office_twice, 110.0),
    "panorama": (_panorama, 70.0),
    "demo": (_demo, 20.0),
    "tiny": (_tiny, 4.0),
}
