"""Groups of things that belong together, drawn at random: a piece of furniture and what stands at, on and in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from supermap_cli.simulation.worlds.furnishing import RecipeLine
from supermap_cli.simulation.worlds.places import (
    AlongWall,
    AnyOf,
    At,
    Beside,
    FromCeiling,
    Hung,
    Inside,
    On,
    OnFloor,
    Place,
)
from supermap_cli.simulation.worlds.shapes.materials import between, pick

ON_DESKS = ("monitor", "keyboard", "mouse", "laptop", "mug", "bottle", "book", "cell phone", "vase", "printer")
ON_TABLES = ("mug", "bowl", "bottle", "vase", "book", "laptop", "cell phone", "handbag")
ON_BOARDS = ("book", "book", "vase", "bowl", "mug", "bottle")
ON_CABINETS = ("microwave", "printer", "vase", "bowl", "mug", "bottle", "potted plant", "handbag", "monitor")
ALONG_WALLS = ("refrigerator", "suitcase", "cardboard box", "backpack", "trash can", "bucket", "cart", "stool", "lamp")
FREE_STANDING = ("armchair", "stool", "safety sign", "bucket", "suitcase", "cardboard box", "backpack", "chair")


@dataclass(frozen=True)
class DrawnRoom:
    """What a group needs to know of the room that it is drawn for: how many small things a piece of furniture gets, and
    how high the ceiling is (m).
    """

    on_hosts: tuple[int, int]
    height_m: float

    def small_things(self, rng: np.random.Generator) -> int:
        """How many small things the next piece of furniture gets."""
        return int(rng.integers(self.on_hosts[0], self.on_hosts[1] + 1))


Group = Callable[[np.random.Generator, DrawnRoom, str], list[RecipeLine]]
"""Draws a group's lines, of which the first names the host of the others by the name given."""


def desk(rng: np.random.Generator, room: DrawnRoom, name: str, style: str = "") -> list[RecipeLine]:
    """A desk at a wall with things on it, mostly with a chair, sometimes with a bin."""
    lines = [RecipeLine("desk", AlongWall(), name=name, style=style)]
    if rng.random() < 0.85:
        lines.append(RecipeLine("chair", At(name, "front")))
    lines += _upon(rng, room, name, ON_DESKS)
    if rng.random() < 0.25:
        lines.append(RecipeLine("trash can", Beside(name)))
    return lines


def table(rng: np.random.Generator, room: DrawnRoom, name: str, style: str = "") -> list[RecipeLine]:
    """A table with chairs, free standing or at a wall."""
    place: Place = OnFloor(from_wall_m=0.4) if rng.random() < 0.6 else AlongWall()
    lines = [RecipeLine("table", place, name=name, style=style)]
    model = f"of {name}" if rng.random() < 0.7 else ""
    seat = "stool" if style and rng.random() < 0.3 else "chair"
    lines += [
        RecipeLine(seat, At(name), model=model, style=style if style == "thin" else "")
        for _ in range(int(rng.integers(1, 4)))
    ]
    return lines + _upon(rng, room, name, ON_TABLES)


def shelf(rng: np.random.Generator, room: DrawnRoom, name: str, style: str = "") -> list[RecipeLine]:
    """A bookshelf with things on its boards."""
    lines = [RecipeLine("bookshelf" if not style else "cabinet", AlongWall(), name=name, style=style)]
    count = room.small_things(rng) + 1
    return lines + [RecipeLine(pick(rng, ON_BOARDS), Inside(name)) for _ in range(count)]


