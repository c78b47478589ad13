"""Axes of the world: rooms, density, look-alikes, furniture, materials, dwell, people, changes."""

from __future__ import annotations

from supermap_cli.simulation.domains.domain import Axis

WORLD_AXES: tuple[Axis, ...] = ()
