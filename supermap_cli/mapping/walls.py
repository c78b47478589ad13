"""Where walls stand, from depth images: upright surfaces that are high and wide, and belong to no object of the map.

Two things on two sides of a wall are not near each other, whatever their distance. A wall is known by its faces, each
with the side that it was seen from: what hangs on a wall lies before its face, and what stands in the next room lies
behind it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D, nearest_points
from supermap_cli.mapping import structure
from supermap_cli.mapping.structure import CoarseDepth, Structure, StructureParameters, stored_depth
from supermap_cli.types.memory import KeyframeRecord
from supermap_cli.types.parameters import TUNED, parameter

_LOWEST_M = -1.5
"""Height, m, of the lowest part of a wall that is kept track of: the map's z = 0 is a floor, but not always."""
_BITS = 62
"""Height bins that are kept, one bit each."""
_SECTORS = 8
"""Directions that a face looks to are told apart by as many sectors."""


@dataclass(frozen=True)
class WallParameters:
    """What counts as a wall, and when it stands between two boxes."""

    cell_m: float = parameter(0.1, "m", "edge of the cells of the floor that faces are kept in", TUNED, at_least=0.02)
    bin_m: float = parameter(0.15, "m", "height of the bins in which a face was seen or not", TUNED, at_least=0.02)
    max_tilt: float = parameter(0.25, "1", "sine of an upright surface's tilt, at most", "15 deg", at_most=1.0)
    least_height_m: float = parameter(
        1.0, "m", "height over which a face must have been seen: counters and desks are lower", TUNED
    )
    least_width_m: float = parameter(
        0.7, "m", "width over which a face must have been seen: people and posts are narrower", TUNED
    )
    around_m: float = parameter(0.5, "m", "how far to both sides of a place that width is looked for", TUNED)
    near_m: float = parameter(0.12, "m", "distance of a face from where a line of sight passes it, at most", TUNED)
    before_m: float = parameter(
        0.05, "m", "how far behind a face a thing's middle may lie that stands before it: drift, unseen backs", TUNED
    )
    behind_m: float = parameter(0.08, "m", "how far behind a face what it hides lies at least", "a thin wall")
    least_share: float = parameter(
        0.5,
        "1",
        "points of a face by those of the fullest one just before or behind it, at least: less is noise",
        TUNED,
    )
    noise_m: float = parameter(0.25, "m", "how far before and behind a face that fullest one is looked for", TUNED)
    least_slope: float = parameter(
        0.08, "1", "sine of the angle at which a line passes a wall, at least: along it, it only grazes it", "5 deg"
    )
    inset_m: float = parameter(0.2, "m", "depth in a box from which its nearest point looks at the other", TUNED)
    object_margin_m: float = parameter(
        0.06, "m", "margin about an object's box within which a face is its own", "PredicateParameters.contact_m"
    )
    viewpoint_m: float = parameter(
        0.7, "m", "edge of the cells of position of a viewpoint", "finds the walls that twice as many views do"
    )
    viewpoint_deg: float = parameter(45.0, "deg", "width of the cells of its direction", "as viewpoint_m", at_least=1)
    views_per_viewpoint: int = parameter(1, "1", "depth images that are used of each", "bounds the time", at_least=1)


DEFAULT = WallParameters()


Cell = tuple[int, int]
"""A square of the floor: x and y in units of its edge."""
Point = tuple[float, float]
"""x and y, m in the map frame. Plain numbers: numpy costs many times the computation for two of them."""


@dataclass(slots=True)
class _Face:
    """A part of an upright surface within one cell, as seen from one sector: sums over its points."""

    count: int = 0
    x: float = 0.0
    y: float = 0.0
    normal_x: float = 0.0
    normal_y: float = 0.0
    heights: int = 0

    def place(self) -> Point:
        """The middle of its points."""
        return self.x / self.count, self.y / self.count

    def normal(self) -> Point:
        """Where it looks to, of unit length."""
        length = max(math.hypot(self.normal_x, self.normal_y), 1e-9)
        return self.normal_x / length, self.normal_y / length


