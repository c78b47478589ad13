"""What stands where: the recipes of all rooms, and of what changes between two traversals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.simulation.worlds.building import CORRIDOR
from supermap_cli.simulation.worlds.furnishing import RecipeLine
from supermap_cli.simulation.worlds.places import AlongWall, AnyOf, At, Beside, Hung, Inside, On, OnFloor, Place, Under

ON_FLOOR_OR_WALL = AnyOf((AlongWall(), OnFloor()))
_SCREEN_Y, _KEYS_Y = (0.45, 0.95), (-0.8, -0.55)  # shares of a desk from its front (-1) to its back (1)

OFFICE = (
    RecipeLine("desk", AlongWall(), name="first desk"),
    RecipeLine("desk", AlongWall(), name="second desk"),
    RecipeLine("bookshelf", AlongWall()),
    RecipeLine("whiteboard", Hung((0.85, 1.0)), model="board"),
    RecipeLine("monitor", On("first desk", x=(-0.3, 0.3), y=_SCREEN_Y)),
    RecipeLine("keyboard", On("first desk", x=(-0.25, 0.1), y=_KEYS_Y, turn_deg=4)),
    RecipeLine("mouse", On("first desk", x=(0.35, 0.6), y=_KEYS_Y)),
    RecipeLine("mug", On("first desk", y=(-0.7, 0.6), turn_deg=180)),
    RecipeLine("laptop", On("second desk", x=(-0.35, 0.35), y=(-0.8, -0.2))),
    RecipeLine("chair", At("first desk", "front"), model="office"),
    RecipeLine("chair", At("second desk", "front"), model="office"),
    RecipeLine("trash can", Under("second desk"), model="bin"),
    RecipeLine("book", Inside("bookshelf"), count=2),
    RecipeLine("potted plant", AlongWall(corner=True)),
)
MEETING_ROOM = (
    RecipeLine("table", OnFloor(from_wall_m=0.4)),
    RecipeLine("cabinet", AlongWall()),
    RecipeLine("tv", Hung((1.1, 1.3))),
    RecipeLine("whiteboard", Hung((0.85, 1.0)), model="board"),
    RecipeLine("chair", At("table"), count=4, model="meeting"),
    RecipeLine("vase", On("cabinet", turn_deg=180)),
    RecipeLine("backpack", AnyOf((Beside("cabinet"), AlongWall()))),
)
KITCHEN = (
    RecipeLine("couch", AlongWall()),
    RecipeLine("refrigerator", AlongWall()),
    RecipeLine("cabinet", AlongWall()),
    RecipeLine("microwave", On("cabinet", turn_deg=3)),
    RecipeLine("lamp", Beside("couch")),
    RecipeLine("armchair", OnFloor(from_wall_m=0.0)),
    RecipeLine("stool", ON_FLOOR_OR_WALL),
    RecipeLine("suitcase", AlongWall()),
    RecipeLine("cardboard box", AlongWall()),
    RecipeLine("bottle", Inside("cardboard box", turn_deg=180)),
    RecipeLine("potted plant", AlongWall(corner=True)),
)
CORRIDOR_THINGS = (
    RecipeLine("fire extinguisher", Hung((0.75, 0.95))),
    RecipeLine("trash can", AlongWall(), model="bin"),
)
ROOMS: Mapping[str, Sequence[RecipeLine]] = {
    "office": OFFICE, "meeting room": MEETING_ROOM, "kitchen": KITCHEN, CORRIDOR: CORRIDOR_THINGS,
}  # fmt: skip
EXTRAS = (
    ("meeting room", RecipeLine("painting", Hung((1.2, 1.5)))),
    ("meeting room", RecipeLine("bowl", On("table", turn_deg=180))),
    ("meeting room", RecipeLine("mug", On("table", turn_deg=180))),
    ("meeting room", RecipeLine("printer", On("cabinet", turn_deg=3))),
    ("kitchen", RecipeLine("clock", Hung((1.75, 1.95)))),
    ("kitchen", RecipeLine("handbag", On("couch"))),
    ("office", RecipeLine("cell phone", On("second desk", turn_deg=90))),
    ("office", RecipeLine("bottle", On("second desk", turn_deg=180))),
    (CORRIDOR, RecipeLine("painting", Hung((1.2, 1.5)))),
)
EXTRAS_DRAWN = 3
PANORAMA_ROOMS: Mapping[str, Sequence[RecipeLine]] = {
    "office": OFFICE,
    "kitchen": (*KITCHEN, RecipeLine("trash can", AlongWall(), model="bin"), RecipeLine("backpack", AlongWall())),
    CORRIDOR: CORRIDOR_THINGS,
}
BUCKET = RecipeLine("bucket", ON_FLOOR_OR_WALL)
PANORAMA_BUCKET_ROOMS = ("office", "kitchen")
"""Each has a bucket in the end; one of the two comes during the traversal."""

TINY_ROOM = (
    RecipeLine("table", OnFloor(from_wall_m=0.4)),
    RecipeLine("whiteboard", Hung((0.85, 1.0))),
    RecipeLine("chair", At("table", "long"), count=2, model="meeting"),
    RecipeLine("laptop", On("table", turn_deg=30)),
    RecipeLine("mug", On("table", turn_deg=180)),
    RecipeLine("potted plant", AlongWall(corner=True)),
    RecipeLine("trash can", AlongWall()),
    RecipeLine("backpack", AlongWall()),
)
DEMO_ROOM = (
    RecipeLine("desk", AlongWall()),
    RecipeLine("bookshelf", AlongWall()),
    RecipeLine("cabinet", AlongWall()),
    RecipeLine("whiteboard", Hung((0.85, 1.0))),
    RecipeLine("monitor", On("desk", x=(-0.3, 0.3), y=_SCREEN_Y)),
    RecipeLine("keyboard", On("desk", x=(-0.25, 0.1), y=_KEYS_Y, turn_deg=4)),
    RecipeLine("mug", On("desk", y=(-0.7, 0.6), turn_deg=180)),
    RecipeLine("vase", On("cabinet", turn_deg=180)),
    RecipeLine("book", Inside("bookshelf")),
    RecipeLine("chair", At("desk", "front"), model="office"),
    RecipeLine("chair", AlongWall(), model="office"),
    RecipeLine("armchair", OnFloor(from_wall_m=0.0)),
    RecipeLine("lamp", AlongWall(corner=True)),
    RecipeLine("suitcase", AlongWall()),
    RecipeLine("potted plant", AlongWall(corner=True)),
    RecipeLine("trash can", AlongWall()),
)


@dataclass(frozen=True)
class RemoveThing:
    """A thing of a label that is gone afterwards, from one room or from any."""

    label: str
    room: str | None = None


@dataclass(frozen=True)
class AddThing:
    """A thing that is new afterwards."""

    line: RecipeLine
    room: str


@dataclass(frozen=True)
class MoveThing:
    """A thing that stands in another place afterwards, at least `at_least_m` away."""

    label: str
    place: Place
    room: str
    at_least_m: float = 2.3


@dataclass(frozen=True)
class ShiftThing:
    """A thing that was pushed aside a little."""

    label: str
    distance_m: float = 0.25


InteriorChange = RemoveThing | AddThing | MoveThing | ShiftThing

OFFICE_CHANGES: tuple[InteriorChange, ...] = (
    RemoveThing("potted plant"),
    RemoveThing("trash can", CORRIDOR),
    RemoveThing("chair", "meeting room"),
    ShiftThing("armchair"),
    MoveThing("suitcase", ON_FLOOR_OR_WALL, "office"),
    MoveThing("stool", ON_FLOOR_OR_WALL, "kitchen"),
    AddThing(RecipeLine("cart", AlongWall()), CORRIDOR),
    AddThing(RecipeLine("bucket", ON_FLOOR_OR_WALL), "kitchen"),
    AddThing(RecipeLine("safety sign", OnFloor()), "meeting room"),
)
DEMO_CHANGES: tuple[InteriorChange, ...] = (
    RemoveThing("potted plant"),
    ShiftThing("armchair"),
    MoveThing("suitcase", ON_FLOOR_OR_WALL, "office"),
    AddThing(RecipeLine("bucket", ON_FLOOR_OR_WALL), "office"),
)


def office_recipes(rng: np.random.Generator) -> dict[str, tuple[RecipeLine, ...]]:
    """All rooms of the office with 41 things in all, a few of them drawn at random."""
    extras = [EXTRAS[k] for k in np.sort(rng.choice(len(EXTRAS), EXTRAS_DRAWN, replace=False))]
    return {
        room: (*lines, *(line for extra_room, line in extras if extra_room == room)) for room, lines in ROOMS.items()
    }
