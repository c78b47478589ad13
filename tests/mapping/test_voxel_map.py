"""An object's voxels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from supermap_cli.geometry.voxels import pack_keys, voxel_keys
from supermap_cli.mapping.voxel_map import DEFAULT, VoxelMap, voxel_map_from_cloud

HIT = 0.85
GREY = np.full((1, 3), 100, np.uint8)

points = hnp.arrays(np.float64, st.tuples(st.integers(1, 40), st.just(3)), elements=st.floats(-0.5, 0.5, width=32))


def map_of(some: NDArray[np.float64], voxel_m: float = 0.02, rgb: int = 100) -> VoxelMap:
    voxels = VoxelMap(voxel_m)
    voxels.add_points(some, np.full((len(some), 3), rgb, np.uint8), HIT)
    return voxels


def sheet(n: int, voxel_m: float = 0.02) -> NDArray[np.float64]:
    """Centres of n x n voxels side by side on the floor."""
    i, j = np.divmod(np.arange(n * n), n)
    return np.column_stack([i + 0.5, j + 0.5, np.full(n * n, 0.5)]) * voxel_m


def test_an_empty_map_has_nothing_solid() -> None:
    voxels = VoxelMap(0.02)
    assert len(voxels) == 0
    assert voxels.solid().shape == (0,)
    voxels.fit_voxel()
    voxels.absorb(VoxelMap(0.04))
    assert len(voxels.to_cloud()) == 0


@given(points)
def test_every_point_falls_into_a_voxel_of_the_map(some: NDArray[np.float64]) -> None:
    voxels = map_of(some)
    assert voxels.codes.tolist() == sorted(set(pack_keys(voxel_keys(some, 0.02)).tolist()))


@given(points, points)
def test_voxels_that_are_known_stay_as_they_are(first: NDArray[np.float64], second: NDArray[np.float64]) -> None:
    voxels = map_of(first)
    voxels.log_odds[:] = 3.0
    before = set(voxels.codes.tolist())
    voxels.add_points(second, np.full((len(second), 3), 9, np.uint8), HIT)
    known = np.isin(voxels.codes, list(before))
    assert (voxels.log_odds[known] == 3.0).all()
    assert (voxels.log_odds[~known] == np.float32(HIT)).all()
    assert (np.diff(voxels.codes) > 0).all()
    assert (voxels.rgb[known] == 100).all()
    assert (voxels.rgb[~known] == 9).all()


def test_centres_follow_the_voxels() -> None:
    voxels = map_of(sheet(3))
    np.testing.assert_allclose(voxels.centers(), sheet(3))
    voxels.keep(np.arange(9) < 4)
    np.testing.assert_allclose(voxels.centers(), sheet(3)[:4])
    voxels.add_points(sheet(3)[8:], GREY, HIT)
    assert len(voxels.centers()) == 5


@given(points)
def test_what_was_stored_comes_back(some: NDArray[np.float64]) -> None:
    voxels = map_of(some)
    voxels.inside += np.arange(len(voxels), dtype=np.float32)
    again = voxel_map_from_cloud(voxels.to_cloud())
    assert again.voxel_m == voxels.voxel_m
    for name in ("codes", "log_odds", "inside", "outside", "rgb"):
        np.testing.assert_array_equal(getattr(again, name), getattr(voxels, name))


def test_a_lone_voxel_is_not_solid_beside_a_sheet() -> None:
    voxels = map_of(np.concatenate([sheet(4), [[1.0, 1.0, 1.0]]]))
    assert voxels.solid().sum() == 16


def test_voxels_seen_through_or_mostly_beside_the_masks_are_not_solid() -> None:
    voxels = map_of(sheet(6))
    voxels.log_odds[:6] = -0.5
    voxels.inside[6:12], voxels.outside[6:12] = 1, 2
    assert voxels.solid().sum() == 24


def test_voxels_seldom_in_the_masks_are_not_solid_once_others_are_there_often() -> None:
    voxels = map_of(sheet(6))
    voxels.inside[6:] = 20
    assert voxels.solid().sum() == 30


@pytest.mark.parametrize(("length_m", "voxel_m"), [(0.3, 0.01), (0.9, 0.02), (2.0, 0.04)])
def test_voxels_grow_with_the_thing(length_m: float, voxel_m: float) -> None:
    rod = np.column_stack([np.arange(0.005, length_m, 0.01), np.zeros((2, round(length_m * 100))).T + 0.005])
    voxels = map_of(rod, 0.01)
    voxels.fit_voxel()
    assert voxels.voxel_m == pytest.approx(voxel_m)
    assert len(voxels) <= DEFAULT.max_side_voxels + 1
    assert np.ptp(voxels.centers()[:, 0]) == pytest.approx(length_m, abs=2 * voxel_m)


def test_a_grown_voxel_is_as_sure_as_its_surest_part_and_has_its_mean_colour() -> None:
    voxels = map_of(sheet(2, 0.01), 0.01, rgb=50)
    voxels.rgb[0] = 90
    voxels.log_odds[:] = [0.5, 2.0, -1.0, 0.1]
    voxels.inside[:] = [1, 3, 5, 7]
    voxels.add_points(np.array([[1.0, 0.005, 0.005]]), GREY, HIT)
    voxels.fit_voxel()
    assert voxels.log_odds[0] == 2.0
    assert voxels.inside[0] == 4.0
    np.testing.assert_allclose(voxels.rgb[0], 60)


def test_absorbing_adds_up_the_evidence_and_keeps_what_is_new() -> None:
    one, other = map_of(sheet(4)), map_of(sheet(4) + np.array([0.04, 0, 0]), rgb=200)
    one.absorb(other)
    assert len(one) == 24
    shared = (one.centers()[:, 0] > 0.04) & (one.centers()[:, 0] < 0.08)
    assert (one.log_odds[shared] == np.float32(2 * HIT)).all()
    assert (one.inside[shared] == 2).all()
    assert (one.rgb[one.centers()[:, 0] > 0.08] == 200).all()
    assert (np.diff(one.codes) > 0).all()


@given(points, points)
def test_absorbing_keeps_every_voxel_of_both_and_stays_in_bounds(
    first: NDArray[np.float64], second: NDArray[np.float64]
) -> None:
    one, other = map_of(first), map_of(second)
    one.log_odds[:] = DEFAULT.log_odds_max
    one.absorb(other)
    wanted = set(pack_keys(voxel_keys(np.concatenate([first, second]), 0.02)).tolist())
    assert one.codes.tolist() == sorted(wanted)
    assert (one.log_odds <= DEFAULT.log_odds_max).all()


def test_finer_voxels_are_absorbed_into_the_coarser_ones_they_lie_in() -> None:
    coarse, fine = map_of(sheet(2, 0.04), 0.04), map_of(sheet(8, 0.01), 0.01)
    coarse.absorb(fine)
    assert len(coarse) == 4
