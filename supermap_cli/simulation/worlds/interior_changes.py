"""Changes of a furnished building between two traversals, and the stays of everything in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import footprint_gap_m
from supermap_cli.simulation.world import Stay
from supermap_cli.simulation.worlds.furnishing import Interior
from supermap_cli.simulation.worlds.places import PlacedPiece
from supermap_cli.simulation.worlds.room_recipes import AddThing, InteriorChange, RemoveThing, ShiftThing


@dataclass(frozen=True)
class ChangedInterior:
    """The ids of things that are gone afterwards, are new, and stand elsewhere (with two places in the interior)."""

    gone: frozenset[str] = frozenset()
    new: frozenset[str] = frozenset()
    moved: frozenset[str] = frozenset()

    @property
    def ids(self) -> frozenset[str]:
        """All of them."""
        return self.gone | self.new | self.moved

    def places_xy(self, interior: Interior) -> list[FloatArray]:
        """Where these things stand before or after, (2,) each."""
        return [placed.T_world_thing[:2, 3] for placed in interior.placed if placed.thing_id in self.ids]


def change_interior(interior: Interior, changes: Sequence[InteriorChange], rng: np.random.Generator) -> ChangedInterior:
    """Choose the things that change, and find places for what is new or moves: free before as well as afterwards.

    Of several that fit a change the one that stands most freely is chosen, so that it can be seen well. Raises
    `SimulationError` when there is none, or no place.
    """
    changed = ChangedInterior()
    for change in changes:
        if isinstance(change, AddThing):
            thing = interior.add(change.line, change.room, rng)
            changed = ChangedInterior(changed.gone, changed.new | {thing.thing_id}, changed.moved)
            continue
        thing = _most_open(
            interior, change.label, change.room if isinstance(change, RemoveThing) else None, changed.ids
        )
        if isinstance(change, RemoveThing):
            changed = ChangedInterior(changed.gone | {thing.thing_id}, changed.new, changed.moved)
            continue
        if isinstance(change, ShiftThing):
            interior.nudged(thing, change.distance_m, rng)
        else:
            interior.another_place(thing, change.place, change.room, rng, at_least_m=change.at_least_m)
        changed = ChangedInterior(changed.gone, changed.new, changed.moved | {thing.thing_id})
    return changed


def stays_with(interior: Interior, changed: ChangedInterior, change_ns: int | None) -> tuple[Stay, ...]:
    """Where everything stands until and since the time of the changes."""
    begun: set[str] = set()
    stays = []
    for placed in interior.placed:
        second = placed.thing_id in begun
        begun.add(placed.thing_id)
        since_ns = change_ns if second or placed.thing_id in changed.new else None
        leaves = placed.thing_id in changed.gone or (placed.thing_id in changed.moved and not second)
        stays.append(Stay(placed.thing_id, placed.T_world_thing, since_ns, change_ns if leaves else None, placed.on))
    return tuple(stays)


def _most_open(interior: Interior, label: str, room: str | None, taken: frozenset[str]) -> PlacedPiece:
    hosts = {placed.on for placed in interior.placed}
    fitting = [
        placed
        for placed in interior.placed
        if placed.piece.label == label and placed.room == (room or placed.room) and placed.on is None
        and placed.thing_id not in hosts | taken
    ]  # fmt: skip
    if not fitting:
        raise SimulationError(f"there is no {label} to change", cure="choose another --seed")
    return max(fitting, key=lambda thing: _gap_m(thing, interior.placed))


def _gap_m(thing: PlacedPiece, others: Sequence[PlacedPiece]) -> float:
    """How far the nearest other thing in its room is."""
    boxes = [placed.box for placed in others if placed.thing_id != thing.thing_id and placed.room == thing.room]
    return min((footprint_gap_m(thing.box, box) for box in boxes), default=float("inf"))
