"""Aligns a map with the truth: the map frame in the world, by the robot's true trajectory.

Both frames are level, so that the transform has four degrees of freedom: yaw and translation, fitted in closed form by
least squares (Umeyama 1991, without scale, in the plane). Besides the base's position, a point one metre ahead of it
and one to its left are fitted: they fix the yaw where the robot hardly moved.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.errors import EvaluationError
from supermap_cli.evaluation.pairing import pair_traversals
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import make_transform, transform_points
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.types.sensing import StampedPose
from supermap_cli.types.truth import GroundTruth, TrueTraversal

MAX_GAP_S = 1.0
"""Seconds; true poses farther apart are not interpolated. Chosen."""

LEVER_POINTS_M = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
"""(3, 3) metres in the base frame: the fitted points, its origin, one ahead, one to the left."""


@dataclass(frozen=True)
class TruthAlignment:
    """`T_world_map` (4, 4), and by traversal the root mean square distance of its keyframes from the true positions."""

    T_world_map: FloatArray
    rmse_m: dict[str, float]


def align_to_truth(reader: MapReader, truth: GroundTruth) -> TruthAlignment:
    """Fit the keyframes of all traversals to the true poses at their stamps; those outside the truth's time are left
    out.

    Raises `EvaluationError` where the truth is not that of the map's recordings (`pair_traversals`), and where no
    keyframe lies in its time.
    """
    pairs = pair_traversals(reader, truth)
    matched_poses = {
        traversal.name: matched
        for traversal in reader.traversals
        if (matched := _matched_poses(reader, traversal, pairs[traversal.id]))
    }
    if not matched_poses:
        raise EvaluationError(
            "no keyframe of the map lies in the time of this truth",
            where=reader.where,
            cure="build the map of all of the recording, or give the truth of the part that is mapped",
        )
    T_world_base, T_map_base = (np.concatenate(poses) for poses in zip(*matched_poses.values(), strict=True))
    T_world_map = fit_level_transform(_lever_points(T_map_base), _lever_points(T_world_base))
    return TruthAlignment(
        T_world_map, {name: _rmse_m(T_world_map, *matched) for name, matched in matched_poses.items()}
    )


def fit_level_transform(source: FloatArray, target: FloatArray) -> FloatArray:
    """`T_target_source` (4, 4), yaw and translation, that brings points (n, 3) nearest to points (n, 3)."""
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    (x, y), (u, v) = (source - source_mean)[:, :2].T, (target - target_mean)[:, :2].T
    yaw = np.arctan2((x * v - y * u).sum(), (x * u + y * v).sum())
    R = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    return make_transform(R, target_mean - R @ source_mean)


def _matched_poses(
    reader: MapReader, traversal: StoredTraversal, true: Sequence[TrueTraversal]
) -> tuple[FloatArray, FloatArray] | None:
    """True (n, 4, 4) and mapped (n, 4, 4) poses of those keyframes of a traversal at which the truth has poses."""
    stamps_ns, T_map_base = reader.poses(traversal.id)
    found = [
        (T_world_base[known], T_map_base[known])
        for true_traversal in true
        for T_world_base, known in [_true_trajectory(true_traversal).at_many(stamps_ns - traversal.clock_shift_ns)]
        if known.any()
    ]
    if not found:
        return None
    world, mapped = zip(*found, strict=True)
    return np.concatenate(world), np.concatenate(mapped)


def _true_trajectory(traversal: TrueTraversal) -> Trajectory:
    def poses() -> Iterator[StampedPose]:
        stamps_ns, first = np.unique(traversal.stamps_ns, return_index=True)
        for stamp_ns, T_world_base in zip(stamps_ns.tolist(), traversal.T_world_base[first], strict=True):
            yield StampedPose(stamp_ns, T_world_base)

    return Trajectory(poses(), max_gap_s=MAX_GAP_S, hold_s=0.0)


def _lever_points(T: FloatArray) -> FloatArray:
    """`LEVER_POINTS_M` at poses (n, 4, 4): (3 n, 3)."""
    points: FloatArray = np.einsum("nij,kj->nki", T[:, :3, :3], LEVER_POINTS_M) + T[:, None, :3, 3]
    return points.reshape(-1, 3)


def _rmse_m(T_world_map: FloatArray, T_world_base: FloatArray, T_map_base: FloatArray) -> float:
    errors_m = transform_points(T_world_map, T_map_base[:, :3, 3]) - T_world_base[:, :3, 3]
    return float(np.sqrt((errors_m**2).sum(axis=1).mean()))
