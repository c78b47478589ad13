"""What is simulated: a world, a robot, and its traversals of the world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from zlib import crc32

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.simulation.building_plan import BuildingPlan
from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.rigs import SimulatedRig
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.sway import Sway
from supermap_cli.simulation.world import World


@dataclass(frozen=True)
class SimulatedTraversal:
    """One traversal: `name` becomes the recording's; `T_world_odom` (4, 4) is where its odometry starts from."""

    name: str
    route: Route
    T_world_odom: FloatArray

    def carried(self, pivot_m: float, seed: Sequence[int]) -> SimulatedTraversal:
        """The same way of a base that a walking person carries, `pivot_m` above the floor; its odometry starts level,
        under the base.
        """
        sway = Sway.drawn(pivot_m, np.random.default_rng((*seed, crc32(b"sway"))))
        return replace(self, route=replace(self.route, sway=sway))


@dataclass(frozen=True)
class Scenario:
    """A world with all its changes on one clock, and the traversals of it in the order of time.

    `errors` are those of its detector; `levels` says which levels of which axes (`simulation.domains`) it was asked
    for.
    """

    name: str
    seed: int
    plan: BuildingPlan
    world: World
    rig: SimulatedRig
    traversals: tuple[SimulatedTraversal, ...]
    errors: DetectorErrors = field(default_factory=DetectorErrors)
    levels: Mapping[str, str] = field(default_factory=dict)
