"""Furnishing a building: every thing gets a free place, and the floor stays open for people and robots."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.simulation.building_plan import BuildingPlan, Room
from supermap_cli.simulation.motion.free_space import CELL_M, FreeSpace
from supermap_cli.simulation.world import Fixture, Material, Shape, SimulatedThing
from supermap_cli.simulation.worlds.kept_free import door_zones, step_inside, window_zones
from supermap_cli.simulation.worlds.pieces import Piece, Solids
from supermap_cli.simulation.worlds.places import OnFloor, Place, PlacedPiece, Spot, draw_spot
from supermap_cli.simulation.worlds.shapes import build_shape
from supermap_cli.simulation.worlds.shapes.primitives import block
from supermap_cli.simulation.worlds.shapes.styles import build_styled

_SPOTS_DRAWN = 80
"""How often a spot is drawn for a thing before its whole room is begun anew."""
_SPOTS_DRAWN_ONCE = 40
"""The same where the thing is then left out."""
_OVERHEAD_M = 1.3
"""Height above which what hangs is in nobody's way, m: as in `FreeSpace`."""
_ROOMS_DRAWN = 80
"""How often a room is begun anew before it counts as too small."""
_WALKING_CLEARANCE_M = 0.37
"""Free radius around robots and people, m: more than either plans with."""
_OPEN_SHARE = 0.2
"""The least share of a room's floor on which one of that clearance can stand, all of it within reach of the door."""


@dataclass(frozen=True)
class RecipeLine:
    """A line of a room's recipe: what it holds, and where.

    Lines of one `model` share one shape in the whole building, others get their own. `name` is what later lines call
    it by (its label will do where there is one only). `style` names a shape of `shapes.styles` instead of the label's
    own.
    """

    label: str
    place: Place
    count: int = 1
    model: str = ""
    name: str = ""
    style: str = ""


