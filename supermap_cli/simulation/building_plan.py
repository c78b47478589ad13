"""The building's plan: rectangular rooms and a corridor, joined by doorways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray


@dataclass(frozen=True)
class Room:
    """An axis-aligned room: inner corners `low` and `high` (2,) metres in the world."""

    name: str
    low: FloatArray
    high: FloatArray

    @property
    def center(self) -> FloatArray:
        """Its middle (2,)."""
        return (self.low + self.high) / 2

    def holds(self, xy: FloatArray, margin_m: float = 0.0) -> bool:
        """Whether a point (2,) lies inside, at least `margin_m` from all walls."""
        return bool((xy >= self.low + margin_m).all() and (xy <= self.high - margin_m).all())


@dataclass(frozen=True)
class Doorway:
    """An opening in the wall between two rooms, without a door leaf in the way.

    `center` (2,) is the middle of the opening in the wall's middle plane; `through` (2,) is the unit direction from
    room `first` to room `second`; `width_m` is clear.
    """

    first: str
    second: str
    center: FloatArray
    through: FloatArray
    width_m: float


@dataclass(frozen=True)
class BuildingPlan:
    """Rooms of one height, and how one gets from one to another."""

    rooms: tuple[Room, ...]
    doorways: tuple[Doorway, ...]
    height_m: float

    def room(self, name: str) -> Room:
        """The room of a name."""
        return next(room for room in self.rooms if room.name == name)

    def room_at(self, xy: FloatArray) -> Room | None:
        """The room that a point (2,) lies in; `None` in a wall, a doorway or outside."""
        return next((room for room in self.rooms if room.holds(np.asarray(xy))), None)
