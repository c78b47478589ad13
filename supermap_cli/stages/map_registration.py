"""Where a traversal's odometry stands in the map: levelled if it is the first, else aligned with what is there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.mapping.alignment import Alignment, align, parse_placement
from supermap_cli.mapping.levelling import Levelling, LowReturns, level, level_view
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.mapping.structure import CoarseDepth, coarse_depth
from supermap_cli.types.sensing import CameraFrame, ImuSample, Sweep

MAX_IMU_SAMPLES = 20_000
"""IMU samples by which a traversal is levelled, 100 s at 200 Hz; of more, every second is left out."""

MAX_SWEEPS = 3_000
"""LiDAR sweeps of a live traversal that the floor is looked for in, 5 minutes at 10 Hz."""

MAX_VIEWS = 60
"""Depth images by which a traversal is placed; of more, every second is left out."""


@dataclass(frozen=True)
class Placement:
    """`T_map_odom`, how it was found, in words, and what the user should know about it; `floor_z`: the floor's height,
    `None` if it was not seen.
    """

    T_map_odom: FloatArray
    method: str
    warnings: tuple[str, ...] = ()
    floor_z: float | None = None


@dataclass(frozen=True)
class EarlierTraversals:
    """What a further traversal is placed by: the depth images of the earlier ones in the map frame, read when they are
    needed, and `T_map_odom` (4, 4) of each, the latest first: the odometry may go on from one of them.
    """

    views_map: Callable[[], Iterable[CoarseDepth]] = tuple
    T_map_odom: Sequence[FloatArray] = ()


@dataclass
class MapRegistration:
    """Collects what a traversal sees, and places it in the map by that.

    `request` is "auto", "none" (the levelled odom frame is the map's), or "x y z yaw_deg".
    """

    trajectory: Trajectory
    request: str = "auto"
    earlier: EarlierTraversals = field(default_factory=EarlierTraversals)
    parameters: MappingParameters = field(default_factory=MappingParameters)
    max_views: int = MAX_VIEWS
    max_sweeps: float = MAX_SWEEPS
    imu: list[ImuSample] = field(default_factory=list)
    _low: LowReturns | None = None
    _stride: int = 1
    _views: list[tuple[int, CoarseDepth]] = field(default_factory=list)
    _moments: int = 0
    _newest_ns: int | None = None
    _imu_stride: int = 1
    _imu_offered: int = 0
    _sweeps: int = 0

    def add_imu(self, sample: ImuSample) -> None:
        """An IMU sample: it tells which way is up; of many, every second, fourth ... is used."""
        self._imu_offered += 1
        if (self._imu_offered - 1) % self._imu_stride:
            return
        self.imu.append(sample)
        if len(self.imu) > MAX_IMU_SAMPLES:
            self.imu = self.imu[::2]
            self._imu_stride *= 2

    def add_sweep(self, sweep: Sweep) -> None:
        """A LiDAR sweep: it may see the floor where the camera does not. Its pose is known."""
        self._sweeps += 1
        if self._sweeps > self.max_sweeps:
            return
        if self._low is None:
            self._low = LowReturns(self.trajectory, self.parameters.levelling, self.parameters.structure)
        self._low.add(sweep)

    def add_frame(self, frame: CameraFrame, T_odom_base: FloatArray) -> None:
        """A frame with depth; of many moments, every second, fourth ... is used, with the frames of all cameras."""
        if frame.stamp_ns != self._newest_ns:
            self._newest_ns = frame.stamp_ns
            self._moments += 1
        if (self._moments - 1) % self._stride:
            return
        view = coarse_depth(frame, T_odom_base, parameters=self.parameters.structure)
        if view is not None:
            self._views.append((self._moments, view))
        if len(self._views) > self.max_views and len({moment for moment, _ in self._views}) > 1:
            self._stride *= 2
            self._views = [(moment, view) for moment, view in self._views if (moment - 1) % self._stride == 0]

    @property
    def views_odom(self) -> list[CoarseDepth]:
        """The depth images that are used, in the odometry's frame."""
        return [view for _, view in self._views]

    def place(self, imu: Iterable[ImuSample] | None = None) -> Placement:
        """Find `T_map_odom`; `imu` may be streamed instead of collected.

        Raises `AlignmentError` if a further traversal cannot be placed with confidence, or the request is not
        understood.
        """
        low = [] if self._low is None else self._low.views()
        level_views = [*map(level_view, self.views_odom), *low]
        samples = self.imu if imu is None else imu
        levelling = level(level_views, samples, self.trajectory, self.parameters.levelling)
        warnings = () if levelling.warning is None else (levelling.warning,)
        if self.request not in {"auto", "none"}:
            T_map_odom = parse_placement(self.request, levelling.T_map_odom)
            return Placement(T_map_odom, f"given: {self.request}", warnings, levelling.floor_z)
        if self.request == "none" or not self.earlier.T_map_odom:
            return Placement(levelling.T_map_odom, describe_levelling(levelling), warnings, levelling.floor_z)
        views_map, sets = list(self.earlier.views_map()), self.parameters.alignment_sets()
        aligned = align(views_map, self.views_odom, levelling.T_map_odom, self.earlier.T_map_odom, sets)
        floor_z = None
        if levelling.floor_z is not None:
            floor_z = levelling.floor_z + float(aligned.T_map_odom[2, 3] - levelling.T_map_odom[2, 3])
        return Placement(aligned.T_map_odom, describe_alignment(aligned), warnings, floor_z)


def describe_levelling(found: Levelling) -> str:
    """One line on how the map was levelled."""
    floor = "floor at z = 0" if found.floor_seen else "no floor seen"
    how = {"imu": "by gravity (IMU)", "structure": "by floors and table tops", "odom": "odometry kept as it is"}
    return f"levelled {how[found.method]}, {found.tilt_deg:.1f} degrees, {floor}"


def describe_alignment(found: Alignment) -> str:
    """One line on how the traversal was aligned."""
    how = {"continued": "odometry goes on from an earlier traversal", "refined": "odometry goes on, refined"}
    return f"{how.get(found.method, 'registered in the map')}, {100 * found.fitness:.0f} % of its surfaces fit"
