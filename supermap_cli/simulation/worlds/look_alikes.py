"""Things that one can hardly tell apart: rows of one chair, twins of everything, and things of a class that swap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import inverse, make_transform
from supermap_cli.simulation.building_plan import Room
from supermap_cli.simulation.worlds.furnishing import Interior, RecipeLine
from supermap_cli.simulation.worlds.places import OnFloor, PlacedPiece
from supermap_cli.simulation.worlds.shapes.materials import between, pick

ROW_OF = (6, 12)
"""Least and greatest number of chairs in rows."""
ROW_GAP_M = (0.15, 0.4)
"""Least and greatest distance from edge to edge of chairs in a row, m: as in a waiting room."""
TWIN_M = (1.0, 2.0)
"""Least and greatest distance of a twin, m: beyond what a robot's pose is wrong by, and within one view."""
SWAP_M = 1.0
"""Least distance of things that swap places, m."""
_TWINS_DRAWN, _ROWS_DRAWN, _SWAPS_DRAWN = 40, 12, 20


def place_rows(interior: Interior, room_name: str, rng: np.random.Generator) -> int:
    """Chairs of one model in one to three rows that all face one way; fewer where not so many fit. Returns how many."""
    room, piece = interior.plan.room(room_name), interior.make_piece(RecipeLine("chair", OnFloor()), rng)
    for count in range(int(rng.integers(ROW_OF[0], ROW_OF[1] + 1)), 1, -1):
        for _ in range(_ROWS_DRAWN):
            placed: list[PlacedPiece] = []
            for T_world_thing in _row_poses(room, piece.size, count, rng):
                thing = interior.stand(piece, T_world_thing, room_name, name="row")
                if thing is None:
                    break
                placed.append(thing)
            if len(placed) == count:
                return count
            for thing in placed:
                interior.take_out(thing)
    return 0


def twin_all(interior: Interior, things: Sequence[PlacedPiece], rng: np.random.Generator) -> None:
    """Give each of these things an identical twin near by; what finds no place for one is taken out, with what stands
    on it. Hosts come before what stands on them, so that a host's twin can hold the twins of its things.
    """
    twins: dict[str, PlacedPiece] = {}
    for thing in things:
        if thing.on is not None and thing.on not in twins:
            interior.take_out(thing)
            continue
        twin = _twin(interior, thing, twins, rng)
        if twin is None:
            interior.take_out(thing)
        else:
            twins[thing.thing_id] = twin


def swap(interior: Interior, room_name: str, label: str, rng: np.random.Generator) -> tuple[str, ...]:
    """Place two different things of a label that stand in each other's place afterwards. Returns their ids: none where
    there is no room for it.
    """
    line = RecipeLine(label, OnFloor())
    for _ in range(_SWAPS_DRAWN):
        first = interior.place(line, room_name, rng)
        second = interior.place(line, room_name, rng)
        pair = [thing for thing in (first, second) if thing is not None]
        if first is not None and second is not None and _apart_m(first, second) >= SWAP_M:
            ids = (first.thing_id, second.thing_id)
            pair += [
                moved
                for thing, other in ((first, second), (second, first))
                if (moved := interior.stand_again(thing, other.T_world_thing, unless=ids)) is not None
            ]
            if len(pair) == 4:
                return ids
        for thing in pair:
            interior.take_out(thing)
    return ()


def _apart_m(first: PlacedPiece, second: PlacedPiece) -> float:
    return float(np.linalg.norm(first.T_world_thing[:2, 3] - second.T_world_thing[:2, 3]))


def _row_poses(room: Room, size: FloatArray, count: int, rng: np.random.Generator) -> list[FloatArray]:
    """Poses of a block of chairs somewhere in a room."""
    rows = int(rng.integers(1, 4 if count >= 9 else 3))
    columns = int(np.ceil(count / rows))
    gap_m = between(rng, *ROW_GAP_M)
    pitch = size[:2] + gap_m
    turn, center = pick(rng, (0.0, 0.5, 1.0, 1.5)) * np.pi + between(rng, -0.05, 0.05), rng.uniform(room.low, room.high)
    T_world_block = _flat(center[0], center[1], turn)
    cells = [(column - (columns - 1) / 2, row - (rows - 1) / 2) for row in range(rows) for column in range(columns)]
    return [T_world_block @ _flat(x * pitch[0], y * pitch[1], between(rng, -0.04, 0.04)) for x, y in cells[:count]]


def _twin(
    interior: Interior, thing: PlacedPiece, twins: dict[str, PlacedPiece], rng: np.random.Generator
) -> PlacedPiece | None:
    if thing.on is not None:
        host = next(placed for placed in interior.placed if placed.thing_id == thing.on)
        T_host_thing = inverse(host.T_world_thing) @ thing.T_world_thing
        return _stood(interior, thing, twins[thing.on].T_world_thing @ T_host_thing, twins[thing.on].thing_id)
    hangs = thing.T_world_thing[2, 3] > 0
    for k in range(_TWINS_DRAWN):
        distance_m = between(rng, *TWIN_M)
        along = pick(rng, (0.0, np.pi)) if hangs or k < _TWINS_DRAWN / 2 else between(rng, -np.pi, np.pi)
        beside = thing.T_world_thing @ _flat(distance_m * np.cos(along), distance_m * np.sin(along), 0.0)
        twin = _stood(interior, thing, beside, None)
        if twin is not None:
            return twin
    return None


def _stood(interior: Interior, thing: PlacedPiece, T_world_thing: FloatArray, on: str | None) -> PlacedPiece | None:
    distance_m = float(np.linalg.norm(T_world_thing[:2, 3] - thing.T_world_thing[:2, 3]))
    if not TWIN_M[0] <= distance_m <= TWIN_M[1] + 1e-6:
        return None
    return interior.stand(thing.piece, T_world_thing, thing.room, on, name=thing.name)


def _flat(x: float, y: float, yaw: float) -> FloatArray:
    cos, sin = np.cos(yaw), np.sin(yaw)
    return make_transform([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], [x, y, 0.0])
