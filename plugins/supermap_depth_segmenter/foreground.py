"""Separates the object that a box was drawn around from what else is in the patch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_depth_segmenter.patch import Patch, depth_noise_m

_MIN_IN_BOX_SHARE = 0.6
"""Share of a component's samples within the box from which on it may be the object and not what is behind it. Chosen.
"""
_MIN_IN_BOX_SHARE_OF_PART = 0.9
"""The same for further parts of the object. Chosen."""
_MIN_COVERAGE = 0.03
"""Share of the box's valid samples that the main component must cover. Chosen."""
_MIN_DEPTH_COVERAGE = 0.15
"""Share of the box's central weight that must have depth; with less, the depth may be that of the surroundings. Chosen.
"""
_FALLBACK_MARGIN = 0.06
"""Share of its size by which the box is shrunk on each side where it serves as the mask. Chosen."""
_PART_DEPTH_RANGE = 0.3
"""Depth between the object's parts and the main component, as a share of the longer side of the box. Chosen."""
_MIN_FRONT_WEIGHT = 0.1
"""Share of all components' weight from which on a component counts as standing in front. Chosen."""
_DEPTH_STEP_M, _NOISE_FACTOR, _SLANT_PER_PX = 0.01, 3.0, 0.004
"""Greatest depth step within one surface: metres, standard deviations of the depth, and share of the depth for each
pixel between the samples (the slant). Chosen.
"""


@dataclass(frozen=True)
class DepthComponents:
    """The depth-connected parts of a patch, k of them.

    `labels` (h, w), -1 = none. Of each component (k,): its `weight` (`Patch.centrality`), the share of its samples that
    lie in the box, the share of the box that its bounding box spans, and its mean depth.
    """

    labels: IntArray
    weight: FloatArray
    in_box_share: FloatArray
    span: FloatArray
    depth_m: FloatArray


def segment_object(patch: Patch, background_mask: BoolArray) -> BoolArray | None:
    """(h, w) the samples of the object the box was drawn around; `None` where the box has too little depth.

    The main component is central and lies within the box; components at its depth that lie within the box as well
    belong to it (a chair's legs). Where none lies within the box - a book on a table, a screen on a wall - the box
    itself, a little smaller, is the mask.
    """
    inside = patch.valid & patch.in_box
    if (patch.centrality * patch.valid).sum() <= _MIN_DEPTH_COVERAGE * patch.centrality.sum():
        return None
    components = connected_parts(patch, patch.valid & ~background_mask)
    if components is None:
        return _shrunken_box(patch)
    main = int(np.argmax(_fitness(components)))
    in_main = components.labels == main
    if (in_main & patch.in_box).sum() < _MIN_COVERAGE * inside.sum():
        return _shrunken_box(patch)
    if components.in_box_share[main] < _MIN_IN_BOX_SHARE:
        inseparable: BoolArray = in_main & _shrunken_box(patch)
        return inseparable
    depth_range_m = _PART_DEPTH_RANGE * patch.size_at_1m * components.depth_m[main]
    is_part = (np.abs(components.depth_m - components.depth_m[main]) < depth_range_m) & (
        components.in_box_share >= _MIN_IN_BOX_SHARE_OF_PART
    )
    is_part[main] = True
    chosen: BoolArray = is_part[components.labels] & (components.labels >= 0) & patch.in_box
    return chosen


def connected_parts(patch: Patch, foreground: BoolArray) -> DepthComponents | None:
    """The depth-connected components of the foreground: neighbours are linked where their depths differ by no more than
    noise and slant explain. `None` if there are none.
    """
    index = np.full(foreground.shape, -1, np.int64)
    n = int(foreground.sum())
    if n == 0:
        return None
    index[foreground] = np.arange(n)
    depth = patch.depth_m.astype(np.float64)
    links = []
    for a, b in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1], np.s_[1:]),
        (np.s_[:, :-2], np.s_[:, 2:]),
        (np.s_[:-2], np.s_[2:]),
    ):
        near = np.minimum(depth[a], depth[b])
        linked = foreground[a] & foreground[b] & (np.abs(depth[a] - depth[b]) < _max_depth_step_m(near, patch.step))
        links.append((index[a][linked], index[b][linked]))
    rows, columns = (np.concatenate(ends) for ends in zip(*links, strict=True))
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(n, n))
    k, labels = connected_components(graph, directed=False)
    in_box = patch.in_box[foreground]
    sizes = np.bincount(labels, minlength=k)
    weight = np.bincount(labels, patch.centrality[foreground], minlength=k).astype(np.float64)
    in_box_share = np.bincount(labels, in_box.astype(np.float64), minlength=k) / sizes
    mean = np.bincount(labels, depth[foreground], minlength=k) / sizes
    span = _span(labels[in_box], patch, foreground, k)
    labels_of_samples = np.full(foreground.shape, -1, np.int64)
    labels_of_samples[foreground] = labels
    return DepthComponents(labels_of_samples, weight, in_box_share, span, mean)


def _span(labels: IntArray, patch: Patch, foreground: BoolArray, k: int) -> FloatArray:
    """(k,) share of the box that each component's bounding box covers: detectors draw boxes tightly.

    `labels` are those of the foreground's samples in the box.
    """
    rows, columns = np.nonzero(foreground & patch.in_box)
    covered = np.ones(k)
    for position in (patch.share_u[columns], patch.share_v[rows]):
        low, high = np.ones(k), np.zeros(k)
        np.minimum.at(low, labels, position)
        np.maximum.at(high, labels, position)
        covered *= np.clip(high - low, 0, 1)
    return covered


def _fitness(components: DepthComponents) -> FloatArray:
    """(k,) how well each component fits the box: it is central, lies within the box, reaches to its sides, and no other
    heavy component is in front of it.
    """
    heavy = components.weight >= _MIN_FRONT_WEIGHT * components.weight.sum()
    nearest = components.depth_m[heavy].min() if heavy.any() else components.depth_m.min()
    nearness = np.minimum(nearest / components.depth_m, 1.0) ** 2
    fitness: FloatArray = components.weight * components.in_box_share**2 * components.span * nearness
    return fitness


def _max_depth_step_m(depth_m: FloatArray, step: int) -> FloatArray:
    """The greatest difference in depth of two neighbouring samples of one surface."""
    return _DEPTH_STEP_M + _NOISE_FACTOR * depth_noise_m(depth_m) + _SLANT_PER_PX * step * depth_m


def _shrunken_box(patch: Patch) -> BoolArray:
    return patch.within(_FALLBACK_MARGIN) & patch.valid
