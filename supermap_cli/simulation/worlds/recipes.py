"""What stands where: the recipes of all rooms, and of what changes between two traversals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.simulation.worlds.building import CORRIDOR
from supermap_cli.simulation.worlds.furnishing import Line
from supermap_cli.simulation.worlds.places import AlongWall, AnyOf, At, Beside, Hung, Inside, On, OnFloor, Place, Under

ON_FLOOR_OR_WALL = AnyOf((AlongWall(), OnFloor()))
_SCREEN_Y, _KEYS_Y = (0.45, 0.95), (-0.8, -0.55)

OFFICE = (
    Line("desk", AlongWall(), name="first desk"),
    Line("desk", AlongWall(), name="second desk"),
    Line("bookshelf", AlongWall()),
    Line("whiteboard", Hung((0.85, 1.0)), model="board"),
    Line("monitor", On("first desk", x=(-0.3, 0.3), y=_SCREEN_Y)),
    Line("keyboard", On("first desk", x=(-0.25, 0.1), y=_KEYS_Y, turn_deg=4)),
    Line("mouse", On("first desk", x=(0.35, 0.6), y=_KEYS_Y)),
    Line("mug", On("first desk", y=(-0.7, 0.6), turn_deg=180)),
    Line("laptop", On("second desk", x=(-0.35, 0.35), y=(-0.8, -0.2))),
    Line("chair", At("first desk", "front"), model="office"),
    Line("chair", At("second desk", "front"), model="office"),
    Line("trash can", Under("second desk"), model="bin"),
    Line("book", Inside("bookshelf"), count=2),
    Line("potted plant", AlongWall(corner=True)),
)
MEETING_ROOM = (
    Line("table", OnFloor(from_wall_m=0.4)),
    Line("cabinet", AlongWall()),
    Line("tv", Hung((1.1, 1.3))),
    Line("whiteboard", Hung((0.85, 1.0)), model="board"),
    Line("chair", At("table"), count=4, model="meeting"),
    Line("vase", On("cabinet", turn_deg=180)),
    Line("backpack", AnyOf((Beside("cabinet"), AlongWall()))),
)
KITCHEN = (
    Line("couch", AlongWall()),
    Line("refrigerator", AlongWall()),
    Line("cabinet", AlongWall()),
    Line("microwave", On("cabinet", turn_deg=3)),
    Line("lamp", Beside("couch")),
    Line("armchair", OnFloor(from_wall_m=0.0)),
    Line("stool", ON_FLOOR_OR_WALL),
    Line("suitcase", AlongWall()),
    Line("cardboard box", AlongWall()),
    Line("bottle", Inside("cardboard box", turn_deg=180)),
    Line("potted plant", AlongWall(corner=True)),
)
CORRIDOR_THINGS = (
    Line("fire extinguisher", Hung((0.75, 0.95))),
    Line("trash can", AlongWall(), model="bin"),
)
ROOMS: Mapping[str, Sequence[Line]] = {
    "office": OFFICE, "meeting room": MEETING_ROOM, "kitchen": KITCHEN, CORRIDOR: CORRIDOR_THINGS,
}  # fmt: skip
EXTRAS = (
    ("meeting room", Line("painting", Hung((1.2, 1.5)))),
    ("meeting room", Line("bowl", On("table", turn_deg=180))),
    ("meeting room", Line("mug", On("table", turn_deg=180))),
    ("meeting room", Line("printer", On("cabinet", turn_deg=3))),
    ("kitchen", Line("clock", Hung((1.75, 1.95)))),
    ("kitchen", Line("handbag", On("couch"))),
    ("office", Line("cell phone", On("second desk", turn_deg=90))),
    ("office", Line("bottle", On("second desk", turn_deg=180))),
    (CORRIDOR, Line("painting", Hung((1.2, 1.5)))),
)
EXTRAS_DRAWN = 3
PANORAMA_ROOMS: Mapping[str, Sequence[Line]] = {
    "office": OFFICE,
    "kitchen": (*KITCHEN, Line("trash can", AlongWall(), model="bin"), Line("backpack", AlongWall())),
    CORRIDOR: CORRIDOR_THINGS,
}
BUCKET = Line("bucket", ON_FLOOR_OR_WALL)
PANORAMA_BUCKET_ROOMS = ("office", "kitchen")
"""Each has a bucket in the end; one of the two comes during the traversal."""

TINY_ROOM = (
    Line("table", OnFloor(from_wall_m=0.4)),
    Line("whiteboard", Hung((0.85, 1.0))),
    Line("chair", At("table", "long"), count=2, model="meeting"),
    Line("laptop", On("table", turn_deg=30)),
    Line("mug", On("table", turn_deg=180)),
    Line("potted plant", AlongWall(corner=True)),
    Line("trash can", AlongWall()),
    Line("backpack", AlongWall()),
)
DEMO_ROOM = (
    Line("desk", AlongWall()),
    Line("bookshelf", AlongWall()),
    Line("cabinet", AlongWall()),
    Line("whiteboard", Hung((0.85, 1.0))),
    Line("monitor", On("desk", x=(-0.3, 0.3), y=_SCREEN_Y)),
    Line("keyboard", On("desk", x=(-0.25, 0.1), y=_KEYS_Y, turn_deg=4)),
    Line("mug", On("desk", y=(-0.7, 0.6), turn_deg=180)),
    Line("vase", On("cabinet", turn_deg=180)),
    Line("book", Inside("bookshelf")),
    Line("chair", At("desk", "front"), model="office"),
    Line("chair", AlongWall(), model="office"),
    Line("armchair", OnFloor(from_wall_m=0.0)),
    Line("lamp", AlongWall(corner=True)),
    Line("suitcase", AlongWall()),
    Line("potted plant", AlongWall(corner=True)),
    Line("trash can", AlongWall()),
)


@dataclass(frozen=True)
class Removal:
    """A thing of a label that is gone afterwards, from one room or from any."""

    label: str
    room: str | None = None


@dataclass(frozen=True)
class Arrival:
    """A thing that is new afterwards."""

    line: Line
    room: str


@dataclass(frozen=True)
class Relocation:
    """A thing that stands in another place afterwards, at least `at_least_m` away."""

    label: str
    place: Place
    room: str
    at_least_m: float = 2.3


@dataclass(frozen=True)
class Shift:
    """A thing that was pushed aside a little."""

    label: str
    distance_m: float = 0.25


Change = Removal | Arrival | Relocation | Shift

OFFICE_CHANGES: tuple[Change, ...] = (
    Removal("potted plant"),
    Removal("trash can", CORRIDOR),
    Removal("chair", "meeting room"),
    Shift("armchair"),
    Relocation("suitcase", ON_FLOOR_OR_WALL, "office"),
    Relocation("stool", ON_FLOOR_OR_WALL, "kitchen"),
    Arrival(Line("cart", AlongWall()), CORRIDOR),
    Arrival(Line("bucket", ON_FLOOR_OR_WALL), "kitchen"),
    Arrival(Line("safety sign", OnFloor()), "meeting room"),
)
DEMO_CHANGES: tuple[Change, ...] = (
    Removal("potted plant"),
    Shift("armchair"),
    Relocation("suitcase", ON_FLOOR_OR_WALL, "office"),
    Arrival(Line("bucket", ON_FLOOR_OR_WALL), "office"),
)


def office_recipes(rng: np.random.Generator) -> dict[str, tuple[Line, ...]]:
    """All rooms of the office with 41 things in all, a few of them drawn at random."""
    extras = [EXTRAS[k] for k in np.sort(rng.choice(len(EXTRAS), EXTRAS_DRAWN, replace=False))]
    return {
        room: (*lines, *(line for extra_room, line in extras if extra_room == room)) for room, lines in ROOMS.items()
    }
