"""Axes of the world: rooms, density, look-alikes, furniture, materials, dwell, people, changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from supermap_cli.simulation.domains.domain import Axis, Domain, Level, usual_level
from supermap_cli.simulation.domains.world_traits import WorldTraits


def _level(text: str, change: Callable[[WorldTraits], WorldTraits]) -> Level:
    return Level(text, lambda domain: _with_world(domain, change(domain.world)))


def _with_world(domain: Domain, world: WorldTraits) -> Domain:
    return replace(domain, world=world)


def _set(text: str, **fields: Any) -> Level:
    """A level that sets fields of the world's traits."""
    return _level(text, lambda world: replace(world, **fields))


def _denser(text: str, things: tuple[int, int], on_hosts: tuple[int, int], stretch: float, longer: float) -> Level:
    """More things: rooms are wider by a factor where they have no size of their own, and visits longer."""

    def change(world: WorldTraits) -> WorldTraits:
        factor = 1.0 if world.building in {"closet", "hall"} else stretch
        return replace(world, things=things, on_hosts=on_hosts, stretch=factor, seconds=longer * world.seconds)

    return _level(text, change)


ROOM_AXIS = Axis(
    "room",
    "what rooms there are",
    "usual",
    {
        "usual": usual_level("a room of about 5 x 6 m"),
        "closet": _set("2.2 x 2.6 m, few things, 20 s",
                       building="closet", floor_m=(2.2, 2.6), things=(5, 7), on_hosts=(0, 2), seconds=20.0),
        "hall": _set("30 x 20 m, 28 to 34 things far apart, 90 s",
                     building="hall", floor_m=(30.0, 20.0), things=(28, 34), seconds=90.0),
        "two-rooms": _set("two rooms and a corridor, 24 to 30 things, 50 s",
                          building="corridor", things=(24, 30), seconds=50.0),
        "slanted": _set("turned by any angle, and one oblique wall", building="slanted"),
        "thin": _set("two rooms with a wall of 5 cm between them and things on either side of it, 45 s",
                     building="thin", floor_m=(4.2, 4.6), things=(22, 27), seconds=45.0),
        "glass": _set("a glass partition without depth, through which one sees",
                      building="glass", floor_m=(5.5, 7.0)),
    },
    of_world=True,
)  # fmt: skip

DENSITY_AXIS = Axis(
    "density",
    "how many things there are",
    "usual",
    {
        "usual": usual_level("16 to 20, or as the room says"),
        "few": _set("6", things=(6, 6), on_hosts=(0, 2)),
        "many": _denser("50, in a room a third wider, half as long again", (48, 52), (3, 7), 1.33, 1.5),
        "crowded": _denser("100 to 120: full shelves and tables, in a room 1.8 times as wide, 2.5 times as long",
                           (100, 120), (7, 14), 1.8, 2.5),
    },
    of_world=True,
)  # fmt: skip

LOOK_ALIKES_AXIS = Axis(
    "look-alikes",
    "which things look alike",
    "none",
    {
        "none": usual_level("only a table's chairs"),
        "rows": _set("6 to 12 chairs of one model in rows, 40 cm apart or less", look_alikes="rows"),
        "pairs": _set("everything has an identical twin 1 to 2 m away", look_alikes="pairs"),
        "swapped": _set("two visits: two different chairs, and two suitcases, have swapped places",
                        look_alikes="swapped"),
    },
    of_world=True,
)  # fmt: skip

FURNITURE_AXIS = Axis(
    "furniture",
    "what furniture is like",
    "usual",
    {
        "usual": usual_level("as in offices and homes"),
        "thin-legs": _set("also of rods of 2 cm: tables, chairs, stools, open frames", furniture="thin-legs"),
        "overhang": _set("also wide tops on a central foot, and an arc lamp", furniture="overhang"),
        "leaning": _set("also boards, a broom, a ladder, a picture and a suitcase that lean at walls",
                        furniture="leaning"),
        "stacked": _set("also boxes on boxes, books on books, a cup on books", furniture="stacked"),
        "nested": _set("also a bottle in a box, a bag in a basket, a bin in a bin", furniture="nested"),
        "hanging": _set("also lamps and plants from the ceiling, coats on hooks, pictures", furniture="hanging"),
    },
    of_world=True,
)  # fmt: skip

MATERIALS_AXIS = Axis(
    "materials",
    "which surfaces have no depth",
    "usual",
    {
        "usual": usual_level("none"),
        "dark": _set("every second thing is black for its greatest part, with depth in 10 % of those pixels",
                     materials="dark"),
        "glossy": _set("screens, pictures and boards have depth in half of their pixels", materials="glossy"),
        "glass": _set("also tables with a glass top, and showcases: the depth is that of what is behind",
                      materials="glass"),
    },
    of_world=True,
)  # fmt: skip

DWELL_AXIS = Axis(
    "dwell",
    "how long and from where the robot looks",
    "usual",
    {
        "usual": usual_level("a tour with stops that shows everything"),
        "turn": _set("a turn on the spot in the middle, every 15 s one", dwell="turn"),
        "pass": _level("one straight pass, half as long",
                       lambda world: replace(world, dwell="pass", seconds=world.seconds / 2)),
        "rounds": _level("three rounds: three times as long",
                         lambda world: replace(world, seconds=3 * world.seconds)),
    },
    of_world=True,
)  # fmt: skip

PEOPLE_AXIS = Axis(
    "people",
    "who is there",
    "one",
    {
        "one": usual_level("one person walks about"),
        "none": _set("nobody", walking=0),
        "standing": _set("two stand still all the time", walking=0, standing=2),
        "six": _set("three stand, three walk", walking=3, standing=3),
        "carrying": _set("one carries a thing from one place to another", walking=0, carrying=True),
    },
    of_world=True,
)

CHANGES_AXIS = Axis(
    "changes",
    "what is different on a second visit, a day later and from elsewhere",
    "none",
    {
        "none": usual_level("no second visit"),
        "appear": _set("three things are new", changes="appear"),
        "vanish": _set("three things are gone", changes="vanish"),
        "shifted-0.15": _set("three things are shifted by 0.15 m", changes="shifted", shift_m=0.15),
        "shifted-0.5": _set("three things are shifted by 0.5 m", changes="shifted", shift_m=0.5),
        "moved": _set("two things stand 2 m or more from where they stood, or as far as the room allows",
                      changes="moved"),
        "rotated": _set("three things are turned by 60 to 120 degrees where they stand, which is no change of place",
                        changes="rotated"),
        "replaced": _set("another thing of its class stands in a thing's place", changes="replaced"),
        "hidden": _set("a large new thing stands before one that is still there", changes="hidden"),
        "all": _set("one of each", changes="all"),
        "unchanged": _set("nothing", changes="unchanged"),
    },
    of_world=True,
)  # fmt: skip

WORLD_AXES: tuple[Axis, ...] = (
    ROOM_AXIS,
    DENSITY_AXIS,
    LOOK_ALIKES_AXIS,
    FURNITURE_AXIS,
    MATERIALS_AXIS,
    DWELL_AXIS,
    PEOPLE_AXIS,
    CHANGES_AXIS,
)
