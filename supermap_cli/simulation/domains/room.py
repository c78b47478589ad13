"""The scenario `room`: a world made from a domain."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.simulation.domains.domain import Domain
from supermap_cli.simulation.domains.room_interior import RoomInterior, make_interior
from supermap_cli.simulation.domains.world_traits import WorldTraits
from supermap_cli.simulation.furnished_building import (
    DAY_NS,
    MONDAY_NS,
    FurnishedBuilding,
    RandomStreams,
    Stream,
    starting_with,
    traversal_from_elsewhere,
)
from supermap_cli.simulation.motion.bystanders import PersonMotion
from supermap_cli.simulation.motion.company import Company
from supermap_cli.simulation.motion.dwells import straight_pass, turn_on_the_spot
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.scenario import Scenario, SimulatedTraversal
from supermap_cli.simulation.turned import turned
from supermap_cli.simulation.world import Stay
from supermap_cli.simulation.worlds.interior_changes import ChangedInterior, stays_with
from supermap_cli.simulation.worlds.look_alikes import swap
from supermap_cli.simulation.worlds.places import PlacedPiece
from supermap_cli.simulation.worlds.random_changes import RandomChanges, with_moved
from supermap_cli.simulation.worlds.room_recipes import ON_FLOOR_OR_WALL
from supermap_cli.simulation.worlds.shapes.materials import between

_SLANT_DEG = (12.0, 78.0)  # degrees between the walls of a slanted building and the world's axes
_CARRIED_M = (1.8, 1.2, 0.8, 0.5)  # m that a thing is carried at least: the first that the room allows
_CARRIED_LABELS = frozenset({"backpack", "suitcase", "cardboard box", "bucket", "trash can", "handbag", "stool"})
_SWAPPED_LABELS = ("chair", "suitcase")


def make_room(streams: RandomStreams, domain: Domain, seconds: float) -> Scenario:
    """A furnished room and the visits to it. Raises `SimulationError` where this attempt leaves no room for it."""
    traits = domain.world
    made = make_interior(streams, traits)
    building = FurnishedBuilding(streams, made.fixtures, made.interior)
    rng = streams.of(Stream.CHANGES)
    fetched = _fetched(made, rng) if traits.carrying else None
    changed = _changed(made, traits, rng, fetched)
    traversals = _visits(building, traits, seconds, changed)
    companies = [_company(building, traits, made, visit, number) for number, visit in enumerate(traversals)]
    carrying = _carried(companies[0], made, fetched) if fetched is not None else None
    change_ns = (traversals[0].route.end_ns + traversals[-1].route.start_ns) // 2
    stays = list(stays_with(made.interior, changed, change_ns if len(traversals) > 1 else None))
    if fetched is not None:
        stays = [stay for stay in stays if stay.thing_id != fetched.before.thing_id] + _stays_of(fetched, carrying)
    walks = [walk for company in companies for walk in company.people]
    scenario = building.scenario("room", domain.rig, traversals, stays, walks)
    if traits.building == "slanted":
        return turned(scenario, np.radians(between(streams.of(Stream.BUILDING, 1), *_SLANT_DEG)))
    return scenario


@dataclass(frozen=True)
class _Fetched:
    """A thing that someone carries from one place to another."""

    before: PlacedPiece
    after: PlacedPiece


def _fetched(made: RoomInterior, rng: np.random.Generator) -> _Fetched | None:
    """A thing on the floor that holds nothing, and where it is brought to; none where the room is too full."""
    hosts = {placed.on for placed in made.interior.placed}
    loose = [
        placed
        for placed in made.interior.placed
        if placed.thing_id not in hosts and placed.on is None and placed.T_world_thing[2, 3] == 0
        and placed.piece.label in _CARRIED_LABELS and placed.name != "row"
    ]  # fmt: skip
    for at_least_m in _CARRIED_M:
        for k in rng.permutation(len(loose)):
            for _ in range(4):
                room = str(rng.choice(list(made.rooms)))
                after = made.interior.try_another_place(loose[k], ON_FLOOR_OR_WALL, room, rng, at_least_m=at_least_m)
                if after is not None:
                    return _Fetched(loose[k], after)
    return None


def _changed(
    made: RoomInterior, traits: WorldTraits, rng: np.random.Generator, fetched: _Fetched | None
) -> ChangedInterior:
    """What is different on the second visit, if there is one."""
    swapped = [
        thing_id
        for label in (_SWAPPED_LABELS if traits.look_alikes == "swapped" else ())
        for thing_id in swap(made.interior, str(rng.choice(list(made.rooms))), label, rng)
    ]
    if traits.changes in {"none", "unchanged"}:
        return ChangedInterior(moved=frozenset(swapped))
    taken = frozenset(swapped) | ({fetched.before.thing_id} if fetched is not None else frozenset())
    changes = RandomChanges(made.interior, made.rooms, rng, taken)
    changes.make(traits.changes, traits.shift_m)
    return with_moved(changes.changed, swapped)


def _visits(
    building: FurnishedBuilding, traits: WorldTraits, seconds: float, changed: ChangedInterior
) -> list[SimulatedTraversal]:
    """One visit, or two on two days, the second from elsewhere where the room allows that."""
    focus = changed.places_xy(building.interior)
    twice = traits.changes != "none" or traits.look_alikes == "swapped"
    names = ("visit-1", "visit-2")
    if traits.dwell == "usual":
        first = building.traversal(names[0], MONDAY_NS, seconds, focus=focus)
        if not twice:
            return [first]
        with suppress(SimulationError):
            return [first, traversal_from_elsewhere(building, first, names[1], seconds, focus)]
        return [first, building.traversal(names[1], MONDAY_NS + DAY_NS, seconds, focus=focus, number=1)]
    planner = turn_on_the_spot if traits.dwell == "turn" else straight_pass
    visits: list[SimulatedTraversal] = []
    for number in range(2 if twice else 1):
        before_xy = visits[0].T_world_odom[:2, 3] if visits else None
        route = _planned(building, planner, MONDAY_NS + number * DAY_NS, seconds, before_xy)
        visits.append(starting_with(names[number], route))
    return visits


def _planned(
    building: FurnishedBuilding,
    planner: Callable[..., Route],
    start_ns: int,
    seconds: float,
    before_xy: FloatArray | None,
) -> Route:
    interior, rng = building.interior, building.streams.of(Stream.ROUTES, int(before_xy is not None))
    try:
        return planner(interior.plan, interior.obstacles, rng, start_ns, seconds, before_xy)
    except ValueError as error:
        raise SimulationError(f"the robot cannot get about: {error}", cure="choose another --seed") from error


def _company(
    building: FurnishedBuilding, traits: WorldTraits, made: RoomInterior, visit: SimulatedTraversal, number: int
) -> Company:
    """Those who stand and walk about on a visit; fewer where they would be in the way."""
    rng = building.streams.of(Stream.PEOPLE, number)
    company = Company(made.interior.plan, made.interior.obstacles, visit.route, rng)
    people = iter(range(1 + 100 * number, 100 + 100 * number))
    for xy in made.standing_xy:
        company.stand(f"person-{next(people)}", xy)
    for _ in range(traits.walking):
        company.walk(f"person-{next(people)}")
    return company


def _carried(company: Company, made: RoomInterior, fetched: _Fetched) -> PersonMotion | None:
    """The carrying, on the first visit; who cannot keep out of the robot's way with it only walks about."""
    thing = made.interior.thing(fetched.before.thing_id)
    carrying = company.carry("person-99", thing, fetched.before.T_world_thing, fetched.after.T_world_thing)
    if carrying is None:
        company.walk("person-99")
    return carrying


def _stays_of(fetched: _Fetched, carrying: PersonMotion | None) -> list[Stay]:
    """Where the thing stands before and after it is carried, or all the time."""
    stay = Stay(fetched.before.thing_id, fetched.before.T_world_thing)
    if carrying is None:
        return [stay]
    taken_ns, put_ns = carrying.carried_between_ns
    return [
        replace(stay, until_ns=taken_ns),
        Stay(stay.thing_id, fetched.after.T_world_thing, since_ns=put_ns, on=fetched.after.on),
    ]
