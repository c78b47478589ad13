"""The depth-connected bodies that a mask shows, and which of them are the object."""

from __future__ import annotations

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.geometry.voxels import connected_components, neighbouring, pack_keys, voxel_keys
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.mask_core import edge_step_m

NEAR_END, REACH_M = 5, 0.2
"""A body begins where this percentile of its points lies; so far from it the next one may begin."""

LEAST_SHARE, LEAST_HIDDEN_SHARE, LEAST_POINTS = 0.15, 0.1, 12
"""Further bodies count from this share of the largest one; those behind something nearer from the second, and no fewer
points than the third.
"""

NEAREST_OF, HIDDEN_SHARE = 64, 0.6
"""The nearest pixels of two bodies are looked for among so many of each; what parts them must hide so much between."""


def voxel_bodies(points: FloatArray, cell_m: float) -> IntArray:
    """(n,) the body of each point: points are joined over 26-connected voxels, as wide as what one pixel's noise and
    thinning leave between neighbours.
    """
    unique, inverse = np.unique(pack_keys(voxel_keys(points, cell_m)), return_inverse=True)
    bodies: IntArray = connected_components(unique)[inverse]
    return bodies


def image_bodies(pixels: BoolArray) -> IntArray:
    """(h, w) the body of each marked pixel: pixels are joined with their eight neighbours, for where they meet is no
    depth edge. What is seen at a grazing angle hangs together in the image and not in space.
    """
    _, bodies = cv2.connectedComponents(pixels.astype(np.uint8), connectivity=8)
    return np.asarray(bodies, np.int64)


def joined_bodies(points: FloatArray, cell_m: float, in_image: IntArray) -> IntArray:
    """(n,) the body of each point: points are of one body if they are so in the image, (n,) bodies, or in space (see
    `voxel_bodies`), or both step by step.
    """
    if in_image.min() == in_image.max():
        return np.zeros(len(in_image), np.int64)
    codes, inverse = np.unique(pack_keys(voxel_keys(points, cell_m)), return_inverse=True)
    held_by = np.empty(len(codes), np.int64)
    held_by[inverse] = in_image
    first, second = neighbouring(codes)
    meeting = np.concatenate([[in_image, held_by[inverse]], [held_by[first], held_by[second]]], axis=1)
    meeting = meeting[:, meeting[0] != meeting[1]]
    width = int(in_image.max()) + 1
    pairs = np.unique(meeting.min(axis=0) * width + meeting.max(axis=0))
    body_of = list(range(width))
    for one, other in zip((pairs // width).tolist(), (pairs % width).tolist(), strict=True):
        kept, joined = body_of[one], body_of[other]
        if kept != joined:
            body_of = [kept if body == joined else body for body in body_of]
    return np.asarray(body_of, np.int64)[in_image]


def main_component(points_camera: FloatArray, depth_m: float, apart_m: float = 0.0) -> BoolArray:
    """(n,) which points belong to the body in space that most of a mask's points belong to (`main_body`); points that
    are no farther apart than `apart_m` may hang together.
    """
    return main_body(points_camera, voxel_bodies(points_camera, max(0.03, 0.02 * depth_m, apart_m)))


def main_body(points_camera: FloatArray, bodies: IntArray) -> BoolArray:
    """(n,) which points belong to the largest body, (n,) bodies, and to what goes on near by.

    Further bodies count when they are a good part of the mask and begin within 0.2 m of what is kept so far: a chair's
    back is parted from its seat by the rail between.
    """
    if bodies.min() == bodies.max():
        return np.ones(len(bodies), dtype=bool)
    counts = np.bincount(bodies)
    largest = int(np.argmax(counts))
    numbers = [largest, *(int(each) for each in np.flatnonzero(counts >= LEAST_SHARE * counts[largest]))]
    points = {number: np.ascontiguousarray(points_camera[bodies == number].T) for number in dict.fromkeys(numbers)}
    kept, others = [largest], [number for number in points if number != largest]
    low, high = _ends([points[largest]])
    reach_m = min(0.5 * float((high - low).max()), REACH_M)
    joined = True
    while joined and others:
        low, high = _ends([points[number] for number in kept])
        near = [number for number in others if _gap_m(points[number], low, high) < reach_m]
        kept += near
        others = [number for number in others if number not in near]
        joined = bool(near)
    return np.isin(bodies, kept)


def _ends(bodies: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """The bounds (3, 1) of bodies (3, n)."""
    low = np.min([each.min(axis=1) for each in bodies], axis=0)
    high = np.max([each.max(axis=1) for each in bodies], axis=0)
    return low[:, None], high[:, None]


def _gap_m(points: FloatArray, low: FloatArray, high: FloatArray) -> float:
    """How far from bounds a body (3, n) begins."""
    gap = np.maximum(np.maximum(low - points, points - high), 0)
    return float(percentiles(np.linalg.norm(gap, axis=0), (NEAR_END,))[0])


def continued_behind(
    view: DepthView, uv: tuple[IntArray, IntArray], points_camera: FloatArray, bodies: IntArray, kept: BoolArray
) -> BoolArray:
    """(n,) which points lie on further bodies of a mask that something nearer parts from the kept ones: a desk goes on
    on the other side of the chair before it.

    A body counts if it is a good part of the mask and what lies between the nearest pixels of both is nearer than both;
    how much deeper it may lie grows with how far away it begins.
    """
    more = np.zeros(len(kept), dtype=bool)
    if kept.all():
        return more
    counts = np.bincount(bodies[~kept], minlength=1)
    own = np.flatnonzero(kept)
    own = own[:: len(own) // NEAREST_OF + 1]
    u, v = uv
    for number in np.flatnonzero(counts >= max(LEAST_POINTS, LEAST_HIDDEN_SHARE * kept.sum())):
        body = np.flatnonzero(bodies == number)
        tried = body[:: len(body) // NEAREST_OF + 1]
        apart = np.hypot(u[own][:, None] - u[tried], v[own][:, None] - v[tried])
        i, j = np.unravel_index(int(np.argmin(apart)), apart.shape)
        gap = points_camera[tried[j]] - points_camera[own[i]]
        hidden = _hidden_share(view, (int(u[own[i]]), int(v[own[i]])), (int(u[tried[j]]), int(v[tried[j]])))
        if hidden > HIDDEN_SHARE and abs(gap[2]) < REACH_M + float(np.hypot(gap[0], gap[1])):
            more[body] = True
    return more


def _hidden_share(view: DepthView, first_uv: tuple[int, int], second_uv: tuple[int, int]) -> float:
    """Share of the way between two pixels on which something nearer than both is seen."""
    steps = np.linspace(0, 1, 24)[2:-2]
    u = (first_uv[0] + steps * (second_uv[0] - first_uv[0])).round().astype(np.int64)
    v = (first_uv[1] + steps * (second_uv[1] - first_uv[1])).round().astype(np.int64)
    nearer = min(float(view.depth_m[first_uv[1], first_uv[0]]), float(view.depth_m[second_uv[1], second_uv[0]]))
    between = view.depth_m[v, u]
    return float(((between > 0) & (between < nearer - edge_step_m(between))).mean())
