"""The objects of the map as the scene graph sees them."""

from __future__ import annotations

from dataclasses import dataclass, field

from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.types.relations import GraphNode


@dataclass
class SceneNodes:
    """A node for each object that stands in the map now; the same as before while its object has not changed."""

    by_number: dict[int, GraphNode] = field(default_factory=dict)

    def update(self, objects: ObjectMap) -> dict[int, GraphNode]:
        """Bring the nodes up to date; by number."""
        self.by_number = {
            obj.number: _node(obj, self.by_number.get(obj.number))
            for obj in objects
            if obj.confirmed and obj.present and not obj.demoted and not obj.is_moving
        }
        return self.by_number


def _node(obj: MapObject, before: GraphNode | None) -> GraphNode:
    label, shape = obj.label, obj.shape
    if before is not None and before.points is shape.points and before.label == label:
        return before
    return GraphNode(obj.number, label, shape.box, shape.points)
