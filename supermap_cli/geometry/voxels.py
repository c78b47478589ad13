"""Voxel indices packed into single integers, so that sets of voxels are sorted arrays."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray, UInt8Array

_BITS = 21
"""Bits of a code for each axis: three fit into an int64."""
_OFFSET, _MASK = 1 << (_BITS - 1), (1 << _BITS) - 1
"""Added to an index, so that it is positive; all bits of one index."""


def voxel_keys(points: NDArray[np.floating], voxel_m: float) -> Int32Array:
    """(n, 3) int32 indices of the voxels that (n, 3) points in metres fall into."""
    keys: Int32Array = np.floor(points / voxel_m).astype(np.int32)
    return keys


def pack_keys(keys: Int32Array | IntArray) -> IntArray:
    """(n,) int64 codes of (n, 3) voxel indices, each within +-2^20; equal indices have equal codes."""
    shifted = keys.astype(np.int64) + _OFFSET
    return (shifted[:, 0] << (2 * _BITS)) | (shifted[:, 1] << _BITS) | shifted[:, 2]


def unpack_codes(codes: IntArray) -> Int32Array:
    """(n, 3) int32 voxel indices of (n,) codes, column by column in memory (Fortran's order)."""
    keys = np.empty((3, len(codes)), np.int32)
    keys[0] = (codes >> (2 * _BITS)) - _OFFSET
    keys[1] = ((codes >> _BITS) & _MASK) - _OFFSET
    keys[2] = (codes & _MASK) - _OFFSET
    return keys.T


def voxel_centers(keys: Int32Array, voxel_m: float) -> FloatArray:
    """(n, 3) centres in metres of (n, 3) voxel indices."""
    centers: FloatArray = (keys.astype(np.float64) + 0.5) * voxel_m
    return centers


def is_member(codes: IntArray, sorted_codes: IntArray) -> BoolArray:
    """(n,) which codes are among the sorted ones."""
    if not len(sorted_codes):
        return np.zeros(len(codes), dtype=bool)
    index = np.minimum(np.searchsorted(sorted_codes, codes), len(sorted_codes) - 1)
    member: BoolArray = sorted_codes[index] == codes
    return member


_STEPS = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.int64)
_NEIGHBOUR_CODES = (_STEPS[:, 0] << (2 * _BITS)) + (_STEPS[:, 1] << _BITS) + _STEPS[:, 2]
_FORWARD_STEPS, _FORWARD_CODES = _STEPS[_NEIGHBOUR_CODES > 0], _NEIGHBOUR_CODES[_NEIGHBOUR_CODES > 0]
"""Steps to the 26 neighbours (and 0), as indices (27, 3) and as differences of codes; those to the 13 of greater codes.
"""

_MAX_CELLS = 1 << 22
"""Cells of the largest block (4 MB); sets of voxels that span more are searched as sorted codes instead."""


@dataclass(frozen=True)
class VoxelBlock:
    """The block around a set of voxels, two wider on every side, laid out cell by cell in the order of the codes.

    `low` (3,) is the index of its first cell, `shape` how many cells it has along x, y and z.
    """

    low: IntArray
    shape: tuple[int, int, int]

    @property
    def cells(self) -> int:
        """How many cells it has."""
        return self.shape[0] * self.shape[1] * self.shape[2]

    def positions(self, keys: Int32Array) -> IntArray:
        """(n,) the cells of (n, 3) voxel indices that lie in the block."""
        x, y, z = keys[:, 0] - self.low[0], keys[:, 1] - self.low[1], keys[:, 2] - self.low[2]
        positions: IntArray = (x * self.shape[1] + y) * self.shape[2] + z
        return positions

    def codes(self, positions: IntArray) -> IntArray:
        """(n,) the codes of cells."""
        rest, z = np.divmod(positions, self.shape[2])
        x, y = np.divmod(rest, self.shape[1])
        return pack_keys(np.stack([x, y, z], axis=1) + self.low)

    def forward_steps(self) -> IntArray:
        """(13,) how many cells further those neighbours of a cell lie that come after it."""
        steps: IntArray = (_FORWARD_STEPS[:, 0] * self.shape[1] + _FORWARD_STEPS[:, 1]) * self.shape[2]
        return steps + _FORWARD_STEPS[:, 2]

    def sums_around(self, positions: IntArray) -> UInt8Array:
        """(cells,) how many of the given cells are within one step of each cell (itself too)."""
        sums = np.zeros(self.cells, np.uint8)
        sums[positions] = 1
        for stride in (1, self.shape[2], self.shape[1] * self.shape[2]):
            wider = sums.copy()
            wider[stride:] += sums[:-stride]
            wider[:-stride] += sums[stride:]
            sums = wider
        return sums


