"""A level that changes the robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from supermap_cli.simulation.domains.domain import Level
from supermap_cli.simulation.rigs import SimulatedRig


def rig_level(text: str, change: Callable[[SimulatedRig], SimulatedRig]) -> Level:
    """A level that lays a change over the rig alone."""
    return Level(text, lambda domain: replace(domain, rig=change(domain.rig)))
