"""Places a further traversal in the map: by an odom frame that goes on, else by where its structure fits.

No step of the paper, which maps one traversal; needed for what it calls long-term changes between traversals.
"""

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
from supermap_cli.mapping import icp, place_search
from supermap_cli.mapping.icp import IcpParameters, Surface
from supermap_cli.mapping.place_search import Candidate, PlaceSearchParameters, distinct, search
from supermap_cli.mapping.structure import CoarseDepth, Structure, join
from supermap_cli.types.limits import FARTHEST_M
from supermap_cli.types.parameters import TUNED, parameter

AlignmentMethod = Literal["continued", "refined", "registered"]


@dataclass(frozen=True)
class AlignmentParameters:
    """What is compared, how a placement is refined, and when it is good enough.

    A point counts as seen through where it lies nearer than a view's surface by `through_m` and `through_per_m` of its
    depth.
    """

    voxel_m: float = parameter(0.05, "m", "edge of the voxels that surfaces are thinned to", TUNED, at_least=0.005)
    match_m: float = parameter(0.08, "m", "distance up to which a point lies on a surface of the map", TUNED)
    min_fitness: float = parameter(0.8, "1", "share on surfaces of what the map can tell, at least", TUNED, at_most=1)
    min_support: float = parameter(0.3, "1", "share of all points on surfaces of the map, at least", TUNED, at_most=1)
    min_continued_support: float = parameter(
        0.15, "1", "the same where the odom frame of an earlier traversal goes on", TUNED, at_most=1
    )
    min_margin: float = parameter(
        0.05, "1", "by how much, as a share, a place must be better than any other", TUNED, at_most=1
    )
    min_points: int = parameter(500, "1", "points below which a traversal cannot be placed", TUNED)
    max_points: int = parameter(
        6000, "1", "points that earlier placements are judged by", "bounds the time", at_least=1
    )
    coarse_points: int = parameter(
        2000, "1", "points that candidates are refined and judged by", "bounds the time", at_least=1
    )
    max_views: int = parameter(
        40, "1", "depth images used of the map and of the traversal", "bounds the time", at_least=1
    )
    keep_m: float = parameter(
        0.04, "m", "mean correction up to which an earlier traversal's placement is kept exactly", TUNED
    )
    coarse_radii_m: tuple[float, ...] = parameter(
        (0.4, 0.4, 0.3, 0.3, 0.2, 0.2, 0.15, 0.15), "m", "radii of correspondences of the first refinement", TUNED
    )
    fine_radii_m: tuple[float, ...] = parameter(
        (0.15, 0.15, 0.1, 0.1, 0.08, 0.08, 0.08, 0.08), "m", "radii of correspondences of the last refinement", TUNED
    )
    through_m: float = parameter(0.1, "m", "distance before a surface from which a place was seen through", TUNED)
    through_per_m: float = parameter(0.03, "m/m", "the same by depth", TUNED)
    through_from_m: float = parameter(0.2, "m", "depth from which on a view tells what it saw through", "depth cameras")


DEFAULT = AlignmentParameters()


@dataclass(frozen=True)
class AlignmentParameterSets:
    """The parameters of all that alignment does."""

    alignment: AlignmentParameters = DEFAULT
    place_search: PlaceSearchParameters = place_search.DEFAULT
    icp: IcpParameters = icp.DEFAULT


DEFAULT_SETS = AlignmentParameterSets()


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
    sets: AlignmentParameterSets = DEFAULT_SETS,
) -> Alignment:
    """Find `T_map_odom` of a traversal.

    `views_map` are depth images of earlier traversals in the map frame, `views_odom` the new one's in its odom frame,
    spread over it (40 of each are used); `T_level_odom` is its own levelling. `hypotheses` are `T_map_odom` of earlier
    traversals: when the odom frame is the same one (a recording cut in two), one of them holds, and is then
    kept exactly. Else the levelled structure is registered in the map, verified by overlap and by what the map saw
    through, and must be clearly better than any other place.

    Raises `AlignmentError` when there is no such place.
    """
    parameters = sets.alignment
    reference = _ReferenceMap(_evenly_spaced(views_map, parameters.max_views), parameters, sets.icp)
    views = _evenly_spaced(views_odom, parameters.max_views)
    structure_odom = join(view.structure() for view in views).thinned(parameters.voxel_m)
    if min(len(reference.structure), len(structure_odom)) < parameters.min_points:
        raise _alignment_error("too few surfaces are seen to tell where the traversal took place")
    sample = _every_nth(structure_odom, parameters.max_points)
    continued = _best_hypothesis(reference, sample, hypotheses)
    return continued or _registered(reference, sample, T_level_odom, sets.place_search)


def parse_placement(text: str, T_level_odom: FloatArray) -> FloatArray:
    """`T_map_odom` from "x y z yaw_deg": where the levelled odom frame's origin lies in the map, and its heading there.

    Raises `AlignmentError` for anything but four finite numbers, and for places that lie too far off.
    """
    try:
        x, y, z, yaw_deg = map(float, text.replace(",", " ").split())
    except ValueError:
        x = y = z = yaw_deg = float("nan")
    if not np.isfinite([x, y, z, yaw_deg]).all():
        raise AlignmentError(f"not a placement: {text!r}", where="--align", cure="give four numbers: 'x y z yaw_deg'")
    if np.abs([x, y, z]).max() > FARTHEST_M:
        raise AlignmentError(
            f"a place more than {FARTHEST_M:.0f} m away: {text!r}",
            where="--align",
            cure="give metres and degrees: 'x y z yaw_deg'",
        )
    half = np.radians(yaw_deg % 360) / 2
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


