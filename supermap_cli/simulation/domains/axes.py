"""All axes by name, and the domain that chosen levels make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from zlib import crc32

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.simulation.domains.detector_axes import DETECTOR_AXES
from supermap_cli.simulation.domains.domain import Axis, Domain
from supermap_cli.simulation.domains.rig_axes import RIG_AXES
from supermap_cli.simulation.domains.world_axes import WORLD_AXES

AXES: Mapping[str, Axis] = {axis.name: axis for axis in (*RIG_AXES, *DETECTOR_AXES, *WORLD_AXES)}
"""Every axis, in the order in which its level is laid over the domain."""

RANDOM = "random"
"""What `--domain` takes in place of NAME=LEVEL to draw the levels of all axes that are not named."""

_USUAL_SHARE = 0.5
"""Probability that a random domain has an axis at its usual level; chosen so that half of the axes are odd."""


def choose_levels(given: Sequence[str], seed: int) -> dict[str, str]:
    """`["masks=hull", "random"]` -> a level for each axis named, and for all others where `random` is given too.

    An axis left out keeps its usual level. Raises `SimulationError` for an unknown axis or level.
    """
    named: dict[str, str] = {}
    for text in given:
        if text != RANDOM:
            name, level = _named(text)
            if named.get(name, level) != level:
                raise SimulationError(f"two levels for {name}: {named[name]} and {level}", cure="give one")
            named[name] = level
    drawn = random_levels(seed) if RANDOM in given else {}
    return {name: (drawn | named)[name] for name in AXES if name in drawn or name in named}


def random_levels(seed: int) -> dict[str, str]:
    """A level of every axis, each drawn from a generator of its own, so that a further axis changes no other. The usual
    level is drawn half of the time: a recording is rarely odd in every respect.
    """
    return {axis.name: _random_level(axis, seed) for axis in AXES.values()}


def _random_level(axis: Axis, seed: int) -> str:
    rng = np.random.default_rng((seed, crc32(axis.name.encode())))
    others = [level for level in axis.levels if level != axis.usual]
    return axis.usual if rng.random() < _USUAL_SHARE else str(rng.choice(others))


def apply_levels(domain: Domain, levels: Mapping[str, str]) -> Domain:
    """The domain with these levels laid over it, in the order of the axes."""
    for name, axis in AXES.items():
        domain = axis.levels[levels.get(name, axis.usual)].apply(domain)
    return domain


def _named(text: str) -> tuple[str, str]:
    name, equals, level = text.partition("=")
    if not equals:
        raise SimulationError(f"--domain {text!r} is not understood", cure=f"write NAME=LEVEL, or {RANDOM}")
    if name not in AXES:
        raise SimulationError(f"there is no axis {name!r}", cure=f"choose one of {', '.join(AXES)}")
    if level not in AXES[name].levels:
        levels = ", ".join(AXES[name].levels)
        raise SimulationError(f"the axis {name} has no level {level!r}", cure=f"choose one of {levels}")
    return name, level
