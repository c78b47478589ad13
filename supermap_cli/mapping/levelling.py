"""Makes the map level: z up, the floor at z = 0, by gravity where there is an IMU, else by the floors and tops seen.

The world frame W of the paper's eq. 3, which is level there because SuperOdometry uses an IMU.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.se3 import make_transform, rotation_between, transform_points
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.mapping import structure
from supermap_cli.mapping.structure import CoarseDepth, Structure, StructureParameters, join, structure_of_points
from supermap_cli.types.parameters import TUNED, parameter
from supermap_cli.types.sensing import ImuSample, Sweep

LevellingMethod = Literal["imu", "structure", "odom"]

_UP = np.array([0.0, 0.0, 1.0])

_BLOCK = 4096
"""IMU samples turned at a time: an hour of them must not be held as transforms."""


@dataclass(frozen=True)
class LevellingParameters:
    """What counts as gravity, as a level surface, and as a floor."""

    voxel_m: float = parameter(0.05, "m", "edge of the voxels by which surfaces are measured", TUNED, at_least=0.005)
    up_cone_deg: float = parameter(
        50.0, "deg", "angle between a normal and the sensor's up axis up to which a surface may be level", TUNED
    )
    min_area_m2: float = parameter(0.3, "m2", "area of level surfaces, or of a floor, at least", TUNED, at_least=0.01)
    level_imu_deg: float = parameter(3.0, "deg", "tilt by gravity up to which odom is level already", TUNED)
    level_structure_deg: float = parameter(2.0, "deg", "tilt by surfaces up to which odom is level already", TUNED)
    same_floor_m: float = parameter(0.05, "m", "height of the floor up to which odom's height is kept", TUNED)
    below_lidar_m: float = parameter(0.2, "m", "how far below a LiDAR its low returns begin", "robots")
    imu_min_samples: int = parameter(20, "1", "IMU samples needed, all and calm ones", TUNED, at_least=1)
    imu_calm_share: float = parameter(
        0.05, "1", "deviation from the median specific force, as a share, of a calm sample", TUNED
    )
    imu_min_force: float = parameter(
        0.5, "m/s2 or g", "median specific force, at least: less is no gravity in any unit", "1 g is 1 or 9.81"
    )
    imu_min_mean: float = parameter(
        0.97, "1", "length of the mean of the unit up directions, at least", "a spread of 14 degrees", at_most=1
    )
    mode_deg: float = parameter(6.0, "deg", "cone within which normals support one up direction", TUNED)
    mean_deg: float = parameter(10.0, "deg", "cone over which the up direction is averaged", TUNED)
    flat_deg: float = parameter(15.0, "deg", "cone within which surfaces are level", TUNED)
    mode_centres: int = parameter(256, "1", "normals tried as the up direction", "bounds the time", at_least=1)
    mean_rounds: int = parameter(5, "1", "rounds of averaging", "converged by then")
    min_flat_share: float = parameter(0.3, "1", "share of the surfaces that may be level that must be", TUNED)
    thicknesses_m: tuple[float, ...] = parameter(
        (0.12, 0.08, 0.05, 0.04, 0.04, 0.04),
        "m",
        "thickness of a plane, in turn, as the up direction gets exact",
        TUNED,
    )
    tile_m: float = parameter(2.0, "m", "edge of the tiles that planes are cut into", "table tops", at_least=0.1)
    min_plane_points: int = parameter(40, "1", "points of a plane, and of a tile of it, at least", TUNED, at_least=3)
    min_anisotropy: float = parameter(
        4.0, "1", "middle scatter within planes by the least, at least: less gives no normal", TUNED
    )
    floor_thickness_m: float = parameter(0.05, "m", "thickness of a floor", TUNED, at_least=0.005)
    min_floor_share: float = parameter(0.05, "1", "size of a floor as a share of the largest plane, at least", TUNED)
    below_floor_m: float = parameter(0.1, "m", "depth below a floor from which points count as below it", TUNED)
    max_below_share: float = parameter(0.02, "1", "share of all points that may lie below a floor", TUNED)

    @property
    def min_up_cos(self) -> float:
        """Cosine of the cone of what may be level."""
        return float(np.cos(np.radians(self.up_cone_deg)))


DEFAULT = LevellingParameters()


@dataclass(frozen=True)
class LevelView:
    """What one frame sees: its surfaces in the odom frame, and the sensor's own up axis in odom.

    The up axis is -y of a camera's optical frame, +z of a LiDAR's; it need only be right within some 45 degrees.
    """

    structure: Structure
    up_odom: FloatArray


def level_view(depth_odom: CoarseDepth) -> LevelView:
    """A camera's view, from its depth placed in odom."""
    return LevelView(depth_odom.structure(), -depth_odom.T_frame_camera[:3, 1])