@dataclass
class WallMap:
    """The faces of upright surfaces, by cell of the floor and sector.

    `add_record` keeps a view for later: surfaces are worked out when they are first asked for. `views` counts those
    in use.
    """

    parameters: WallParameters = DEFAULT
    views: int = 0
    _faces: dict[Cell, dict[int, _Face]] = field(default_factory=dict, repr=False)
    _waiting: list[CoarseDepth] = field(default_factory=list, repr=False)
    _viewpoints: dict[tuple[int, int, int], int] = field(default_factory=dict, repr=False)

    def add_record(self, record: KeyframeRecord, parameters: StructureParameters = structure.DEFAULT) -> None:
        """The depth image that the memory keeps with a keyframe; of each viewpoint the first few are used."""
        if self.wants(record.T_map_camera):
            viewpoint = self._viewpoint(record.T_map_camera)
            self._viewpoints[viewpoint] = self._viewpoints.get(viewpoint, 0) + 1
            self._waiting.append(stored_depth(record, parameters))
            self.views += 1

    def wants(self, T_map_camera: FloatArray) -> bool:
        """Whether a view from there would add to those that there are."""
        return self._viewpoints.get(self._viewpoint(T_map_camera), 0) < self.parameters.views_per_viewpoint

    def _viewpoint(self, T_map_camera: FloatArray) -> tuple[int, int, int]:
        parameters = self.parameters
        azimuth_deg = math.degrees(math.atan2(T_map_camera[1, 2], T_map_camera[0, 2]))
        x, y = (math.floor(place / parameters.viewpoint_m) for place in T_map_camera[:2, 3].tolist())
        return x, y, math.floor(azimuth_deg / parameters.viewpoint_deg)

    def add_surfaces(self, surfaces: Structure) -> None:
        """Points with normals that look to the side they were seen from, in the map frame."""
        parameters = self.parameters
        bins = np.floor((surfaces.points[:, 2] - _LOWEST_M) / parameters.bin_m).astype(np.int64)
        upright = np.abs(surfaces.normals[:, 2]) <= parameters.max_tilt
        chosen = np.flatnonzero(upright & (bins >= 0) & (bins < _BITS))
        if not len(chosen):
            return
        points, normals = surfaces.points[chosen, :2], surfaces.normals[chosen, :2]
        cells = np.floor(points / parameters.cell_m).astype(np.int64)
        keys = np.column_stack([cells, _sectors(normals)])
        order = np.lexsort(keys.T[::-1])
        keys = keys[order]
        starts = np.flatnonzero(np.r_[True, (keys[1:] != keys[:-1]).any(axis=1)])
        counts = np.diff(np.r_[starts, len(keys)])
        sums = np.add.reduceat(np.column_stack([points, normals])[order], starts, axis=0)
        heights = np.bitwise_or.reduceat(np.left_shift(np.int64(1), bins[chosen][order]), starts)
        rows = zip(keys[starts].tolist(), counts.tolist(), sums.tolist(), heights.tolist(), strict=True)
        for (cell_x, cell_y, sector), count, (x, y, normal_x, normal_y), seen in rows:
            face = self._faces.setdefault((cell_x, cell_y), {}).setdefault(sector, _Face())
            face.count += count
            face.x, face.y = face.x + x, face.y + y
            face.normal_x, face.normal_y = face.normal_x + normal_x, face.normal_y + normal_y
            face.heights |= seen

    def clear_between(self, first: Box3D, second: Box3D, objects: Sequence[Box3D] = ()) -> bool:
        """Whether no wall is known to stand between two boxes.

        One does that is passed by the line between their middles, and by the shortest one between their outlines, too.
        The faces of `objects`, and those of the two themselves, are no walls.
        """
        for view in self._waiting:
            self.add_surfaces(view.structure())
        self._waiting.clear()
        if not self._faces:
            return True
        owners = [first, second, *objects]
        return any(not self._is_crossed(line, first, second, owners) for line in _lines(first, second, self.parameters))

    def _is_crossed(self, line: tuple[Point, Point], first: Box3D, second: Box3D, owners: Sequence[Box3D]) -> bool:
        """Whether a line between two boxes passes a wall with the middle of one of them behind it: a box's corner may
        stick into the wall that it stands against.
        """
        middles = (_middle(first), _middle(second))
        return any(
            any(_height_above(middle, place, normal) <= -self.parameters.behind_m for middle in middles)
            and self._is_wall(place, normal, sector)
            and not _is_owned(place, normal, owners, self.parameters)
            for place, normal, sector in self._passed(*line)
        )

    def _passed(self, start: Point, end: Point) -> Iterator[tuple[Point, Point, int]]:
        """Place, normal and sector of each face that a line passes: one end is before it, the other one behind it."""
        parameters = self.parameters
        way_x, way_y = end[0] - start[0], end[1] - start[1]
        least_m = max(parameters.least_slope * math.hypot(way_x, way_y), 1e-9)
        for cell in _cells_along(start, end, parameters.cell_m):
            for sector, face in _main_faces(self._faces.get(cell, {})):
                (x, y), (normal_x, normal_y) = face.place(), face.normal()
                at_start = _height_above(start, (x, y), (normal_x, normal_y))
                at_end = _height_above(end, (x, y), (normal_x, normal_y))
                if max(at_start, at_end) < -parameters.before_m or min(at_start, at_end) > -parameters.behind_m:
                    continue
                if abs(at_start - at_end) < least_m:
                    continue
                share = min(max(at_start / (at_start - at_end), 0.0), 1.0)
                off_m = math.hypot(start[0] + way_x * share - x, start[1] + way_y * share - y)
                if off_m <= parameters.near_m:
                    yield (x, y), (normal_x, normal_y), sector

    def _is_wall(self, place: Point, normal: Point, sector: int) -> bool:
        """Whether the surface about a face is high and wide enough, and not just noise before or behind one."""
        parameters = self.parameters
        if self._height_m(place, normal, sector) < parameters.least_height_m:
            return False
        if not self._is_fullest(place, normal, sector):
            return False
        steps = round(parameters.around_m / parameters.cell_m)
        places = ((place[0] - normal[1] * k, place[1] + normal[0] * k) for k in _offsets(steps, parameters.cell_m))
        high = sum(self._height_m(other, normal, sector) >= parameters.least_height_m for other in places)
        return high * parameters.cell_m >= parameters.least_width_m

    def _is_fullest(self, place: Point, normal: Point, sector: int) -> bool:
        """Whether most points of a surface lie at a face, and not just before or behind it."""
        parameters = self.parameters
        steps = round(2 * parameters.noise_m / parameters.cell_m)
        counts = [
            sum(face.count for face in self._faces_at(place, normal, offset_m, sector))
            for offset_m in _offsets(steps, parameters.cell_m / 2)
        ]
        return counts[steps] >= parameters.least_share * max(counts)

    def _height_m(self, place: Point, normal: Point, sector: int) -> float:
        """Height over which a face was seen at a place, or up to a cell before or behind it."""
        seen = 0
        for offset_m in _offsets(2, self.parameters.cell_m / 2):
            for face in self._faces_at(place, normal, offset_m, sector):
                seen |= face.heights
        return seen.bit_count() * self.parameters.bin_m

    def _faces_at(self, place: Point, normal: Point, offset_m: float, sector: int) -> Iterator[_Face]:
        """The faces that look to a sector or one beside it, in the cell so far before a place."""
        at = (place[0] + normal[0] * offset_m, place[1] + normal[1] * offset_m)
        faces = self._faces.get(_cell(at, self.parameters.cell_m))
        if faces is not None:
            for other in (sector, (sector + 1) % _SECTORS, (sector - 1) % _SECTORS):
                if (face := faces.get(other)) is not None:
                    yield face


