"""Was a thing pushed aside between two memories? Its cloud is laid where the other memory's lies, and that memory's
depth images say which of the two places it is in (as `mapping.displacement` does within a build).

Two clouds of a thing that stood still lie askew, too, where each shows another side of it: then the images agree with
neither place less than with the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.displacement import DEFAULT, depth_agreement, level_grid
from supermap_cli.mapping.objects import MapObject

LEAST_LOOKS = 3
TOLD_SHARE = 0.05
"""A look that can tell of less of it than this, in either place, says nothing."""

_SAMPLES = 300
_RELUCTANCE_PER_M = 0.1


@dataclass
class LaidAside:
    """A level shift (3,) that would explain the other cloud, and what looks said for it, all together by `gain`; the
    first that did so at `since_ns`.
    """

    shift_m: FloatArray
    gain: float = 0.0
    looks: int = 0
    since_ns: int | None = None

    def look(self, depth: DepthView, standing: MapObject, stamp_ns: int) -> None:
        """Take in what an image says of both places."""
        there, here = depth_agreement(depth, standing, np.array([self.shift_m, np.zeros(3)]))
        gain = float(there - here)
        self.looks += 1
        self.gain += gain
        if gain > DEFAULT.min_gain and self.since_ns is None:
            self.since_ns = stamp_ns

    @property
    def is_sure(self) -> bool:
        """Whether it was pushed aside."""
        return self.looks >= LEAST_LOOKS and self.gain > max(2 * DEFAULT.sure_gain, DEFAULT.min_gain * self.looks)


def laid_aside(first: MapObject, second: MapObject) -> LaidAside | None:
    """The level shift by which the first cloud lies best on the second; `None` if that is none to speak of."""
    shift = _best(first, second, level_grid(DEFAULT.coarse_step_m, DEFAULT.max_shift_m))
    shift = _best(first, second, shift + level_grid(DEFAULT.fine_step_m, DEFAULT.coarse_step_m))
    return LaidAside(shift) if float(np.linalg.norm(shift)) >= DEFAULT.min_shift_m else None


def _best(first: MapObject, second: MapObject, shifts: FloatArray) -> FloatArray:
    """The one of some shifts (k, 3) by which most of each cloud lies on the other; of equals the least."""
    p, q = (each.shape.points[:: len(each.shape.points) // _SAMPLES + 1] for each in (first, second))
    lying = first.shape.near((q[None] - shifts[:, None]).reshape(-1, 3)).reshape(len(shifts), -1).mean(axis=1)
    covered = second.shape.near((p[None] + shifts[:, None]).reshape(-1, 3)).reshape(len(shifts), -1).mean(axis=1)
    away = _RELUCTANCE_PER_M * np.linalg.norm(shifts, axis=1)
    return np.asarray(shifts[int(np.argmax(lying + covered - away))])
