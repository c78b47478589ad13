"""Buildings at random: rooms along a corridor, with walls of thickness, doors, windows, floor and ceiling."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.simulation.building_plan import BuildingPlan, Doorway, Room
from supermap_cli.simulation.world import Fixture, Material, Shape
from supermap_cli.simulation.worlds.doors_and_windows import (
    DOOR_TOP_M,
    HEAD_M,
    JAMB_M,
    SILL_M,
    closed_door,
    open_door,
    window,
)
from supermap_cli.simulation.worlds.filled_cells import filled_cells
from supermap_cli.simulation.worlds.shapes.materials import Rgb, between, pick, tinted, wood

CORRIDOR = "corridor"
AREA_M2 = (70.0, 110.0)
"""Least and greatest floor area of a building of three rooms and a corridor, m^2."""
_SLAB_M = 0.2
"""m, thickness of floors and ceilings, about that of a concrete slab; only their inner faces are seen."""
_TINTS: tuple[Rgb, ...] = ((232, 228, 218), (214, 222, 226), (226, 216, 204), (218, 226, 212), (238, 236, 230))
"""sRGB, 0 to 255, of painted walls; chosen by eye."""
_CARPETS: tuple[Rgb, ...] = ((112, 116, 124), (134, 118, 98), (92, 104, 116), (146, 140, 130))
"""sRGB, 0 to 255, of carpets; chosen by eye."""


@dataclass(frozen=True)
class Opening:
    """A place in a wall for a door or a window: `low`, `high` (2,) of its footprint, and the direction `through` (2,)
    it, out of the room `room`. Only a doorway has a room `beyond`.
    """

    room: str
    low: FloatArray
    high: FloatArray
    through: FloatArray
    closed: bool = False
    beyond: str | None = None

    @property
    def center(self) -> FloatArray:
        """Its middle (2,)."""
        return (self.low + self.high) / 2

    @property
    def width_m(self) -> float:
        """How wide it is along the wall."""
        return float(np.abs(self.along) @ (self.high - self.low))

    @property
    def along(self) -> FloatArray:
        """The direction of the wall (2,), `through` being to its left."""
        return np.array([self.through[1], -self.through[0]])

    @property
    def T_world_opening(self) -> FloatArray:
        """The frame of `doors_and_windows`."""
        R = np.eye(3)
        R[:2, 0], R[:2, 1] = self.along, self.through
        return make_transform(R, [*self.center, 0.0])


@dataclass(frozen=True)
class FloorPlan:
    """Rooms and the openings in their walls, before any surfaces are made."""

    rooms: tuple[Room, ...]
    openings: tuple[Opening, ...]
    wall_m: float

    @property
    def area_m2(self) -> float:
        """Of all floors."""
        return float(sum(np.prod(room.high - room.low) for room in self.rooms))

    def mapped(self, onto: Callable[[FloatArray], FloatArray]) -> FloorPlan:
        """Mirrored, turned or moved: `onto` maps points (2,)."""

        def corners(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
            both = np.stack([onto(low), onto(high)])
            return both.min(axis=0), both.max(axis=0)

        rooms = tuple(Room(room.name, *corners(room.low, room.high)) for room in self.rooms)
        openings = []
        for opening in self.openings:
            low, high = corners(opening.low, opening.high)
            through = onto(opening.through) - onto(np.zeros(2))
            openings.append(replace(opening, low=low, high=high, through=through))
        return FloorPlan(rooms, tuple(openings), self.wall_m)


def make_building(rng: np.random.Generator, room_names: Sequence[str]) -> tuple[BuildingPlan, tuple[Fixture, ...]]:
    """A building with these rooms and a corridor that joins them; three rooms make 70 to 110 m2 in all.

    A single room has no corridor, and its door is shut. The lowest corner of all rooms is the world's origin.
    """
    layout = _single_room(rng, room_names[0]) if len(room_names) == 1 else _along_corridor(rng, room_names)
    return built(rng, turned_at_random(rng, layout))


def built(rng: np.random.Generator, layout: FloorPlan) -> tuple[BuildingPlan, tuple[Fixture, ...]]:
    """The building of a floor plan: its height and its colours are drawn."""
    height_m = round(between(rng, 2.6, 2.9), 3)
    doorways = tuple(
        Doorway(opening.room, opening.beyond, opening.center, opening.through, opening.width_m - 2 * JAMB_M)
        for opening in layout.openings
        if opening.beyond is not None
    )
    fixtures = (*_walls_and_floors(rng, layout, height_m), *_doors_and_windows(rng, layout))
    return BuildingPlan(layout.rooms, doorways, height_m), fixtures


def _single_room(rng: np.random.Generator, name: str) -> FloorPlan:
    wall = round(between(rng, 0.12, 0.18), 3)
    room = Room(name, np.zeros(2), np.round([between(rng, 4.8, 6.0), between(rng, 4.4, 5.4)], 3))
    door = replace(doorway(rng, room, wall, up=True), beyond=None, closed=True)
    return FloorPlan((room,), (door, *windows(rng, room, wall, up=True)), wall)


def _along_corridor(rng: np.random.Generator, room_names: Sequence[str]) -> FloorPlan:
    """Rooms above (and often one below) a corridor that runs along x, drawn until the area fits."""
    fair = AREA_M2[0] / 3 * (len(room_names) - 1), AREA_M2[1] / 3 * len(room_names)
    while True:
        layout = _draw_along_corridor(rng, [room_names[k] for k in rng.permutation(len(room_names))])
        if fair[0] <= layout.area_m2 <= fair[1] and (
            len(room_names) != 3 or AREA_M2[0] <= layout.area_m2 <= AREA_M2[1]
        ):
            return layout


def _draw_along_corridor(rng: np.random.Generator, names: Sequence[str]) -> FloorPlan:
    wall, across = round(between(rng, 0.12, 0.18), 3), round(between(rng, 1.8, 2.3), 3)
    above = len(names) if rng.random() < 0.35 else len(names) - 1
    upper = list(_row(rng, names[:above], wall))
    length = upper[-1].high[0]
    lower = []
    if above < len(names):
        width, depth = round(between(rng, min(4.5, length), min(7.0, length)), 3), round(between(rng, 4.0, 5.5), 3)
        x = round(between(rng, 0.0, length - width), 3)
        lower.append(Room(names[-1], np.array([x, -wall - depth]), np.array([x + width, -wall])))
    corridor = Room(CORRIDOR, np.zeros(2), np.array([length, across]))
    lift = np.array([0.0, across + wall])
    upper = [Room(room.name, room.low + lift, room.high + lift) for room in upper]
    openings = [doorway(rng, room, wall, up=up) for rooms, up in ((upper, True), (lower, False)) for room in rooms]
    for rooms, up in ((upper, True), (lower, False)):
        openings.extend(opening for room in rooms for opening in windows(rng, room, wall, up=up))
    return FloorPlan((*upper, *lower, corridor), tuple(openings), wall)


def _row(rng: np.random.Generator, names: Sequence[str], wall: float) -> Iterator[Room]:
    """Rooms side by side, their lower sides on y = 0."""
    x = 0.0
    for name in names:
        width, depth = between(rng, 4.0, 5.6 if len(names) > 2 else 6.5), between(rng, 4.0, 5.6)
        yield Room(name, np.array([x, 0.0]), np.round([x + width, depth], 3))
        x = round(x + width + wall, 3)


def doorway(rng: np.random.Generator, room: Room, wall: float, *, up: bool) -> Opening:
    """A doorway in the side that faces the corridor: the lower one of a room that lies above it (`up`)."""
    width = round(between(rng, 1.0, 1.12), 3)
    x = round(between(rng, room.low[0] + 0.25, room.high[0] - 0.25 - width), 3)
    y = room.low[1] - wall if up else room.high[1]
    through = np.array([0.0, -1.0 if up else 1.0])
    return Opening(room.name, np.array([x, y]), np.array([x + width, y + wall]), through, beyond=CORRIDOR)


def windows(rng: np.random.Generator, room: Room, wall: float, *, up: bool) -> Iterator[Opening]:
    """One or two windows in the side away from the corridor."""
    y = room.high[1] if up else room.low[1] - wall
    count = 2 if room.high[0] - room.low[0] > 4.8 and rng.random() < 0.6 else 1
    bay = (room.high[0] - room.low[0] - 0.6) / count
    for k in range(count):
        width = between(rng, 1.0, min(1.7, bay - 0.2))
        x = round(room.low[0] + 0.3 + k * bay + between(rng, 0.1, bay - width - 0.1), 3)
        through = np.array([0.0, 1.0 if up else -1.0])
        yield Opening(room.name, np.array([x, y]), np.array([round(x + width, 3), y + wall]), through)


def turned_at_random(rng: np.random.Generator, layout: FloorPlan) -> FloorPlan:
    """Mirrored, and turned by right angles; its lowest corner is the origin."""
    mirror, swap = rng.choice([-1.0, 1.0], 2), rng.random() < 0.5
    turned = layout.mapped(lambda xy: (mirror * xy)[::-1] if swap else mirror * xy)
    corner = np.min([room.low for room in turned.rooms], axis=0)
    return turned.mapped(lambda xy: xy - corner)


def _walls_and_floors(rng: np.random.Generator, layout: FloorPlan, height_m: float) -> tuple[Fixture, ...]:
    """Walls, floor and ceiling; every room has its own colours."""
    cells = _Cells(layout)
    tints = [Material(tinted(rng, pick(rng, _TINTS), 6), "speckle", 0.25, 0.1) for _ in layout.rooms]
    floors = [_floor_material(rng, room.name) for room in layout.rooms]
    plaster = Material((234, 232, 226), "speckle", 0.2, 0.06)
    z = np.array([0.0, SILL_M, DOOR_TOP_M, HEAD_M, height_m])
    everywhere = np.ones((*cells.shape, 1), bool)
    below, above = np.array([-_SLAB_M, 0.0]), np.array([height_m, height_m + _SLAB_M])
    return (
        Fixture("wall", filled_cells([cells.x, cells.y, z], cells.walls(z), cells.owner, [plaster, *tints])),
        Fixture("floor", filled_cells([cells.x, cells.y, below], everywhere, cells.owner, [floors[-1], *floors])),
        Fixture("ceiling", filled_cells([cells.x, cells.y, above], everywhere, cells.owner * 0, [plaster])),
    )


def _floor_material(rng: np.random.Generator, room: str) -> Material:
    if room == CORRIDOR:
        return Material(tinted(rng, (186, 182, 172), 10), "checks", 0.5, 0.1)
    if rng.random() < 0.4:
        return replace(wood(rng), scale_m=0.12)
    return Material(tinted(rng, pick(rng, _CARPETS), 8), "speckle", 0.06, 0.2)


class _Cells:
    """The grid that all edges of rooms, walls and openings make: what lies in each of its columns."""

    def __init__(self, layout: FloorPlan) -> None:
        edges = [np.stack([room.low, room.high]) for room in layout.rooms]
        edges += [room + np.array([[-1], [1]]) * layout.wall_m for room in edges]
        edges += [np.stack([opening.low, opening.high]) for opening in layout.openings]
        self.x, self.y = (np.unique(np.concatenate(edges)[:, k].round(6)) for k in (0, 1))
        self.shape = len(self.x) - 1, len(self.y) - 1
        self._layout = layout
        self.owner = np.zeros((self.shape[0] + 2, self.shape[1] + 2), np.int64)
        for k, room in enumerate(layout.rooms):
            self.owner[1:-1, 1:-1][self._within(room.low, room.high)] = k + 1

    def walls(self, z: FloatArray) -> BoolArray:
        """(a, b, c) which cells are of stone, between the levels `z` (c + 1,)."""
        near = np.zeros(self.shape, bool)
        for room in self._layout.rooms:
            near |= self._within(room.low - self._layout.wall_m, room.high + self._layout.wall_m)
        stone = np.repeat((near & (self.owner[1:-1, 1:-1] == 0))[..., None], len(z) - 1, axis=2)
        middles = (z[1:] + z[:-1]) / 2
        for opening in self._layout.openings:
            if not opening.closed:
                low, high = (0.0, DOOR_TOP_M) if opening.beyond is not None else (SILL_M, HEAD_M)
                stone[self._within(opening.low, opening.high)[..., None] & (middles > low) & (middles < high)] = False
        return stone

    def _within(self, low: FloatArray, high: FloatArray) -> BoolArray:
        x, y = ((edges[1:] + edges[:-1]) / 2 for edges in (self.x, self.y))
        inside_x, inside_y = (x > low[0]) & (x < high[0]), (y > low[1]) & (y < high[1])
        within: BoolArray = inside_x[:, None] & inside_y[None, :]
        return within


def _doors_and_windows(rng: np.random.Generator, layout: FloorPlan) -> Iterator[Fixture]:
    for opening in layout.openings:
        if opening.closed:
            label, shape = "door", closed_door(rng, opening.width_m, layout.wall_m)
        elif opening.beyond is not None:
            label, shape = "door", open_door(rng, opening.width_m, layout.wall_m, _hinge_side(layout, opening))
        else:
            label, shape = "window", window(rng, opening.width_m, layout.wall_m)
        yield Fixture(label, _placed(shape, opening))


def _placed(shape: Shape, opening: Opening) -> Shape:
    return shape.moved(opening.T_world_opening)


def _hinge_side(layout: FloorPlan, opening: Opening) -> int:
    """The side (-1 or 1 along the wall) on which more of the room's wall is left for the leaf to lie against."""
    room = next(room for room in layout.rooms if room.name == opening.room)
    middle, at = room.center @ opening.along, opening.center @ opening.along
    return 1 if middle >= at else -1
