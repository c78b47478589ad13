"""Places a further traversal in the map: by an odom frame that goes on, else by where its structure fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from supermap_cli.errors import AlignmentError
from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.geometry.se3 import (
    inverse,
    make_transform,
    rotation_from_quaternion_xyzw,
    transform_points,
)
from supermap_cli.mapping.icp import Surface
from supermap_cli.mapping.place_search import Candidate, distinct, search
from supermap_cli.mapping.structure import CoarseDepth, Structure, join

AlignmentMethod = Literal["continued", "refined", "registered"]

_VOXEL_M = 0.05
_REACH_M = 0.08
_LEAST_FITNESS = 0.8
_LEAST_SUPPORT, _LEAST_CONTINUED = 0.3, 0.15
_LEAST_MARGIN = 0.05
_MOST_POINTS = 6000
_MOST_VIEWS = 40
_KEEP_M = 0.04
_COARSE_REACHES_M = (0.4, 0.4, 0.3, 0.3, 0.2, 0.2, 0.15, 0.15)
_FINE_REACHES_M = (0.15, 0.15, 0.1, 0.1, 0.08, 0.08, 0.08, 0.08)


@dataclass(frozen=True)
class Alignment:
    """`T_map_odom` of a traversal.

    `fitness` is the share of its surface points, of those that the map can tell, that lie on a surface of the map (the
    others lie where the map saw through); `overlap` the share of its points that the map can tell; `rmse_m` the
    distance of matched points to the map's planes.
    """

    T_map_odom: FloatArray
    fitness: float
    overlap: float
    rmse_m: float
    method: AlignmentMethod


def align(
    views_map: Sequence[CoarseDepth],
    views_odom: Sequence[CoarseDepth],
    T_level_odom: FloatArray,
    hypotheses: Sequence[FloatArray] = (),
) -> Alignment:
    """Find `T_map_odom` of a traversal.

    `views_map` are depth images of earlier traversals in the map frame, `views_odom` the new one's in its odom frame,
    spread over it (40 of each are used); `T_level_odom` is its own levelling. `hypotheses` are `T_map_odom` of earlier
    traversals: when the odom frame is the same one (a recording cut in two), one of them holds, and is then
    kept exactly. Else the levelled structure is registered in the map, verified by overlap and by what the map saw
    through, and must be clearly better than any other place.

    Raises `AlignmentError` when there is no such place.
    """
    chart = _Chart(_spread(views_map))
    structure_odom = join(view.structure() for view in _spread(views_odom)).thinned(_VOXEL_M)
    if len(chart.structure) < 500 or len(structure_odom) < 500:
        raise _refusal("too few surfaces are seen to tell where the traversal took place")
    sample = structure_odom.take(np.arange(0, len(structure_odom), max(1, len(structure_odom) // _MOST_POINTS)))
    continued = _best_hypothesis(chart, sample, hypotheses)
    return continued or _registered(chart, sample, T_level_odom)


def placed_by_hand(text: str, T_level_odom: FloatArray) -> FloatArray:
    """`T_map_odom` from "x y z yaw_deg": where the levelled odom frame's origin lies in the map, and its heading there.

    Raises `AlignmentError` for anything but four finite numbers.
    """
    try:
        x, y, z, yaw_deg = map(float, text.replace(",", " ").split())
    except ValueError:
        x = y = z = yaw_deg = float("nan")
    if not np.isfinite([x, y, z, yaw_deg]).all():
        raise AlignmentError(f"not a placement: {text!r}", where="--align", cure="give four numbers: 'x y z yaw_deg'")
    half = np.radians(yaw_deg) / 2
    R = rotation_from_quaternion_xyzw([0.0, 0.0, np.sin(half), np.cos(half)])
    return make_transform(R, [x, y, z]) @ T_level_odom


@dataclass(frozen=True)
class _Evidence:
    """Shares of all points: on a surface of the map, and where the map saw through."""

    T_map_source: FloatArray
    supported: float
    contradicted: float
    rmse_m: float

    @property
    def score(self) -> float:
        return self.supported - self.contradicted

    @property
    def overlap(self) -> float:
        return self.supported + self.contradicted

    @property
    def fitness(self) -> float:
        return self.supported / max(self.overlap, 1e-9)

    def alignment(self, method: AlignmentMethod) -> Alignment:
        return Alignment(self.T_map_source, self.fitness, self.overlap, self.rmse_m, method)


class _Chart:
    """The map's surfaces, and the space it saw through."""

    def __init__(self, views: Sequence[CoarseDepth]) -> None:
        self.structure = join(view.structure() for view in views).thinned(_VOXEL_M)
        self.surface = Surface(self.structure)
        self._views = [(view, _nearest_around(view)) for view in views]

    def evidence(self, source: Structure, T_map_source: FloatArray) -> _Evidence:
        """What the map says of a placement."""
        fit = self.surface.fit(source, T_map_source, _REACH_M)
        empty = self._seen_through(transform_points(T_map_source, source.points)) & ~fit.matched
        return _Evidence(T_map_source, float(fit.matched.mean()), float(empty.mean()), fit.rmse_m)

    def _seen_through(self, points_map: FloatArray) -> BoolArray:
        """(n,) which points lie clearly before a surface that some view saw."""
        through = np.zeros(len(points_map), bool)
        for view, nearest_m in self._views:
            points_camera = transform_points(inverse(view.T_frame_camera), points_map)
            pixels, seen = view.camera.project(points_camera)
            column, row = (pixels[seen] / view.step_px).astype(np.int64).T
            height, width = nearest_m.shape
            surface_m = nearest_m[np.minimum(row, height - 1), np.minimum(column, width - 1)]
            depth_m = view.camera.depth_of(points_camera[seen])
            through[seen] |= (depth_m > 0.2) & (depth_m < surface_m - 0.1 - 0.03 * depth_m)
        return through


