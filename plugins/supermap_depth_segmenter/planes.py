"""Supporting and background surfaces of an object: planes that extend beyond its box."""

from __future__ import annotations

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_depth_segmenter.patch import Patch, depth_noise_m

_MAX_PLANES = 3
"""Planes that are looked for in a patch: a table, a wall, the floor."""
_MIN_PLANE_SHARE = 0.12
"""Share of the samples around the box that a plane must hold to count as a surface. Chosen."""
_MAX_RANSAC_POINTS = 250
"""Points that a plane is fitted to; more cost time and change little."""
_RANSAC_TRIALS = 48
"""Random triples: with 40 % inliers, one is all inliers with a probability of 95 % (1 - (1 - 0.4**3)**48)."""
_MAX_IN_BOX_SHARE = 0.9
"""Share of a plane's part within the box from which on the part ends with the box. Chosen."""
_MAX_CENTRE_SHARE = 0.6
"""Share of the box's central weight above which a plane is the object itself: a table top, a book, a screen. Chosen."""
_TOLERANCE_M, _NOISE_FACTOR = 0.006, 3.0
"""Distance of a plane's points from it: metres, and standard deviations of the depth. Chosen."""


def background_mask(patch: Patch) -> BoolArray:
    """(h, w) the samples on surfaces that extend beyond the box and do not make up its centre.

    Where the plane of a table cuts through a chair behind it, the cut is no part of the table: only those parts of a
    plane count that extend beyond the box.
    """
    tolerance = _TOLERANCE_M + _NOISE_FACTOR * depth_noise_m(patch.depth_m)
    centre_weight = patch.centrality * patch.valid
    removed = np.zeros(patch.depth_m.shape, dtype=bool)
    around_box = ~patch.in_box & patch.valid
    min_samples = _MIN_PLANE_SHARE * around_box.sum()
    for _ in range(_MAX_PLANES):
        remaining = around_box & ~removed
        if remaining.sum() <= min_samples:
            break
        plane = _fit_plane(patch.points[remaining], tolerance[remaining])
        if plane is None:
            break
        on_plane = patch.valid & (np.abs(patch.points @ plane[:3] + plane[3]) < tolerance)
        if (on_plane & remaining).sum() < min_samples:
            break
        surface = _extending_beyond_box(on_plane, patch.in_box)
        if centre_weight[surface].sum() < _MAX_CENTRE_SHARE * centre_weight.sum():
            removed |= surface
        around_box &= ~on_plane
    return removed


def _extending_beyond_box(on_plane: BoolArray, in_box: BoolArray) -> BoolArray:
    """The connected parts of a plane that extend beyond the box."""
    k, labels = cv2.connectedComponents(on_plane.astype(np.uint8), connectivity=8)
    in_box_share = np.bincount(labels.ravel(), in_box.ravel(), minlength=k) / np.maximum(
        np.bincount(labels.ravel(), minlength=k), 1
    )
    outside = in_box_share < _MAX_IN_BOX_SHARE
    outside[0] = False
    parts: BoolArray = outside[labels]
    return parts


def _fit_plane(points: FloatArray, tolerance: FloatArray) -> FloatArray | None:
    """The plane (a, b, c, d), a x + b y + c z + d = 0, that holds most points (RANSAC, then least squares)."""
    chosen = np.linspace(0, len(points) - 1, min(len(points), _MAX_RANSAC_POINTS)).astype(np.int64)
    points, tolerance = points[chosen], tolerance[chosen]
    corners = points[np.random.default_rng(0).integers(0, len(points), (_RANSAC_TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    valid = lengths > 1e-6
    if not valid.any():
        return None
    normals = normals[valid] / lengths[valid, None]
    offsets = -(normals * corners[valid, 0]).sum(axis=1)
    inside = np.abs(points @ normals.T + offsets) < tolerance[:, None]
    inliers = points[inside[:, int(np.count_nonzero(inside, axis=0).argmax())]]
    centre = inliers.mean(axis=0)
    _, _, axes = np.linalg.svd(inliers - centre, full_matrices=False)
    return np.append(axes[2], -axes[2] @ centre)