def block_around(keys: Int32Array) -> VoxelBlock | None:
    """The block of (n, 3) voxel indices; `None` if there are none, or they lie too far apart for one."""
    if not len(keys):
        return None
    columns = np.ascontiguousarray(keys.T)
    low, high = columns.min(axis=1).astype(np.int64) - 2, columns.max(axis=1).astype(np.int64) + 3
    x, y, z = (high - low).tolist()
    block = VoxelBlock(low, (x, y, z))
    return block if block.cells <= _MAX_CELLS else None


def dilate_codes(codes: IntArray) -> IntArray:
    """The sorted codes of all voxels within one step (26 neighbours) of the given ones."""
    keys = unpack_codes(codes)
    block = block_around(keys)
    if block is None:
        return np.unique((codes[:, None] + _NEIGHBOUR_CODES[None, :]).ravel())
    return block.codes(np.flatnonzero(block.sums_around(block.positions(keys))))


@dataclass(frozen=True)
class NearVoxels:
    """The voxels within one step of a set of voxels: marked (cells,) in a block, or else as sorted codes (n,)."""

    codes: IntArray
    block: VoxelBlock | None
    marked: UInt8Array

    def hold(self, keys: Int32Array) -> BoolArray:
        """(n,) which of (n, 3) voxel indices are among them."""
        if self.block is None:
            return is_member(pack_keys(keys), self.codes)
        low, shape = self.block.low.astype(np.int32), np.array(self.block.shape, np.int32)
        offsets = np.ascontiguousarray(keys.T) - low[:, None]
        x, y, z = np.minimum(np.maximum(offsets, 0), shape[:, None] - 1)  # what lies outside: the border, never marked
        held: BoolArray = self.marked[(x * shape[1] + y) * shape[2] + z] > 0
        return held


def near_voxels(keys: Int32Array) -> NearVoxels:
    """All voxels within one step (26 neighbours) of (n, 3) voxel indices, n > 0."""
    block = block_around(keys)
    if block is None:
        return NearVoxels(dilate_codes(np.unique(pack_keys(keys))), None, np.zeros(0, np.uint8))
    return NearVoxels(np.zeros(0, np.int64), block, block.sums_around(block.positions(keys)))


def neighbour_counts(codes: IntArray) -> IntArray:
    """(n,) how many of a sorted voxel's 26 neighbours are in the set too."""
    keys = unpack_codes(codes)
    block = block_around(keys)
    if block is not None:
        positions = block.positions(keys)
        return block.sums_around(positions)[positions].astype(np.int64) - 1
    counts = np.zeros(len(codes), dtype=np.int64)
    for first, second in _neighbour_pairs(codes):
        counts[first] += 1
        counts[second] += 1
    return counts


