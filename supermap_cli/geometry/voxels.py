"""Voxel indices packed into single integers, so that sets of voxels are sorted arrays."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray

_BITS = 21
_OFFSET = 1 << (_BITS - 1)
_MASK = (1 << _BITS) - 1


def voxel_keys(points: NDArray[np.floating], voxel_m: float) -> Int32Array:
    """(n, 3) int32 indices of the voxels that (n, 3) points in metres fall into."""
    keys: Int32Array = np.floor(points / voxel_m).astype(np.int32)
    return keys


def pack_keys(keys: Int32Array) -> IntArray:
    """(n,) int64 codes of (n, 3) voxel indices, each within +-2^20; equal indices have equal codes."""
    shifted = keys.astype(np.int64) + _OFFSET
    return (shifted[:, 0] << (2 * _BITS)) | (shifted[:, 1] << _BITS) | shifted[:, 2]


def unpack_codes(codes: IntArray) -> Int32Array:
    """(n, 3) int32 voxel indices of (n,) codes."""
    return np.stack(
        [(codes >> (2 * _BITS)) - _OFFSET, ((codes >> _BITS) & _MASK) - _OFFSET, (codes & _MASK) - _OFFSET], axis=1
    ).astype(np.int32)


def voxel_centers(keys: Int32Array, voxel_m: float) -> FloatArray:
    """(n, 3) centres in metres of (n, 3) voxel indices."""
    centers: FloatArray = (keys.astype(np.float64) + 0.5) * voxel_m
    return centers


def is_member(codes: IntArray, sorted_codes: IntArray) -> BoolArray:
    """(n,) which codes are among the sorted ones."""
    if not len(sorted_codes):
        return np.zeros(len(codes), dtype=bool)
    at = np.minimum(np.searchsorted(sorted_codes, codes), len(sorted_codes) - 1)
    member: BoolArray = sorted_codes[at] == codes
    return member


_STEPS = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.int64)
_NEIGHBOUR_CODES = (_STEPS[:, 0] << (2 * _BITS)) + (_STEPS[:, 1] << _BITS) + _STEPS[:, 2]


def dilate_codes(codes: IntArray) -> IntArray:
    """The sorted codes of all voxels within one step (26 neighbours) of the given ones."""
    return np.unique((codes[:, None] + _NEIGHBOUR_CODES[None, :]).ravel())


def neighbour_counts(codes: IntArray) -> IntArray:
    """(n,) how many of a sorted voxel's 26 neighbours are in the set too."""
    counts = np.zeros(len(codes), dtype=np.int64)
    for first, second in _neighbour_pairs(codes):
        counts[first] += 1
        counts[second] += 1
    return counts


def _neighbour_pairs(codes: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Positions of neighbouring voxels among sorted codes, each pair once, for each of 13 directions."""
    if not len(codes):
        return
    for step in _NEIGHBOUR_CODES[_NEIGHBOUR_CODES > 0]:
        wanted = codes + step
        at = np.minimum(np.searchsorted(codes, wanted), len(codes) - 1)
        first = np.flatnonzero(codes[at] == wanted)
        yield first, at[first]


def connected_components(codes: IntArray) -> IntArray:
    """(n,) component numbers of sorted voxel codes under 26-connectivity, the largest component first (0)."""
    if not len(codes):
        return np.zeros(0, dtype=np.int64)
    from scipy.sparse import coo_array  # noqa: PLC0415 - keeps scipy out of light commands
    from scipy.sparse.csgraph import connected_components as components  # noqa: PLC0415

    rows, columns = zip(*_neighbour_pairs(codes), strict=True)
    row, column = np.concatenate(rows), np.concatenate(columns)
    graph = coo_array((np.ones(len(row), dtype=np.int8), (row, column)), shape=(len(codes), len(codes)))
    _, labels = components(graph, directed=False)
    order = np.argsort(-np.bincount(labels), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    ranked: IntArray = rank[labels].astype(np.int64)
    return ranked
