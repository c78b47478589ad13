"""The walls of a stored map: asked for relations that no stored edge answers, from the images that show their ends."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

from supermap_cli.geometry.boxes import Box3D, Reach
from supermap_cli.mapping.walls import WallMap, high_between, least_object_height_m
from supermap_cli.memory.keyframe_views import camera_poses, keyframe_views, observing_keyframes
from supermap_cli.memory.reading import MapReader

MOST_VIEWS = 60
"""Keyframes of each instance that are looked through for new viewpoints: an index finds them, each costs little."""
AROUND = Reach(0.5, 1.0)
"""How far from two things others may stand whose sides are no walls between them, m."""


@dataclass
class MapWalls:
    """What is known of walls from the views of the things that were asked about; it grows with them."""

    reader: MapReader
    walls: WallMap = field(default_factory=WallMap)
    _seen: set[int] = field(default_factory=set, repr=False)
    _around: dict[int, frozenset[int]] = field(default_factory=dict, repr=False)

    def look_around(self, numbers: Collection[int]) -> None:
        """Read what tells of the walls about some instances, as far as it was not read before."""
        self._look_from_around(numbers)
        missing = sorted(set(numbers) - self._around.keys())
        around: dict[int, set[int]] = {number: set() for number in missing}
        for here, there in self.reader.search.near(missing, AROUND) if missing else ():
            around[here].add(there)
        self._around |= {number: frozenset(others) for number, others in around.items()}
        self.reader.instances_by_number({other for others in around.values() for other in others})

    def clear_between(self, ends: tuple[int, int], first: Box3D, second: Box3D) -> bool:
        """Whether no wall is known to stand between two boxes, those of the instances with the numbers `ends`."""
        self.look_around(ends)
        if not self.walls.views:
            return True
        return self.walls.clear_between(first, second, high_between(first, second, self._high_objects(ends)))

    def _look_from_around(self, ends: Collection[int]) -> None:
        """Add the views of instances that were not looked at yet, as far as their viewpoints are new."""
        new = set(ends) - self._seen
        if not new:
            return
        self._seen |= new
        connection, parts = self.reader.connection, self.reader.parts_of(new)
        poses = camera_poses(connection, observing_keyframes(connection, list(parts), MOST_VIEWS))
        wanted = [number for number, T_map_camera in poses.items() if self.walls.wants(T_map_camera)]
        for record in keyframe_views(connection, wanted):
            self.walls.add_record(record)

    def _high_objects(self, ends: tuple[int, int]) -> list[Box3D]:
        """The things about two others that are high enough to be taken for a wall."""
        self.look_around(ends)
        around = {number for end in ends for number in self._around[end]} - set(ends)
        instances = self.reader.instances_by_number(sorted(around))
        boxes = (instance.states[-1].box for instance in instances.values() if instance.presence == "present")
        return [box for box in boxes if box.size[2] >= least_object_height_m()]