def least_object_height_m(parameters: WallParameters = DEFAULT) -> float:
    """Height from which an object may be taken for a wall: bins are counted that it only reaches into."""
    return parameters.least_height_m - 2 * parameters.bin_m


def high_between(
    first: Box3D, second: Box3D, boxes: Iterable[Box3D], parameters: WallParameters = DEFAULT
) -> list[Box3D]:
    """Those of some boxes that are high enough to be taken for a wall, and lie between two others."""
    (ax, ay), (bx, by) = first.center[:2].tolist(), second.center[:2].tolist()
    middle_x, middle_y, reach_m = (ax + bx) / 2, (ay + by) / 2, math.hypot(ax - bx, ay - by) / 2
    least_m = least_object_height_m(parameters)
    return [
        box
        for box in boxes
        if box.size[2] >= least_m
        and math.hypot(box.center[0] - middle_x, box.center[1] - middle_y)
        <= reach_m + math.hypot(box.size[0], box.size[1]) / 2 + parameters.near_m
    ]


def _main_faces(faces: Mapping[int, _Face]) -> Iterator[tuple[int, _Face]]:
    """A cell's surfaces with their sectors, each with what noise has put into the sectors beside its own."""
    for sector, face in faces.items():
        beside = [faces[other] for other in ((sector + 1) % _SECTORS, (sector - 1) % _SECTORS) if other in faces]
        if all(face.count >= other.count for other in beside):
            parts = (face, *beside)
            yield (
                sector,
                _Face(
                    sum(part.count for part in parts),
                    sum(part.x for part in parts),
                    sum(part.y for part in parts),
                    sum(part.normal_x for part in parts),
                    sum(part.normal_y for part in parts),
                ),
            )


