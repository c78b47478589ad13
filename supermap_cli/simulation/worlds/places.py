"""Kinds of places that a thing can have in a room: each draws spots at random, free or not."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.simulation.building_plan import Room
from supermap_cli.simulation.world import box_of
from supermap_cli.simulation.worlds.pieces import Piece, Solids, SupportSurface
from supermap_cli.simulation.worlds.shapes.materials import between, pick

Range = tuple[float, float]
_WHOLE: Range = (-1.0, 1.0)
"""All of the free way on a surface."""


@dataclass(frozen=True, eq=False)
class PlacedPiece:
    """A piece in its place. `name` is what recipes call it by, `on` the id of what it stands on or in."""

    thing_id: str
    name: str
    room: str
    piece: Piece
    T_world_thing: FloatArray
    on: str | None = None

    @cached_property
    def solids(self) -> Solids:
        """Its parts in the world."""
        return self.piece.parts.placed(self.T_world_thing)

    @cached_property
    def outline(self) -> Solids:
        """Its one box in the world."""
        return self.piece.outline.placed(self.T_world_thing)

    @property
    def box(self) -> Box3D:
        """The same as a box."""
        return box_of(self.piece.shape, self.T_world_thing)

    @property
    def yaw(self) -> float:
        """Which way its front faces; 0: towards -y."""
        return float(np.arctan2(self.T_world_thing[1, 0], self.T_world_thing[0, 0]))


@dataclass(frozen=True)
class Spot:
    """A pose for a thing, and the id of what it would stand on or in."""

    T_world_thing: FloatArray
    on: str | None = None


class RoomPlace(ABC):
    """A kind of place that a room has."""

    @abstractmethod
    def within(self, room: Room, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """A spot for a piece in a room; `None` where there cannot be one."""


@dataclass(frozen=True)
class HostPlace(ABC):
    """A kind of place that another thing has: recipes name it as `host`."""

    host: str

    @abstractmethod
    def at(self, host: PlacedPiece, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """A spot for a piece at its host; `None` where there cannot be one."""


@dataclass(frozen=True)
class AlongWall(RoomPlace):
    """On the floor with its back to a wall, anywhere along it or (`corner`) at one of its ends; `side` names the wall:
    0 at the lowest y, 1 at the highest x, 2 at the highest y, 3 at the lowest x.
    """

    corner: bool = False
    gap_m: Range = (0.02, 0.07)
    side: int | None = None

    def within(self, room: Room, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """Somewhere along one of the walls."""
        wall, reach = _wall(room, rng, self.side), piece.size[0] / 2 + 0.02
        if wall.length_m < 2 * reach:
            return None
        along = between(rng, reach, wall.length_m - reach)
        if self.corner:
            along = reach + between(rng, 0.0, 0.1)
            along = along if rng.random() < 0.5 else wall.length_m - along
        return Spot(wall.pose(along, piece.size[1] / 2 + between(rng, *self.gap_m), 0.0))


@dataclass(frozen=True)
class Hung(RoomPlace):
    """On a wall, its lower edge at a height of `low_m`; `side` as in `AlongWall`."""

    low_m: Range
    side: int | None = None

    def within(self, room: Room, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """Somewhere on one of the walls."""
        wall, reach = _wall(room, rng, self.side), piece.size[0] / 2 + 0.1
        if wall.length_m < 2 * reach:
            return None
        return Spot(wall.pose(between(rng, reach, wall.length_m - reach), 0.004, between(rng, *self.low_m)))


@dataclass(frozen=True)
class OnFloor(RoomPlace):
    """Anywhere on the floor, turned at random, `from_wall_m` or more from all walls."""

    from_wall_m: float = 0.15

    def within(self, room: Room, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """Somewhere in the room."""
        reach = float(np.hypot(*piece.size[:2])) / 2 + self.from_wall_m
        if (room.high - room.low < 2 * reach).any():
            return None
        x, y = rng.uniform(room.low + reach, room.high - reach)
        return Spot(_pose(float(x), float(y), 0.0, between(rng, -np.pi, np.pi)))


@dataclass(frozen=True)
class FromCeiling(RoomPlace):
    """Hung from a ceiling at `height_m`, 2 cm below it, `from_wall_m` or more from all walls."""

    height_m: float
    from_wall_m: float = 0.3

    def within(self, room: Room, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """Somewhere over the room's floor."""
        spot = OnFloor(self.from_wall_m).within(room, piece, rng)
        if spot is None:
            return None
        spot.T_world_thing[2, 3] = self.height_m - 0.021 - piece.size[2]
        return spot