def cabinet(rng: np.random.Generator, room: DrawnRoom, name: str) -> list[RecipeLine]:
    """A cabinet or a cart with things on it."""
    label = "cabinet" if rng.random() < 0.75 else "cart"
    lines = [RecipeLine(label, AlongWall(), name=name)]
    if label == "cart":
        count = max(1, room.small_things(rng) // 2)
        return lines + [RecipeLine(pick(rng, ON_BOARDS), AnyOf((On(name), Inside(name)))) for _ in range(count)]
    return lines + _upon(rng, room, name, ON_CABINETS)


def sofa(rng: np.random.Generator, room: DrawnRoom, name: str) -> list[RecipeLine]:
    """A couch or an armchair, perhaps with a bag on it and a lamp beside it."""
    label = pick(rng, ("couch", "armchair"))
    place: Place = AlongWall() if label == "couch" or rng.random() < 0.5 else OnFloor(0.1)
    lines = [RecipeLine(label, place, name=name)]
    if label == "couch" and rng.random() < 0.5:
        lines.append(RecipeLine(pick(rng, ("handbag", "book")), On(name)))
    if rng.random() < 0.4 and room.on_hosts[1] > 0:
        lines.append(RecipeLine("lamp", Beside(name)))
    return lines


def at_wall(rng: np.random.Generator, room: DrawnRoom, name: str) -> list[RecipeLine]:
    """One thing along a wall, or a plant or lamp in a corner; an open box may hold something."""
    if rng.random() < 0.3:
        return [RecipeLine(pick(rng, ("potted plant", "lamp")), AlongWall(corner=True))]
    lines = [RecipeLine(pick(rng, ALONG_WALLS), AlongWall(), name=name)]
    if lines[0].label == "cardboard box" and room.on_hosts[1] > 0:
        lines.append(RecipeLine(pick(rng, ("bottle", "book")), Inside(name, turn_deg=180)))
    return lines


def free_standing(rng: np.random.Generator, _: DrawnRoom, name: str) -> list[RecipeLine]:
    """One thing somewhere on the floor."""
    return [RecipeLine(pick(rng, FREE_STANDING), OnFloor(), name=name)]


def on_wall(rng: np.random.Generator, _: DrawnRoom, name: str) -> list[RecipeLine]:
    """One thing that hangs on a wall."""
    label = pick(rng, ("painting", "painting", "clock", "tv", "whiteboard", "fire extinguisher"))
    low_m = {"painting": (1.2, 1.5), "clock": (1.7, 1.9), "tv": (1.1, 1.3), "whiteboard": (0.85, 1.0)}
    return [RecipeLine(label, Hung(low_m.get(label, (0.75, 0.95))), name=name)]


USUAL: Mapping[Group, float] = {
    desk: 1.3, table: 1.2, shelf: 1.0, cabinet: 1.0, sofa: 0.8, at_wall: 2.2, free_standing: 1.0, on_wall: 1.2,
}  # fmt: skip
"""How often each group is drawn; what was drawn gets rarer."""


def one_of(label: str, style: str, *places: Place) -> Group:
    """A group of a single styled thing."""
    return lambda rng, _, name: [RecipeLine(label, pick(rng, places), name=name, style=style)]


def _stack(_: np.random.Generator, __: DrawnRoom, name: str) -> list[RecipeLine]:
    """Three boxes on one another, the smallest above."""
    lines = [RecipeLine("cardboard box", AlongWall(), name=name, style="closed large")]
    lines.append(RecipeLine("cardboard box", On(name, turn_deg=10), name=f"{name} middle", style="closed medium"))
    return [*lines, RecipeLine("cardboard box", On(f"{name} middle", turn_deg=15), style="closed small")]


def _book_pile(rng: np.random.Generator, _: DrawnRoom, name: str) -> list[RecipeLine]:
    """A table with books on one another; a cup or a smaller book is the topmost."""
    lines = [RecipeLine(pick(rng, ("table", "desk", "cabinet")), AlongWall(), name=f"{name} host")]
    lines.append(RecipeLine("book", On(f"{name} host"), name=name, style="lying large"))
    lines.append(RecipeLine("book", On(name, turn_deg=4), name=f"{name} middle", style="lying medium"))
    top = RecipeLine("mug", On(f"{name} middle", turn_deg=180))
    return [*lines, top if rng.random() < 0.6 else replace(top, label="book", style="lying small")]


def _nested(outer: RecipeLine, *inner: RecipeLine) -> Group:
    def lines(_: np.random.Generator, __: DrawnRoom, name: str) -> list[RecipeLine]:
        within = [replace(line, place=Inside(name, turn_deg=3 if line.style else 180)) for line in inner]
        return [replace(outer, name=name), *within]

    return lines


def _from_ceiling(label: str) -> Group:
    return lambda _, room, name: [RecipeLine(label, FromCeiling(room.height_m), name=name, style="hung")]


_ANYWHERE = OnFloor()
STYLED: Mapping[str, Sequence[Group]] = {
    "thin-legs": (
        partial(table, style="thin"), one_of("chair", "thin", _ANYWHERE), one_of("stool", "thin", _ANYWHERE),
        one_of("bookshelf", "thin", AlongWall()), one_of("lamp", "thin", _ANYWHERE, AlongWall()),
        one_of("clothes rack", "thin", AlongWall()),
    ),
    "overhang": (
        partial(table, style="overhanging"), partial(desk, style="overhanging"),
        one_of("stool", "overhanging", _ANYWHERE), one_of("lamp", "overhanging", AlongWall()),
    ),
    "leaning": tuple(
        one_of(label, "leaning", AlongWall(gap_m=(0.005, 0.015)))
        for label in ("board", "broom", "suitcase", "painting", "ladder")
    ),
    "stacked": (_stack, _book_pile),
    "nested": (
        _nested(RecipeLine("cardboard box", AlongWall()), RecipeLine("bottle", _ANYWHERE)),
        _nested(RecipeLine("basket", AlongWall(), style="open"), RecipeLine("handbag", _ANYWHERE, model="nested")),
        _nested(
            RecipeLine("trash can", AlongWall(), style="outer"), RecipeLine("trash can", _ANYWHERE, style="inner")
        ),
    ),
    "hanging": (
        _from_ceiling("lamp"), one_of("coat", "hung", Hung((0.6, 0.8))), one_of("painting", "", Hung((1.2, 1.5))),
        _from_ceiling("potted plant"),
    ),
    "glass": (partial(table, style="glass"), partial(shelf, style="glass")),
    "glossy": (
        one_of("tv", "", Hung((1.1, 1.3))), one_of("whiteboard", "", Hung((0.85, 1.0))),
        lambda _, __, name: [
            RecipeLine("desk", AlongWall(), name=name),
            RecipeLine("monitor", On(name, x=(-0.8, -0.2), y=(0.45, 0.95))),
            RecipeLine("laptop", On(name, x=(0.3, 0.8), y=(-0.8, 0.2))),
        ],
    ),
}  # fmt: skip
"""The groups that some levels ask for."""


def _upon(rng: np.random.Generator, room: DrawnRoom, name: str, labels: Sequence[str]) -> list[RecipeLine]:
    """Small things on a host, at most one screen."""
    lines: list[RecipeLine] = []
    for _ in range(room.small_things(rng)):
        label = pick(rng, labels)
        if label == "monitor":
            if any(line.label == "monitor" for line in lines):
                continue
            x = between(rng, -0.5, 0.2)
            lines.append(RecipeLine(label, On(name, x=(x, x + 0.3), y=(0.45, 0.95))))
        else:
            y = (-0.9, -0.4) if label in {"keyboard", "mouse"} else (-0.9, 0.9)
            lines.append(RecipeLine(label, On(name, y=y, turn_deg=25)))
    return lines