def _height_above(point: Point, place: Point, normal: Point) -> float:
    """How far before a face a point lies, m; negative behind it."""
    return (point[0] - place[0]) * normal[0] + (point[1] - place[1]) * normal[1]


def _is_owned(place: Point, normal: Point, owners: Iterable[Box3D], parameters: WallParameters) -> bool:
    """Whether a face is an object's own: it lies on its box and looks away from its middle."""
    margin_m = parameters.object_margin_m
    for box in owners:
        x, y = place[0] - float(box.center[0]), place[1] - float(box.center[1])
        c, s = math.cos(box.yaw), math.sin(box.yaw)
        within = abs(c * x + s * y) <= box.size[0] / 2 + margin_m and abs(c * y - s * x) <= box.size[1] / 2 + margin_m
        if within and x * normal[0] + y * normal[1] > 0:
            return True
    return False


def _offsets(steps: int, step_m: float) -> list[float]:
    """From so many steps on one side to as many on the other, m."""
    return [k * step_m for k in range(-steps, steps + 1)]


def _sectors(normals: FloatArray) -> IntArray:
    """(n,) which sector each of (n, 2) normals looks to; the map's axes lie in the middle of sectors."""
    turns = np.arctan2(normals[:, 1], normals[:, 0]) / (2 * np.pi)
    return np.mod(np.rint(turns * _SECTORS).astype(np.int64), _SECTORS)


def _cell(place: Point, cell_m: float) -> Cell:
    return math.floor(place[0] / cell_m), math.floor(place[1] / cell_m)


def _cells_along(start: Point, end: Point, cell_m: float) -> list[Cell]:
    """The cells within about one cell of a line, each once."""
    way_x, way_y = end[0] - start[0], end[1] - start[1]
    steps = max(1, math.ceil(math.hypot(way_x, way_y) / cell_m))
    line = [_cell((start[0] + way_x * k / steps, start[1] + way_y * k / steps), cell_m) for k in range(steps + 1)]
    return list(dict.fromkeys((x + dx, y + dy) for x, y in line for dx in (-1, 0, 1) for dy in (-1, 0, 1)))


def _lines(first: Box3D, second: Box3D, parameters: WallParameters) -> Iterator[tuple[Point, Point]]:
    """Between the middles, and between the points of the outlines that are nearest to each other, from within."""
    yield _middle(first), _middle(second)
    a, b = nearest_points(first, second)
    yield _inwards(a, first, parameters.inset_m), _inwards(b, second, parameters.inset_m)


def _middle(box: Box3D) -> Point:
    return float(box.center[0]), float(box.center[1])


def _inwards(point: Point, box: Box3D, depth_m: float) -> Point:
    """A point moved towards a box's middle, up to there."""
    x, y = _middle(box)
    share = min(1.0, depth_m / max(math.hypot(x - point[0], y - point[1]), 1e-9))
    return point[0] + (x - point[0]) * share, point[1] + (y - point[1]) * share