def _neighbour_pairs(codes: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Positions of neighbouring voxels among sorted codes, each pair once, for each of 13 directions."""
    if not len(codes):
        return
    for step in _FORWARD_CODES:
        wanted = codes + step
        index = np.minimum(np.searchsorted(codes, wanted), len(codes) - 1)
        first = np.flatnonzero(codes[index] == wanted)
        yield first, index[first]


def _forward_neighbours(codes: IntArray) -> IntArray:
    """(n, 13) positions of the neighbours with greater codes among sorted codes, -1 where there is none."""
    keys = unpack_codes(codes)
    block = block_around(keys)
    if block is None:
        wanted = codes[:, None] + _FORWARD_CODES
        index = np.minimum(np.searchsorted(codes, wanted), len(codes) - 1)
        return np.where(codes[index] == wanted, index, -1)
    positions = block.positions(keys)
    numbers = np.full(block.cells, -1, np.int32)
    numbers[positions] = np.arange(len(codes), dtype=np.int32)
    neighbours: IntArray = numbers[positions[:, None] + block.forward_steps()].astype(np.int64)
    return neighbours


def neighbouring(codes: IntArray) -> tuple[IntArray, IntArray]:
    """(m,) and (m,) positions of all pairs of neighbours (26-connected) among sorted voxel codes, each pair once."""
    index = _forward_neighbours(codes)
    first, step = np.nonzero(index >= 0)
    return first, index[first, step]


def connected_components(codes: IntArray) -> IntArray:
    """(n,) component numbers of sorted voxel codes under 26-connectivity, the largest component first (0)."""
    if not len(codes):
        return np.zeros(0, dtype=np.int64)
    least = _linked(*neighbouring(codes), len(codes))
    order = np.argsort(-np.bincount(least), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    ranked: IntArray = rank[least].astype(np.int64)
    return ranked


def _linked(first: IntArray, second: IntArray, count: int) -> IntArray:
    """(n,) the least of all that each of `count` positions is linked to, step by step, by pairs of them (m,) and (m,).

    Of the two ends of a pair the one with the greater least position takes over the other's, as often as there are such
    pairs; between, everything takes a step to the least that its least has found (Shiloach and Vishkin 1982).
    """
    least = np.arange(count)
    while True:
        one, other = least[first], least[second]
        apart = one != other
        if not apart.any():
            return least
        one, other = one[apart], other[apart]
        np.minimum.at(least, np.maximum(one, other), np.minimum(one, other))
        least = least[least]


def part_numbers(keys: Int32Array) -> IntArray:
    """(n,) numbers, in any order, of the 26-connected parts that (n, 3) voxel indices, which may repeat, lie in."""
    block = block_around(keys)
    if block is None:
        codes, voxel = np.unique(pack_keys(keys), return_inverse=True)
        numbers: IntArray = connected_components(codes)[voxel]
        return numbers
    cell = block.positions(keys)
    number_at = np.full(block.cells, -1, np.int32)
    number_at[cell] = 0
    occupied = np.flatnonzero(number_at == 0)
    number_at[occupied] = np.arange(len(occupied), dtype=np.int32)
    return _linked(*_different_neighbours(block, number_at), len(occupied))[number_at[cell]]


def meetings(keys: Int32Array, values: IntArray) -> tuple[IntArray, IntArray]:
    """The pairs of different values >= 0, less than 2^31, that meet: (n,) values at (n, 3) voxel indices, in one voxel
    or in neighbouring ones (26-connected). In a voxel the last value stands for the others. Pairs may repeat.
    """
    block = block_around(keys)
    if block is None:
        codes, voxel = np.unique(pack_keys(keys), return_inverse=True)
        value_in = np.empty(len(codes), np.int64)
        value_in[voxel] = values
        here, (one, other) = value_in[voxel], neighbouring(codes)
        ends = value_in[one], value_in[other]
    else:
        cell = block.positions(keys)
        value_at = np.full(block.cells, -1, np.int32)
        value_at[cell] = values
        here, ends = value_at[cell].astype(np.int64), _different_neighbours(block, value_at)
    first, second = np.concatenate([values, ends[0]]), np.concatenate([here, ends[1]])
    apart = first != second
    return first[apart], second[apart]


def _different_neighbours(block: VoxelBlock, value_at: Int32Array) -> tuple[IntArray, IntArray]:
    """The values, (m,) and (m,), of all pairs of neighbouring cells whose values (cells,) differ; < 0 is none."""
    occupied = np.flatnonzero(value_at >= 0)
    own, beside = value_at[occupied], value_at[occupied + block.forward_steps()[:, None]]
    step, at = np.nonzero((beside >= 0) & (beside != own))
    return own[at].astype(np.int64), beside[step, at].astype(np.int64)


def distinct_keys(keys: Int32Array) -> Int32Array:
    """(m, k) the distinct ones of (n, k) voxel indices, in the order of x, then y (and z)."""
    columns = np.ascontiguousarray(keys.T)
    low = columns.min(axis=1)
    sides = tuple((columns.max(axis=1) - low + 1).tolist())
    if math.prod(sides) > _MAX_CELLS:
        return np.unique(keys, axis=0)
    columns -= low[:, None]
    marked = np.zeros(sides, bool)
    marked.ravel()[np.ravel_multi_index(tuple(columns), sides)] = True
    found = np.array(np.unravel_index(np.flatnonzero(marked), sides), np.int32)
    distinct: Int32Array = (found + low[:, None]).T
    return distinct