def _best_hypothesis(chart: _Chart, structure_odom: Structure, hypotheses: Sequence[FloatArray]) -> Alignment | None:
    """The best of the given placements if it holds: kept as it is, or slightly corrected."""
    tried = [chart.evidence(structure_odom, T) for T in hypotheses]
    tried += [
        chart.evidence(structure_odom, chart.surface.refine(structure_odom, T, _FINE_REACHES_M, level=False))
        for T in hypotheses
    ]
    holding = [each for each in tried if each.fitness > _LEAST_FITNESS and each.supported > _LEAST_CONTINUED]
    if not holding:
        return None
    best = max(holding, key=lambda each: each.score)
    where = transform_points(best.T_map_source, structure_odom.points)
    for T in hypotheses:
        correction_m = np.linalg.norm(transform_points(T, structure_odom.points) - where, axis=1).mean()
        if correction_m < _KEEP_M:
            return chart.evidence(structure_odom, T).alignment("continued")
    return best.alignment("refined")


def _registered(chart: _Chart, structure_odom: Structure, T_level_odom: FloatArray) -> Alignment:
    """The one place where the structure fits. Raises `AlignmentError` if none does, or more than one."""
    level = structure_odom.moved(T_level_odom)
    few = level.take(np.arange(0, len(level), max(1, len(level) // 2000)))
    candidates = []
    for candidate in search(chart.structure, level):
        T = chart.surface.refine(few, candidate.T_map_level, _COARSE_REACHES_M, level=True)
        candidates.append(Candidate(T, chart.evidence(few, T).score))
    best, *others = [
        chart.evidence(level, chart.surface.refine(level, place.T_map_level, _FINE_REACHES_M, level=False))
        for place in distinct(sorted(candidates, key=lambda each: -each.score), 2)
    ]
    if others and others[0].score > best.score:
        best, others = others[0], [best]
    if best.fitness < _LEAST_FITNESS or best.supported < _LEAST_SUPPORT:
        raise _refusal(f"the traversal fits nowhere in the map ({best.supported:.0%} of it lies on mapped surfaces)")
    if others and others[0].score > (1 - _LEAST_MARGIN) * best.score:
        raise _refusal("the traversal fits in more than one place of the map")
    return chart.evidence(structure_odom, best.T_map_source @ T_level_odom).alignment("registered")


def _refusal(what: str) -> AlignmentError:
    return AlignmentError(
        what,
        cure="give the place of its levelled odom frame with --align 'x y z yaw_deg', or map it into its own database",
    )


def _nearest_around(view: CoarseDepth) -> FloatArray:
    """The least depth of every pixel's 3 x 3 neighbourhood, 0 where any of it has no return or nothing is known."""
    padded = np.pad(view.depth_m.astype(np.float64), 1)
    height, width = view.depth_m.shape
    around = [padded[dv : dv + height, du : du + width] for dv in range(3) for du in range(3)]
    nearest: FloatArray = np.min(around, axis=0)
    return nearest


def _spread(views: Sequence[CoarseDepth]) -> Sequence[CoarseDepth]:
    """At most 40 of the views, evenly spread."""
    chosen = np.unique(np.linspace(0, len(views) - 1, min(len(views), _MOST_VIEWS)).round().astype(int))
    return [views[k] for k in chosen]
