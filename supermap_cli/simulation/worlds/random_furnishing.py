"""Rooms that fill with groups of things drawn at random, as many as are wanted and find a place."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from supermap_cli.simulation.worlds.furnishing import Interior, RecipeLine
from supermap_cli.simulation.worlds.random_recipes import USUAL, DrawnRoom, Group

_FAILURES = 25  # groups in a row that find no place: then the rooms count as full
_FULL_HOST = 3  # small things in a row that find no place on one host
_COPIES = 5  # of the things of one label, before no more are drawn of it, but for every tenth thing one more


def furnish_at_random(
    interior: Interior,
    rooms: Sequence[str],
    wanted: int,
    on_hosts: tuple[int, int],
    rng: np.random.Generator,
    *,
    first: Sequence[Group] = (),
) -> None:
    """Place groups until there are `wanted` things in these rooms, or no more find a place: those of `first` once, then
    the usual ones. A small room lets go of what does not fit.
    """
    drawn = DrawnRoom(on_hosts, interior.plan.height_m)
    areas = np.array([np.prod(interior.plan.room(name).high - interior.plan.room(name).low) for name in rooms])
    waiting, times, failures, number = list(first), Counter[Group](), 0, 0
    while _count(interior, rooms) < wanted and failures < _FAILURES:
        group = waiting.pop(0) if waiting else _drawn_group(times, rng)
        times[group] += 1
        room = str(rng.choice(list(rooms), p=areas / areas.sum()))
        lines = group(rng, drawn, f"group {number}")
        number += 1
        placed = _placed(interior, room, lines, wanted - _count(interior, rooms), rng)
        failures = 0 if placed else failures + 1


def _placed(interior: Interior, room: str, lines: Sequence[RecipeLine], most: int, rng: np.random.Generator) -> int:
    """How many of a group's things found a place; none where its host did not."""
    placed, refused = 0, 0
    for line in lines:
        if placed == most or refused == _FULL_HOST:
            break
        if placed and _too_many(interior, line):
            continue
        try:
            thing = interior.place(line, room, rng)
        except LookupError:  # its host, itself a thing on something, found no place
            thing = None
        if thing is None and not placed:
            return 0
        placed, refused = (placed + 1, 0) if thing is not None else (placed, refused + 1)
    return placed


def _too_many(interior: Interior, line: RecipeLine) -> bool:
    """Whether there are enough things of a label, where it need not be this one (books and cups may be many)."""
    if line.style or line.label in {"book", "mug", "bottle", "bowl", "vase", "chair"}:
        return False
    same = sum(placed.piece.label == line.label for placed in interior.placed)
    return same >= _COPIES + len(interior.placed) // 10


def _drawn_group(times: Counter[Group], rng: np.random.Generator) -> Group:
    groups = list(USUAL)
    weights = np.array([USUAL[group] / (1 + 0.7 * times[group]) for group in groups])
    return groups[int(rng.choice(len(groups), p=weights / weights.sum()))]


def _count(interior: Interior, rooms: Sequence[str]) -> int:
    return sum(placed.room in rooms for placed in interior.placed)
