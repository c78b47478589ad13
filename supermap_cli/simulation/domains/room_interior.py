"""The furnished rooms of the scenario `room`, before anything changes and anyone comes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.domains.world_traits import WorldTraits
from supermap_cli.simulation.furnished_building import RandomStreams, Stream
from supermap_cli.simulation.world import Fixture
from supermap_cli.simulation.worlds.building import make_building
from supermap_cli.simulation.worlds.finishes import Finish
from supermap_cli.simulation.worlds.furnishing import Interior, RecipeLine
from supermap_cli.simulation.worlds.layouts import (
    BareBuilding,
    cut_room,
    facing_sides,
    glass_parted_room,
    one_room,
    thin_walled_rooms,
)
from supermap_cli.simulation.worlds.look_alikes import place_rows, twin_all
from supermap_cli.simulation.worlds.places import AlongWall, Hung
from supermap_cli.simulation.worlds.random_changes import NEEDED
from supermap_cli.simulation.worlds.random_furnishing import furnish_at_random
from supermap_cli.simulation.worlds.random_recipes import STYLED, Group, one_of
from supermap_cli.simulation.worlds.shapes.materials import pick

_ROOMS = ("first room", "second room")
_STYLED_GROUPS = 6  # groups of things, a third of a room, chosen: that a level of the axis `furniture` asks for
_GLAZED_GROUPS = 3  # groups, chosen: the same of the axis `materials`
_FEWER_AN_ATTEMPT = 0.15  # share of the things left out, chosen, so that a later attempt is easier
_PERSON_M = (0.55, 0.55, 1.8)  # m, the room that a standing person needs
_STANDS_DRAWN = 60  # tries at a place for a person; bounds the time
_TWIN_ROUNDS = 4  # rounds in which twins look for a place; bounds the time
_LEAST_THINGS = 2  # things that even the last attempt has: with fewer there is nothing to map
_SHARE_BESIDE_ROWS = 0.6  # share of the things that a room holds without rows (chosen): rows take up the floor


@dataclass(frozen=True)
class RoomInterior:
    """What was made: the building's surfaces, what stands in it, the names of its furnished rooms, and the points (2,)
    where people stand.
    """

    fixtures: tuple[Fixture, ...]
    interior: Interior
    rooms: tuple[str, ...]
    standing_xy: tuple[FloatArray, ...]


def make_interior(streams: RandomStreams, traits: WorldTraits) -> RoomInterior:
    """Furnish the rooms that a world has. Raises `SimulationError` where next to nothing finds a place."""
    bare, rooms = _bare_building(streams.of(Stream.BUILDING), traits)
    finish = Finish(traits.materials) if traits.materials in {"dark", "glossy"} else None
    interior = Interior(bare.plan, bare.fixtures, bare.barriers, finish)
    rng = streams.of(Stream.FURNITURE)
    standing = _standing_places(interior, rooms, traits.standing, streams.of(Stream.PEOPLE, 50))
    wanted = int(rng.integers(traits.things[0], traits.things[1] + 1))
    wanted = max(_LEAST_THINGS, round(wanted * (1 - _FEWER_AN_ATTEMPT * streams.attempt)))
    if traits.building == "thin":
        _furnish_both_sides(interior, rooms, rng)
    if traits.look_alikes == "rows":
        place_rows(interior, max(rooms, key=lambda name: _area_m2(interior, name)), rng)
        wanted = len(interior.placed) + max(_LEAST_THINGS, round(_SHARE_BESIDE_ROWS * wanted))
    first = _asked_for(traits, rng)
    if traits.look_alikes == "pairs":
        _furnish_in_pairs(interior, rooms, wanted, first=first, on_hosts=traits.on_hosts, rng=rng)
    else:
        furnish_at_random(interior, rooms, wanted, traits.on_hosts, rng, first=first)
    if len(interior.placed) < min(wanted, _LEAST_THINGS):
        raise SimulationError("the room has no place for its things", cure="choose another --seed")
    return RoomInterior(bare.fixtures, interior, rooms, standing)


def _bare_building(rng: np.random.Generator, traits: WorldTraits) -> tuple[BareBuilding, tuple[str, ...]]:
    sides = [side * traits.stretch for side in traits.floor_m]
    if traits.building == "corridor":
        plan, fixtures = make_building(rng, _ROOMS)
        return BareBuilding(plan, fixtures), tuple(room.name for room in plan.rooms)
    if traits.building == "thin":
        return thin_walled_rooms(rng, _ROOMS, sides), _ROOMS
    make = {"glass": glass_parted_room, "slanted": cut_room}.get(traits.building, one_room)
    return make(rng, "room", sides), ("room",)


def _asked_for(traits: WorldTraits, rng: np.random.Generator) -> list[Group]:
    """The groups that levels ask for, each at least once."""
    groups = list(NEEDED.get(traits.changes, ()))
    if traits.carrying:
        groups.append(one_of(pick(rng, ("backpack", "suitcase")), "", AlongWall()))
    for kind, count in ((traits.furniture, _STYLED_GROUPS), (traits.materials, _GLAZED_GROUPS)):
        styled = STYLED.get(kind, ())
        groups += [styled[k % len(styled)] for k in range(count)] if styled else []
    return groups


def _furnish_in_pairs(
    interior: Interior,
    rooms: tuple[str, ...],
    wanted: int,
    *,
    first: list[Group],
    on_hosts: tuple[int, int],
    rng: np.random.Generator,
) -> None:
    """Half as many things, and a twin of each; what lost its twin's place is drawn anew."""
    for number in range(_TWIN_ROUNDS):
        before = len(interior.placed)
        more = (wanted - before) // 2
        if more > 0:
            furnish_at_random(interior, rooms, before + more, on_hosts, rng, first=first if number == 0 else ())
            twin_all(interior, interior.placed[before:], rng)


def _furnish_both_sides(interior: Interior, rooms: tuple[str, ...], rng: np.random.Generator) -> None:
    """Furniture and pictures on either side of the wall between two rooms."""
    for room, side in zip(rooms, facing_sides(interior.plan, *rooms), strict=True):
        label = pick(rng, ("cabinet", "bookshelf", "desk", "couch"))
        lines = [
            RecipeLine(label, AlongWall(side=side)),
            RecipeLine(pick(rng, ("chair", "suitcase", "trash can")), AlongWall(side=side)),
            RecipeLine("painting", Hung((1.2, 1.5), side=side)),
        ]
        for line in lines:
            interior.place(line, room, rng)


def _standing_places(
    interior: Interior, rooms: tuple[str, ...], count: int, rng: np.random.Generator
) -> tuple[FloatArray, ...]:
    """Where people stand, their places kept free from now on; fewer where they would be in the way."""
    places: list[FloatArray] = []
    size = np.array(_PERSON_M)
    for _ in range(_STANDS_DRAWN if count else 0):
        room = interior.plan.room(str(rng.choice(list(rooms))))
        reach = size[:2] / 2 + 0.1
        xy = rng.uniform(room.low + reach, room.high - reach)
        if interior.bar(Box3D(np.array([*xy, size[2] / 2]), size, 0.0), room.name):
            places.append(xy)
        if len(places) == count:
            break
    return tuple(places)


def _area_m2(interior: Interior, name: str) -> float:
    room = interior.plan.room(name)
    return float(np.prod(room.high - room.low))
