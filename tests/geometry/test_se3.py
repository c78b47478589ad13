"""Rigid motions, against scipy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from supermap_cli.geometry import se3

quaternions = (
    st.tuples(*[st.floats(-1, 1)] * 4)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: np.array(q) / np.linalg.norm(q))
)
vectors = st.tuples(*[st.floats(-100, 100)] * 3).map(np.array)


@given(quaternions)
def test_quaternions_turn_as_scipy_says(q):
    R = se3.rotation_from_quaternion_xyzw(q)
    assert np.allclose(R, Rotation.from_quat(q).as_matrix())
    back = se3.quaternion_xyzw_from_rotation(R)
    assert back[3] >= 0
    assert np.allclose(se3.rotation_from_quaternion_xyzw(back), R)


@given(quaternions, vectors, vectors)
def test_the_inverse_undoes_a_motion(q, t, point):
    T = se3.make_transform(se3.rotation_from_quaternion_xyzw(q), t)
    there = se3.transform_points(T, point[None])
    assert np.allclose(se3.transform_points(se3.inverse(T), there), point[None], atol=1e-9)


@given(quaternions, quaternions, st.floats(0, 1))
def test_slerp_is_scipys(q_start, q_end, fraction):
    if abs(q_start @ q_end) < 1e-6:
        return
    expected = Slerp([0, 1], Rotation.from_quat([q_start, q_end]))(fraction).as_matrix()
    found = se3.rotation_from_quaternion_xyzw(se3.slerp_xyzw(q_start, q_end, fraction))
    assert np.allclose(found, expected, atol=1e-6)


def test_interpolation_meets_its_ends():
    T_end = se3.make_transform(Rotation.from_euler("z", 1.0).as_matrix(), [2, 0, 0])
    assert np.allclose(se3.interpolate_transform(np.eye(4), T_end, 0), np.eye(4))
    assert np.allclose(se3.interpolate_transform(np.eye(4), T_end, 1), T_end)
    middle = se3.interpolate_transform(np.eye(4), T_end, 0.5)
    assert np.allclose(middle[:3, 3], [1, 0, 0])
    assert se3.rotation_angle_rad(middle[:3, :3]) == pytest.approx(0.5)


@given(quaternions)
def test_the_rotation_between_directions_turns_one_into_the_other(q):
    target = se3.rotation_from_quaternion_xyzw(q)[:, 0]
    assert np.allclose(se3.rotation_between([1, 0, 0], target) @ [1, 0, 0], target, atol=1e-5)


@pytest.mark.parametrize("angle_rad", [1e-3, 1e-6, 1e-9, 1e-12])
def test_nearly_opposite_directions_are_turned_as_exactly_as_others(angle_rad):
    a, b = np.array([0.0, 0.0, 1.0]), np.array([np.sin(angle_rad), 0.0, -np.cos(angle_rad)])
    R = se3.rotation_between(a, b)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(R @ a, b, atol=1e-12)


def test_opposite_directions_have_a_rotation_between_them():
    R = se3.rotation_between([0, 0, 1], [0, 0, -1])
    assert np.allclose(R @ [0, 0, 1], [0, 0, -1])
    assert np.linalg.det(R) == pytest.approx(1)


@pytest.mark.parametrize("T", [np.eye(3), np.full((4, 4), np.nan), np.diag([1, 1, -1, 1.0]), np.diag([2, 2, 2, 1.0])])
def test_what_is_no_rigid_motion_is_refused(T):
    with pytest.raises(ValueError, match="T_a_b"):
        se3.check_transform("T_a_b", T)


@pytest.mark.parametrize("q", [[0, 0, 0, 0], [np.nan, 0, 0, 1], [np.inf, 0, 0, 1]])
def test_what_is_no_quaternion_is_refused(q):
    with pytest.raises(ValueError, match="not a quaternion"):
        se3.rotation_from_quaternion_xyzw(q)
