"""Approach poses and ways against the simulated world: may the robot stand and drive there, does it see the thing.

Measured on the world's own surfaces, not on its boxes: distances and rays by open3d's RaycastingScene.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from supermap_cli.evaluation.matching import MAX_MATCH_DISTANCE_M, MIN_MATCH_IOU, same_label
from supermap_cli.evaluation.truth_alignment import align_to_truth
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D, box_iou
from supermap_cli.geometry.open3d_loader import load_open3d
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.memory.reading import MapReader
from supermap_cli.navigation.observed_space import occupancy_grid
from supermap_cli.navigation.route import DrivingRobot, Waypoint, plan_route
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.world import SimulatedThing, World, box_of, sample_surface
from supermap_cli.types.truth import GroundTruth

_STEP_M = 0.05
"""m between the points of a way, and of the robot's height, at which distances are measured."""
_UNDERFOOT_M = 0.05
"""m; what ends below it is driven over (a rug), as in the simulator's own free space."""
_SAMPLE_M = 0.05
"""m between the points of a thing that rays are cast at."""
_SEEN_SHARE = 0.3
"""Share of these rays that must end on the thing, on any side of it, for it to be seen."""


@dataclass(frozen=True)
class TrueWaypoint:
    """One waypoint in the world: `clearance_m` from the robot's axis to the nearest surface, at the pose and the least
    along the way; `in_sight` the share of the rays from the camera to points of the thing that end on it.
    """

    instance_id: str
    thing_id: str
    clearance_m: float
    way_clearance_m: float
    in_sight: float

    @property
    def seen(self) -> bool:
        """Whether the thing is seen from the pose."""
        return self.in_sight >= _SEEN_SHARE


@dataclass(frozen=True)
class WaypointScores:
    """Counts over all instances that are real: those with a pose, those of these whose pose is free, whose way is free,
    and from which the thing is seen.
    """

    radius_m: float
    goals: int
    waypoints: tuple[TrueWaypoint, ...]
    without_pose: tuple[tuple[str, str], ...]

    @property
    def free(self) -> int:
        """Poses at which nothing is nearer than the robot's radius."""
        return sum(waypoint.clearance_m >= self.radius_m for waypoint in self.waypoints)

    @property
    def way_free(self) -> int:
        """Ways along which nothing is nearer than that."""
        return sum(waypoint.way_clearance_m >= self.radius_m for waypoint in self.waypoints)

    @property
    def seen(self) -> int:
        """Poses that the thing is seen from."""
        return sum(waypoint.seen for waypoint in self.waypoints)


def score_waypoints(
    reader: MapReader, truth: GroundTruth, world: World, robot: DrivingRobot | None = None
) -> WaypointScores:
    """Plan a way to every present instance that is a real thing, from the robot's last pose, and hold it against the
    world as it is at the end of the map. Raises `EvaluationError` where map and truth do not belong together.
    """
    robot = robot or DrivingRobot()
    T_world_map = align_to_truth(reader, truth).T_world_map
    grid = occupancy_grid(reader, robot.height_m)
    checks = _TrueChecks(world, reader.now_ns, grid.robot_height_m, grid.camera_height_m)
    scored, missing = [], []
    matches = _real_instances(reader, world, T_world_map)
    for text_id, thing in matches:
        (waypoint,) = plan_route(reader, f"go to {text_id}", robot, grid=grid).waypoints
        if waypoint.pose is None:
            missing.append((text_id, waypoint.message))
        else:
            scored.append(checks.check(text_id, thing, waypoint, T_world_map))
    return WaypointScores(robot.radius_m, len(matches), tuple(scored), tuple(missing))


