"""Floor plans of one or two rooms of a wanted size, and walls within rooms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.simulation.building_plan import BuildingPlan, Room
from supermap_cli.simulation.world import Fixture
from supermap_cli.simulation.worlds.building import FloorPlan, Opening, built, doorway, turned_at_random, windows
from supermap_cli.simulation.worlds.shapes.glass import partition
from supermap_cli.simulation.worlds.shapes.materials import between, metal
from supermap_cli.simulation.worlds.shapes.primitives import extruded

THIN_WALL_M = 0.05
"""Thickness of a partition of boards, m: less than what most maps blur a surface by."""
_VARIES = 0.08  # share, chosen: by which each side of a room varies
_WINDOWED_M = 3.0  # m: narrower rooms have no window
_PASSAGE_M = 1.25  # m, a robot and its turns: left free beside a glass partition
_OBLIQUE_M = (1.3, 2.0)  # m that an oblique wall takes from each of two walls
_PARTITION_THICK_M = 0.06  # m, chosen: two panes and their frame


@dataclass(frozen=True)
class BareBuilding:
    """A building without furniture. `barriers` are the walls within its rooms that its plan does not know."""

    plan: BuildingPlan
    fixtures: tuple[Fixture, ...]
    barriers: tuple[Box3D, ...] = ()


def one_room(rng: np.random.Generator, name: str, sides_m: Sequence[float]) -> BareBuilding:
    """A closed room with a shut door."""
    return BareBuilding(*built(rng, turned_at_random(rng, _one_room(rng, name, sides_m))))


def thin_walled_rooms(rng: np.random.Generator, names: tuple[str, str], sides_m: Sequence[float]) -> BareBuilding:
    """Two rooms of equal depth side by side, with a doorway in the thin wall between them; all walls are thin."""
    first, second = (float(sides_m[0]) * between(rng, 1 - _VARIES, 1 + _VARIES) for _ in range(2))
    depth, thick = round(float(sides_m[1]) * between(rng, 1 - _VARIES, 1 + _VARIES), 3), THIN_WALL_M
    x = round(first, 3)
    left = Room(names[0], np.zeros(2), np.array([x, depth]))
    right = Room(names[1], np.array([x + thick, 0.0]), np.array([round(x + thick + second, 3), depth]))
    width, at = round(between(rng, 1.0, 1.12), 3), 0.3
    low = np.array([x, at if rng.random() < 0.5 else round(depth - at - width, 3)])
    through = Opening(left.name, low, low + np.array([thick, width]), np.array([1.0, 0.0]), beyond=right.name)
    shut = replace(doorway(rng, left, thick, up=True), beyond=None, closed=True)
    openings = [through, shut, *(opening for room in (left, right) for opening in windows(rng, room, thick, up=True))]
    return BareBuilding(*built(rng, turned_at_random(rng, FloorPlan((left, right), tuple(openings), thick))))


def glass_parted_room(rng: np.random.Generator, name: str, sides_m: Sequence[float]) -> BareBuilding:
    """A room whose longer side a glass partition divides; at one end of it is a way round."""
    bare = one_room(rng, name, sides_m)
    room, height_m = bare.plan.rooms[0], bare.plan.height_m
    extent = room.high - room.low
    long = int(np.argmax(extent))
    at, length = room.low[long] + between(rng, 0.42, 0.58) * extent[long], extent[1 - long] - _PASSAGE_M
    middle = room.center.copy()
    middle[long] = at
    middle[1 - long] += (1 if rng.random() < 0.5 else -1) * _PASSAGE_M / 2
    yaw = 0.0 if long == 1 else np.pi / 2
    pane = partition(float(length), height_m, metal(rng)).moved(_upright(middle, yaw))
    size = np.array([length, _PARTITION_THICK_M, height_m])
    barrier = Box3D(np.array([*middle, height_m / 2]), size, yaw)
    return BareBuilding(bare.plan, (*bare.fixtures, Fixture("window", pane)), (barrier,))


def cut_room(rng: np.random.Generator, name: str, sides_m: Sequence[float]) -> BareBuilding:
    """A room one of whose corners an oblique wall cuts off, where that meets no door or window."""
    bare = one_room(rng, name, sides_m)
    room, height_m = bare.plan.rooms[0], bare.plan.height_m
    walls = next(fixture.shape.materials for fixture in bare.fixtures if fixture.label == "wall")
    for factor in (1.0, 0.8, 0.6):
        for k in rng.permutation(4):
            legs = factor * rng.uniform(*_OBLIQUE_M, 2)
            outline = _corner(room, int(k), legs)
            if not any(_touches(outline, fixture) for fixture in bare.fixtures if fixture.label in {"door", "window"}):
                wall = Fixture("wall", extruded(outline, height_m, walls[-1]))
                return BareBuilding(bare.plan, (*bare.fixtures, wall), (_behind(outline, height_m),))
    return bare


def facing_sides(plan: BuildingPlan, first: str, second: str) -> tuple[int, int]:
    """Which wall (as in `places.AlongWall`) of each of two neighbouring rooms is the one between them."""
    a, b = plan.room(first), plan.room(second)
    gaps = np.array([a.low[1] - b.high[1], b.low[0] - a.high[0], b.low[1] - a.high[1], a.low[0] - b.high[0]])
    side = int(np.argmax(gaps))
    return side, (side + 2) % 4


def _one_room(rng: np.random.Generator, name: str, sides_m: Sequence[float]) -> FloorPlan:
    wall = round(between(rng, 0.12, 0.18), 3)
    extent = np.round([side * between(rng, 1 - _VARIES, 1 + _VARIES) for side in sides_m], 3)
    room = Room(name, np.zeros(2), extent)
    door = replace(doorway(rng, room, wall, up=True), beyond=None, closed=True)
    lit = tuple(windows(rng, room, wall, up=True)) if extent[0] >= _WINDOWED_M else ()
    return FloorPlan((room,), (door, *lit), wall)


def _upright(xy: FloatArray, yaw: float) -> FloatArray:
    cos, sin = np.cos(yaw), np.sin(yaw)
    return make_transform([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], [*xy, 0.0])


def _corner(room: Room, k: int, legs: FloatArray) -> FloatArray:
    """The triangle (3, 2) that an oblique wall cuts from the k-th corner of a room, counter-clockwise."""
    corner = np.array([[room.low[0], room.high[0]][k in {1, 2}], [room.low[1], room.high[1]][k in {2, 3}]])
    inwards = np.sign(room.center - corner)
    ends = [corner + np.array(leg) for leg in ((inwards[0] * legs[0], 0.0), (0.0, inwards[1] * legs[1]))]
    return np.array([corner, *(ends if k in {0, 2} else ends[::-1])])


def _touches(outline: FloatArray, fixture: Fixture) -> bool:
    low, high = fixture.shape.bounds
    margin = 0.15
    return bool((outline.min(axis=0) < high[:2] + margin).all() and (outline.max(axis=0) > low[:2] - margin).all())


def _behind(outline: FloatArray, height_m: float) -> Box3D:
    """The box behind an oblique wall: within the room it is just what the wall cuts off."""
    corner, start, end = outline
    along = (end - start) / np.linalg.norm(end - start)
    across = np.array([along[1], -along[0]])
    deep = float((corner - start) @ across)
    middle = (start + end) / 2 + across * deep / 2
    size = np.array([np.linalg.norm(end - start), abs(deep), height_m])
    return Box3D(np.array([*middle, height_m / 2]), size, float(np.arctan2(along[1], along[0])))
