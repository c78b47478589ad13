"""Drift: the odometry is followed, and put right by the surfaces that the map already knows.

Wheels, inertia and visual odometry leave the truth little by little; what they leave it by is a slowly growing turn
and shift of their frame. Every keyframe's surfaces are laid onto those seen before, by point-to-plane ICP from where
the odometry expects them, and the correction found is carried on to the next. A place seen again after a long way is
so found where it stood, not beside it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.se3 import inverse, make_transform, transform_points
from supermap_cli.geometry.voxels import is_member, pack_keys, voxel_keys
from supermap_cli.mapping.icp import Surface
from supermap_cli.mapping.structure import CoarseDepth, Structure

SURFACE_M = 0.05
"""One point is kept of every cube of this edge: the first, so that what was seen early holds what is seen late."""

SAMPLE_M = 0.1
LOOK_M, REMEMBER_M = 5.0, 4.0
"""Surfaces up to the first distance are compared, up to the second remembered: a camera's depth gets worse."""

REACHES_M = (0.3, 0.25, 0.2, 0.15, 0.12, 0.1, 0.1)
SAME_PARTNERS_M, SURE_SIGMAS = 0.01, 3.0
"""Partners are looked for within these distances, one after the other, but no farther than so many deviations of the
correction; and anew only when the points have moved so far since, for surfaces are known every `SURFACE_M`.
"""

LEAST_MATCHED, LEAST_POINTS = 0.4, 150
"""A keyframe of which less lies on known surfaces is new country: the odometry is followed."""

MUCH_SEEN = 0.05
"""The known surfaces near by are laid out anew when this share of them has come since."""

PLACED_SIGMA_M, PLACED_SIGMA_DEG = 0.1, 1.0
"""How well a further traversal is placed in the map as a whole."""

SURFACE_SIGMA_M = 0.02
CORRELATED = 25.0
"""Deviation of a point from a surface, and how many points say no more than one: they share their camera's faults."""


@dataclass(frozen=True)
class OdometryNoise:
    """How an odometry errs between two keyframes: standard deviations of what is added to the correction.

    `m_per_m` of the way gone, and `m` in any case; `deg_per_m`, `deg_per_turn` and `deg` of the heading.
    """

    m: float = 0.003
    m_per_m: float = 0.03
    deg: float = 0.05
    deg_per_m: float = 0.3
    deg_per_turn: float = 2.0


class KnownSurfaces:
    """All surfaces seen so far, in arrays with room to grow: adding to them does not copy what is there."""

    def __init__(self) -> None:
        self._points, self._normals = np.empty((4096, 3)), np.empty((4096, 3))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def structure(self) -> Structure:
        """All of them."""
        return Structure(self._points[: self._count], self._normals[: self._count])

    def add(self, seen: Structure) -> None:
        """Add surfaces after those that are there."""
        count = self._count + len(seen)
        while count > len(self._points):
            self._points = np.concatenate([self._points, np.empty_like(self._points)])
            self._normals = np.concatenate([self._normals, np.empty_like(self._normals)])
        self._points[self._count : count], self._normals[self._count : count] = seen.points, seen.normals
        self._count = count

    def within(self, center: FloatArray, radius_m: float) -> Structure:
        """Those that come within a distance of a point (3,)."""
        return self.structure.within(center, radius_m)


@dataclass(frozen=True)
class DriftMark:
    """Where a drift correction is after one keyframe: with the first `known` surfaces, all else follows.

    `near_known` of them had been known when those around `near_at` (3,) were laid out last (-1: never), and `fresh`
    have come since.
    """

    T_map_drifted: FloatArray
    covariance: FloatArray
    last: FloatArray | None
    known: int
    near_at: FloatArray
    near_known: int
    fresh: int


