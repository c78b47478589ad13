"""The walls as a session's scene graph asks for them: with the objects of the map, which are none."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.mapping.walls import WallMap
from supermap_cli.types.relations import GraphNode


@dataclass
class SessionWalls:
    """Walls, less the sides of what stands in the map; `nodes` are the objects that do now."""

    walls: WallMap
    nodes: Callable[[], Mapping[int, GraphNode]]

    @property
    def views(self) -> int:
        """How many depth images the walls are known from."""
        return self.walls.views

    def clear_between(self, first: Box3D, second: Box3D) -> bool:
        """Whether no wall is known to stand between two boxes."""
        return self.walls.clear_between(first, second, high_between(first, second, self._boxes(), self.walls))

    def _boxes(self) -> list[Box3D]:
        return [node.box for node in self.nodes().values()]


def high_between(first: Box3D, second: Box3D, boxes: list[Box3D], walls: WallMap) -> list[Box3D]:
    """Those of some boxes that are high enough to be taken for a wall, and lie between two others."""
    (ax, ay), (bx, by) = first.center[:2].tolist(), second.center[:2].tolist()
    middle_x, middle_y, reach_m = (ax + bx) / 2, (ay + by) / 2, math.hypot(ax - bx, ay - by) / 2
    least_m = walls.parameters.least_height_m - 2 * walls.parameters.bin_m
    return [
        box
        for box in boxes
        if box.size[2] >= least_m
        and math.hypot(box.center[0] - middle_x, box.center[1] - middle_y)
        <= reach_m + math.hypot(box.size[0], box.size[1]) / 2 + walls.parameters.near_m
    ]
