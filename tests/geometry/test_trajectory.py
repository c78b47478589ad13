from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from supermap_cli.errors import OdometryError
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.types.sensing import StampedPose

SECOND = 1_000_000_000


def pose_at(time_s: float, x: float = 0.0, yaw: float = 0.0) -> StampedPose:
    rotation = Rotation.from_euler("z", yaw).as_matrix()
    return StampedPose(round(time_s * SECOND), make_transform(rotation, [x, 0, 0]))


def test_a_trajectory_without_poses_knows_nothing() -> None:
    trajectory = Trajectory([])
    assert trajectory.at(0) is None
    assert trajectory.at_many(np.zeros(0, np.int64))[0].shape == (0, 4, 4)
    assert len(trajectory.stamps_ns()) == 0


def test_halfway_between_two_poses_lies_half_the_motion() -> None:
    between = Trajectory([pose_at(0), pose_at(1, x=2.0, yaw=1.0)]).at(SECOND // 2)
    assert between is not None
    np.testing.assert_allclose(between, pose_at(0.5, x=1.0, yaw=0.5).T_odom_base, atol=1e-12)


@pytest.mark.parametrize(
    ("time_s", "known"), [(-0.2, False), (-0.05, True), (0, True), (1, True), (1.05, True), (1.2, False)]
)
def test_the_ends_hold_for_a_moment_only(time_s: float, known: bool) -> None:
    trajectory = Trajectory([pose_at(0), pose_at(1)], hold_s=0.1)
    assert (trajectory.at(round(time_s * SECOND)) is not None) == known


def test_a_gap_has_no_pose_but_its_edges_hold_for_a_moment() -> None:
    trajectory = Trajectory([pose_at(0), pose_at(1), pose_at(4), pose_at(5)], max_gap_s=1.5, hold_s=0.1)
    _, valid = trajectory.at_many((np.array([0.5, 1.05, 1.2, 3.8, 3.95, 4.5]) * SECOND).astype(np.int64))
    assert valid.tolist() == [True, True, False, False, True, True]


def test_poses_are_pulled_only_as_far_as_needed() -> None:
    pulled = []

    def source() -> Iterator[StampedPose]:
        for second in range(1000):
            pulled.append(second)
            yield pose_at(second, x=second)

    trajectory = Trajectory(source())
    trajectory.at(3 * SECOND + 1)
    assert pulled[-1] == 4
    trajectory.at(600 * SECOND)
    earlier = trajectory.at(2 * SECOND)
    assert pulled[-1] == 600
    assert earlier is not None
    assert earlier[0, 3] == 2


def test_a_source_that_goes_back_in_time_is_an_error() -> None:
    with pytest.raises(OdometryError, match="forward in time"):
        Trajectory([pose_at(1), pose_at(1)]).at(2 * SECOND)


@settings(deadline=None)
@given(st.lists(st.floats(0, 9), min_size=1, max_size=20), st.integers(0, 2**16))
def test_interpolation_agrees_with_scipy(times_s: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotations = Rotation.random(10, rng=rng)
    positions = rng.normal(size=(10, 3))
    poses = [StampedPose(k * SECOND, make_transform(rotations[k].as_matrix(), positions[k])) for k in range(10)]
    stamps_ns = (np.array(times_s) * SECOND).astype(np.int64)
    transforms, valid = Trajectory(poses).at_many(stamps_ns)
    assert valid.all()
    expected = Slerp(np.arange(10.0), rotations)(stamps_ns / SECOND).as_matrix()
    np.testing.assert_allclose(transforms[:, :3, :3], expected, atol=1e-6)
    for axis in range(3):
        wanted = np.interp(stamps_ns / SECOND, np.arange(10.0), positions[:, axis])
        np.testing.assert_allclose(transforms[:, axis, 3], wanted, atol=1e-9)


def test_pushed_poses_are_those_that_are_pulled() -> None:
    pulled = Trajectory([pose_at(time_s) for time_s in range(5)])
    pushed = Trajectory()
    for pose in pulled.poses():
        pushed.append(pose)
    stamps_ns = (np.linspace(0, 4, 50) * SECOND).astype(np.int64)
    np.testing.assert_array_equal(pushed.at_many(stamps_ns)[0], pulled.at_many(stamps_ns)[0])
    assert pushed.newest_ns == 4 * SECOND


def test_what_is_forgotten_does_not_change_what_comes_later() -> None:
    kept, forgetting = Trajectory(), Trajectory()
    for i in range(2000):
        for trajectory in (kept, forgetting):
            trajectory.append(pose_at(i / 100))
        forgetting.forget_before(round((i / 100 - 2) * SECOND))
    assert len(forgetting) < 600 < len(kept)
    stamps_ns = (np.linspace(18, 19.99, 40) * SECOND).astype(np.int64)
    np.testing.assert_array_equal(forgetting.at_many(stamps_ns)[0], kept.at_many(stamps_ns)[0])