class LowReturns:
    """A LiDAR's returns from well below it, of a whole recording.

    One that hardly looks down sees the floor far off only and now and then: not in 30 views, but in thousands of
    sweeps.
    """

    def __init__(
        self,
        trajectory: Trajectory,
        parameters: LevellingParameters = DEFAULT,
        structure_parameters: StructureParameters = structure.DEFAULT,
    ) -> None:
        self._trajectory = trajectory
        self._parameters, self._structure_parameters = parameters, structure_parameters
        self._points_odom: list[FloatArray] = []
        self._up_odom = _UP

    def add(self, sweep: Sweep) -> None:
        """A further sweep."""
        T_odom_base = self._trajectory.at(sweep.stamp_ns)
        if T_odom_base is not None:
            T_odom_lidar = T_odom_base @ sweep.T_base_lidar
            self._up_odom = T_odom_lidar[:3, 2]
            low = sweep.points_lidar[sweep.points_lidar[:, 2] < -self._parameters.below_lidar_m]
            self._points_odom.append(transform_points(T_odom_lidar, low))

    def views(self) -> list[LevelView]:
        """One view of their level surfaces and, without normals, all of them: a table top is no floor, however little
        a LiDAR sees of the walls beneath it. None without a LiDAR, or where it sees nothing level there.
        """
        points = np.concatenate([np.zeros((0, 3)), *self._points_odom])
        surfaces = structure_of_points(
            points,
            voxel_m=self._parameters.voxel_m,
            max_range_m=np.inf,
            parameters=self._structure_parameters,
        )
        facing = np.sign(surfaces.normals @ self._up_odom)[:, None]
        level_ones = np.abs(surfaces.normals @ self._up_odom) > self._parameters.min_up_cos
        faced = Structure(surfaces.points, surfaces.normals * facing).take(level_ones)
        all_ones = Structure(points, np.zeros_like(points)).thinned(self._parameters.voxel_m)
        return [LevelView(join([faced, all_ones]), self._up_odom)] if len(faced) else []


@dataclass(frozen=True)
class Levelling:
    """`T_map_odom` and how it was found.

    `method` "odom" means that odom's own z axis was kept: because it is level already, or, then with a `warning`,
    because nothing told where up is. `tilt_deg` is the angle between odom's z axis and the up direction found (0 if
    none was). `floor_seen` tells whether z = 0 is a floor; else odom's height is kept. `floor_z` is the floor's height
    in the map as measured, within 5 cm of 0 where odom was kept; `None` if none was seen.
    """

    T_map_odom: FloatArray
    method: LevellingMethod
    tilt_deg: float
    floor_seen: bool
    warning: str | None = None
    floor_z: float | None = None