@dataclass
class DriftCorrection:
    """Holds the correction, `T_map_drifted`, and the surfaces by which it is found."""

    noise: OdometryNoise = field(default_factory=OdometryNoise)
    T_map_drifted: FloatArray = field(default_factory=lambda: np.eye(4))
    known: KnownSurfaces = field(default_factory=KnownSurfaces)
    _codes: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    _near: Surface | None = None
    _near_at: FloatArray = field(default_factory=lambda: np.full(3, np.inf))
    _near_known: int = -1
    _fresh: int = 0
    _covariance: FloatArray = field(default_factory=lambda: np.zeros((4, 4)))
    _last: FloatArray | None = None

    def remember(self, view: CoarseDepth) -> None:
        """Take in the surfaces of a depth image that is placed in the map."""
        self._learn(view.structure(REMEMBER_M).thinned(SURFACE_M))

    def place(self, view: CoarseDepth, T_drifted_base: FloatArray) -> FloatArray:
        """`T_map_base` of a keyframe: `view` is its depth, placed where the odometry has it, as is `T_drifted_base`."""
        covariance = self._covariance + self._step_covariance(T_drifted_base)
        self._covariance = covariance
        seen = view.structure(LOOK_M).thinned(SURFACE_M)
        sample = seen.thinned(SAMPLE_M)
        center = transform_points(self.T_map_drifted, T_drifted_base[None, :3, 3])[0]
        if len(sample) >= LEAST_POINTS and (surface := self._surface_near(center)) is not None:
            found = refine(surface, sample, self.T_map_drifted, center, covariance)
            if found is not None and found.matched >= LEAST_MATCHED:
                self.T_map_drifted, self._covariance = found.T_map_drifted, found.covariance
        self._learn(seen.within(view.T_frame_camera[:3, 3], REMEMBER_M).moved(self.T_map_drifted))
        return self.T_map_drifted @ T_drifted_base

    def mark(self) -> DriftMark:
        """Where it is now."""
        return DriftMark(
            self.T_map_drifted,
            self._covariance,
            self._last,
            len(self.known),
            self._near_at,
            self._near_known,
            self._fresh,
        )

    @classmethod
    def at_mark(cls, mark: DriftMark, points: FloatArray, normals: FloatArray) -> Self:
        """One that goes on from a mark, with the surfaces (n, 3) known then."""
        resumed = cls(T_map_drifted=mark.T_map_drifted)
        if mark.near_known >= 0:
            resumed.known.add(Structure(points[: mark.near_known], normals[: mark.near_known]))
            resumed._lay_out(mark.near_at)
        so_far = len(resumed.known)
        resumed.known.add(Structure(points[so_far:], normals[so_far:]))
        resumed._codes = np.unique(pack_keys(voxel_keys(points, SURFACE_M)))
        resumed._covariance, resumed._last, resumed._fresh = mark.covariance, mark.last, mark.fresh
        return resumed

    def _step_covariance(self, T_drifted_base: FloatArray) -> FloatArray:
        """(4, 4) how far, in x, y, z and heading, the correction may have changed since the last keyframe."""
        last, self._last = self._last, T_drifted_base
        if last is None:
            return _covariance(PLACED_SIGMA_M, PLACED_SIGMA_DEG)
        step = inverse(last) @ T_drifted_base
        way_m = float(np.linalg.norm(step[:3, 3]))
        turned = float(np.arccos(np.clip((np.trace(step[:3, :3]) - 1) / 2, -1, 1)) / (2 * np.pi))
        noise = self.noise
        deg = np.hypot(noise.deg, np.hypot(noise.deg_per_m * way_m, noise.deg_per_turn * turned))
        return _covariance(float(np.hypot(noise.m, noise.m_per_m * way_m)), float(deg))

    def _learn(self, seen: Structure) -> None:
        codes = pack_keys(voxel_keys(seen.points, SURFACE_M))
        codes, first = np.unique(codes, return_index=True)
        fresh = ~is_member(codes, self._codes)
        self._codes = np.insert(self._codes, np.searchsorted(self._codes, codes[fresh]), codes[fresh])
        self.known.add(seen.take(first[fresh]))
        self._fresh += int(fresh.sum())

    def _surface_near(self, center: FloatArray) -> Surface | None:
        """The known surfaces around a place; made anew when it has been left, or much has been seen since."""
        moved_m = float(np.linalg.norm(center - self._near_at))
        if self._near is None or moved_m > 1.0 or self._fresh > MUCH_SEEN * len(self._near.structure):
            self._lay_out(center)
        return self._near

    def _lay_out(self, center: FloatArray) -> None:
        near = self.known.within(center, LOOK_M + 2.0)
        self._near = Surface(near) if len(near) >= LEAST_POINTS else None
        self._near_at, self._near_known, self._fresh = center, len(self.known), 0


