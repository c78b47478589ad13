"""A domain: everything about a recording that an axis may vary, and the axes with their levels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.domains.world_traits import WorldTraits
from supermap_cli.simulation.rigs import SimulatedRig


@dataclass(frozen=True)
class Domain:
    """The robot, its detector and the world as one level of each axis makes them."""

    rig: SimulatedRig
    errors: DetectorErrors = field(default_factory=DetectorErrors)
    world: WorldTraits = field(default_factory=WorldTraits)


@dataclass(frozen=True)
class Level:
    """One value of an axis: `text` says what it is, `apply` lays it over a domain."""

    text: str
    apply: Callable[[Domain], Domain]


@dataclass(frozen=True)
class Axis:
    """One thing that differs between recordings. `usual` names the level that stands where nothing else is asked for.

    `of_world` marks an axis that changes the world, not only how it is measured: it needs a scenario whose world is
    made from a domain.
    """

    name: str
    text: str
    usual: str
    levels: Mapping[str, Level]
    of_world: bool = False

    def __post_init__(self) -> None:
        if self.usual not in self.levels:
            raise ValueError(f"axis {self.name}: the usual level {self.usual!r} is none of its levels")


def usual_level(text: str) -> Level:
    """A level that leaves the domain as it is."""
    return Level(text, lambda domain: domain)
