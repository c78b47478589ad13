"""Point-to-plane ICP (Chen and Medioni 1992) between surfaces whose normals must agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.se3 import make_transform, rotation_from_quaternion_xyzw
from supermap_cli.mapping.structure import Structure

_NORMALS_AGREE = np.cos(np.radians(40))


@dataclass(frozen=True)
class Fit:
    """How a source lies on a surface: `matched` (n,) points have a partner, `rmse_m` off whose plane they lie."""

    T_target_source: FloatArray
    matched: BoolArray
    rmse_m: float


@dataclass(frozen=True)
class Partners:
    """Which m of a source's points have a partner on a surface, (m,) positions, and the partners' points and normals
    (m, 3). They stay the same while the source moves by much less than the surface's points are apart.
    """

    source: IntArray
    points: FloatArray
    normals: FloatArray

    def within(self, points: FloatArray, reach_m: float) -> tuple[IntArray, FloatArray]:
        """Which k of the source's points (m, 3) are within reach of their partners, and how far they lie off their
        planes, (k,) each.
        """
        apart = points - self.points
        near = np.flatnonzero(np.einsum("ij,ij->i", apart, apart) < reach_m**2)
        return near, np.einsum("ij,ij->i", apart[near], self.normals[near])


class Surface:
    """A structure that nearest neighbours can be asked of."""

    def __init__(self, structure: Structure) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415 - heavy

        self.structure = structure
        self._tree = cKDTree(structure.points, leafsize=64, balanced_tree=False, compact_nodes=False)

    def fit(self, source: Structure, T_target_source: FloatArray, reach_m: float) -> Fit:
        """Match a source with the surface where it lies; a partner is within reach and faces the same way."""
        matched, residual, _, _ = self._match(source.moved(T_target_source), reach_m)
        return Fit(T_target_source, matched, _rms(residual))

    def refine(
        self, source: Structure, T_target_source: FloatArray, reaches_m: tuple[float, ...], *, level: bool
    ) -> FloatArray:
        """Improve a placement (4, 4), one step for each reach; `level` keeps it to a turn about z and a shift."""
        T = T_target_source
        for reach_m in reaches_m:
            moved = source.moved(T)
            matched, residual, normals, points = self._match(moved, reach_m)
            if matched.sum() < 30:
                return T
            T = _step(points, normals, residual, reach_m, level=level) @ T
        return T

    def partners(self, moved: Structure, reach_m: float) -> Partners:
        """The nearest point within reach of each of a source's, where it faces the same way."""
        _, nearest = self._tree.query(moved.points, distance_upper_bound=reach_m)
        found = np.flatnonzero(nearest < len(self.structure))
        points, normals = self.structure.points[nearest[found]], self.structure.normals[nearest[found]]
        facing = np.einsum("ij,ij->i", moved.normals[found], normals) > _NORMALS_AGREE
        return Partners(found[facing], points[facing], normals[facing])

    def _match(self, moved: Structure, reach_m: float) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray]:
        """Which points have a partner (n,); of those m distances to its plane (m,), its normals, the points (m, 3)."""
        partners = self.partners(moved, reach_m)
        points = moved.points[partners.source]
        matched = np.zeros(len(moved), dtype=bool)
        matched[partners.source] = True
        return matched, np.einsum("ij,ij->i", points - partners.points, partners.normals), partners.normals, points


def _step(points: FloatArray, normals: FloatArray, residual: FloatArray, reach_m: float, *, level: bool) -> FloatArray:
    """One Gauss-Newton step on the point-to-plane error with Tukey's weights, about the points' middle."""
    weight = np.square(np.maximum(1 - np.square(residual / reach_m), 0))
    middle = points.mean(axis=0)
    jacobian = np.concatenate([normals, np.cross(points - middle, normals)], axis=1)
    if level:
        jacobian[:, 3:5] = 0
    normal_matrix = (jacobian * weight[:, None]).T @ jacobian
    damping = 1e-3 * len(points) * np.eye(6)
    change = -np.linalg.solve(normal_matrix + damping, jacobian.T @ (weight * residual))
    R = rotation_from_quaternion_xyzw([*(change[3:] / 2), 1.0])
    return make_transform(R, middle - R @ middle + change[:3])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("inf")
