"""Furnishing a building: every thing gets a free place, and the floor stays open for people and robots."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.building_plan import BuildingPlan, Doorway, Room
from supermap_cli.simulation.motion.free_space import CELL_M, FreeSpace
from supermap_cli.simulation.world import Fixture, SimulatedThing
from supermap_cli.simulation.worlds.pieces import Piece, Solids
from supermap_cli.simulation.worlds.places import Place, PlacedPiece, Spot, draw_spot
from supermap_cli.simulation.worlds.shapes import build_shape

_SPOTS_DRAWN = 80
"""How often a spot is drawn for a thing before its whole room is begun anew."""
_ROOMS_DRAWN = 80
"""How often a room is begun anew before it counts as too small."""
_WALKING_CLEARANCE_M = 0.37
"""Free radius around robots and people, m: more than either plans with."""
_OPEN_SHARE = 0.2
"""The least share of a room's floor on which one of that clearance can stand, all of it within reach of the door."""
_DOOR_DEPTH_M = 0.95
"""Depth of the zone kept free before a doorway, m: a leaf's width."""
_WINDOW_DEPTH_M = 0.25
"""Depth of the zone kept free before a window, m."""


@dataclass(frozen=True)
class RecipeLine:
    """A line of a room's recipe: what it holds, and where.

    Lines of one `model` share one shape in the whole building, others get their own. `name` is what later lines call
    it by (its label will do where there is one only).
    """

    label: str
    place: Place
    count: int = 1
    model: str = ""
    name: str = ""


