"""A thing pushed aside: part of its old place is empty, part is taken by itself. What tells is that its known shape,
laid where the detection is, agrees with the depth image, and where it stood does not.
"""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.visibility import ObjectView, check_visibility

LEAST_SHIFT_M = 0.1
"""Less is drift, or the error of one pose."""

VACATED_SHARE = 0.15
"""Share of the seen part of its old place that must be empty before a shift is looked for."""

EXPLAINED_SHARE = 0.6
"""A shift must explain more than this share of the emptiness."""

_POINTS = 300
_ROUNDS = 12
_TRIM = 0.8


def find_shift(depth: DepthView, seen: MapObject, view: ObjectView, detection: LiftedDetection) -> FloatArray | None:
    """The level shift (3,) in metres by which an object has been pushed aside; `None` if it stands where it stood.

    `view` is what the image says of its voxels where they are believed to be.
    """
    before = view.contradicted_share
    if before < VACATED_SHARE:
        return None
    shift = fit_shift(seen.shape.points, detection.points_map)
    if np.linalg.norm(shift) < LEAST_SHIFT_M:
        return None
    after = check_visibility(depth, seen.voxels.centers() + shift, seen.voxels.voxel_m)
    explained = after.contradicted_share < (1 - EXPLAINED_SHARE) * before
    return shift if explained and after.supported.sum() > view.supported.sum() else None


def fit_shift(cloud: FloatArray, points: FloatArray) -> FloatArray:
    """The level shift (3,) that brings a cloud (n, 3) onto points (m, 3) of a part of it: trimmed point-to-point ICP
    (Chetverikov et al. 2002) of a translation, begun where the middles agree and where the cloud is.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415 - heavy

    sample = points[:: max(1, len(points) // _POINTS)]
    tree = cKDTree(cloud)
    best, least = np.zeros(3), np.inf
    for start in (np.zeros(3), sample.mean(axis=0) - cloud.mean(axis=0)):
        shift = start * [1, 1, 0]
        for _ in range(_ROUNDS):
            distance, nearest = tree.query(sample - shift)
            kept = distance <= np.quantile(distance, _TRIM)
            shift = shift + (sample[kept] - shift - cloud[nearest[kept]]).mean(axis=0) * [1, 1, 0]
        distance, _ = tree.query(sample - shift)
        error = float(np.sort(distance)[: int(_TRIM * len(distance)) + 1].mean())
        if error < least:
            best, least = shift, error
    return best
