"""The fixed set of worlds that `supermap eval benchmark --suite domains` builds and scores."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from supermap_cli.simulation.domains.axes import AXES, RANDOM

Half = Literal["development", "report"]
HALVES: tuple[Half, ...] = ("development", "report")

USUAL = "usual"
"""The axis of the worlds in which every axis has its usual level: what the others are held against."""

USUAL_WORLDS, RANDOM_WORLDS = 4, 6
"""How many worlds of each half have all axes at their usual levels, and at random ones."""

_FIRST_SEED = {"development": 1, "report": 101}
"""The halves share no seed, and so no room, no drive and no noise."""


@dataclass(frozen=True)
class SuiteWorld:
    """One world: the axis that is varied (or `USUAL`, or `RANDOM`), its level, the seed, and the half it belongs to."""

    axis: str
    level: str
    seed: int
    half: Half

    @property
    def name(self) -> str:
        """`masks=hull, seed 2`."""
        return f"{self.axis}={self.level}, seed {self.seed}" if self.level else f"{self.axis}, seed {self.seed}"

    @property
    def domain(self) -> tuple[str, ...]:
        """What `--domain` is given for it."""
        return () if self.axis == USUAL else (RANDOM,) if self.axis == RANDOM else (f"{self.axis}={self.level}",)


def suite_worlds() -> tuple[SuiteWorld, ...]:
    """Every level but the usual one of every axis, one world in each half; usual and random worlds in each half.

    The seeds of the levels go round those of the usual worlds, so that each level has a usual world of the same room
    to be held against.
    """
    return tuple(world for half in HALVES for world in _half(half))


def _half(half: Half) -> Iterator[SuiteWorld]:
    first = _FIRST_SEED[half]
    for k in range(USUAL_WORLDS):
        yield SuiteWorld(USUAL, "", first + k, half)
    varied = [(axis.name, level) for axis in AXES.values() for level in axis.levels if level != axis.usual]
    for k, (axis, level) in enumerate(varied):
        yield SuiteWorld(axis, level, first + k % USUAL_WORLDS, half)
    for k in range(RANDOM_WORLDS):
        yield SuiteWorld(RANDOM, "", first + USUAL_WORLDS + k, half)
