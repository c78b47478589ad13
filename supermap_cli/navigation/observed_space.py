"""The occupancy grid of a map, from its stored depth images: what rays went through, and where they ended.

A voxel is free where rays passed it and occupied where they ended, by the newest traversal that saw it: things move. A
cell of the floor is free where the floor was seen and everything above it, up to the robot's height, was seen free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import cv2
import numpy as np

from supermap_cli.errors import QueryError
from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray, UInt8Array
from supermap_cli.geometry.cameras import Camera, camera_from_json
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.geometry.voxels import voxel_centers
from supermap_cli.mapping.free_space import SmallView, decode_small_depth, small_view
from supermap_cli.mapping.visibility import tolerance_m
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.streaming import stream_present_geometry
from supermap_cli.navigation.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from supermap_cli.navigation.parameters import ABOVE_CAMERA_M, DEFAULT, ROBOT_HEIGHTS_M, NavigationParameters
from supermap_cli.navigation.viewpoints import StoredViewpoint, all_viewpoints, depth_records, newest_of_each_place


def occupancy_grid(
    reader: MapReader, robot_height_m: float | None = None, parameters: NavigationParameters = DEFAULT
) -> OccupancyGrid:
    """The grid of the whole map for a robot of a height (default: as high as its cameras).

    Raises `QueryError` for a map without depth images.
    """
    viewpoints = all_viewpoints(reader)
    if not viewpoints:
        raise QueryError(
            "the map has no keyframe, so nobody has seen where its floor is free",
            where=reader.where,
            cure="supermap build a recording with depth into it",
        )
    camera_m = float(np.median([viewpoint.T_map_camera[2, 3] for viewpoint in viewpoints]))
    height_m = robot_height_m or _height_by_cameras(viewpoints)
    volume = _Volume.around(viewpoints, height_m, parameters)
    newest = newest_of_each_place(viewpoints, parameters.views_per_cell, parameters.traversals_per_cell)
    for traversal in sorted({viewpoint.traversal for viewpoint in newest}):
        of_traversal = [viewpoint for viewpoint in newest if viewpoint.traversal == traversal]
        seen = _Volume.around(of_traversal, height_m, parameters, volume.cell_m)
        evidence = _TraversalEvidence.empty(seen)
        for viewpoint, record in depth_records(reader, of_traversal):
            small_m = decode_small_depth(record)
            camera = camera_from_json(record.camera)
            view = small_view(record.stamp_ns, viewpoint.T_map_camera, camera, small_m, record.depth_step)
            evidence.add(view, small_m)
        volume.update(evidence)
    volume.add_ways(viewpoints)
    volume.add_present(reader)
    return volume.grid(height_m, camera_m)


def _height_by_cameras(viewpoints: list[StoredViewpoint]) -> float:
    low, high = ROBOT_HEIGHTS_M
    heights = [viewpoint.T_map_camera[2, 3] for viewpoint in viewpoints]
    return float(np.clip(math.ceil(10 * (np.percentile(heights, 90) + ABOVE_CAMERA_M)) / 10, low, high))


@dataclass
class _Volume:
    """What is known of the voxels (nx, ny, nz): `seen` 0 nothing, 1 free, 2 occupied; `floor` (nx, ny) was seen."""

    origin_xy: FloatArray
    cell_m: float
    shape: tuple[int, int, int]
    robot_levels: int
    parameters: NavigationParameters
    state: UInt8Array = field(init=False)
    floor: BoolArray = field(init=False)
    driven: BoolArray = field(init=False)

    def __post_init__(self) -> None:
        self.state = np.zeros(self.shape, np.uint8)
        self.floor, self.driven = np.zeros(self.shape[:2], bool), np.zeros(self.shape[:2], bool)

    @classmethod
    def around(
        cls,
        viewpoints: list[StoredViewpoint],
        height_m: float,
        parameters: NavigationParameters,
        cell_m: float | None = None,
    ) -> _Volume:
        """Room for everything within reach of the viewpoints. Volumes of one `cell_m` share their cells' edges."""
        positions = np.array([viewpoint.T_map_camera[:2, 3] for viewpoint in viewpoints])
        low, high = positions.min(axis=0) - parameters.reach_m, positions.max(axis=0) + parameters.reach_m
        levels = math.ceil(max(parameters.top_m, height_m) / parameters.level_m) + 1
        fixed, cell_m = cell_m is not None, cell_m or parameters.cell_m
        while not fixed and np.prod(np.ceil((high - low) / cell_m)) * levels > parameters.most_voxels:
            cell_m *= 2
        origin = np.floor(low / cell_m) * cell_m
        nx, ny = (int(n) for n in np.ceil((high - origin) / cell_m))
        robot_levels = max(1, math.ceil(height_m / parameters.level_m - 1e-9))
        return cls(origin, cell_m, (nx, ny, levels), robot_levels, parameters)

    def heights_m(self) -> FloatArray:
        """The heights at which the levels are looked at: their upper ends."""
        heights = (np.arange(self.shape[2], dtype=np.float64) + 1) * self.parameters.level_m
        return np.maximum(heights, self.parameters.lowest_m)

    def voxels_of(self, points_map: FloatArray) -> tuple[IntArray, IntArray, IntArray]:
        """The voxels of those of the points (n, 3) that lie in the volume above the floor."""
        cells = np.floor((points_map[:, :2] - self.origin_xy) / self.cell_m).astype(np.int64)
        levels = np.floor(points_map[:, 2] / self.parameters.level_m).astype(np.int64)
        kept = (points_map[:, 2] >= self.parameters.lowest_m) & (levels < self.shape[2])
        kept &= ((cells >= 0) & (cells < np.array(self.shape[:2]))).all(axis=1)
        return cells[kept, 0], cells[kept, 1], levels[kept]

    def update(self, evidence: _TraversalEvidence) -> None:
        """What a later traversal saw replaces what was known."""
        hits, passes = evidence.hits, evidence.passes
        offset = np.rint((evidence.volume.origin_xy - self.origin_xy) / self.cell_m).astype(np.int64)
        low, high = np.maximum(offset, 0), np.minimum(offset + hits.shape[:2], self.shape[:2])
        here = slice(low[0], high[0]), slice(low[1], high[1])
        there = tuple(slice(a, b) for a, b in zip(low - offset, high - offset, strict=True))
        for level in range(self.shape[2]):  # a level at a time bounds the memory
            hit, passed = hits[there][:, :, level].astype(np.float32), passes[there][:, :, level]
            occupied = (hit >= self.parameters.min_hits) & (hit > self.parameters.hit_share * (hit + passed))
            state = self.state[here][:, :, level]
            state[occupied] = OCCUPIED
            state[~occupied & (passed > 0)] = FREE
        self.floor[here] |= evidence.floor[there]

    def add_ways(self, viewpoints: list[StoredViewpoint]) -> None:
        """The cells that the robot's base passed over, from one keyframe to the next."""
        for before, after in pairwise(viewpoints):
            start, end = before.T_map_base[:2, 3], after.T_map_base[:2, 3]
            distance_m = float(np.linalg.norm(end - start))
            joined = before.traversal == after.traversal and distance_m <= self.parameters.longest_step_m
            steps = max(2, math.ceil(2 * distance_m / self.cell_m)) if joined else 1
            passed = start + np.linspace(0, 1, steps)[:, None] * (end - start)
            self._mark_driven(passed)
        self._mark_driven(viewpoints[-1].T_map_base[None, :2, 3])

    def _mark_driven(self, points_xy: FloatArray) -> None:
        x, y = np.floor((points_xy - self.origin_xy) / self.cell_m).astype(np.int64).T
        self.driven[x, y] = True

    def add_present(self, reader: MapReader) -> None:
        """What stands there by the map is occupied: full images show thin things that small ones miss."""
        for _, cloud in stream_present_geometry(reader):
            solid = cloud.log_odds > 0
            self.state[self.voxels_of(voxel_centers(cloud.keys[solid], cloud.voxel_m))] = OCCUPIED

    def grid(self, height_m: float, camera_m: float) -> OccupancyGrid:
        """The cells that the voxels make."""
        below = self.state[:, :, : self.robot_levels]
        cells = np.full(self.shape[:2], UNKNOWN, np.uint8)
        free = self.floor & (below == FREE).all(axis=2)
        cells[_closed(free)] = FREE
        cells[(below == OCCUPIED).any(axis=2)] = OCCUPIED
        low, high = _extent(cells, self.driven)
        part = slice(low[0], high[0]), slice(low[1], high[1])
        origin = self.origin_xy + np.array(low) * self.cell_m
        blocked = self.state[part] == OCCUPIED
        return OccupancyGrid(
            cells[part], origin, self.cell_m, blocked, self.driven[part], self.parameters.level_m, height_m, camera_m
        )


