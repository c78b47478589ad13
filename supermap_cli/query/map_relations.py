"""The relations of a stored map as questions compute them: on the boxes, labels, surfaces and walls that it holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.relations import StoredForm, stored_forms
from supermap_cli.relations.map_relations import relations_of_configs
from supermap_cli.relations.registry import RelationRegistry
from supermap_cli.types.memory import StateRecord
from supermap_cli.types.relations import GraphNode, Pair, PredicateParameters

if TYPE_CHECKING:
    from supermap_cli.query.map_walls import MapWalls

SAME_SIZE = 0.3
"""Share by which the sizes of two boxes of a thing may differ for its shape to be taken from one to the other."""


LEAST_WITHIN = 0.8
"""Share of a thing's voxels that lie in its box, which leaves out 3 % along each axis (`mapping.object_shape`)."""


class StoredThing(GraphNode):
    """A thing of a stored map: its voxels are read when a relation asks for its surface."""

    def __init__(self, number: int, label: str, box: Box3D, read_points: Callable[[], FloatArray]) -> None:
        for name, value in (("number", number), ("label", label), ("box", box), ("_read_points", read_points)):
            object.__setattr__(self, name, value)

    @cached_property
    def points(self) -> FloatArray:
        """(n, 3) the centres of its solid voxels in the map frame; none where they are not known."""
        found: FloatArray = self.__dict__["_read_points"]()
        return found


@dataclass
class MapRelations:
    """What relations are judged by in one map; surfaces and walls are read once."""

    reader: MapReader
    _points: dict[int, FloatArray] = field(default_factory=dict, repr=False)

    @cached_property
    def registry(self) -> RelationRegistry:
        """The relations that can be asked of this map."""
        return relations_of_configs(traversal.config for traversal in self.reader.traversals)[0]

    @cached_property
    def walls(self) -> MapWalls:
        """Where walls stand in it."""
        from supermap_cli.query.map_walls import MapWalls  # noqa: PLC0415 - keeps start-up light

        return MapWalls(self.reader)

    def stored_forms(self, name: str) -> tuple[StoredForm, ...]:
        """The stored relations that answer a relation."""
        return stored_forms(self.registry, name)

    def graph_keeps(self, name: str) -> bool:
        """Whether a scene graph kept this relation (or those that answer it) in all traversals, by today's definitions:
        maps that were written by hand have none, and older versions of the program judged otherwise.
        """
        return self._has_graph and bool(self.stored_forms(name))

    @cached_property
    def _has_graph(self) -> bool:
        every = {parameter.name for parameter in fields(PredicateParameters)}
        used = [_predicate_parameters(traversal.config) for traversal in self.reader.traversals]
        return bool(used) and all(every <= names for names in used)

    def measure(
        self, name: str, first: tuple[StoredInstance, StateRecord], second: tuple[StoredInstance, StateRecord]
    ) -> float:
        """A confidence in (0, 1] that a relation holds between two instances in one of their states each, else 0."""
        pair = Pair(self.thing(*first), self.thing(*second), self.registry.parameters)
        ends = (first[0].number, second[0].number)
        return self.registry.measure(name, pair, 1.0, partial(self._clear_between, ends))

    def _clear_between(self, ends: tuple[int, int], first: Box3D, second: Box3D) -> bool:
        return self.walls.clear_between(ends, first, second)

    def thing(self, instance: StoredInstance, state: StateRecord) -> StoredThing:
        """An instance in one of its states.

        The memory keeps the voxels of its newest place; in an earlier one it had the same shape, unless its size was
        another: then only its box is known.
        """
        label = instance.label if state is instance.states[-1] else state.label
        return StoredThing(instance.number, label, state.box, lambda: self._points_in(instance, state))

    def _points_in(self, instance: StoredInstance, state: StateRecord) -> FloatArray:
        if instance.number not in self._points:
            self._points[instance.number] = self._solid_points(instance)
        points, newest = self._points[instance.number], instance.states[-1].box
        if state.index == instance.states[-1].index:
            return points
        return moved_with(points, newest, state.box)

    def _solid_points(self, instance: StoredInstance) -> FloatArray:
        from supermap_cli.mapping.object_shape import measure_shape  # noqa: PLC0415 - keeps start-up light
        from supermap_cli.mapping.voxel_map import voxel_map_from_cloud  # noqa: PLC0415

        cloud = self.reader.voxels(instance)
        points = measure_shape(voxel_map_from_cloud(cloud)).points if len(cloud) else np.zeros((0, 3))
        return points if _fill(instance.states[-1].box, points, cloud.voxel_m) else np.zeros((0, 3))


def _predicate_parameters(config: Mapping[str, object]) -> set[str]:
    """The names of the parameters by which a build judged relations."""
    parameters = config.get("parameters")
    predicates = parameters.get("predicates") if isinstance(parameters, Mapping) else None
    return set(predicates) if isinstance(predicates, Mapping) else set()


def _fill(box: Box3D, points: FloatArray, voxel_m: float) -> bool:
    """Whether a box is that of these points (n, 3): those of a map that was written by hand need not be."""
    if not len(points):
        return False
    c, s = np.cos(box.yaw), np.sin(box.yaw)
    local = np.abs((points - box.center) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
    return bool((local <= box.size / 2 + 2 * voxel_m).all(axis=1).mean() >= LEAST_WITHIN)


def moved_with(points: FloatArray, source: Box3D, target: Box3D) -> FloatArray:
    """Points (n, 3) of a thing's surface, moved as its box was; none where the two boxes differ in size."""
    if np.abs(np.log(np.maximum(target.size, 1e-3) / np.maximum(source.size, 1e-3))).max() > np.log1p(SAME_SIZE):
        return np.zeros((0, 3))
    turn = target.yaw - source.yaw
    c, s = np.cos(turn), np.sin(turn)
    moved: FloatArray = (points - source.center) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + target.center
    return moved
