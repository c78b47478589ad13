"""Point-to-plane ICP (Chen and Medioni 1992) between surfaces whose normals must agree.

No step of the paper: what drift correction and alignment need of its geometric layer (sec. IV-A).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.se3 import make_transform, rotation_from_quaternion_xyzw
from supermap_cli.mapping.structure import Structure
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class IcpParameters:
    """Which points correspond, and when there are too few of them."""

    max_normal_angle_deg: float = parameter(
        40.0, "deg", "angle between the normals of corresponding points, at most", TUNED, at_most=180
    )
    min_matched: int = parameter(30, "1", "correspondences below which a placement is left as it is", TUNED)
    damping: float = parameter(
        1e-3, "1", "Levenberg's damping of a step, as a share of the number of correspondences", "keeps steps finite"
    )


DEFAULT = IcpParameters()


@dataclass(frozen=True)
class Fit:
    """How a source lies on a surface: `matched` (n,) points correspond to one there, `rmse_m` off its plane."""

    T_target_source: FloatArray
    matched: BoolArray
    rmse_m: float


@dataclass(frozen=True)
class Correspondences:
    """Which m of a source's points correspond to one on a surface, (m,) positions, which ones these are, (m,), and
    their points and normals (m, 3). They stay the same while the source moves by much less than the surface's points
    are apart.
    """

    source: IntArray
    nearest: IntArray
    points: FloatArray
    normals: FloatArray

    def within(self, points: FloatArray, reach_m: float) -> tuple[IntArray, FloatArray]:
        """Which k of the source's points (m, 3) are within reach of theirs on the surface, and how far they lie off its
        plane, (k,) each.
        """
        apart = points - self.points
        near = np.flatnonzero(np.einsum("ij,ij->i", apart, apart) < reach_m**2)
        return near, np.einsum("ij,ij->i", apart[near], self.normals[near])


class Surface:
    """A structure that nearest neighbours can be asked of."""

    def __init__(self, structure: Structure, parameters: IcpParameters = DEFAULT) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415 - heavy

        self.structure = structure
        self.parameters = parameters
        self._tree = cKDTree(structure.points, leafsize=64, balanced_tree=False, compact_nodes=False)

    def fit(self, source: Structure, T_target_source: FloatArray, reach_m: float) -> Fit:
        """Match a source with the surface where it lies; what corresponds is within reach and faces the same way."""
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
            if matched.sum() < self.parameters.min_matched:
                return T
            T = _step(points, normals, residual, reach_m, level=level, damping=self.parameters.damping) @ T
        return T

    def correspondences(self, moved: Structure, reach_m: float) -> Correspondences:
        """The nearest point within reach of each of a source's, where it faces the same way."""
        _, nearest = self._tree.query(moved.points, distance_upper_bound=reach_m)
        found = np.flatnonzero(nearest < len(self.structure))
        points, normals = self.structure.points[nearest[found]], self.structure.normals[nearest[found]]
        least_cos = np.cos(np.radians(self.parameters.max_normal_angle_deg))
        facing = np.einsum("ij,ij->i", moved.normals[found], normals) > least_cos
        return Correspondences(found[facing], nearest[found[facing]], points[facing], normals[facing])

    def _match(self, moved: Structure, reach_m: float) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray]:
        """Which points (n,) correspond to one; of those m distances to its plane (m,), normals, points (m, 3)."""
        found = self.correspondences(moved, reach_m)
        points = moved.points[found.source]
        matched = np.zeros(len(moved), dtype=bool)
        matched[found.source] = True
        return matched, np.einsum("ij,ij->i", points - found.points, found.normals), found.normals, points


def _step(
    points: FloatArray, normals: FloatArray, residual: FloatArray, reach_m: float, *, level: bool, damping: float
) -> FloatArray:
    """One Gauss-Newton step on the point-to-plane error with Tukey's weights, about the points' middle."""
    weight = np.square(np.maximum(1 - np.square(residual / reach_m), 0))
    middle = points.mean(axis=0)
    jacobian = np.concatenate([normals, np.cross(points - middle, normals)], axis=1)
    if level:
        jacobian[:, 3:5] = 0
    normal_matrix = (jacobian * weight[:, None]).T @ jacobian
    damped = normal_matrix + damping * len(points) * np.eye(6)
    change = -np.linalg.solve(damped, jacobian.T @ (weight * residual))
    R = rotation_from_quaternion_xyzw([*(change[3:] / 2), 1.0])
    return make_transform(R, middle - R @ middle + change[:3])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("inf")
