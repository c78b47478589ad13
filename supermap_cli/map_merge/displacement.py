"""Whether an object was pushed aside between two maps.

Its cloud is moved to where the other map's cloud lies, and the other map's depth images say which of the two places it
is in, as `mapping.displacement` does within a build. Clouds of an object that stood still may lie askew because each
shows another side of it; then the images support neither place clearly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.displacement import DEFAULT, depth_agreement, level_grid
from supermap_cli.mapping.objects import MapObject

MIN_VIEWS = 3
"""Views needed before a displacement is accepted."""
MIN_OBSERVABLE_SHARE = 0.05
"""A view of less than this share of the object, in either place, does not count."""

_SAMPLES = 300
"""Points of each cloud that are compared."""
_PENALTY_PER_M = 0.1
"""Taken off the overlap for each metre, so that of equal shifts the shortest is chosen."""


@dataclass
class DisplacementHypothesis:
    """A level shift `shift_m` (3,) that would explain the other cloud, and the evidence for it.

    `gain` sums over `views` how much better the displaced place explains the depth images; `since_ns` is the stamp of
    the first view that supports it.
    """

    shift_m: FloatArray
    gain: float = 0.0
    views: int = 0
    since_ns: int | None = None

    def add_view(self, depth: DepthView, obj: MapObject, stamp_ns: int) -> None:
        """Compare both places with one depth image."""
        displaced, unmoved = depth_agreement(depth, obj, np.array([self.shift_m, np.zeros(3)]))
        gain = float(displaced - unmoved)
        self.views += 1
        self.gain += gain
        if gain > DEFAULT.min_gain and self.since_ns is None:
            self.since_ns = stamp_ns

    @property
    def is_accepted(self) -> bool:
        """Whether the views support the shift."""
        return self.views >= MIN_VIEWS and self.gain > max(2 * DEFAULT.sure_gain, DEFAULT.min_gain * self.views)


def displacement_hypothesis(first: MapObject, second: MapObject) -> DisplacementHypothesis | None:
    """The level shift that lays the first cloud best on the second; `None` if it is too short to matter."""
    shift = _best_shift(first, second, level_grid(DEFAULT.coarse_step_m, DEFAULT.max_shift_m))
    shift = _best_shift(first, second, shift + level_grid(DEFAULT.fine_step_m, DEFAULT.coarse_step_m))
    return DisplacementHypothesis(shift) if float(np.linalg.norm(shift)) >= DEFAULT.min_shift_m else None


def _best_shift(first: MapObject, second: MapObject, shifts: FloatArray) -> FloatArray:
    """The one of some shifts (k, 3) with the most overlap of both clouds; of equal ones the shortest."""
    p, q = (obj.shape.points[:: len(obj.shape.points) // _SAMPLES + 1] for obj in (first, second))
    lying = first.shape.near((q[None] - shifts[:, None]).reshape(-1, 3)).reshape(len(shifts), -1).mean(axis=1)
    covered = second.shape.near((p[None] + shifts[:, None]).reshape(-1, 3)).reshape(len(shifts), -1).mean(axis=1)
    penalty = _PENALTY_PER_M * np.linalg.norm(shifts, axis=1)
    return np.asarray(shifts[int(np.argmax(lying + covered - penalty))])
