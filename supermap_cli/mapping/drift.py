"""Drift: the odometry is followed, and put right by the surfaces that the map already knows.

Wheels, inertia and visual odometry leave the truth little by little; what they leave it by is a slowly growing turn
and shift of their frame. Every keyframe's surfaces are laid onto those seen before, by point-to-plane ICP from where
the odometry expects them, and the correction found is carried on to the next. A place seen again after a long way is
so found where it stood, not beside it.

Departs from the paper, which takes P_t of eq. 3 from SuperOdometry as exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray, Int32Array, IntArray
from supermap_cli.geometry.se3 import inverse, make_transform, transform_points
from supermap_cli.geometry.voxels import is_member, pack_keys, voxel_keys
from supermap_cli.mapping import drift_evidence, icp
from supermap_cli.mapping.drift_evidence import (
    DriftBelief,
    DriftEvidence,
    DriftEvidenceParameters,
    KeyframePlace,
    SurfaceFit,
)
from supermap_cli.mapping.icp import IcpParameters, Surface
from supermap_cli.mapping.structure import CoarseDepth, Structure
from supermap_cli.types.parameters import TUNED, parameter

_FIRST_CAPACITY = 4096
"""Points for which there is room at first; a full array doubles."""


@dataclass(frozen=True)
class DriftParameters:
    """What of the surfaces is compared and kept, how they are matched, and how an odometry errs.

    Between two keyframes the correction's standard deviations grow by `odometry_*`: those in metres of x, y and z, each
    in any case and by the way gone; those in degrees of the heading, in any case, by the way and by the turn.
    """

    surface_m: float = parameter(
        0.05, "m", "edge of the cubes that one point is kept of: the first, so that early holds late", TUNED
    )
    sample_m: float = parameter(0.1, "m", "edge of the cubes that one point is compared of", TUNED)
    compare_range_m: float = parameter(5.0, "m", "depth up to which surfaces are compared", TUNED)
    keep_range_m: float = parameter(
        4.0, "m", "depth up to which they are kept in the map: a camera's depth gets worse", TUNED
    )
    search_radii_m: tuple[float, ...] = parameter(
        (0.3, 0.25, 0.2, 0.15, 0.12, 0.1, 0.1), "m", "radii within which correspondences are looked for, in turn", TUNED
    )
    rematch_m: float = parameter(
        0.01, "m", "shift of the points from which correspondences are looked for anew", "a fraction of surface_m"
    )
    settled_m: float = parameter(
        0.002, "m", "shift of the points below which the radii but for the last are left out", "a fifth of rematch_m"
    )
    gate_sigmas: float = parameter(
        3.0, "1", "deviations of the correction beyond which no correspondences are looked for", "three-sigma rule"
    )
    min_matched: float = parameter(
        0.4, "1", "share of a keyframe on known surfaces below which the odometry alone is followed", TUNED
    )
    min_points: int = parameter(150, "1", "points below which nothing is matched", TUNED)
    local_margin_m: float = parameter(
        2.0, "m", "how much farther than compare_range_m the local surfaces reach", "twice rebuild_distance_m"
    )
    rebuild_distance_m: float = parameter(
        1.0, "m", "distance from their middle at which the local surfaces are gathered anew", "half of local_margin_m"
    )
    rebuild_share: float = parameter(
        0.05, "1", "share of new surfaces at which the local ones are gathered anew", "bounds the time"
    )
    placed_sigma_m: float = parameter(
        0.1, "m", "deviation of the place that alignment gives a further traversal", TUNED
    )
    placed_sigma_deg: float = parameter(1.0, "deg", "deviation of its heading", TUNED)
    surface_sigma_m: float = parameter(0.02, "m", "deviation of a point from a surface", TUNED, at_least=0.001)
    correlated_points: float = parameter(
        25.0, "1", "points that say no more than one: they share their camera's faults", TUNED, at_least=1
    )
    jump_matched: float = parameter(
        0.6,
        "1",
        "share of a keyframe on known surfaces below which, if more of the last one did, the odometry may have jumped",
        "chosen",
        at_most=1.0,
    )
    jump_found: float = parameter(
        0.75, "1", "share of a keyframe that must lie on known surfaces once a jump is put right", "chosen", at_most=1.0
    )
    jump_points: int = parameter(
        600, "1", "points below which a keyframe cannot tell: a bare wall fits in many places", "four times min_points"
    )
    jump_gain: float = parameter(
        0.3,
        "1",
        "how much more of a keyframe must lie on known surfaces after a jump is put right than without: what is new "
        "ground lies on none either way",
        "chosen",
        at_most=1.0,
    )
    jump_sigma_m: float = parameter(
        0.3, "m", "deviation of the place after a jump, as of a wheel that slips or a loop that is closed", "chosen"
    )
    jump_sigma_deg: float = parameter(5.0, "deg", "deviation of the heading after one", "chosen")
    odometry_m: float = parameter(0.003, "m", "drift of the place between two keyframes", TUNED)
    odometry_m_per_m: float = parameter(0.03, "m/m", "drift of the place by the way gone", TUNED)
    odometry_deg: float = parameter(0.05, "deg", "drift of the heading between two keyframes", TUNED)
    odometry_deg_per_m: float = parameter(0.3, "deg/m", "drift of the heading by the way gone", TUNED)
    odometry_deg_per_turn: float = parameter(2.0, "deg", "drift of the heading by a full turn", TUNED)


DEFAULT = DriftParameters()


class KnownSurfaces:
    """All surfaces seen so far, in arrays with room to grow: adding to them does not copy what is there."""

    def __init__(self) -> None:
        self._points, self._normals = np.empty((_FIRST_CAPACITY, 3)), np.empty((_FIRST_CAPACITY, 3))
        self._sources = np.empty(_FIRST_CAPACITY, np.int32)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def structure(self) -> Structure:
        """All of them."""
        return Structure(self._points[: self._count], self._normals[: self._count])

    @property
    def sources(self) -> Int32Array:
        """(n,) the keyframe that each was seen first in."""
        return self._sources[: self._count]

    def add(self, seen: Structure, source: int | Int32Array) -> None:
        """Add surfaces after those that are there, and in which keyframe they were seen."""
        count = self._count + len(seen)
        while count > len(self._points):
            self._points = np.concatenate([self._points, np.empty_like(self._points)])
            self._normals = np.concatenate([self._normals, np.empty_like(self._normals)])
            self._sources = np.concatenate([self._sources, np.empty_like(self._sources)])
        self._sources[self._count : count] = source
        self._points[self._count : count], self._normals[self._count : count] = seen.points, seen.normals
        self._count = count

    def within(self, center: FloatArray, radius_m: float) -> tuple[Structure, Int32Array]:
        """Those that come within a distance of a point (3,), and which keyframes they were seen in."""
        offsets = self._points[: self._count] - center
        chosen = np.flatnonzero(np.einsum("ij,ij->i", offsets, offsets) < radius_m**2)
        return self.structure.take(chosen), self._sources[chosen]


@dataclass(frozen=True)
class DriftMark:
    """Where a drift correction is after one keyframe: with the first `known` surfaces, all else follows.

    `near_known` of them had been known when those around `near_at` (3,) were laid out last (-1: never), and `fresh`
    have come since. `matched` is the share of its last keyframe that lay on known surfaces. Of the `remembered` first
    keyframes is known how well they were placed.
    """

    T_map_drifted: FloatArray
    belief: DriftBelief
    last: FloatArray | None
    last_camera: FloatArray | None
    known: int
    remembered: int
    near_at: FloatArray
    near_known: int
    fresh: int
    matched: float


@dataclass
class DriftCorrection:
    """Holds the correction, `T_map_drifted`, the surfaces by which it is found, and the evidence for it."""

    parameters: DriftParameters = DEFAULT
    icp_parameters: IcpParameters = icp.DEFAULT
    evidence_parameters: DriftEvidenceParameters = drift_evidence.DEFAULT
    T_map_drifted: FloatArray = field(default_factory=lambda: np.eye(4))
    known: KnownSurfaces = field(default_factory=KnownSurfaces)
    evidence: DriftEvidence = field(init=False)
    _codes: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    _local: Surface | None = None
    _local_sources: Int32Array = field(default_factory=lambda: np.zeros(0, np.int32))
    _near_at: FloatArray = field(default_factory=lambda: np.full(3, np.inf))
    _near_known: int = -1
    _fresh: int = 0
    _last: FloatArray | None = None
    _last_camera: FloatArray | None = None
    _matched: float = 0.0

    def __post_init__(self) -> None:
        self.evidence = DriftEvidence(self.evidence_parameters)

    def add_view(self, view: CoarseDepth) -> None:
        """Take in the surfaces of a depth image that is placed in the map."""
        seen = view.structure(self.parameters.keep_range_m).thinned(self.parameters.surface_m)
        self._add_surfaces(seen, self.evidence.remember_exact(view.T_frame_camera[:3, 3]))

    def register(self, view: CoarseDepth, T_drifted_base: FloatArray) -> FloatArray:
        """`T_map_base` of a keyframe: `view` is its depth, placed where the odometry has it, as is `T_drifted_base`."""
        parameters, evidence = self.parameters, self.evidence
        usual = self._go_on(T_drifted_base)
        place = self._place(view, T_drifted_base)
        share = self._independent_share(view.T_frame_camera)
        seen = view.structure(parameters.compare_range_m).thinned(parameters.surface_m)
        sample = seen.thinned(parameters.sample_m)
        if len(sample) >= parameters.min_points and (surface := self._local_surface(place.base_map)) is not None:
            covariance = evidence.covariance(place) + usual
            found = refine(surface, sample, self.T_map_drifted, place.base_map, covariance, parameters=parameters)
            matched = 0.0 if found is None else found.matched
            if matched < min(parameters.jump_matched, self._matched - parameters.jump_gain):
                jumped = self._after_jump(surface, sample, place, covariance, matched)
                if jumped is not None:
                    evidence.placed(_covariance(parameters.jump_sigma_m, parameters.jump_sigma_deg), place.base_map)
                    found, share = jumped, 0.0
            if found is not None and found.matched >= parameters.min_matched:
                evidence.weigh(self._registered(found), place, share)
                self.T_map_drifted = evidence.mean(place.base_drifted)
            self._matched = 0.0 if found is None else found.matched
        near = seen.within(view.T_frame_camera[:3, 3], parameters.keep_range_m)
        source = evidence.remember(self.T_map_drifted, place.camera_map)
        self._add_surfaces(near.moved(self.T_map_drifted), source)
        return self.T_map_drifted @ T_drifted_base

    def _go_on(self, T_drifted_base: FloatArray) -> FloatArray:
        """Follow the odometry to its next pose; returns what it usually errs by meanwhile, (4, 4)."""
        parameters = self.parameters
        last, self._last = self._last, T_drifted_base
        base_map = transform_points(self.T_map_drifted, T_drifted_base[None, :3, 3])[0]
        if last is None:
            placed = _covariance(parameters.placed_sigma_m, parameters.placed_sigma_deg)
            if len(self.known):
                self.evidence.placed(placed, base_map)
            return placed
        if np.array_equal(last, T_drifted_base):
            return _covariance(parameters.odometry_m, parameters.odometry_deg)
        way_m, turned_deg = _way(last, T_drifted_base)
        by_turn_deg = parameters.odometry_deg_per_turn * turned_deg / 360
        deg = np.linalg.norm([parameters.odometry_deg, parameters.odometry_deg_per_m * way_m, by_turn_deg])
        usual = _covariance(float(np.hypot(parameters.odometry_m, parameters.odometry_m_per_m * way_m)), float(deg))
        self.evidence.moved(usual, base_map)
        self.T_map_drifted = self.evidence.mean(T_drifted_base[:3, 3])
        return usual

    def _place(self, view: CoarseDepth, T_drifted_base: FloatArray) -> KeyframePlace:
        both = np.stack([T_drifted_base[:3, 3], view.T_frame_camera[:3, 3]])
        return KeyframePlace(both[0], *transform_points(self.T_map_drifted, both))

    def _independent_share(self, T_drifted_camera: FloatArray) -> float:
        last, self._last_camera = self._last_camera, T_drifted_camera
        return 1.0 if last is None else self.evidence_parameters.independent_share(*_way(last, T_drifted_camera))

    def _registered(self, found: Refined) -> SurfaceFit:
        """What was found, with the keyframes whose surfaces the points lie on."""
        shares = np.bincount(self._local_sources[found.nearest], found.weight)
        sources = np.flatnonzero(shares)
        return SurfaceFit(
            found.T_map_drifted, found.slope, found.information, sources, shares[sources] / found.weight.sum()
        )

    def _after_jump(
        self, surface: Surface, sample: Structure, place: KeyframePlace, covariance: FloatArray, without: float
    ) -> Refined | None:
        """The correction if the odometry has jumped, where the surfaces say so clearly: `without`, that share fits."""
        parameters = self.parameters
        if len(sample) < parameters.jump_points:
            return None
        wide = covariance + _covariance(parameters.jump_sigma_m, parameters.jump_sigma_deg)
        jumped = refine(surface, sample, self.T_map_drifted, place.base_map, wide, parameters=parameters)
        if jumped is None or jumped.matched < max(parameters.jump_found, without + parameters.jump_gain):
            return None
        return jumped

    def mark(self) -> DriftMark:
        """Where it is now."""
        return DriftMark(
            self.T_map_drifted,
            self.evidence.belief,
            self._last,
            self._last_camera,
            len(self.known),
            len(self.evidence.past),
            self._near_at,
            self._near_known,
            self._fresh,
            self._matched,
        )

    def resume(self, mark: DriftMark, known: KnownSurfaces, past: tuple[Float32Array, FloatArray, FloatArray]) -> None:
        """Go on from a mark, with the surfaces known then and what had been believed of earlier keyframes."""
        self.T_map_drifted, self.evidence.belief = mark.T_map_drifted, mark.belief
        self.evidence.past.restore(*past)
        points, normals = known.structure.points, known.structure.normals
        if mark.near_known >= 0:
            before = slice(mark.near_known)
            self.known.add(Structure(points[before], normals[before]), known.sources[before])
            self._gather_local(mark.near_at)
        after = slice(len(self.known), None)
        self.known.add(Structure(points[after], normals[after]), known.sources[after])
        self._codes = np.unique(pack_keys(voxel_keys(points, self.parameters.surface_m)))
        self._last, self._last_camera, self._fresh = mark.last, mark.last_camera, mark.fresh
        self._matched = mark.matched

    def _add_surfaces(self, seen: Structure, source: int) -> None:
        codes = pack_keys(voxel_keys(seen.points, self.parameters.surface_m))
        codes, first = np.unique(codes, return_index=True)
        fresh = ~is_member(codes, self._codes)
        self._codes = np.insert(self._codes, np.searchsorted(self._codes, codes[fresh]), codes[fresh])
        self.known.add(seen.take(first[fresh]), source)
        self._fresh += int(fresh.sum())

    def _local_surface(self, center: FloatArray) -> Surface | None:
        """The known surfaces around a place; made anew when it has been left, or much has been seen since."""
        parameters = self.parameters
        moved_m = float(np.linalg.norm(center - self._near_at))
        if (
            self._local is None
            or moved_m > parameters.rebuild_distance_m
            or self._fresh > parameters.rebuild_share * len(self._local.structure)
        ):
            self._gather_local(center)
        return self._local

    def _gather_local(self, center: FloatArray) -> None:
        reach_m = self.parameters.compare_range_m + self.parameters.local_margin_m
        near, self._local_sources = self.known.within(center, reach_m)
        self._local = Surface(near, self.icp_parameters) if len(near) >= self.parameters.min_points else None
        self._near_at, self._near_known, self._fresh = center, len(self.known), 0


@dataclass(frozen=True)
class Refined:
    """A correction found, (4, 4), and what speaks for it but for the prior: slope (4,) and curvature (4, 4) of the
    misfit in x, y, z and heading. Of the points the share `matched` lies on the surface, at its points `nearest` (k,),
    with `weight` (k,).
    """

    T_map_drifted: FloatArray
    slope: FloatArray
    information: FloatArray
    matched: float
    nearest: IntArray
    weight: FloatArray


def refine(
    surface: Surface,
    sample: Structure,
    T_start: FloatArray,
    center: FloatArray,
    covariance: FloatArray,
    *,
    parameters: DriftParameters = DEFAULT,
) -> Refined | None:
    """The level turn and shift of a sample, about `center` (3,), that lays it best onto a surface and is likely for the
    odometry; `None` if too little of it lies there.

    Gauss-Newton on point-to-plane distances with Tukey's weights and a Gaussian prior of `covariance` (4, 4) on
    how far it leaves `T_start`: where the surfaces leave a direction open, as in a corridor, the prior holds.
    """
    prior = np.linalg.inv(covariance)
    total = np.zeros(4)
    matched_at = np.full(4, np.inf)
    variance = parameters.correlated_points * parameters.surface_sigma_m**2
    radii_m, settled = _search_radii_m(covariance, parameters), False
    for reach_m in radii_m:
        if settled and reach_m > radii_m[-1]:
            continue
        T = shifted(T_start, center, total)
        if _displacement_m(total - matched_at, parameters.compare_range_m) > parameters.rematch_m:
            found, matched_at = surface.correspondences(sample.moved(T), reach_m), total
        points = transform_points(T, sample.points[found.source])
        near, residual = found.within(points, reach_m)
        if len(near) < parameters.min_points // 2:
            return None
        weight = np.square(np.maximum(1 - np.square(residual / reach_m), 0)) / variance
        arms, normals = points[near, :2] - center[:2] - total[:2], found.normals[near]
        jacobian = np.column_stack([normals, arms[:, 0] * normals[:, 1] - arms[:, 1] * normals[:, 0]])
        data, slope = (jacobian * weight[:, None]).T @ jacobian, jacobian.T @ (weight * residual)
        change = -np.linalg.solve(data + prior, slope + prior @ total)
        total = total + change
        settled = _displacement_m(change, parameters.compare_range_m) < parameters.settled_m
    slope = slope + data @ change
    return Refined(shifted(T_start, center, total), slope, data, len(near) / len(sample), found.nearest[near], weight)


def _search_radii_m(covariance: FloatArray, parameters: DriftParameters) -> tuple[float, ...]:
    """How far away correspondences are looked for, in turn: no farther than the correction may be wrong by."""
    radii_m = parameters.search_radii_m
    wrong_m = _displacement_m(np.sqrt(np.diag(covariance)), parameters.compare_range_m)
    needed_m = radii_m[-1] + parameters.gate_sigmas * wrong_m
    return tuple(radius_m for radius_m in radii_m if radius_m <= needed_m)


def _displacement_m(change: FloatArray, range_m: float) -> float:
    """How far a change (4,) of x, y, z and heading moves what is seen within a range, at most."""
    return float(np.linalg.norm(change[:3]) + range_m * abs(change[3]))


def shifted(T_start: FloatArray, center: FloatArray, change: FloatArray) -> FloatArray:
    """A placement turned about the vertical through `center` by change[3] radians, and shifted by change[:3]."""
    cos, sin = np.cos(change[3]), np.sin(change[3])
    R = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
    return make_transform(R, center - R @ center + change[:3]) @ T_start


def _covariance(sigma_m: float, sigma_deg: float) -> FloatArray:
    return np.diag(np.square([sigma_m, sigma_m, sigma_m, float(np.radians(sigma_deg))]))


def _way(T_from: FloatArray, T_to: FloatArray) -> tuple[float, float]:
    """How far, in metres and degrees, it is from one pose to another."""
    step = inverse(T_from) @ T_to
    cos = (step[0, 0] + step[1, 1] + step[2, 2] - 1) / 2
    return math.hypot(*step[:3, 3]), math.degrees(math.acos(min(max(cos, -1.0), 1.0)))
