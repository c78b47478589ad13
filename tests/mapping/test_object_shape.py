"""An object's shape: its box, its bounds, and what lies on it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.mapping.object_shape import coarse_edge_m, measure_shape, upright_box
from supermap_cli.mapping.voxel_map import VoxelMap
from support import scenes as s


def filled(size: tuple[float, float, float], yaw: float = 0.0, center: s.Point = (0, 0, 0)) -> np.ndarray:
    """Points on a 1 cm grid that fill a box."""
    axes = [np.arange(-length / 2 + 0.005, length / 2, 0.01) for length in size]
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)
    c, z = np.cos(yaw), np.sin(yaw)
    turned: np.ndarray = points @ np.array([[c, z, 0], [-z, c, 0], [0, 0, 1]]) + center
    return turned


def voxels_of(points: np.ndarray) -> VoxelMap:
    voxels = VoxelMap(0.01)
    voxels.add_points(points, np.zeros((len(points), 3), np.uint8), 0.85)
    return voxels


@settings(max_examples=30)
@given(st.floats(-1.5, 1.5))
def test_the_box_fits_a_turned_thing(yaw: float) -> None:
    box = upright_box(filled((0.6, 0.3, 0.2), yaw, (1, 2, 3)), 0.01)
    np.testing.assert_allclose(box.center, [1, 2, 3], atol=0.02)
    np.testing.assert_allclose(box.size, [0.6, 0.3, 0.2], atol=0.04)
    assert abs(np.sin(box.yaw - yaw)) < 0.1


def test_the_longer_side_comes_first_and_the_heading_is_one_of_a_half_turn() -> None:
    box = upright_box(filled((0.2, 0.8, 0.2)), 0.01)
    assert box.size[0] > box.size[1]
    assert abs(box.yaw) == pytest.approx(np.pi / 2, abs=0.02)
    assert -np.pi / 2 <= box.yaw < np.pi / 2


def test_a_single_voxel_has_a_box() -> None:
    shape = measure_shape(voxels_of(np.array([[0.005, 0.005, 0.005]])))
    np.testing.assert_allclose(shape.box.size, 0.01)
    np.testing.assert_allclose(shape.centroid, 0.005)
    assert shape.extent_m == pytest.approx(0.01)


def test_few_stray_voxels_do_not_stretch_the_box() -> None:
    points = np.concatenate([filled((0.2, 0.2, 0.2)), [[2.0, 0, 0], [0, -2, 0]]])
    assert measure_shape(voxels_of(points)).box.size.max() < 0.25


def test_points_near_a_shape_are_those_in_or_beside_its_voxels() -> None:
    shape = measure_shape(voxels_of(filled((0.2, 0.2, 0.2))))
    near = shape.near(np.array([[0, 0, 0], [0.11, 0, 0], [0.3, 0, 0]]))
    assert near.tolist() == [True, True, False]
    assert shape.share_near(np.zeros((0, 3))) == 0.0


@pytest.mark.parametrize(("extent_m", "edge_m"), [(0.01, 0.02), (0.2, 0.04), (3.0, 0.05)])
def test_clouds_are_compared_on_the_scale_of_the_thing(extent_m: float, edge_m: float) -> None:
    assert coarse_edge_m(extent_m) == pytest.approx(edge_m)


@pytest.mark.parametrize("yaw", [0.0, 0.35, -0.7])
def test_two_sides_seen_of_a_thing_in_a_corner_give_its_own_heading(yaw: float) -> None:
    front, side = filled((0.6, 0.02, 1.2), 0, (0, -0.3, 0)), filled((0.02, 0.6, 1.2), 0, (0.3, 0, 0))
    c, z = np.cos(yaw), np.sin(yaw)
    box = upright_box(np.concatenate([front, side]) @ np.array([[c, z, 0], [-z, c, 0], [0, 0, 1]]), 0.02)
    np.testing.assert_allclose(box.size[:2], 0.62, atol=0.04)
    assert abs(np.sin(2 * (box.yaw - yaw))) < 0.08
