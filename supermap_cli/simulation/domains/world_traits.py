"""What an axis may ask of a world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Building = Literal["single", "closet", "hall", "corridor", "slanted", "thin", "glass"]
"""`corridor`: two rooms and a corridor; `slanted`: one room turned by any angle, one of its corners cut off by an
oblique wall; `thin`: two rooms with a wall of 5 cm between them; `glass`: one room with a glass partition.
"""
LookAlikes = Literal["none", "rows", "pairs", "swapped"]
Furniture = Literal["usual", "thin-legs", "overhang", "leaning", "stacked", "nested", "hanging"]
Materials = Literal["usual", "dark", "glossy", "glass"]
Dwell = Literal["usual", "turn", "pass"]
Changes = Literal[
    "none", "appear", "vanish", "shifted", "moved", "rotated", "replaced", "hidden", "all", "unchanged"
]  # fmt: skip


@dataclass(frozen=True)
class WorldTraits:
    """How a world of the scenario `room` is made. The defaults are its usual levels.

    `building` is what rooms there are, `floor_m` the two sides of a room in metres, before they vary by 8 % each;
    `stretch` is a factor on them where rooms have no size of their own. `things` is the least and the greatest number
    of things (fewer where they find no place), `on_hosts` that of the small things on or in each piece of furniture.
    `seconds` is how long each visit lasts. `walking` people walk about, `standing` ones stand all the time, and one
    may come who carries something (`carrying`). `changes` other than `none` make a second visit on the next day;
    `shift_m` is how far things are pushed aside (m), for `shifted`.
    """

    building: Building = "single"
    floor_m: tuple[float, float] = (5.0, 6.0)
    stretch: float = 1.0
    things: tuple[int, int] = (16, 20)
    on_hosts: tuple[int, int] = (1, 4)
    seconds: float = 30.0
    look_alikes: LookAlikes = "none"
    furniture: Furniture = "usual"
    materials: Materials = "usual"
    dwell: Dwell = "usual"
    walking: int = 1
    standing: int = 0
    carrying: bool = False
    changes: Changes = "none"
    shift_m: float = 0.5
