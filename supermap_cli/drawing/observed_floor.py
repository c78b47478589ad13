"""What the robot has seen of the place, from above: where space is free, where structure stands, what is unknown.

It is drawn from the small depth images that the memory keeps of keyframes, one of each viewpoint, so that the cost is
that of the place and not of the recording. It is a picture; a grid to drive by needs clearances and a robot's height.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.cameras import camera_from_json
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.mapping.free_space import decode_small_depth
from supermap_cli.memory.keyframe_views import camera_poses, keyframe_traversals, keyframe_views, observing_keyframes
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.stored_values import parsed_transform
from supermap_cli.memory.streaming import stream_keyframes
from supermap_cli.types.memory import KeyframeRecord

CELL_M = 0.05
"""m; edge of a cell, the usual resolution of floor plans (nav2's default). Larger where the place is."""
MOST_CELLS = 4_000_000
"""Cells of a plan; bounds memory and time: 100 m x 100 m at 5 cm."""
REACH_M = 8.0
"""m; depth up to which an image is drawn: beyond, depth cameras err by more than a cell (chosen)."""
FLOOR_M = 0.08
"""m; a point within this height of z = 0 lies on the floor (chosen: twice the noise of levelling)."""
TOP_M = 2.0
"""m; structure above it (ceilings, lamps) is not drawn: a plan is a cut below the top of a door."""
BIN_M = 0.25
"""m; height of the bins in which structure was seen or not: what fills more of them is drawn darker."""
_BINS = math.ceil(TOP_M / BIN_M)
_VIEW_M, _VIEW_RAD = 0.5, math.radians(30)
"""Cells of position and of direction of a viewpoint, as in the free-space memory (FreeSpaceParameters)."""
MOST_VIEWS = 500
"""Depth images that are drawn; further ones are left out evenly."""
_RAYS, _RAY_STEP_M, _BEFORE_SURFACE_M, _NEAREST_M = 2, 0.1, 0.2, 0.3
"""Every second pixel's ray is followed in steps of so many m, up to so far before its end, from so far on (chosen)."""
_VIEWS_OF_THING = 30
"""Keyframes of each thing that are looked through for viewpoints about it (chosen)."""
_LEAST_HITS = 2
"""Points in a cell for structure: one may be noise."""


@dataclass(frozen=True)
class ObservedFloor:
    """Cells (ny, nx) of `cell_m` metres; cell (row, column) begins at `low` (2,) plus (column, row) cells, map frame.

    `free` bool: seen, and nothing stands there. `structure` float in [0, 1]: the share of the height up to 2 m over
    which surfaces were seen. Neither: nobody has seen it.
    """

    low: FloatArray
    cell_m: float
    free: BoolArray
    structure: FloatArray

    @property
    def high(self) -> FloatArray:
        """The upper corner (2,), m."""
        rows, columns = self.free.shape
        high: FloatArray = self.low + self.cell_m * np.array([columns, rows])
        return high

    @property
    def free_m2(self) -> float:
        """The floor that was seen free, m2."""
        return float(self.free.sum()) * self.cell_m**2


def observed_floor(
    reader: MapReader, traversal_id: int | None = None, until_ns: int | None = None
) -> ObservedFloor | None:
    """The floor of the map (of one traversal; as seen by a time). `None` where no keyframe has seen anything."""
    poses = (
        (row.id, row.traversal_id, parsed_transform(row.T_map_camera, f"the camera of keyframe {row.id}"))
        for row in stream_keyframes(reader, traversal_id, until_ns)
    )
    return _floor_of(reader, _viewpoints(poses))


def floor_about(reader: MapReader, numbers: Collection[int]) -> ObservedFloor | None:
    """The floor about some instances, from keyframes that show them: what is far off is not read."""
    connection = reader.connection
    ids = observing_keyframes(connection, list(reader.parts_of(numbers)), _VIEWS_OF_THING)
    traversals = keyframe_traversals(connection, ids)
    poses = [(keyframe_id, traversals[keyframe_id], T) for keyframe_id, T in camera_poses(connection, ids).items()]
    return _floor_of(reader, _viewpoints(poses))


def _floor_of(reader: MapReader, views: Sequence[_Viewpoint]) -> ObservedFloor | None:
    if not views:
        return None
    raster = _Raster.around(np.array([view.position for view in views]))
    numbers = sorted({view.traversal_id for view in views})
    order = {traversal.id: traversal.number for traversal in reader.traversals}
    for number in sorted(numbers, key=lambda number: order.get(number, 0)):
        of_traversal = raster.empty()
        for record in keyframe_views(reader.connection, [view.id for view in views if view.traversal_id == number]):
            of_traversal.add(record)
        raster.update(of_traversal)
    return raster.floor()


@dataclass(frozen=True)
class _Viewpoint:
    id: int
    traversal_id: int
    position: FloatArray


def _viewpoints(poses: Iterable[tuple[int, int, FloatArray]]) -> list[_Viewpoint]:
    """The newest keyframe of every viewpoint of every traversal: from ids, traversals and `T_map_camera`."""
    newest: dict[tuple[int, ...], _Viewpoint] = {}
    for keyframe_id, traversal_id, T in poses:
        place = np.floor(T[:3, 3] / _VIEW_M).astype(int).tolist()
        azimuth = math.floor(math.atan2(T[1, 2], T[0, 2]) / _VIEW_RAD)
        elevation = math.floor(math.asin(min(1.0, max(-1.0, float(T[2, 2])))) / _VIEW_RAD)
        newest[traversal_id, *place, azimuth, elevation] = _Viewpoint(keyframe_id, traversal_id, T[:2, 3])
    views = sorted(newest.values(), key=lambda view: view.id)
    return views[:: max(1, math.ceil(len(views) / MOST_VIEWS))]


@dataclass
class _Raster:
    low: FloatArray
    cell_m: float
    shape: tuple[int, int]
    hits: IntArray = field(init=False)
    bins: IntArray = field(init=False)
    passed: BoolArray = field(init=False)

    def __post_init__(self) -> None:
        self.hits = np.zeros(self.shape, np.int64)
        self.bins = np.zeros(self.shape, np.int64)
        self.passed = np.zeros(self.shape, bool)

    @classmethod
    def around(cls, positions: FloatArray) -> _Raster:
        low, high = positions.min(axis=0) - REACH_M, positions.max(axis=0) + REACH_M
        cell_m = max(CELL_M, math.sqrt(float(np.prod(high - low)) / MOST_CELLS))
        low = np.floor(low / cell_m) * cell_m
        columns, rows = (max(1, math.ceil(extent / cell_m)) for extent in (high - low).tolist())
        return cls(low, cell_m, (rows, columns))

    def empty(self) -> _Raster:
        return _Raster(self.low, self.cell_m, self.shape)

    def add(self, record: KeyframeRecord) -> None:
        """Add the surfaces of a depth image, and the space before them."""
        depth_m, camera = decode_small_depth(record), camera_from_json(record.camera)
        rows, columns = np.nonzero((depth_m > 0) & (depth_m <= REACH_M))
        pixels = np.column_stack([columns, rows]).astype(np.float64) * record.depth_step
        points_camera = camera.back_project(pixels, depth_m[rows, columns].astype(np.float64))
        points_camera = points_camera[np.isfinite(points_camera).all(axis=1)]
        points = transform_points(record.T_map_camera, points_camera)
        standing = points[(points[:, 2] > FLOOR_M) & (points[:, 2] < TOP_M)]
        cells, inside = self._cells(standing)
        np.add.at(self.hits, cells, 1)
        bits = np.left_shift(1, np.floor(standing[inside, 2] / BIN_M).astype(np.int64))
        np.bitwise_or.at(self.bins, cells, bits)
        self.passed[self._cells(points[np.abs(points[:, 2]) <= FLOOR_M])[0]] = True
        for along in _along_rays(record.T_map_camera[:3, 3], points[::_RAYS]):
            self.passed[self._cells(along[(along[:, 2] > FLOOR_M) & (along[:, 2] < TOP_M)])[0]] = True

    def update(self, later: _Raster) -> None:
        """What a later traversal saw counts: things move."""
        stands = later.hits >= _LEAST_HITS
        cleared = later.passed & ~stands
        self.bins[stands] |= later.bins[stands]
        self.hits[stands] = later.hits[stands]
        self.bins[cleared], self.hits[cleared] = 0, 0
        self.passed |= later.passed

    def floor(self) -> ObservedFloor | None:
        structure = np.bitwise_count(self.bins) / _BINS * (self.hits >= _LEAST_HITS)
        free = self.passed & (structure == 0)
        rows, columns = (np.flatnonzero((free | (structure > 0)).any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            return None
        part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        low = self.low + self.cell_m * np.array([columns[0], rows[0]])
        return ObservedFloor(low, self.cell_m, free[part], structure[part])

    def _cells(self, points: FloatArray) -> tuple[tuple[IntArray, IntArray], BoolArray]:
        """Rows and columns of the points that lie in the raster, and which those are."""
        columns, rows = np.floor((points[:, :2] - self.low) / self.cell_m).astype(np.int64).T
        inside = (columns >= 0) & (columns < self.shape[1]) & (rows >= 0) & (rows < self.shape[0])
        return (rows[inside], columns[inside]), inside


def _along_rays(origin: FloatArray, ends: FloatArray) -> Iterator[FloatArray]:
    """Points (n, 3) of the space that rays from a camera passed, one array for each distance from it."""
    rays = ends - origin
    lengths = np.linalg.norm(rays, axis=1)
    for distance_m in np.arange(_NEAREST_M, REACH_M, _RAY_STEP_M):
        reached = lengths - _BEFORE_SURFACE_M > distance_m
        if not reached.any():
            return
        yield origin + rays[reached] * (distance_m / lengths[reached])[:, None]