def level(
    views: Iterable[LevelView],
    imu: Iterable[ImuSample] = (),
    trajectory: Trajectory | None = None,
    parameters: LevellingParameters = DEFAULT,
) -> Levelling:
    """Find `T_map_odom` of the first traversal from 20 to 40 views spread over it, and its IMU samples if it has any.

    The heading stays as in odom: the map is odom turned by the smallest rotation that makes it level. An odom that is
    level within the estimate's own error stays exactly as it is.
    """
    surfaces, level_surfaces = _gather(views, parameters)
    up = gravity_up(imu, trajectory, parameters) if trajectory is not None else None
    method: LevellingMethod = "imu"
    if up is None:
        method, up = "structure", structural_up(level_surfaces, parameters)
    if up is None:
        return Levelling(
            np.eye(4),
            "odom",
            0.0,
            floor_seen=False,
            warning="neither gravity nor a floor or table top tells which way is up: the map keeps the odometry's axes",
        )
    tilt_deg = float(np.degrees(np.arccos(np.clip(up @ _UP, -1.0, 1.0))))
    if tilt_deg < (parameters.level_imu_deg if method == "imu" else parameters.level_structure_deg):
        method, R_map_odom = "odom", np.eye(3)
    else:
        R_map_odom = rotation_between(up, _UP)
    T_map_odom = make_transform(R_map_odom, np.zeros(3))
    floor_z = floor_height(surfaces.moved(T_map_odom), parameters)
    if floor_z is not None and not (method == "odom" and abs(floor_z) < parameters.same_floor_m):
        T_map_odom[2, 3], floor_z = -floor_z, 0.0
    return Levelling(T_map_odom, method, tilt_deg, floor_seen=floor_z is not None, floor_z=floor_z)


def gravity_up(
    imu: Iterable[ImuSample], trajectory: Trajectory, parameters: LevellingParameters = DEFAULT
) -> FloatArray | None:
    """The up direction (3,) in odom by the specific force, which at rest points up; `None` where it makes no sense.

    Samples near the median magnitude are taken, turned into odom by the trajectory's orientation: what acceleration
    remains cancels in the mean. Any unit will do (some drivers give g). A mean much shorter than its parts tells that
    the IMU's mounting or the orientation is wrong; a rotating or falling sensor has no level either.
    """
    stamps, forces = array("q"), array("d")
    for sample in imu:
        stamps.append(sample.stamp_ns)
        forces.extend(sample.specific_force_base.tolist())
    if len(stamps) < parameters.imu_min_samples:
        return None
    stamps_ns, force_base = np.array(stamps, np.int64), np.array(forces).reshape(-1, 3)
    magnitude = np.linalg.norm(force_base, axis=1)
    usual = float(np.median(magnitude))
    calm = np.isfinite(magnitude) & (np.abs(magnitude - usual) < parameters.imu_calm_share * usual)
    direction = force_base[calm] / magnitude[calm, None]
    turned = [
        _turned(trajectory, stamps_ns[calm][start : start + _BLOCK], direction[start : start + _BLOCK])
        for start in range(0, len(direction), _BLOCK)
    ]
    up = np.concatenate([np.zeros((0, 3)), *turned])
    if usual < parameters.imu_min_force or len(up) < parameters.imu_min_samples:
        return None
    mean = up.mean(axis=0)
    length = float(np.linalg.norm(mean))
    return mean / length if length > parameters.imu_min_mean else None


def _turned(trajectory: Trajectory, stamps_ns: IntArray, direction_base: FloatArray) -> FloatArray:
    """Directions (n, 3) turned into odom, those at whose stamps there is a pose."""
    T_odom_base, valid = trajectory.at_many(stamps_ns)
    turned: FloatArray = np.einsum("nij,nj->ni", T_odom_base[valid, :3, :3], direction_base[valid])
    return turned


