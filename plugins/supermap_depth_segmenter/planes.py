"""The surfaces an object stands on or before: planes that go on outside its box."""

from __future__ import annotations

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_depth_segmenter.patch import Patch, depth_noise_m

_MOST_PLANES = 3
_LEAST_SHARE = 0.12
"""Of the samples around the box, how many a plane must hold to count as a surface."""
_MOST_SAMPLES = 250
_TRIALS = 48
_OWN = 0.9
_CENTRE_SHARE = 0.6
"""A plane that holds more of the box's middle than this is the object itself: a table top, a book, a screen."""


def background(patch: Patch) -> BoolArray:
    """(h, w) the samples that lie on a surface which goes on around the box and does not make up the box's middle.

    Where the plane of a table cuts through a chair behind it, the cut is no part of the table: only those parts of a
    plane count that do not end with the box.
    """
    tolerance = 0.006 + 3 * depth_noise_m(patch.depth_m)
    middle = patch.centrality * patch.valid
    taken = np.zeros(patch.depth_m.shape, dtype=bool)
    ring = ~patch.in_box & patch.valid
    least = _LEAST_SHARE * ring.sum()
    for _ in range(_MOST_PLANES):
        rest = ring & ~taken
        if rest.sum() <= least:
            break
        plane = _fit_plane(patch.points[rest], tolerance[rest])
        if plane is None:
            break
        on_plane = patch.valid & (np.abs(patch.points @ plane[:3] + plane[3]) < tolerance)
        if (on_plane & rest).sum() < least:
            break
        surface = _going_on_outside(on_plane, patch.in_box)
        if middle[surface].sum() < _CENTRE_SHARE * middle.sum():
            taken |= surface
        ring &= ~on_plane
    return taken


def _going_on_outside(on_plane: BoolArray, in_box: BoolArray) -> BoolArray:
    """The connected parts of a plane that do not end with the box."""
    k, labels = cv2.connectedComponents(on_plane.astype(np.uint8), connectivity=8)
    own = np.bincount(labels.ravel(), in_box.ravel(), minlength=k) / np.maximum(
        np.bincount(labels.ravel(), minlength=k), 1
    )
    outside = own < _OWN
    outside[0] = False
    parts: BoolArray = outside[labels]
    return parts


def _fit_plane(points: FloatArray, tolerance: FloatArray) -> FloatArray | None:
    """The plane (a, b, c, d), a x + b y + c z + d = 0, that holds most points (RANSAC, then least squares)."""
    chosen = np.linspace(0, len(points) - 1, min(len(points), _MOST_SAMPLES)).astype(np.int64)
    points, tolerance = points[chosen], tolerance[chosen]
    corners = points[np.random.default_rng(0).integers(0, len(points), (_TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    sound = lengths > 1e-6
    if not sound.any():
        return None
    normals = normals[sound] / lengths[sound, None]
    offsets = -(normals * corners[sound, 0]).sum(axis=1)
    inside = np.abs(points @ normals.T + offsets) < tolerance[:, None]
    inliers = points[inside[:, int(np.count_nonzero(inside, axis=0).argmax())]]
    centre = inliers.mean(axis=0)
    _, _, axes = np.linalg.svd(inliers - centre, full_matrices=False)
    return np.append(axes[2], -axes[2] @ centre)
