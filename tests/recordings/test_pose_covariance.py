"""What a recorded pose's covariance says, and how it is carried over to the base."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from supermap_cli.geometry.se3 import make_transform
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.messages import read_covariance
from supermap_cli.recordings.poses import carried_covariance
from supermap_cli.types.sensing import StampedPose
from support import bags

VARIANCES = (0.01, 0.02, 0.03, 0.001, 0.002, 0.003)


class WithCovariance(bags.BagWriter):
    """Writes poses with a covariance."""

    covariance: np.ndarray = np.zeros(36)

    def _pose_with_covariance(self, T: np.ndarray) -> Any:
        return self.type("geometry_msgs/msg/PoseWithCovariance", pose=self._pose(T), covariance=self.covariance)


def recorded(path: Path, covariance: np.ndarray, T_odom_imu: np.ndarray) -> StampedPose:
    """The first pose of a recording whose IMU, 0.5 m in front of the base, is what the odometry moves."""
    size, K = (bags.WIDTH, bags.HEIGHT), (bags.FOCAL, bags.FOCAL, (bags.WIDTH - 1) / 2, (bags.HEIGHT - 1) / 2)
    with WithCovariance(path) as bag:
        bag.covariance = covariance.ravel()
        bag.transform(bags.START_NS, "base_link", "imu", make_transform(np.eye(3), [0.5, 0, 0]), static=True)
        bag.transform(bags.START_NS, "base_link", "camera", bags.T_BASE_OPTICAL, static=True)
        for at in map(bags.stamp, range(3)):
            bag.camera_info("/camera/color/camera_info", at, "camera", size, K)
            bag.image("/camera/color/image_raw", at, "camera", bags.color_image(0), "rgb8")
            bag.image("/camera/depth/image_raw", at, "camera", bags.depth_image(), "16UC1")
            bag.odometry("/odom", at, T_odom_imu, child_frame_id="imu")
    return next(iter(open_bag_recording(path, RecordingRequest(frames={"base": "base_link"})).poses()))


@pytest.mark.parametrize("name", ["run.mcap", "run.bag"])
def test_a_recorded_pose_has_its_covariance_at_the_base(tmp_path: Path, name: str) -> None:
    T_odom_imu = make_transform(Rotation.from_euler("z", 90, degrees=True).as_matrix(), [1, 0, 0])
    pose = recorded(tmp_path / name, np.diag(VARIANCES), T_odom_imu)
    np.testing.assert_allclose(pose.T_odom_base[:3, 3], [1, -0.5, 0], atol=1e-9)
    assert pose.covariance is not None
    across_m2 = np.array([0.25 * VARIANCES[5], 0, 0.25 * VARIANCES[3], 0, 0, 0])
    np.testing.assert_allclose(np.diag(pose.covariance), VARIANCES + across_m2, atol=1e-12)
    np.testing.assert_allclose(pose.covariance, pose.covariance.T)
    assert pose.covariance[0, 5] == pytest.approx(0.5 * VARIANCES[5])


def test_a_recorded_pose_without_a_covariance_has_none(tmp_path: Path) -> None:
    assert recorded(tmp_path / "run.mcap", np.zeros(36), np.eye(4)).covariance is None


@pytest.mark.parametrize(
    "values",
    [
        np.zeros(36),
        np.diag([-1.0, 0, 0, 0, 0, 0]),
        np.diag([0.1, 0.1, np.nan, 0.1, 0.1, 0.1]),
        np.full(36, np.inf),
        (),
        np.ones(9),
    ],
)
def test_an_unknown_covariance_is_none(values: Any) -> None:
    assert read_covariance(np.ravel(values)) is None


def test_it_is_read_row_by_row() -> None:
    values = np.diag(VARIANCES)
    values[0, 5] = values[5, 0] = 0.004
    np.testing.assert_array_equal(read_covariance(values.ravel().tolist()), values)


def test_it_is_carried_over_as_the_pose_is() -> None:
    """By poses drawn at random: their base spreads as the carried covariance says."""
    noise = np.random.default_rng(0)
    covariance = np.diag(np.square([0.01, 0.02, 0.03, 0.01, 0.02, 0.03]))
    T_odom_moved = make_transform(Rotation.from_euler("zyx", [90, 20, 10], degrees=True).as_matrix(), [1, 2, 3])
    T_moved_base = make_transform(Rotation.from_euler("z", 30, degrees=True).as_matrix(), [2.0, 0.5, -1.0])
    expected = (T_odom_moved @ T_moved_base)[:3, 3]
    drawn = noise.multivariate_normal(np.zeros(6), covariance, 20_000)
    lever_arm = T_odom_moved[:3, :3] @ T_moved_base[:3, 3]
    places = T_odom_moved[:3, 3] + drawn[:, :3] + Rotation.from_rotvec(drawn[:, 3:]).apply(lever_arm)
    sampled = np.cov(np.hstack([places - expected, drawn[:, 3:]]).T)
    carried = carried_covariance(covariance, lever_arm)
    np.testing.assert_allclose(carried, sampled, atol=1e-4)