@dataclass(frozen=True)
class Refined:
    """A correction found, (4, 4), its covariance (4, 4) in x, y, z and heading, and which share of the points it was
    found from lies on the surface.
    """

    T_map_drifted: FloatArray
    covariance: FloatArray
    matched: float


def refine(
    surface: Surface, sample: Structure, T_start: FloatArray, center: FloatArray, covariance: FloatArray
) -> Refined | None:
    """The level turn and shift of a sample, about `center` (3,), that lays it best onto a surface and is likely for the
    odometry; `None` if too little of it lies there.

    Gauss-Newton on point-to-plane distances with Tukey's weights and a Gaussian prior of `covariance` (4, 4) on
    how far it leaves `T_start`: where the surfaces leave a direction open, as in a corridor, the prior holds.
    """
    prior = np.linalg.inv(covariance)
    information = prior
    total = np.zeros(4)
    asked = np.full(4, np.inf)
    for reach_m in _reaches_m(covariance):
        T = shifted(T_start, center, total)
        if _way_m(total - asked) > SAME_PARTNERS_M:
            partners, asked = surface.partners(sample.moved(T), reach_m), total
        points = transform_points(T, sample.points[partners.source])
        near, residual = partners.within(points, reach_m)
        if len(near) < LEAST_POINTS // 2:
            return None
        weight = np.square(np.maximum(1 - np.square(residual / reach_m), 0)) / (CORRELATED * SURFACE_SIGMA_M**2)
        arms, normals = points[near, :2] - center[:2] - total[:2], partners.normals[near]
        jacobian = np.column_stack([normals, arms[:, 0] * normals[:, 1] - arms[:, 1] * normals[:, 0]])
        information = (jacobian * weight[:, None]).T @ jacobian + prior
        total = total - np.linalg.solve(information, jacobian.T @ (weight * residual) + prior @ total)
    return Refined(shifted(T_start, center, total), np.linalg.inv(information), len(near) / len(sample))


def _reaches_m(covariance: FloatArray) -> tuple[float, ...]:
    """How far away partners are looked for, one after the other: no farther than the correction may be wrong by."""
    needed_m = REACHES_M[-1] + SURE_SIGMAS * _way_m(np.sqrt(np.diag(covariance)))
    return tuple(reach_m for reach_m in REACHES_M if reach_m <= needed_m)


def _way_m(change: FloatArray) -> float:
    """How far a change (4,) of x, y, z and heading moves what is seen, at most."""
    return float(np.linalg.norm(change[:3]) + LOOK_M * abs(change[3]))


def shifted(T_start: FloatArray, center: FloatArray, change: FloatArray) -> FloatArray:
    """A placement turned about the vertical through `center` by change[3] radians, and shifted by change[:3]."""
    cos, sin = np.cos(change[3]), np.sin(change[3])
    R = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
    return make_transform(R, center - R @ center + change[:3]) @ T_start


def _covariance(sigma_m: float, sigma_deg: float) -> FloatArray:
    return np.diag(np.square([sigma_m, sigma_m, sigma_m, float(np.radians(sigma_deg))]))
