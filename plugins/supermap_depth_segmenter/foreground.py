"""Which of the things in a patch is the object of the box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_depth_segmenter.patch import Patch, depth_noise_m

_OWN = 0.6
"""Share of a component's samples in the box from which it may be the object, and not what lies behind it."""
_OWN_PART = 0.9
_LEAST_COVER = 0.03
_LEAST_SEEN = 0.15
"""Share of the box's middle that must have a depth: what is measured may otherwise be what lies around the object."""
_SHRINK = 0.06
_REACH = 0.3
"""Parts of the object lie within so much of its extent from the main one in depth."""
_WEIGHTY = 0.1


@dataclass(frozen=True)
class Components:
    """The depth-connected parts of a patch, k of them.

    `labels` (h, w), -1 = none. Of each part (k,): its `weight` in the box's middle, the share of it that is the box's
    `own`, the share of the box's width and height that it spans, and its mean depth.
    """

    labels: IntArray
    weight: FloatArray
    own: FloatArray
    span: FloatArray
    depth_m: FloatArray


def object_of(patch: Patch, background: BoolArray) -> BoolArray | None:
    """(h, w) the samples of the object the box was drawn around; `None` where the box holds no depth.

    The main component is the one that fills the middle and ends with the box; parts at its depth that end with the box
    as well belong to it (a chair's legs). Where nothing ends with the box - a book on a table, a screen on a wall - the
    box itself, a little smaller, is the mask.
    """
    inside = patch.valid & patch.in_box
    if (patch.centrality * patch.valid).sum() <= _LEAST_SEEN * patch.centrality.sum():
        return None
    components = connect(patch, patch.valid & ~background)
    if components is None:
        return _shrunk(patch)
    main = int(np.argmax(_fitness(components)))
    in_main = components.labels == main
    if (in_main & patch.in_box).sum() < _LEAST_COVER * inside.sum():
        return _shrunk(patch)
    if components.own[main] < _OWN:
        inseparable: BoolArray = in_main & _shrunk(patch)
        return inseparable
    reach = _REACH * patch.size_at_1m * components.depth_m[main]
    alike = (np.abs(components.depth_m - components.depth_m[main]) < reach) & (components.own >= _OWN_PART)
    alike[main] = True
    chosen: BoolArray = alike[components.labels] & (components.labels >= 0) & patch.in_box
    return chosen


def connect(patch: Patch, foreground: BoolArray) -> Components | None:
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
        linked = foreground[a] & foreground[b] & (np.abs(depth[a] - depth[b]) < _jump_m(near, patch.step))
        links.append((index[a][linked], index[b][linked]))
    rows, columns = (np.concatenate(ends) for ends in zip(*links, strict=True))
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(n, n))
    k, labels = connected_components(graph, directed=False)
    in_box = patch.in_box[foreground]
    sizes = np.bincount(labels, minlength=k)
    weight = np.bincount(labels, patch.centrality[foreground], minlength=k).astype(np.float64)
    own = np.bincount(labels, in_box.astype(np.float64), minlength=k) / sizes
    mean = np.bincount(labels, depth[foreground], minlength=k) / sizes
    span = _span(labels[in_box], patch, foreground, k)
    whole = np.full(foreground.shape, -1, np.int64)
    whole[foreground] = labels
    return Components(whole, weight, own, span, mean)


def _span(labels: IntArray, patch: Patch, foreground: BoolArray, k: int) -> FloatArray:
    """(k,) which part of the box the smallest box around each component covers: detectors draw boxes tightly.

    `labels` are those of the foreground's samples in the box.
    """
    rows, columns = np.nonzero(foreground & patch.in_box)
    covered = np.ones(k)
    for share in (patch.share_u[columns], patch.share_v[rows]):
        low, high = np.ones(k), np.zeros(k)
        np.minimum.at(low, labels, share)
        np.maximum.at(high, labels, share)
        covered *= np.clip(high - low, 0, 1)
    return covered


def _fitness(components: Components) -> FloatArray:
    """(k,) how likely each component is what the box was drawn around: it fills the middle, ends with the box, reaches
    to its sides, and nothing of weight stands before it.
    """
    weighty = components.weight >= _WEIGHTY * components.weight.sum()
    nearest = components.depth_m[weighty].min() if weighty.any() else components.depth_m.min()
    nearness = np.minimum(nearest / components.depth_m, 1.0) ** 2
    fitness: FloatArray = components.weight * components.own**2 * components.span * nearness
    return fitness


def _jump_m(depth_m: FloatArray, step: int) -> FloatArray:
    """The greatest difference in depth of two neighbouring samples of one surface."""
    return 0.01 + 3 * depth_noise_m(depth_m) + 0.004 * step * depth_m


def _shrunk(patch: Patch) -> BoolArray:
    return patch.within(_SHRINK) & patch.valid
