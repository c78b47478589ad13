"""Nodes of the scene graph, made from boxes: for tests of relations."""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.types.relations import GraphNode

Point = tuple[float, float, float]


def node(number: int, label: str, foot: Point, size: Point, yaw: float = 0.0) -> GraphNode:
    """A closed box that stands with the centre of its lower side on `foot`."""
    box = Box3D(np.array([foot[0], foot[1], foot[2] + size[2] / 2]), np.array(size), yaw)
    return GraphNode(number, label, box, surface(box))


def table(number: int = 2, foot: Point = (0, 0, 0), height: float = 0.75, label: str = "dining table") -> GraphNode:
    """A table top of 1.6 x 0.9 m on one thin leg: below it there is room."""
    box = Box3D(np.array([foot[0], foot[1], height / 2]), np.array([1.6, 0.9, height]), 0.0)
    top = surface(Box3D(np.array([foot[0], foot[1], height - 0.02]), np.array([1.6, 0.9, 0.04]), 0.0))
    leg = surface(Box3D(np.array([foot[0] + 0.7, foot[1], height / 2]), np.array([0.06, 0.06, height]), 0.0))
    return GraphNode(number, label, box, np.concatenate([top, leg]))


def surface(box: Box3D, step_m: float = 0.04) -> np.ndarray:
    """Points of the six sides, `step_m` apart."""
    axes = [np.linspace(-side / 2, side / 2, max(2, round(side / step_m) + 1)) for side in box.size]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    outer = (np.abs(grid) >= box.size / 2 - 1e-9).any(axis=1)
    c, s = np.cos(box.yaw), np.sin(box.yaw)
    points: np.ndarray = grid[outer] @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + box.center
    return points