def _closed(free: BoolArray) -> BoolArray:
    """Gaps of one cell closed: far away rows of pixels are farther apart than cells."""
    around = np.ones((3, 3), np.uint8)
    closed: BoolArray = cv2.morphologyEx(np.pad(free, 2).astype(np.uint8), cv2.MORPH_CLOSE, around)[2:-2, 2:-2] > 0
    return closed


def _extent(cells: UInt8Array, driven: BoolArray) -> tuple[tuple[int, int], tuple[int, int]]:
    """The part of the cells that is known, with a cell around it; the first cell where none is."""
    known = np.argwhere((cells != UNKNOWN) | driven)
    if not len(known):
        return (0, 0), (1, 1)
    low, high = np.maximum(known.min(axis=0) - 1, 0), np.minimum(known.max(axis=0) + 2, cells.shape)
    return (int(low[0]), int(low[1])), (int(high[0]), int(high[1]))


@dataclass
class _TraversalEvidence:
    """What one traversal saw: in how many views a voxel gave returns or was looked through, and where floor was."""

    volume: _Volume
    hits: UInt8Array
    passes: UInt8Array
    floor: BoolArray

    @classmethod
    def empty(cls, volume: _Volume) -> _TraversalEvidence:
        """Nothing seen yet."""
        hits = np.zeros(volume.shape, np.uint8)
        return cls(volume, hits, np.zeros_like(hits), np.zeros(volume.shape[:2], bool))

    def add(self, view: SmallView, small_m: Float32Array) -> None:
        """Add a depth image (h, w): where its rays ended, and what they went through."""
        parameters, T = self.volume.parameters, view.T_map_camera
        rows, columns = np.nonzero((small_m > 0) & (small_m <= parameters.reach_m))
        pixels = np.column_stack([columns, rows]).astype(np.float64) * view.step_px
        depth_m = small_m[rows, columns].astype(np.float64)
        returned = transform_points(T, view.camera.back_project(pixels, depth_m))
        codes = np.unique(np.ravel_multi_index(self.volume.voxels_of(returned), self.volume.shape))
        _count(self.hits.ravel(), codes)
        on_floor = np.zeros(small_m.shape, bool)
        on_floor[rows, columns] = np.abs(returned[:, 2]) <= parameters.floor_m
        cells = self._columns_in_view(view)
        seen_enough = self.passes[cells[:, 0], cells[:, 1], : self.volume.robot_levels].min(axis=1)
        self._look_through(view, cells[seen_enough < parameters.enough_passes], on_floor)

    def _columns_in_view(self, view: SmallView) -> IntArray:
        """The cells (n, 2) that the camera looks over."""
        volume, T = self.volume, view.T_map_camera
        reach = math.ceil(volume.parameters.reach_m / volume.cell_m)
        middle = np.floor((T[:2, 3] - volume.origin_xy) / volume.cell_m).astype(np.int64)
        low = np.maximum(middle - reach, 0)
        high = np.minimum(middle + reach + 1, np.array(volume.shape[:2]))
        i, j = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
        offsets = np.stack([i - middle[0], j - middle[1]], axis=-1)
        near = (offsets**2).sum(axis=-1) <= reach**2
        axis = T[:2, 2]
        half = view.camera.widest_angle()
        if half < math.pi / 2 and np.linalg.norm(axis) > 0.5:  # looking ahead: what lies behind is left out
            along = offsets @ (axis / np.linalg.norm(axis))
            near &= along >= np.cos(min(half, math.pi / 2)) * np.sqrt((offsets**2).sum(axis=-1)) - 4
        return np.column_stack([i[near], j[near]])

    def _look_through(self, view: SmallView, cells: IntArray, on_floor: BoolArray) -> None:
        """Project every level of the columns above the cells into the image and compare it with the depth there."""
        volume = self.volume
        xy = (cells + 0.5) * volume.cell_m + volume.origin_xy
        T_camera_map = inverse(view.T_map_camera)
        heights = volume.heights_m()
        on_ground = xy @ T_camera_map[:3, :2].T + T_camera_map[:3, 3]
        for level in range(-1, volume.robot_levels):
            z = 0.0 if level < 0 else heights[level]
            points_camera = on_ground + z * T_camera_map[:3, 2]
            v, u, seen = _small_pixels(view.camera, points_camera, view.step_px, on_floor.shape)
            if level < 0:
                shown = cells[seen][on_floor[v, u]]
                self.floor[shown[:, 0], shown[:, 1]] = True
                continue
            depth = view.camera.depth_of(points_camera[seen])
            nearest = view.nearest_m[v, u]
            through = np.isfinite(nearest) & (depth > 0) & (depth < nearest - tolerance_m(depth, volume.cell_m))
            passed = cells[seen][through]
            _count(self.passes[:, :, level], (passed[:, 0], passed[:, 1]))


def _count(counts: UInt8Array, at: IntArray | tuple[IntArray, IntArray]) -> None:
    """One more at each place (given once), up to 255: more views tell no more."""
    before = counts[at]
    counts[at] = before + (before < 255)


def _small_pixels(
    camera: Camera, points_camera: FloatArray, step_px: int, shape: tuple[int, ...]
) -> tuple[IntArray, IntArray, IntArray]:
    """The pixels v, u of the small image that points (n, 3) fall on, and which of the points those are."""
    pixels, in_view = camera.project(points_camera)
    seen = np.flatnonzero(in_view)
    u, v = np.rint(pixels[seen] / step_px).astype(np.int64).T
    kept = (u >= 0) & (v >= 0) & (u < shape[1]) & (v < shape[0])
    return v[kept], u[kept], seen[kept]