@dataclass(frozen=True)
class On(HostPlace):
    """On top of a host, at shares `x` (across) and `y` (from its front -1 to its back 1) of the free way, facing as it
    does but for `turn_deg`.
    """

    x: Range = _WHOLE
    y: Range = _WHOLE
    turn_deg: float = 8.0

    def at(self, host: PlacedPiece, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """Somewhere on the host's top."""
        tops = [surface for surface in host.piece.surfaces if surface.z_m == host.piece.top.z_m]
        yaw = np.radians(between(rng, -self.turn_deg, self.turn_deg))
        return _upon(host, pick(rng, tops), piece, (between(rng, *self.x), between(rng, *self.y), yaw))


@dataclass(frozen=True)
class Inside(HostPlace):
    """On one of a host's inner boards that leaves enough room above it, or at the bottom of an open box."""

    turn_deg: float = 10.0

    def at(self, host: PlacedPiece, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """On one of the host's boards."""
        high_enough = [shelf for shelf in host.piece.shelves if shelf.clear_m > piece.size[2] + 0.02]
        if not high_enough:
            return None
        yaw = np.radians(between(rng, -self.turn_deg, self.turn_deg))
        return _upon(host, pick(rng, high_enough), piece, (between(rng, -1, 1), between(rng, -1, 1), yaw))


@dataclass(frozen=True)
class Under(HostPlace):
    """On the floor beneath a host."""

    def at(self, host: PlacedPiece, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """Between the host's legs."""
        slack = (host.piece.size[:2] - piece.size[:2]) / 2
        if (slack < 0).any():
            return None
        x, y = rng.uniform(-slack, slack)
        return Spot(host.T_world_thing @ _pose(float(x), float(y), 0.0, between(rng, -0.3, 0.3)))


@dataclass(frozen=True)
class At(HostPlace):
    """On the floor at a side of a host and facing it, as a chair at a table, pushed in more or less."""

    sides: Literal["front", "long", "all"] = "all"

    def at(self, host: PlacedPiece, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """Before one of the host's sides."""
        half_x, half_y = host.piece.size[:2] / 2
        side = pick(rng, {"front": (0,), "long": (0, 2), "all": (0, 2, 0, 2, 1, 3)}[self.sides])
        half_width, half_depth = (half_x, half_y) if side % 2 == 0 else (half_y, half_x)
        reach = max(half_width - 0.3, 0.0)
        seat = _pose(between(rng, -reach, reach), -half_depth - piece.size[1] * between(rng, 0.0, 0.8), 0.0, np.pi)
        turn = _pose(0.0, 0.0, 0.0, side * np.pi / 2)
        return Spot(host.T_world_thing @ turn @ seat @ _pose(0.0, 0.0, 0.0, np.radians(between(rng, -14, 14))))


@dataclass(frozen=True)
class Beside(HostPlace):
    """On the floor right or left of a host, their backs in line."""

    gap_m: Range = (0.05, 0.3)

    def at(self, host: PlacedPiece, piece: Piece, rng: np.random.Generator) -> Spot | None:
        """To the host's right or left."""
        x = (host.piece.size[0] + piece.size[0]) / 2 + between(rng, *self.gap_m)
        y = (host.piece.size[1] - piece.size[1]) / 2
        side = pick(rng, (-1.0, 1.0))
        return Spot(host.T_world_thing @ _pose(side * x, float(y), 0.0, np.radians(between(rng, -6, 6))))


@dataclass(frozen=True)
class AnyOf:
    """One of several kinds of places, a new draw each time."""

    places: tuple[RoomPlace | HostPlace, ...]


Place = RoomPlace | HostPlace | AnyOf


def draw_spot(
    place: Place, piece: Piece, room: Room, things: Sequence[PlacedPiece], rng: np.random.Generator
) -> Spot | None:
    """A spot of a kind for a piece, in a room that holds `things`; `None` where there cannot be one.

    Raises `LookupError` when the place's host is not there.
    """
    kind = pick(rng, place.places) if isinstance(place, AnyOf) else place
    if isinstance(kind, RoomPlace):
        return kind.within(room, piece, rng)
    hosts = [placed for placed in things if kind.host in {placed.name, placed.piece.label}]
    if not hosts:
        raise LookupError(f"there is no {kind.host!r} to place a {piece.label} at")
    return kind.at(pick(rng, hosts), piece, rng)


@dataclass(frozen=True)
class _Wall:
    """One side of a room: from `start` (2,) along a unit direction, its inside to the left."""

    start: FloatArray
    along: FloatArray
    length_m: float

    def pose(self, at_m: float, off_m: float, z_m: float) -> FloatArray:
        """Of what turns its back to the wall: `at_m` along it, its origin `off_m` before it."""
        inwards = np.array([-self.along[1], self.along[0]])
        x, y = self.start + at_m * self.along + off_m * inwards
        return _pose(float(x), float(y), z_m, float(np.arctan2(inwards[0], -inwards[1])))


def _wall(room: Room, rng: np.random.Generator, side: int | None = None) -> _Wall:
    """One of the four, the longer the likelier."""
    corners = np.array([room.low, [room.high[0], room.low[1]], room.high, [room.low[0], room.high[1]]])
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(sides, axis=1)
    k = int(rng.choice(4, p=lengths / lengths.sum())) if side is None else side
    return _Wall(corners[k], sides[k] / lengths[k], float(lengths[k]))


def _pose(x: float, y: float, z: float, yaw: float) -> FloatArray:
    cos, sin = np.cos(yaw), np.sin(yaw)
    return make_transform([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], [x, y, z])


def _upon(host: PlacedPiece, surface: SupportSurface, piece: Piece, at: tuple[float, float, float]) -> Spot | None:
    """A spot wholly on a surface: `at` is the shares (-1 .. 1) of the free way along x and y, and the yaw on it."""
    x, y, yaw = at
    cos, sin = abs(np.cos(yaw)), abs(np.sin(yaw))
    reach = np.array([[cos, sin], [sin, cos]]) @ piece.size[:2] / 2 + 0.005
    slack = (surface.high - surface.low) / 2 - reach
    if (slack < 0).any():
        return None
    local = (surface.low + surface.high) / 2 + np.array([x, y]) * slack
    return Spot(host.T_world_thing @ _pose(float(local[0]), float(local[1]), surface.z_m, yaw), host.thing_id)
