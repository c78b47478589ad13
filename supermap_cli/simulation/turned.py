"""A whole scenario in another frame: the building, all that stands and moves in it, and the visits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.scenario import Scenario, SimulatedTraversal
from supermap_cli.simulation.world import Fixture, World


def turned(scenario: Scenario, yaw: float) -> Scenario:
    """The scenario turned about the world's origin. Its plan, which knows level rectangles only, stays in the frame of
    the building.
    """
    cos, sin = np.cos(yaw), np.sin(yaw)
    T = make_transform([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], [0.0, 0.0, 0.0])
    world = scenario.world
    return replace(
        scenario,
        world=World(
            tuple(Fixture(fixture.label, fixture.shape.moved(T)) for fixture in world.fixtures),
            world.things,
            tuple(replace(stay, T_world_thing=T @ stay.T_world_thing) for stay in world.stays),
            tuple(replace(motion, T_world_body=T @ motion.T_world_body) for motion in world.motions),
        ),
        traversals=tuple(_turned_traversal(traversal, T, yaw) for traversal in scenario.traversals),
    )


def _turned_traversal(traversal: SimulatedTraversal, T: FloatArray, yaw: float) -> SimulatedTraversal:
    route = traversal.route
    moved = Route(route.start_ns, route.times_s, route.knots_xy @ T[:2, :2].T, route.knots_yaw + yaw)
    return replace(traversal, route=moved, T_world_odom=T @ traversal.T_world_odom)
