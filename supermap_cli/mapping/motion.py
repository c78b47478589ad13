"""Short-term dynamics: people and carried things are followed while they move, and never burn into the static map."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import FloatArray

RECENT = 4
"""Sightings that decide whether something moves now."""


@dataclass
class MotionState:
    """The last few places of an object, and whether it is on the move.

    A thing moves when its last sightings lie clearly apart in one direction, more than partial views of a still thing
    of its size can explain; it has come to rest when they agree again.
    """

    stamps_ns: list[int] = field(default_factory=list)
    centroids: list[FloatArray] = field(default_factory=list)
    moving: bool = False

    def sighted(self, stamp_ns: int, centroid_map: FloatArray, overlap: float, size_m: float) -> None:
        """Take in a sighting: (3,) centroid, share of it that lies on the known cloud, size of what was seen."""
        self.stamps_ns = [*self.stamps_ns, stamp_ns][-RECENT:]
        self.centroids = [*self.centroids, centroid_map][-RECENT:]
        if len(self.centroids) < RECENT - 1:
            return
        steps = np.diff(np.array(self.centroids), axis=0)
        travelled = float(np.linalg.norm(np.sum(steps, axis=0)))
        wandered = float(np.linalg.norm(steps, axis=1).sum())
        straight = travelled > 0.8 * wandered
        if not self.moving:
            self.moving = straight and travelled > max(0.3, 0.6 * size_m) and overlap < 0.2
        else:
            self.moving = wandered > 0.1 * (len(self.centroids) - 1)