def structural_up(level_surfaces: Structure, parameters: LevellingParameters = DEFAULT) -> FloatArray | None:
    """The up direction (3,) by the dominant horizontal structure, `None` where there is none.

    `level_surfaces` are the points whose normal lies within 50 degrees of the sensor's up axis: floors, table tops,
    seats, and hardly ever a wall, because a wall's visible side looks back at a camera that is pitched down. The mode
    of their normals is refined by least squares over all planes across it together (`_common_normal`).
    """
    normals = level_surfaces.normals
    if len(normals) * parameters.voxel_m**2 < parameters.min_area_m2:
        return None
    centres = normals[:: max(1, len(normals) // parameters.mode_centres)]
    support = (normals @ centres.T > np.cos(np.radians(parameters.mode_deg))).sum(axis=0)
    up: FloatArray = centres[int(np.argmax(support))]
    for _ in range(parameters.mean_rounds):
        up = normals[normals @ up > np.cos(np.radians(parameters.mean_deg))].mean(axis=0)
        up /= np.linalg.norm(up)
    flat = level_surfaces.take(normals @ up > np.cos(np.radians(parameters.flat_deg)))
    if len(flat) < parameters.min_flat_share * len(level_surfaces):
        return None
    for thickness_m in parameters.thicknesses_m:
        refined = _common_normal(flat.points, up, thickness_m, parameters)
        if refined is None:
            return None
        up = refined
    return up


def _common_normal(
    points: FloatArray, up: FloatArray, thickness_m: float, parameters: LevellingParameters
) -> FloatArray | None:
    """The normal shared by all planes across `up`, by total least squares over them together.

    Planes are the peaks of the height histogram, cut into tiles so that two table tops of nearly one height do not pass
    for one slanted plane. The normal is the eigenvector of the smallest eigenvalue of the pooled scatter within tiles.
    """
    R_level = rotation_between(up, _UP)
    levelled = points @ R_level.T
    scatter, used = np.zeros((3, 3)), 0
    for height in plane_heights(levelled[:, 2], thickness_m, least=parameters.min_plane_points):
        plane = levelled[np.abs(levelled[:, 2] - height) < thickness_m]
        tile = np.floor(plane[:, :2] / parameters.tile_m).astype(np.int64)
        _, tile_of = np.unique(tile, axis=0, return_inverse=True)
        for k in range(int(tile_of.max()) + 1):
            part = plane[tile_of.ravel() == k]
            if len(part) >= parameters.min_plane_points:
                centred = part - part.mean(axis=0)
                scatter += centred.T @ centred
                used += len(part)
    if used * parameters.voxel_m**2 < parameters.min_area_m2:
        return None
    values, vectors = np.linalg.eigh(scatter)
    if values[1] < parameters.min_anisotropy * values[0]:
        return None
    normal: FloatArray = R_level.T @ vectors[:, 0]
    return normal if normal @ up > 0 else -normal


def plane_heights(heights_m: FloatArray, thickness_m: float, least: int) -> list[float]:
    """Heights at which at least `least` points gather within `thickness_m`, strongest first, none twice."""
    bin_m = thickness_m / 2
    left = np.sort(heights_m)
    found: list[float] = []
    while len(left) >= least:
        first = np.searchsorted(left, left - bin_m)
        last = np.searchsorted(left, left + bin_m, side="right")
        best = int(np.argmax(last - first))
        if last[best] - first[best] < least:
            break
        height = float(np.median(left[first[best] : last[best]]))
        found.append(height)
        left = left[np.abs(left - height) > thickness_m]
    return found


def floor_height(levelled: Structure, parameters: LevellingParameters = DEFAULT) -> float | None:
    """Height of the floor: the lowest fair-sized plane that looks up and has next to nothing below; `None` if none."""
    thickness_m = parameters.floor_thickness_m
    flat_z = levelled.points[levelled.normals[:, 2] > np.cos(np.radians(parameters.flat_deg)), 2]
    planes = plane_heights(flat_z, thickness_m, least=round(parameters.min_area_m2 / parameters.voxel_m**2))
    if not planes:
        return None
    size = {height: int((np.abs(flat_z - height) < thickness_m).sum()) for height in planes}
    for height in sorted(planes):
        below = float((levelled.points[:, 2] < height - parameters.below_floor_m).mean())
        large = size[height] > parameters.min_floor_share * max(size.values())
        if large and below < parameters.max_below_share:
            return height
    return None


def _gather(views: Iterable[LevelView], parameters: LevellingParameters) -> tuple[Structure, Structure]:
    """All surfaces, and those that may be level, thinned so that a point stands for an area."""
    everything, upward = [], []
    for view in views:
        up = view.up_odom / np.linalg.norm(view.up_odom)
        thin = view.structure.thinned(parameters.voxel_m)
        everything.append(thin)
        upward.append(thin.take(thin.normals @ up > parameters.min_up_cos))
    return join(everything).thinned(parameters.voxel_m), join(upward).thinned(parameters.voxel_m)
