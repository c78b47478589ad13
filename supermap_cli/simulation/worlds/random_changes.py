"""What changes in a room between two visits, drawn at random from what stands there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.simulation.world import sample_surface
from supermap_cli.simulation.worlds.furnishing import Interior, RecipeLine
from supermap_cli.simulation.worlds.interior_changes import ChangedInterior
from supermap_cli.simulation.worlds.places import AlongWall, OnFloor, PlacedPiece
from supermap_cli.simulation.worlds.random_recipes import Group, one_of
from supermap_cli.simulation.worlds.room_recipes import ON_FLOOR_OR_WALL
from supermap_cli.simulation.worlds.shapes.materials import between, pick

TURN_DEG = (60.0, 120.0)
"""Least and greatest turn of a thing that is rotated in place, degrees: a corner or a side more of it is seen."""
MOVE_M = (2.0, 1.5, 1.0, 0.6)
"""How far a thing moves at least, m: the first that the room allows."""
NEW_LABELS = ("bucket", "suitcase", "backpack", "cardboard box", "chair", "trash can", "stool", "potted plant")
"""What may be new."""
_HIDING_LABELS = ("cabinet", "refrigerator", "bookshelf", "armchair", "couch")
_HEAVY = frozenset({"table", "desk", "couch", "refrigerator", "bookshelf", "cabinet"})
_TRIES = 12

_ON_FLOOR, _AT_WALL = OnFloor(), AlongWall()
NEEDED: Mapping[str, Sequence[Group]] = {
    "shifted": (one_of("chair", "", _ON_FLOOR), one_of("backpack", "", _ON_FLOOR), one_of("stool", "", _ON_FLOOR)),
    "moved": (one_of("suitcase", "", _AT_WALL), one_of("stool", "", _ON_FLOOR)),
    "rotated": (one_of("chair", "", _ON_FLOOR), one_of("armchair", "", _ON_FLOOR), one_of("suitcase", "", _ON_FLOOR)),
    "replaced": (one_of("suitcase", "", _AT_WALL), one_of("chair", "", _ON_FLOOR)),
    "hidden": (one_of("backpack", "", _AT_WALL), one_of("trash can", "", _AT_WALL)),
    "all": (one_of("chair", "", _ON_FLOOR), one_of("armchair", "", _ON_FLOOR), one_of("suitcase", "", _AT_WALL),
            one_of("backpack", "", _AT_WALL), one_of("stool", "", _ON_FLOOR)),
}  # fmt: skip
"""The things that each kind of change needs to be there."""


class RandomChanges:
    """Changes things of an interior, each at most once, and keeps which; where none fits it does without."""

    def __init__(
        self, interior: Interior, rooms: Sequence[str], rng: np.random.Generator, taken: frozenset[str] = frozenset()
    ) -> None:
        self.changed = ChangedInterior()
        self._interior, self._rooms, self._rng, self._taken = interior, rooms, rng, set(taken)

    def make(self, kind: str, shift_m: float) -> None:
        """All changes of a kind: three new, three gone, three shifted, two moved, three rotated, one replaced or one
        hidden; one of each for `all`.
        """
        makers: Mapping[str, tuple[int, Callable[[], bool]]] = {
            "appear": (3, self._appear), "vanish": (3, self._vanish), "shifted": (3, lambda: self._shift(shift_m)),
            "moved": (2, self._move), "rotated": (3, self._rotate), "replaced": (1, self._replace),
            "hidden": (1, self._hide),
        }  # fmt: skip
        order = ("hidden", "rotated", "replaced", "shifted", "moved", "vanish", "appear") if kind == "all" else (kind,)
        for name in order:
            count, change = makers.get(name, (0, self._vanish))
            for _ in range(min(count, 1) if kind == "all" else count):
                change()

    def _appear(self) -> bool:
        for _ in range(_TRIES):
            line = RecipeLine(pick(self._rng, NEW_LABELS), ON_FLOOR_OR_WALL)
            thing = self._interior.place(line, pick(self._rng, self._rooms), self._rng)
            if thing is not None:
                return self._note(new=thing.thing_id)
        return False

    def _vanish(self) -> bool:
        for thing in self._loose():
            return self._note(gone=thing.thing_id)
        return False

    def _shift(self, distance_m: float) -> bool:
        for thing in self._loose(on_floor=True):
            with suppress(SimulationError):
                self._interior.nudged(thing, distance_m, self._rng)
                return self._note(moved=thing.thing_id)
        return False

    def _move(self) -> bool:
        for at_least_m in MOVE_M:
            for thing in self._loose(on_floor=True):
                for _ in range(3):
                    found = self._interior.try_another_place(
                        thing, ON_FLOOR_OR_WALL, pick(self._rng, self._rooms), self._rng, at_least_m=at_least_m
                    )
                    if found is not None:
                        return self._note(moved=thing.thing_id)
        return False

    def _rotate(self) -> bool:
        for thing in self._loose(on_floor=True):
            low, high = sorted(thing.piece.size[:2])
            if thing.piece.label in {"trash can", "bucket", "stool", "lamp", "potted plant"} and high < 1.2 * low:
                continue  # nobody could tell
            for _ in range(_TRIES):
                turn = np.radians(between(self._rng, *TURN_DEG)) * pick(self._rng, (-1.0, 1.0))
                if self._interior.stand_again(thing, _turned_in_place(thing, turn)) is not None:
                    return self._note(moved=thing.thing_id)
        return False

    def _replace(self) -> bool:
        for thing in self._loose(on_floor=True):
            for _ in range(_TRIES):
                piece = self._interior.make_piece(RecipeLine(thing.piece.label, _ON_FLOOR), self._rng)
                other = self._interior.stand_in_place_of(thing, piece)
                if other is not None:
                    return self._note(gone=thing.thing_id, new=other.thing_id)
        return False

    def _hide(self) -> bool:
        small = [thing for thing in self._loose(on_floor=True) if thing.piece.size.max() < 0.9]
        for thing in sorted(small, key=lambda thing: thing.piece.label not in {"backpack", "trash can"}):
            for _ in range(_TRIES):
                line = RecipeLine(pick(self._rng, _HIDING_LABELS), _AT_WALL)
                piece = self._interior.make_piece(line, self._rng)
                before_m = (thing.piece.size[1] + piece.size[1]) / 2 + between(self._rng, 0.05, 0.2)
                aside_m = between(self._rng, -0.2, 0.2)
                pose = thing.T_world_thing @ make_transform(np.eye(3), [aside_m, -before_m, 0.0])
                big = self._interior.stand(piece, pose, thing.room)
                if big is not None:
                    self._taken.add(thing.thing_id)
                    return self._note(new=big.thing_id)
        return False

    def _loose(self, *, on_floor: bool = False) -> Iterator[PlacedPiece]:
        """Things that have not changed yet and hold nothing, in a random order; on the floor heavy ones come last."""
        hosts = {placed.on for placed in self._interior.placed}
        loose = [
            placed for placed in self._interior.placed
            if placed.thing_id not in hosts | self._taken | self.changed.ids
            and (not on_floor or (placed.on is None and placed.T_world_thing[2, 3] == 0))
        ]  # fmt: skip
        order = [loose[k] for k in self._rng.permutation(len(loose))]
        yield from sorted(order, key=lambda thing: on_floor and thing.piece.label in _HEAVY)

    def _note(self, *, gone: str = "", new: str = "", moved: str = "") -> bool:
        changed = self.changed
        self.changed = ChangedInterior(
            changed.gone | ({gone} - {""}), changed.new | ({new} - {""}), changed.moved | ({moved} - {""})
        )
        return True


def with_moved(changed: ChangedInterior, ids: Sequence[str]) -> ChangedInterior:
    """The same, with some more that stand elsewhere."""
    return ChangedInterior(changed.gone, changed.new, changed.moved | set(ids))


def _turned_in_place(thing: PlacedPiece, turn: float) -> FloatArray:
    """The pose after a turn about the middle of its surface, which stays where it is."""
    middle = sample_surface(thing.piece.shape, 0.02)[0].astype(np.float64).mean(axis=0)
    cos, sin = np.cos(turn), np.sin(turn)
    about = make_transform(np.eye(3), [middle[0], middle[1], 0.0])
    back = make_transform(np.eye(3), [-middle[0], -middle[1], 0.0])
    turned: FloatArray = (
        thing.T_world_thing @ about @ make_transform([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], [0, 0, 0]) @ back
    )
    return turned
