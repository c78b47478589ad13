"""A synthetic building of any size: rooms in rows, furnished by plans of equal density."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.geometry.boxes import Box3D

ROOM_M = 6.0
"""Edge of a square room in metres: 18 objects on 36 m2. Chosen."""

Point = tuple[float, float, float]

SIZES: dict[str, Point] = {
    "chair": (0.5, 0.5, 0.9),
    "desk": (1.6, 0.8, 0.75),
    "dining table": (1.8, 0.9, 0.75),
    "monitor": (0.6, 0.2, 0.45),
    "laptop": (0.35, 0.25, 0.03),
    "keyboard": (0.45, 0.15, 0.03),
    "cup": (0.08, 0.08, 0.1),
    "book": (0.2, 0.15, 0.03),
    "lamp": (0.2, 0.2, 0.45),
    "vase": (0.15, 0.15, 0.3),
    "globe": (0.3, 0.3, 0.4),
    "printer": (0.5, 0.4, 0.4),
    "cabinet": (0.9, 0.45, 1.8),
    "bookshelf": (1.0, 0.35, 2.0),
    "potted plant": (0.4, 0.4, 0.9),
    "trash can": (0.3, 0.3, 0.4),
    "whiteboard": (1.8, 0.05, 1.2),
    "tv": (1.2, 0.08, 0.7),
    "couch": (1.9, 0.9, 0.8),
    "backpack": (0.35, 0.25, 0.5),
    "refrigerator": (0.7, 0.7, 1.8),
    "microwave": (0.5, 0.35, 0.3),
    "bottle": (0.08, 0.08, 0.25),
    "sink": (0.6, 0.5, 0.2),
    "clock": (0.3, 0.05, 0.3),
    "piano": (1.5, 0.6, 1.2),
    "aquarium": (1.2, 0.5, 0.6),
}
"""Class -> extent (x, y, z) in metres: usual sizes of furniture and household objects. Chosen."""

RARE_CLASSES = ("piano", "aquarium", "globe", "vase")
"""Classes with `INSTANCES_PER_RARE_CLASS` instances, however large the building is."""
INSTANCES_PER_RARE_CLASS = 4
"""Chosen: so few that questions about a rare class have the same answer in all memories."""

Placement = tuple[str, float, float, float]
"""(class, x, y, z): the box's centre on the floor and the height of its lower face, in metres in the room."""


def _desk_group(x: float, y: float) -> tuple[Placement, ...]:
    """A desk with a chair, a monitor, a keyboard and a cup."""
    on_top = SIZES["desk"][2]
    return (
        ("desk", x, y, 0.0),
        ("chair", x, y - 0.75, 0.0),
        ("monitor", x, y + 0.2, on_top),
        ("keyboard", x - 0.1, y - 0.15, on_top),
        ("cup", x + 0.6, y - 0.1, on_top),
    )


def _dining_group(x: float, y: float) -> tuple[Placement, ...]:
    """A table with six chairs."""
    sides = [(dx, dy) for dx in (-0.6, 0.0, 0.6) for dy in (-0.8, 0.8)]
    return (("dining table", x, y, 0.0), *(("chair", x + dx, y + dy, 0.0) for dx, dy in sides))


PLANS: tuple[tuple[Placement, ...], ...] = (
    (
        *(*_desk_group(1.3, 1.6), *_desk_group(4.5, 1.6), *_desk_group(1.3, 4.6)),
        ("cabinet", 5.4, 5.6, 0.0),
        ("potted plant", 4.0, 5.0, 0.0),
        ("lamp", 1.9, 4.7, SIZES["desk"][2]),
    ),
    (
        *(*_dining_group(1.8, 1.8), *_dining_group(4.2, 4.2)),
        ("tv", 3.0, 5.9, 1.0),
        ("whiteboard", 5.0, 5.9, 0.8),
        ("laptop", 4.2, 4.2, SIZES["dining table"][2]),
        ("potted plant", 0.5, 5.4, 0.0),
    ),
    (
        *_dining_group(2.0, 2.0),
        *(("bottle", 1.6, 2.0, 0.75), ("cup", 2.0, 2.2, 0.75), ("cup", 2.4, 1.9, 0.75)),
        *(("refrigerator", 5.5, 0.6, 0.0), ("cabinet", 5.5, 1.6, 0.0), ("microwave", 5.5, 1.6, 1.8)),
        *(("sink", 5.5, 2.6, 0.8), ("trash can", 5.6, 3.4, 0.0), ("couch", 2.0, 5.2, 0.0)),
        *(("potted plant", 3.6, 5.2, 0.0), ("clock", 3.0, 5.95, 2.0)),
    ),
    (
        *_desk_group(1.3, 1.6),
        *(("bookshelf", 0.7 + 1.1 * i, 5.7, 0.0) for i in range(4)),
        *(("book", 0.7 + 1.1 * i, 5.6, 2.0) for i in range(4)),
        *(("printer", 4.5, 2.0, 0.0), ("trash can", 4.5, 2.6, 0.0), ("backpack", 1.9, 2.3, 0.0)),
        *(("lamp", 1.9, 1.9, 0.75), ("potted plant", 5.4, 5.4, 0.0)),
    ),
)
"""An office, a meeting room, a kitchen, a library: 18 objects each."""