class _ReferenceMap:
    """The map's surfaces, and the space it saw through."""

    def __init__(
        self, views: Sequence[CoarseDepth], parameters: AlignmentParameters, icp_parameters: IcpParameters
    ) -> None:
        self.parameters = parameters
        self.structure = join(view.structure() for view in views).thinned(parameters.voxel_m)
        self.surface = Surface(self.structure, icp_parameters)
        self._views = [(view, _nearest_around(view)) for view in views]

    def evidence(self, source: Structure, T_map_source: FloatArray) -> _Evidence:
        """What the map says of a placement."""
        fit = self.surface.fit(source, T_map_source, self.parameters.match_m)
        empty = self._seen_through(transform_points(T_map_source, source.points)) & ~fit.matched
        return _Evidence(T_map_source, float(fit.matched.mean()), float(empty.mean()), fit.rmse_m)

    def _seen_through(self, points_map: FloatArray) -> BoolArray:
        """(n,) which points lie clearly before a surface that some view saw."""
        parameters = self.parameters
        through = np.zeros(len(points_map), bool)
        for view, nearest_m in self._views:
            points_camera = transform_points(inverse(view.T_frame_camera), points_map)
            pixels, seen = view.camera.project(points_camera)
            column, row = (pixels[seen] / view.step_px).astype(np.int64).T
            height, width = nearest_m.shape
            surface_m = nearest_m[np.minimum(row, height - 1), np.minimum(column, width - 1)]
            depth_m = view.camera.depth_of(points_camera[seen])
            before_m = surface_m - parameters.through_m - parameters.through_per_m * depth_m
            through[seen] |= (depth_m > parameters.through_from_m) & (depth_m < before_m)
        return through


def _best_hypothesis(
    reference: _ReferenceMap, structure_odom: Structure, hypotheses: Sequence[FloatArray]
) -> Alignment | None:
    """The best of the given placements if it holds: kept as it is, or slightly corrected."""
    parameters = reference.parameters
    tried = [reference.evidence(structure_odom, T) for T in hypotheses]
    for T in hypotheses:
        refined = reference.surface.refine(structure_odom, T, parameters.fine_radii_m, level=False)
        tried.append(reference.evidence(structure_odom, refined))
    holding = [
        evidence
        for evidence in tried
        if evidence.fitness > parameters.min_fitness and evidence.supported > parameters.min_continued_support
    ]
    if not holding:
        return None
    best = max(holding, key=lambda evidence: evidence.score)
    where = transform_points(best.T_map_source, structure_odom.points)
    for T in hypotheses:
        correction_m = np.linalg.norm(transform_points(T, structure_odom.points) - where, axis=1).mean()
        if correction_m < parameters.keep_m:
            return reference.evidence(structure_odom, T).alignment("continued")
    return best.alignment("refined")


def _registered(
    reference: _ReferenceMap,
    structure_odom: Structure,
    T_level_odom: FloatArray,
    search_parameters: PlaceSearchParameters,
) -> Alignment:
    """The one place where the structure fits. Raises `AlignmentError` if none does, or more than one."""
    parameters = reference.parameters
    level = structure_odom.moved(T_level_odom)
    sample = _every_nth(level, parameters.coarse_points)
    candidates = []
    for candidate in search(reference.structure, level, search_parameters):
        T = reference.surface.refine(sample, candidate.T_map_level, parameters.coarse_radii_m, level=True)
        candidates.append(Candidate(T, reference.evidence(sample, T).score))
    candidates.sort(key=lambda candidate: -candidate.score)
    best, *others = [
        reference.evidence(
            level, reference.surface.refine(level, place.T_map_level, parameters.fine_radii_m, level=False)
        )
        for place in distinct(candidates, 2, search_parameters)
    ]
    if others and others[0].score > best.score:
        best, others = others[0], [best]
    if best.fitness < parameters.min_fitness or best.supported < parameters.min_support:
        raise _alignment_error(
            f"the traversal fits nowhere in the map ({best.supported:.0%} of it lies on mapped surfaces)"
        )
    if others and others[0].score > (1 - parameters.min_margin) * best.score:
        raise _alignment_error("the traversal fits in more than one place of the map")
    return reference.evidence(structure_odom, best.T_map_source @ T_level_odom).alignment("registered")


def _every_nth(structure: Structure, about: int) -> Structure:
    """About so many of the points, or all if there are fewer."""
    return structure.take(np.arange(0, len(structure), max(1, len(structure) // about)))


def _alignment_error(what: str) -> AlignmentError:
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


def _evenly_spaced(views: Sequence[CoarseDepth], most: int) -> Sequence[CoarseDepth]:
    """At most so many of the views, evenly spread."""
    chosen = np.unique(np.linspace(0, len(views) - 1, min(len(views), most)).round().astype(int))
    return [views[k] for k in chosen]
