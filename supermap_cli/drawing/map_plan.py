"""What a plan of a map from above shows, as values: things, ways, changes, and the floor that was seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from supermap_cli.drawing.observed_floor import ObservedFloor
from supermap_cli.geometry.arrays import FloatArray

Standing = Literal["present", "unknown", "doubted", "absent", "ended"]
"""Unknown: nobody can say at that time. Absent: its place was seen empty. Ended: it stands elsewhere today."""

MARGIN_M = 0.4
"""m; free space around what is drawn (chosen)."""
_DEFAULT_HALF_M = 2.0
"""m; half the edge of the plan of an empty map (chosen)."""


@dataclass(frozen=True)
class PlanThing:
    """A thing: the corners (4, 2) of its box in metres of the map frame, how it stands, and its top's height in m."""

    id: str
    label: str
    corners: FloatArray
    standing: Standing
    z_max: float = 0.0

    @property
    def middle(self) -> FloatArray:
        """The middle (2,) of its box."""
        middle: FloatArray = self.corners.mean(axis=0)
        return middle


@dataclass(frozen=True)
class PlanChange:
    """A change: `kind` as in temporal edges; from and to (2,), metres, equal where nothing moved."""

    kind: str
    id: str
    start: FloatArray
    end: FloatArray


@dataclass(frozen=True)
class PlanWay:
    """The robot's way (n, 2) in one traversal, metres."""

    traversal: str
    points: FloatArray


@dataclass(frozen=True)
class MapPlan:
    """All that a plan shows."""

    title: str
    things: Sequence[PlanThing]
    ways: Sequence[PlanWay] = ()
    changes: Sequence[PlanChange] = ()
    floor: ObservedFloor | None = None
    changes_of: str = ""
    """The traversal whose changes are marked; empty where none are."""
    window: tuple[FloatArray, FloatArray] | None = None
    """The lower and upper corner (2,) of the part that is drawn, m; `None` for all."""

    def extent(self) -> tuple[FloatArray, FloatArray]:
        """The lower and upper corner (2,) of what is drawn, with a margin."""
        if self.window is not None:
            return self.window
        parts = [*(thing.corners for thing in self.things), *(way.points for way in self.ways)]
        parts += [np.stack([change.start, change.end]) for change in self.changes]
        if self.floor is not None:
            parts.append(np.stack([self.floor.low, self.floor.high]))
        parts = [part for part in parts if len(part)]
        if not parts:
            return np.full(2, -_DEFAULT_HALF_M), np.full(2, _DEFAULT_HALF_M)
        together = np.concatenate(parts)
        return together.min(axis=0) - MARGIN_M, together.max(axis=0) + MARGIN_M