OBJECTS_PER_ROOM = len(PLANS[0])
"""18, in every plan."""
_SIZE_SPREAD, _POSITION_SPREAD_M, _YAW_SPREAD_RAD = 0.05, 0.04, 0.1
"""Greatest deviation from the plan: of an extent (a share of it), of a position in metres, of the yaw. Chosen."""
_MOVE_RANGE_M = (0.3, 1.2)
"""Least and greatest distance along x and along y of a moved object, in metres. Chosen."""
_LARGEST_ON_DESK_M = 0.5
"""Extent along x in metres below which a rare object takes a cup's place and not a plant's."""


@dataclass(frozen=True)
class SyntheticObject:
    """An object at its first place; `room` counts the rooms from 0."""

    number: int
    label: str
    room: int
    box: Box3D


def room_count(objects: int) -> int:
    """How many rooms so many objects need."""
    return max(math.ceil(objects / OBJECTS_PER_ROOM), 1)


def furnish(objects: int, rng: np.random.Generator) -> Iterator[SyntheticObject]:
    """Generate that many objects, room by room."""
    rooms = room_count(objects)
    columns = math.ceil(math.sqrt(rooms))
    rare = _rare_rooms(rooms)
    for room in range(rooms):
        corner = ROOM_M * np.array([room % columns, room // columns, 0.0])
        spots = _place_rare(_plan_of(room), rare.get(room, ()))
        for index in range(min(OBJECTS_PER_ROOM, objects - room * OBJECTS_PER_ROOM)):
            label, x, y, bottom = spots[index]
            size = np.array(SIZES[label]) * rng.uniform(1 - _SIZE_SPREAD, 1 + _SIZE_SPREAD)
            shift = (*rng.uniform(-_POSITION_SPREAD_M, _POSITION_SPREAD_M, 2), size[2] / 2)
            center = corner + np.array([x, y, bottom]) + shift
            yield SyntheticObject(
                room * OBJECTS_PER_ROOM + index + 1,
                label,
                room,
                Box3D(center, size, float(rng.uniform(-_YAW_SPREAD_RAD, _YAW_SPREAD_RAD))),
            )


def move_in_room(obj: SyntheticObject, box: Box3D, rng: np.random.Generator) -> SyntheticObject:
    """The object at another place in its room: 0.3 to 1.2 m away along x and along y, at any yaw."""
    step = np.array([*rng.uniform(*_MOVE_RANGE_M, 2) * rng.choice([-1, 1], 2), 0.0])
    return replace(obj, box=Box3D(box.center + step, box.size, float(rng.uniform(-np.pi, np.pi))))


def _plan_of(room: int) -> tuple[Placement, ...]:
    return PLANS[room % len(PLANS)]


def _rare_rooms(rooms: int) -> dict[int, tuple[str, ...]]:
    """Room -> rare classes in it: offices, spread over the building."""
    offices = [room for room in range(rooms) if room % len(PLANS) == 0]
    chosen: dict[int, tuple[str, ...]] = {}
    for at, label in enumerate(RARE_CLASSES):
        for i in range(INSTANCES_PER_RARE_CLASS):
            room = offices[
                (len(offices) * (i * len(RARE_CLASSES) + at))
                // (INSTANCES_PER_RARE_CLASS * len(RARE_CLASSES))
                % len(offices)
            ]
            chosen[room] = (*chosen.get(room, ()), label)
    return chosen


def _place_rare(spots: tuple[Placement, ...], rare: tuple[str, ...]) -> tuple[Placement, ...]:
    """Replace common objects by rare ones: a cup by small ones, a plant or cabinet by large ones."""
    free = {"cup": [at for at, spot in enumerate(spots) if spot[0] == "cup"], "potted plant": [16, 15]}
    changed = list(spots)
    for label in rare:
        index = "cup" if SIZES[label][0] < _LARGEST_ON_DESK_M else "potted plant"
        if free[index]:
            at = free[index].pop(0)
            changed[at] = (label, *spots[at][1:])
    return tuple(changed)
