"""The walls as a session's scene graph asks for them: with the objects of the map, which are none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.mapping.walls import WallMap, high_between
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
        return self.walls.clear_between(
            first, second, high_between(first, second, self._boxes(), self.walls.parameters)
        )

    def _boxes(self) -> list[Box3D]:
        return [node.box for node in self.nodes().values()]
