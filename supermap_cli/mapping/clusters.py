"""The depth-connected clusters of points that a mask shows, and which of them are the object.

Part of `Unproject` of the paper's algorithm 1, step (4), which takes all of a mask for the object; here what a mask
bleeds onto is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.geometry.voxels import connected_components, meetings, pack_keys, voxel_keys
from supermap_cli.mapping.depth import DepthView, edge_step_m
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class ClusterParameters:
    """Which clusters belong together."""

    cell_m: float = parameter(0.03, "m", "least edge of the voxels over which points are connected", TUNED)
    cell_per_m: float = parameter(0.02, "1", "the same, as a share of the depth", TUNED)
    near_percentile: float = parameter(
        5.0, "%", "percentile of a cluster's distances at which it begins", TUNED, at_most=100
    )
    reach_m: float = parameter(0.2, "m", "gap across which a cluster may still belong to another", TUNED)
    reach_share: float = parameter(0.5, "1", "the same, as a share of the largest cluster's longest side", TUNED)
    min_share: float = parameter(0.15, "1", "least size of a further cluster, as a share of the largest", TUNED)
    min_occluded_share: float = parameter(
        0.1, "1", "least size of a cluster that something nearer parts from the others, as a share of these", TUNED
    )
    min_occluded_points: int = parameter(12, "1", "least points of such a cluster", TUNED)
    nearest_of: int = parameter(
        64, "1", "points of each cluster among which the nearest pair is looked for", "bounds the time", at_least=1
    )
    occluder_share: float = parameter(
        0.6, "1", "share of the way between two clusters that something nearer must cover", TUNED
    )
    occluder_steps: int = parameter(24, "1", "pixels looked at on that way, its ends included", TUNED, at_least=6)


DEFAULT = ClusterParameters()


def cell_m(depth_m: float, parameters: ClusterParameters = DEFAULT) -> float:
    """Edge of the voxels over which the points of a mask at a depth are connected."""
    return max(parameters.cell_m, parameters.cell_per_m * depth_m)


def voxel_clusters(points: FloatArray, cell_m: float) -> IntArray:
    """(n,) the cluster of each point: points are joined over 26-connected voxels, as wide as what one pixel's noise and
    thinning leave between neighbours.
    """
    unique, inverse = np.unique(pack_keys(voxel_keys(points, cell_m)), return_inverse=True)
    clusters: IntArray = connected_components(unique)[inverse]
    return clusters


def image_clusters(pixels: BoolArray, chosen: IntArray) -> IntArray:
    """(n,) the cluster of the chosen ones, by position, of the marked pixels (h, w): pixels are joined with their eight
    neighbours, for where they meet is no depth edge. What is seen at a grazing angle hangs together in the image and
    not in space.
    """
    _, clusters = cv2.connectedComponents(pixels.view(np.uint8), connectivity=8)
    return np.asarray(clusters.ravel()[chosen], np.int64)


def joined_clusters(points: FloatArray, cell_m: float, in_image: IntArray) -> IntArray:
    """(n,) the cluster of each point: points are of one cluster if they are so in the image, (n,) clusters, or in space
    (see `voxel_clusters`), or both step by step.
    """
    if in_image.min() == in_image.max():
        return np.zeros(len(in_image), np.int64)
    first, second = meetings(voxel_keys(points, cell_m), in_image)
    width = int(in_image.max()) + 1
    pairs = np.unique(np.minimum(first, second) * width + np.maximum(first, second))
    cluster_of = list(range(width))
    for one, other in zip((pairs // width).tolist(), (pairs % width).tolist(), strict=True):
        kept, joined = cluster_of[one], cluster_of[other]
        if kept != joined:
            cluster_of = [kept if cluster == joined else cluster for cluster in cluster_of]
    return np.asarray(cluster_of, np.int64)[in_image]


def main_cluster(points_camera: FloatArray, clusters: IntArray, parameters: ClusterParameters = DEFAULT) -> BoolArray:
    """(n,) which points belong to the largest cluster, (n,) clusters, and to what goes on near by.

    Further clusters count when they are a good part of the mask and begin within `reach_m` of what is kept so far: a
    chair's back is parted from its seat by the rail between.
    """
    if clusters.min() == clusters.max():
        return np.ones(len(clusters), dtype=bool)
    counts = np.bincount(clusters)
    largest = int(np.argmax(counts))
    numbers = [largest, *np.flatnonzero(counts >= parameters.min_share * counts[largest]).tolist()]
    points = {number: np.ascontiguousarray(points_camera[clusters == number].T) for number in dict.fromkeys(numbers)}
    kept, others = [largest], [number for number in points if number != largest]
    low, high = _bounds([points[largest]])
    reach_m = min(parameters.reach_share * float((high - low).max()), parameters.reach_m)
    joined = True
    while joined and others:
        low, high = _bounds([points[number] for number in kept])
        percentile = parameters.near_percentile
        near = [number for number in others if _gap_m(points[number], low, high, percentile) < reach_m]
        kept += near
        others = [number for number in others if number not in near]
        joined = bool(near)
    is_kept = np.zeros(len(counts), dtype=bool)
    is_kept[kept] = True
    return is_kept[clusters]


def _bounds(clusters: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """The bounds (3, 1) of clusters (3, n)."""
    low = np.min([points.min(axis=1) for points in clusters], axis=0)
    high = np.max([points.max(axis=1) for points in clusters], axis=0)
    return low[:, None], high[:, None]


def _gap_m(points: FloatArray, low: FloatArray, high: FloatArray, percentile: float) -> float:
    """How far from bounds a cluster (3, n) begins."""
    gap = np.maximum(np.maximum(low - points, points - high), 0)
    return float(percentiles(np.linalg.norm(gap, axis=0), (percentile,))[0])


def occluded_continuation(
    view: DepthView,
    uv: tuple[IntArray, IntArray],
    points_camera: FloatArray,
    clusters: IntArray,
    kept: BoolArray,
    *,
    parameters: ClusterParameters = DEFAULT,
) -> BoolArray:
    """(n,) which points lie on further clusters of a mask that an occluder parts from the kept ones: a desk goes on on
    the other side of the chair before it.

    A cluster counts if it is a good part of the mask and what lies between the nearest pixels of both is nearer than
    both; how much deeper it may lie grows with how far away it begins.
    """
    more = np.zeros(len(kept), dtype=bool)
    if kept.all():
        return more
    counts = np.bincount(clusters[~kept], minlength=1)
    own = np.flatnonzero(kept)
    own = own[:: len(own) // parameters.nearest_of + 1]
    u, v = uv
    least = max(parameters.min_occluded_points, parameters.min_occluded_share * kept.sum())
    for number in np.flatnonzero(counts >= least):
        cluster = np.flatnonzero(clusters == number)
        tried = cluster[:: len(cluster) // parameters.nearest_of + 1]
        apart = np.hypot(u[own][:, None] - u[tried], v[own][:, None] - v[tried])
        i, j = np.unravel_index(int(np.argmin(apart)), apart.shape)
        gap = points_camera[tried[j]] - points_camera[own[i]]
        first_uv, second_uv = (int(u[own[i]]), int(v[own[i]])), (int(u[tried[j]]), int(v[tried[j]]))
        if abs(gap[2]) >= parameters.reach_m + float(np.hypot(gap[0], gap[1])):
            continue
        if _occluded_share(view, first_uv, second_uv, parameters.occluder_steps) > parameters.occluder_share:
            more[cluster] = True
    return more


def _occluded_share(view: DepthView, first_uv: tuple[int, int], second_uv: tuple[int, int], count: int) -> float:
    """Share of the way between two pixels on which something nearer than both is seen."""
    steps = np.linspace(0, 1, count)[2:-2]
    u = (first_uv[0] + steps * (second_uv[0] - first_uv[0])).round().astype(np.int64)
    v = (first_uv[1] + steps * (second_uv[1] - first_uv[1])).round().astype(np.int64)
    nearer = min(float(view.depth_m[first_uv[1], first_uv[0]]), float(view.depth_m[second_uv[1], second_uv[0]]))
    between = view.depth_m[v, u]
    return float(((between > 0) & (between < nearer - edge_step_m(between, view.parameters))).mean())