class Interior:
    """A building that fills up: what stands where, and what else finds a place.

    `barriers` take up room as walls do that stand in rooms. `finish` gives a new shape of a label its materials.
    """

    def __init__(
        self,
        plan: BuildingPlan,
        fixtures: Sequence[Fixture],
        barriers: Sequence[Box3D] = (),
        finish: Callable[[str, Shape], Shape] | None = None,
    ) -> None:
        self.plan = plan
        self.barriers = list(barriers)
        self._finish = finish
        self.placed: list[PlacedPiece] = []
        self._doors = [Piece("door", fixture.shape) for fixture in fixtures if fixture.label == "door"]
        self._kept_free = [*door_zones(plan), *window_zones(fixtures)]
        self._models: dict[tuple[str, str, str], Piece] = {}
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

    def place(self, line: RecipeLine, room_name: str, rng: np.random.Generator) -> PlacedPiece | None:
        """Place one more thing, as `add` does, from a few draws; `None` where these find nothing."""
        room = self.plan.room(room_name)
        thing = self._free_place(self._piece(line, rng), line.place, room, rng, _SPOTS_DRAWN_ONCE)
        if thing is None or not (_leaves_the_floor(thing) or self._floor_is_open(room, thing)):
            return None
        return self._kept(line, thing)

    def stand(
        self, piece: Piece, T_world_thing: FloatArray, room_name: str, on: str | None = None, *, name: str = ""
    ) -> PlacedPiece | None:
        """Place a piece in a pose; `None` where something is in the way."""
        room = self.plan.room(room_name)
        thing = PlacedPiece("", "", room_name, piece, T_world_thing, on)
        others = [placed for placed in self.placed if placed.room == room_name]
        if not self._is_free(thing, room, others) or not (_leaves_the_floor(thing) or self._floor_is_open(room, thing)):
            return None
        return self._kept(RecipeLine(piece.label, OnFloor(), name=name), thing)

    def stand_again(
        self, thing: PlacedPiece, T_world_thing: FloatArray, on: str | None = None, *, unless: Sequence[str] = ()
    ) -> PlacedPiece | None:
        """A further place for a thing, given its pose; from now on both are taken. `None` where something other than
        the thing itself, or those of the ids `unless`, is in the way.
        """
        room = self.plan.room(thing.room)
        moved = replace(thing, T_world_thing=T_world_thing, on=on)
        away = {thing.thing_id, *unless}
        others = [placed for placed in self.placed if placed.thing_id not in away and placed.room == room.name]
        if not self._is_free(moved, room, others) or not (_leaves_the_floor(moved) or self._floor_is_open(room, moved)):
            return None
        self.placed.append(moved)
        return moved

    def stand_in_place_of(self, thing: PlacedPiece, piece: Piece) -> PlacedPiece | None:
        """Place a piece where another thing stands, as if that were gone; `None` where something is in the way."""
        before = self.placed
        self.placed = [placed for placed in before if placed is not thing]
        found = self.stand(piece, thing.T_world_thing, thing.room, thing.on)
        self.placed = before if found is None else [*before, found]
        return found

    def try_another_place(
        self, thing: PlacedPiece, place: Place, room_name: str, rng: np.random.Generator, *, at_least_m: float
    ) -> PlacedPiece | None:
        """A further place for a thing from a few draws, `at_least_m` away; `None` where these find nothing."""
        room = self.plan.room(room_name)
        found = self._free_place(thing.piece, place, room, rng, _SPOTS_DRAWN_ONCE)
        if found is None or np.linalg.norm(found.box.center - thing.box.center) < at_least_m:
            return None
        if not self._floor_is_open(room, found):
            return None
        self.placed.append(replace(found, thing_id=thing.thing_id, name=thing.name))
        return self.placed[-1]

    def bar(self, box: Box3D, room_name: str) -> bool:
        """Keep a box of a room free from now on; `False` where something stands there or it would be in the way."""
        shape = block((float(box.size[0]), float(box.size[1]), float(box.size[2])), Material((0, 0, 0)))
        cos, sin = np.cos(box.yaw), np.sin(box.yaw)
        pose = make_transform([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], [*box.center[:2], box.z_min])
        room, thing = self.plan.room(room_name), PlacedPiece("", "", room_name, Piece("", shape), pose)
        if not self._is_free(thing, room, self.placed) or not self._floor_is_open(room, thing):
            return False
        self.barriers.append(box)
        return True

    def make_piece(self, line: RecipeLine, rng: np.random.Generator) -> Piece:
        """A piece as a line says, not yet placed."""
        return self._piece(line, rng)

    def take_out(self, thing: PlacedPiece) -> None:
        """Undo a placing."""
        self.placed = [placed for placed in self.placed if placed is not thing]

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
        return [*(placed.box for placed in self.placed), *self.barriers, *self._door_boxes()]

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
        key = (line.label, line.style, line.model)
        if line.model and key in self._models:
            return self._models[key]
        shape = build_styled(line.label, line.style, rng) if line.style else build_shape(line.label, rng)
        piece = Piece(line.label, shape if self._finish is None else self._finish(line.label, shape))
        if line.model:
            self._models[key] = piece
        return piece

    def _free_place(
        self, piece: Piece, place: Place, room: Room, rng: np.random.Generator, draws: int = _SPOTS_DRAWN
    ) -> PlacedPiece | None:
        """A free place for a piece, still without an id and a name."""
        here = [placed for placed in self.placed if placed.room == room.name]
        for _ in range(draws):
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
        taken += [(solids, solids) for solids in map(_solids_of, self.barriers)]
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
        free = FreeSpace(alone, [*standing, *self.barriers, *self._door_boxes()], clearance_m=_WALKING_CLEARANCE_M)
        doorways = [doorway for doorway in self.plan.doorways if room.name in (doorway.first, doorway.second)]
        if doorways and not free.are_reachable(np.array([step_inside(doorway, room) for doorway in doorways])).all():
            return False
        return bool(free.reachable.sum() * CELL_M**2 >= _OPEN_SHARE * np.prod(room.high - room.low))

    def _door_boxes(self) -> list[Box3D]:
        parts = [door.parts for door in self._doors]
        return [
            Box3D(center, size, 0.0)
            for solids in parts
            for center, size in zip(solids.centers, solids.sizes, strict=True)
        ]


def _solids_of(box: Box3D) -> Solids:
    return Solids(box.center[None], box.size[None], box.yaw)


def _leaves_the_floor(thing: PlacedPiece) -> bool:
    """Whether it takes no floor from anyone: it stands on something, or hangs overhead."""
    return thing.on is not None or thing.box.z_min > _OVERHEAD_M


def _standing(piece: Piece, spot: Spot, room: Room) -> PlacedPiece:
    return PlacedPiece("", "", room.name, piece, spot.T_world_thing, spot.on)


def _no_place(room: str, what: str) -> SimulationError:
    return SimulationError(f"the {room} has no place for {what}", cure="choose another --seed")
