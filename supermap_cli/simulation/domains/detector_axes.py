"""Axes of the detector: recall, false alarms, labels, masks."""

from __future__ import annotations

from supermap_cli.simulation.domains.domain import Axis

DETECTOR_AXES: tuple[Axis, ...] = ()
