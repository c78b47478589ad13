"""The transform from one map's frame and time into another's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.geometry.se3 import inverse, make_transform, transform_points
from supermap_cli.geometry.voxels import pack_keys
from supermap_cli.map_merge.transform import MapTransform
from supermap_cli.mapping.belief import Viewpoint, ViewpointHistory
from supermap_cli.mapping.voxel_map import VoxelMap
from support import memories as m


def level(yaw_deg: float, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    c, s = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    return make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [x, y, z])


def block(low: tuple[int, int, int] = (-3, 2, 0), size: tuple[int, int, int] = (12, 7, 9)) -> VoxelMap:
    """A solid block of 1 cm voxels with different log-odds."""
    keys = (np.indices(size).reshape(3, -1).T + np.array(low)).astype(np.int32)
    codes = np.sort(pack_keys(keys))
    n = len(codes)
    values = np.linspace(0.1, 4, n).astype(np.float32)
    return VoxelMap(0.01, codes, values, values + 1, values * 0, np.tile(values[:, None], (1, 3)))


poses = st.builds(
    level,
    st.floats(-180, 180),
    st.floats(-5, 5),
    st.floats(-5, 5),
    st.floats(-1, 1),
)


def test_a_cloud_in_the_same_frame_is_the_same() -> None:
    before, after = block(), block().carried(np.eye(4))
    np.testing.assert_array_equal(after.codes, before.codes)
    np.testing.assert_array_equal(after.log_odds, before.log_odds)
    np.testing.assert_array_equal(after.rgb, before.rgb)


def test_a_quarter_turn_and_whole_steps_lose_nothing() -> None:
    before = block()
    after = before.carried(level(90, 0.05, -0.2, 0.03))
    assert len(after) == len(before)
    assert sorted(after.log_odds.tolist()) == sorted(before.log_odds.tolist())


@given(poses)
def test_a_turned_cloud_has_no_holes_and_its_size(T: np.ndarray) -> None:
    before = block()
    after = before.carried(T)
    assert len(after) == pytest.approx(len(before), rel=0.15)
    back = transform_points(inverse(T), after.centers())
    low, high = before.centers().min(axis=0), before.centers().max(axis=0)
    assert (back > low - 0.00501).all()
    assert (back < high + 0.00501).all()
    np.testing.assert_allclose(
        after.centers().mean(axis=0), transform_points(T, before.centers()).mean(axis=0), atol=0.01
    )
    inner = np.array([[0.03, 0.055, 0.045]])  # every voxel around the middle is there
    around = transform_points(T, inner) + (np.indices((3, 3, 3)).reshape(3, -1).T - 1) * 0.01
    held = after.carried(np.eye(4)).codes
    keys = np.floor(around / 0.01).astype(np.int32)
    assert np.isin(pack_keys(keys), held).all()


def test_an_empty_cloud_stays_empty() -> None:
    assert len(VoxelMap(0.02).carried(level(30))) == 0


@given(poses, st.floats(-3, 3), st.integers(0, 10**15))
def test_boxes_points_and_times_pass_together(T: np.ndarray, yaw: float, shift_ns: int) -> None:
    transform = MapTransform(T, shift_ns)
    box = m.upright_box((1, 2, 0.5), (0.8, 0.3, 1), yaw)
    moved = transform.box(box)
    corners = np.array([[sx, sy, sz] for sx in (-0.4, 0.4) for sy in (-0.15, 0.15) for sz in (-0.5, 0.5)])
    there = transform_points(T, transform_points(level(np.degrees(box.yaw), *box.center), corners))
    here = transform_points(level(np.degrees(moved.yaw), *moved.center), corners)
    assert np.linalg.norm(there[:, None] - here[None], axis=2).min(axis=1).max() < 1e-6
    state = transform.state(m.state(1, 0, (1, 2), (1, 2, 0.5), gone=5, empty_before=0))
    assert (state.first_seen_ns, state.gone_ns) == (m.ns(1) + shift_ns, m.ns(5) + shift_ns)
    np.testing.assert_allclose(state.centroid_map, transform_points(T, np.array([[1, 2, 0.5]]))[0])
    assert transform.optional_time(None) is None


@given(st.sampled_from([-165, -90, -15, 0, 15, 45, 90, 180]), st.floats(0, 6.28), st.floats(0.5, 4))
def test_views_turn_with_the_frame(yaw_deg: float, bearing: float, distance: float) -> None:
    """By whole cells of 15 degrees a view is that of the camera in the map's frame."""
    camera = distance * np.array([np.cos(bearing), np.sin(bearing), 0.3])
    view, turned = (
        Viewpoint(0, transform_points(T, camera[None])[0], T[:3, 3], "a detector")
        for T in (np.eye(4), level(yaw_deg, 1, 2))
    )
    if abs(np.degrees(bearing) / 15 - round(np.degrees(bearing) / 15)) < 1e-6:
        return  # on the edge of a cell
    seen = ViewpointHistory()
    seen.add_detection(view, 1.0)
    (name,) = seen.cells
    assert MapTransform(level(yaw_deg), 0)._rotated_cell(name) == turned.cell()