class Interior:
    """A building that fills up: what stands where, and what else finds a place."""

    def __init__(self, plan: BuildingPlan, fixtures: Sequence[Fixture]) -> None:
        self.plan = plan
        self.placed: list[PlacedPiece] = []
        self._doors = [Piece("door", fixture.shape) for fixture in fixtures if fixture.label == "door"]
        self._kept_free = [*_door_zones(plan), *_window_zones(fixtures)]
        self._models: dict[tuple[str, str], Piece] = {}
        self._numbers: Counter[str] = Counter()

    def furnish(self, recipes: Mapping[str, Sequence[RecipeLine]], rng: np.random.Generator) -> None:
        """Place all lines of all rooms. Raises `SimulationError` when a room is too small for what it should hold."""
        for name, lines in recipes.items():
            room, before = self.plan.room(name), (list(self.placed), self._numbers.copy())
            for _ in range(_ROOMS_DRAWN):
                if self._furnished(room, lines, rng):
                    break
                self.placed, self._numbers = list(before[0]), before[1].copy()
            else:
                raise _no_place(name, "all its things")

    def add(self, line: RecipeLine, room_name: str, rng: np.random.Generator) -> PlacedPiece:
        """Place one more thing and leave all ways open. Raises `SimulationError` when there is no place for it."""
        room = self.plan.room(room_name)
        for _ in range(_ROOMS_DRAWN):
            thing = self._free_place(self._piece(line, rng), line.place, room, rng)
            if thing is not None and self._floor_is_open(room, thing):
                return self._kept(line, thing)
        raise _no_place(room_name, f"another {line.label}")

    def another_place(
        self, thing: PlacedPiece, place: Place, room_name: str, rng: np.random.Generator, *, at_least_m: float
    ) -> PlacedPiece:
        """A further place for a thing, `at_least_m` away; from now on both are taken.

        Raises `SimulationError` when there is none.
        """
        room = self.plan.room(room_name)
        for _ in range(_ROOMS_DRAWN):
            found = self._free_place(thing.piece, place, room, rng)
            if found is None or np.linalg.norm(found.box.center - thing.box.center) < at_least_m:
                continue
            if self._floor_is_open(room, found):
                self.placed.append(replace(found, thing_id=thing.thing_id, name=thing.name))
                return self.placed[-1]
        raise _no_place(room_name, f"the {thing.piece.label} from elsewhere")

    def nudged(self, thing: PlacedPiece, distance_m: float, rng: np.random.Generator) -> PlacedPiece:
        """A further place for a thing, shifted by `distance_m` sideways; from now on both are taken.

        Raises `SimulationError` when something is in the way all round.
        """
        room = self.plan.room(thing.room)
        others = [placed for placed in self.placed if placed.thing_id != thing.thing_id]
        for angle in rng.permutation(24) * np.pi / 12:
            T_world_thing = thing.T_world_thing.copy()
            T_world_thing[:2, 3] += distance_m * np.array([np.cos(angle), np.sin(angle)])
            moved = replace(thing, T_world_thing=T_world_thing)
            if self._is_free(moved, room, others) and self._floor_is_open(room, moved):
                self.placed.append(moved)
                return moved
        raise _no_place(thing.room, f"the {thing.piece.label} {distance_m} m further on")

    @property
    def obstacles(self) -> list[Box3D]:
        """The boxes of all that stands anywhere at any time, and of the doors' leaves."""
        return [*(placed.box for placed in self.placed), *self._door_boxes()]

    @property
    def things(self) -> tuple[SimulatedThing, ...]:
        """Every thing once, in the order of their first places."""
        first = {placed.thing_id: placed.piece for placed in reversed(self.placed)}
        return tuple(SimulatedThing(thing_id, piece.label, piece.shape) for thing_id, piece in reversed(first.items()))

    def thing(self, thing_id: str) -> SimulatedThing:
        """The thing of an id."""
        return next(thing for thing in self.things if thing.id == thing_id)

    def _furnished(self, room: Room, lines: Sequence[RecipeLine], rng: np.random.Generator) -> bool:
        for line in lines:
            for _ in range(line.count):
                thing = self._free_place(self._piece(line, rng), line.place, room, rng)
                if thing is None:
                    return False
                self._kept(line, thing)
        return self._floor_is_open(room)

    def _kept(self, line: RecipeLine, thing: PlacedPiece) -> PlacedPiece:
        self._numbers[line.label] += 1
        thing_id = f"{line.label.replace(' ', '-')}-{self._numbers[line.label]}"
        self.placed.append(replace(thing, thing_id=thing_id, name=line.name or line.label))
        return self.placed[-1]

    def _piece(self, line: RecipeLine, rng: np.random.Generator) -> Piece:
        if not line.model:
            return Piece(line.label, build_shape(line.label, rng))
        key = (line.label, line.model)
        if key not in self._models:
            self._models[key] = Piece(line.label, build_shape(line.label, rng))
        return self._models[key]

    def _free_place(self, piece: Piece, place: Place, room: Room, rng: np.random.Generator) -> PlacedPiece | None:
        """A free place for a piece, still without an id and a name."""
        here = [placed for placed in self.placed if placed.room == room.name]
        for _ in range(_SPOTS_DRAWN):
            spot = draw_spot(place, piece, room, here, rng)
            if spot is not None:
                thing = _standing(piece, spot, room)
                if self._is_free(thing, room, here):
                    return thing
        return None

    def _is_free(self, thing: PlacedPiece, room: Room, others: Sequence[PlacedPiece]) -> bool:
        """Whether it is within the room, out of everyone's way, and meets nothing."""
        footprint = thing.box.footprint()
        within = (footprint >= room.low).all() and (footprint <= room.high).all()
        if not within or thing.box.z_max > self.plan.height_m - 0.02:
            return False
        if any(thing.outline.meet(zone) for zone in self._kept_free):
            return False
        gap_m = 0.01 if thing.on is not None else 0.04
        taken = [(door.outline, door.parts) for door in self._doors]
        taken += [(other.outline, other.solids) for other in others]
        return not any(
            thing.outline.meet(outline, gap_m) and thing.solids.meet(solids, gap_m) for outline, solids in taken
        )

    def _floor_is_open(self, room: Room, further: PlacedPiece | None = None) -> bool:
        """Whether one gets from every doorway of a room to the others, and to a good part of its floor."""
        standing = [placed.box for placed in self.placed if placed.room == room.name]
        if further is not None:
            standing.append(further.box)
        alone = BuildingPlan((room,), (), self.plan.height_m)
        free = FreeSpace(alone, [*standing, *self._door_boxes()], clearance_m=_WALKING_CLEARANCE_M)
        doorways = [doorway for doorway in self.plan.doorways if room.name in (doorway.first, doorway.second)]
        if doorways and not free.are_reachable(np.array([_step_inside(doorway, room) for doorway in doorways])).all():
            return False
        return bool(free.reachable.sum() * CELL_M**2 >= _OPEN_SHARE * np.prod(room.high - room.low))

    def _door_boxes(self) -> list[Box3D]:
        parts = [door.parts for door in self._doors]
        return [
            Box3D(center, size, 0.0)
            for solids in parts
            for center, size in zip(solids.centers, solids.sizes, strict=True)
        ]


def _standing(piece: Piece, spot: Spot, room: Room) -> PlacedPiece:
    return PlacedPiece("", "", room.name, piece, spot.T_world_thing, spot.on)


def _step_inside(doorway: Doorway, room: Room) -> FloatArray:
    """A point (2,) just within a room, before its doorway."""
    inwards = -doorway.through if room.name == doorway.first else doorway.through
    return doorway.center + 0.65 * inwards


def _door_zones(plan: BuildingPlan) -> Iterator[Solids]:
    """Where nothing stands or hangs: the way through every doorway."""
    for doorway in plan.doorways:
        along = np.abs(doorway.through)
        size = 2 * _DOOR_DEPTH_M * along + (doorway.width_m + 0.1) * (1 - along)
        yield Solids(np.array([[*doorway.center, 1.1]]), np.array([[*size, 2.2]]))


def _window_zones(fixtures: Sequence[Fixture]) -> Iterator[Solids]:
    """Where nothing hangs or towers: before windows."""
    for fixture in fixtures:
        if fixture.label == "window":
            low, high = fixture.shape.bounds
            margin = np.array([_WINDOW_DEPTH_M, _WINDOW_DEPTH_M, 0.0])
            yield Solids(((low + high) / 2)[None], (high - low + 2 * margin)[None])


def _no_place(room: str, what: str) -> SimulationError:
    return SimulationError(f"the {room} has no place for {what}", cure="choose another --seed")
