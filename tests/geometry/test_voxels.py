"""Sets of voxels as sorted codes, compared with sets, and with scipy on dense grids."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy import ndimage

from supermap_cli.geometry.voxels import (
    connected_components,
    dilate_codes,
    is_member,
    meetings,
    near_voxels,
    neighbour_counts,
    pack_keys,
    part_numbers,
    unpack_codes,
    voxel_centers,
    voxel_keys,
)

FARTHEST = 2**20 - 1
CUBE = np.ones((3, 3, 3), int)

keys = hnp.arrays(np.int32, st.tuples(st.integers(0, 30), st.just(3)), elements=st.integers(-FARTHEST, FARTHEST))
close_keys = hnp.arrays(np.int32, st.tuples(st.integers(0, 30), st.just(3)), elements=st.integers(-3, 3))
grids = hnp.arrays(bool, (5, 6, 7))


def sorted_codes(grid: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Codes of a dense grid's voxels; its order (C) is that of the codes."""
    return pack_keys(np.argwhere(grid).astype(np.int32))


@given(keys)
def test_unpacking_undoes_packing(some: NDArray[np.int32]) -> None:
    np.testing.assert_array_equal(unpack_codes(pack_keys(some)), some)


@given(keys)
def test_codes_sort_as_their_keys_do(some: NDArray[np.int32]) -> None:
    assert [tuple(key) for key in unpack_codes(np.sort(pack_keys(some)))] == sorted(tuple(key) for key in some)


@pytest.mark.parametrize(("x", "key"), [(0.0, 0), (0.049, 0), (0.05, 1), (-0.001, -1), (-0.05, -1), (-0.051, -2)])
def test_a_voxel_holds_its_lower_border(x: float, key: int) -> None:
    np.testing.assert_array_equal(voxel_keys(np.array([[x, 0, 0]]), 0.05), [[key, 0, 0]])


@given(keys, st.sampled_from([0.01, 0.05, 0.32]))
def test_a_voxels_centre_lies_in_it(some: NDArray[np.int32], voxel_m: float) -> None:
    np.testing.assert_array_equal(voxel_keys(voxel_centers(some, voxel_m), voxel_m), some)


@given(close_keys, close_keys)
def test_members_are_those_of_the_set(some: NDArray[np.int32], others: NDArray[np.int32]) -> None:
    members = {tuple(key) for key in others}
    known = np.unique(pack_keys(others))
    assert is_member(pack_keys(some), known).tolist() == [tuple(key) in members for key in some]


@settings(max_examples=30)
@given(grids)
def test_dilation_adds_all_26_neighbours(grid: NDArray[np.bool_]) -> None:
    padded = np.pad(grid, 1)
    np.testing.assert_array_equal(
        dilate_codes(sorted_codes(padded)), sorted_codes(ndimage.binary_dilation(padded, CUBE.astype(bool)))
    )


def test_dilation_of_nothing_is_nothing() -> None:
    assert dilate_codes(np.zeros(0, np.int64)).shape == (0,)


@settings(max_examples=30)
@given(grids)
def test_neighbours_are_counted_without_the_voxel_itself(grid: NDArray[np.bool_]) -> None:
    counts = ndimage.convolve(grid.astype(int), CUBE, mode="constant")[grid] - 1
    np.testing.assert_array_equal(neighbour_counts(sorted_codes(grid)), counts)


@settings(max_examples=30)
@given(grids)
def test_components_are_those_of_scipy(grid: NDArray[np.bool_]) -> None:
    ours = connected_components(sorted_codes(grid))
    theirs = ndimage.label(grid, CUBE)[0][grid]
    assert (
        len(set(zip(ours.tolist(), theirs.tolist(), strict=True)))
        == len(set(ours.tolist()))
        == len(set(theirs.tolist()))
    )


@settings(max_examples=30)
@given(grids)
def test_the_largest_component_comes_first(grid: NDArray[np.bool_]) -> None:
    sizes = np.bincount(connected_components(sorted_codes(grid)))
    assert (np.diff(sizes) <= 0).all()


def test_nothing_has_no_components() -> None:
    assert connected_components(np.zeros(0, np.int64)).shape == (0,)


def test_neighbours_across_zero_are_neighbours() -> None:
    codes = np.sort(pack_keys(np.array([[-1, -1, -1], [0, 0, 0]], np.int32)))
    assert connected_components(codes).tolist() == [0, 0]
    assert neighbour_counts(codes).tolist() == [1, 1]


def test_voxels_within_one_step_are_near_however_far_apart_they_lie() -> None:
    for far in (9, 5_000_000 // 100):
        near = near_voxels(np.array([[0, 0, 0], [far, 7, far // 2]], np.int32))
        asked = np.array([[1, -1, 0], [2, 0, 0], [far, 7, far // 2 + 1], [-900, 0, 0], [far + 2, 7, 0]], np.int32)
        np.testing.assert_array_equal(near.hold(asked), [True, False, True, False, False])


@settings(max_examples=30)
@given(grids)
def test_parts_are_the_components(grid: NDArray[np.bool_]) -> None:
    keys = unpack_codes(sorted_codes(grid))
    ours, theirs = part_numbers(np.repeat(keys, 2, axis=0)), np.repeat(ndimage.label(grid, CUBE)[0][grid], 2)
    assert len(set(zip(ours.tolist(), theirs.tolist(), strict=True))) == len(set(theirs.tolist()))
    assert len(set(ours.tolist())) == len(set(theirs.tolist()))


def test_parts_may_lie_far_apart() -> None:
    for far in (9, 200, 50_000):
        keys = np.array([[0, 0, 0], [far, 7, far // 2], [0, 1, 0], [0, 0, 0]], np.int32)
        numbers = part_numbers(keys).tolist()
        assert numbers[0] == numbers[2] == numbers[3] != numbers[1]


@settings(max_examples=30)
@given(grids, st.sampled_from([0, 500]))
def test_what_meets_lies_in_one_voxel_or_beside_it(grid: NDArray[np.bool_], far: int) -> None:
    keys = unpack_codes(sorted_codes(grid))
    keys = np.concatenate([keys, keys[:1], np.full((1, 3), far, np.int32)]).astype(np.int32)
    values = np.arange(len(keys)) % 5
    found = {tuple(sorted(pair)) for pair in zip(*(side.tolist() for side in meetings(keys, values)), strict=True)}
    last = {tuple(key): value for key, value in zip(keys.tolist(), values.tolist(), strict=True)}
    beside = {
        tuple(sorted((value, other)))
        for key, value in last.items()
        for step in np.ndindex(3, 3, 3)
        if (other := last.get(tuple(np.add(key, step) - 1))) is not None
    }
    in_one = {
        tuple(sorted((value, last[tuple(key)]))) for key, value in zip(keys.tolist(), values.tolist(), strict=True)
    }
    assert found == {pair for pair in beside | in_one if pair[0] != pair[1]}