def _real_instances(reader: MapReader, world: World, T_world_map: FloatArray) -> list[tuple[str, SimulatedThing]]:
    """The ids of present instances and the things that they are: of one name, and boxes that overlap."""
    yaw = float(np.arctan2(T_world_map[1, 0], T_world_map[0, 0]))
    standing = [
        (world.thing(stay.thing_id), box_of(world.thing(stay.thing_id).shape, stay.T_world_thing))
        for stay in world.stays
        if stay.covers(reader.now_ns)
    ]
    found = []
    for instance in reader.iter_instances(visits=False):
        center = transform_points(T_world_map, instance.box.center[None])[0]
        box = Box3D(center, instance.box.size, instance.box.yaw + yaw)
        fits = [
            (box_iou(box, other), thing)
            for thing, other in standing
            if same_label(instance.label, thing.label) and np.linalg.norm(other.center - center) < MAX_MATCH_DISTANCE_M
        ]
        iou, thing = max(fits, key=lambda fit: fit[0], default=(0.0, None))
        if instance.presence == "present" and thing is not None and iou > MIN_MATCH_IOU:
            found.append((instance.id, thing))
    return found


class _TrueChecks:
    """The world at one time, to measure distances in and to cast rays into."""

    def __init__(self, world: World, stamp_ns: int, height_m: float, eye_m: float) -> None:
        self._world, self._stamp_ns = world, stamp_ns
        self._heights = np.arange(_UNDERFOOT_M, height_m + 1e-9, _STEP_M)
        self._eye_m = eye_m
        self._scene = Scene(world)
        self._core = load_open3d().core
        self._obstacles = load_open3d().t.geometry.RaycastingScene()
        placed = [(fixture.shape, np.eye(4)) for fixture in world.fixtures if fixture.label not in {"floor", "ceiling"}]
        stays = [stay for stay in world.stays if stay.covers(stamp_ns)]
        placed += [(world.thing(stay.thing_id).shape, stay.T_world_thing) for stay in stays]
        self._places = {stay.thing_id: stay.T_world_thing for stay in stays}
        for shape, T_world_shape in placed:
            vertices = transform_points(T_world_shape, shape.vertices)
            if vertices[:, 2].max() > _UNDERFOOT_M:
                triangles = self._core.Tensor(shape.triangles.astype(np.uint32))
                self._obstacles.add_triangles(self._core.Tensor(vertices.astype(np.float32)), triangles)

    def check(self, text_id: str, thing: SimulatedThing, waypoint: Waypoint, T_world_map: FloatArray) -> TrueWaypoint:
        """Measure one waypoint that has a pose."""
        assert waypoint.pose is not None  # noqa: S101 - callers have asked
        points_xy = _resampled(np.array(waypoint.way))
        way = np.column_stack([points_xy, np.zeros(len(points_xy))])
        place = transform_points(T_world_map, np.array([waypoint.pose.position]))[0]
        return TrueWaypoint(
            instance_id=text_id,
            thing_id=thing.id,
            clearance_m=float(self._clearances_m(place[None])[0]),
            way_clearance_m=float(self._clearances_m(transform_points(T_world_map, way)).min()),
            in_sight=self._in_sight(thing, place),
        )

    def _clearances_m(self, places: FloatArray) -> FloatArray:
        """(n,) distances from upright axes at places (n, 3) to the nearest surface."""
        points = np.repeat(places, len(self._heights), axis=0)
        points[:, 2] = np.tile(self._heights, len(places))
        distances = self._obstacles.compute_distance(self._core.Tensor(points.astype(np.float32))).numpy()
        nearest: FloatArray = distances.reshape(len(places), -1).min(axis=1).astype(np.float64)
        return nearest

    def _in_sight(self, thing: SimulatedThing, place: FloatArray) -> float:
        points = transform_points(self._places[thing.id], sample_surface(thing.shape, _SAMPLE_M)[0])
        eye = np.array([place[0], place[1], self._eye_m])
        hits = self._scene.cast(self._stamp_ns, eye, points - eye, colour=False)
        return float((hits.thing == self._world.index[thing.id] + 1).mean())


def _resampled(way: FloatArray) -> FloatArray:
    """Points (m, 2) along a way (n, 2), no farther apart than they are measured."""
    parts = [way[:1]]
    for start, end in pairwise(way):
        steps = max(1, int(np.ceil(np.linalg.norm(end - start) / _STEP_M)))
        parts.append(start + np.linspace(0, 1, steps + 1)[1:, None] * (end - start))
    return np.concatenate(parts)
