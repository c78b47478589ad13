"""Jumps of an odometry's frame, and what only looks like one."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.geometry.se3 import make_transform
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.continuous_poses import ContinuousPoses
from supermap_cli.types.sensing import StampedPose
from support import bags


def turned(heading_rad: float) -> np.ndarray:
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])


def run(poses: Iterable[tuple[float, float, float]]) -> tuple[np.ndarray, int]:
    """The x of all poses given by (s, x in metres, heading in radians), and how many jumps were found."""
    continuous, xs, jumps = ContinuousPoses(), [], 0
    for at_s, x, heading_rad in poses:
        pose, jump = continuous.add(StampedPose(round(at_s * 1e9), make_transform(turned(heading_rad), [x, 0, 0])))
        xs.append(pose.T_odom_base[0, 3])
        jumps += jump is not None
    return np.array(xs), jumps


def test_poses_behind_a_jump_are_brought_back() -> None:
    xs, jumps = run((k / 20, 0.02 * k + (0.3 if k > 30 else 0.0), 0.0) for k in range(60))
    np.testing.assert_allclose(xs, 0.02 * np.arange(60), atol=1e-9)
    assert jumps == 1


def test_a_jump_and_the_way_back_leave_the_frame_as_it_was() -> None:
    xs, jumps = run((k / 10, 0.05 * k + (2.0 if 8 < k < 12 else 0.0), 0.0) for k in range(20))
    np.testing.assert_allclose(xs, 0.05 * np.arange(20), atol=1e-9)
    assert jumps == 2


def test_a_jump_while_the_robot_stands_is_brought_back() -> None:
    xs, jumps = run((k / 20, 0.02 * min(k, 40) + (0.3 if k > 60 else 0.0), 0.0) for k in range(80))
    assert xs[-1] == pytest.approx(0.8, abs=0.01)
    assert jumps == 1


@pytest.mark.parametrize("rate_hz", [10, 20, 50, 100])
@pytest.mark.parametrize("gap_s", [0.2, 0.3, 1.0, 2.0, 60.0])
def test_a_gap_is_no_jump(rate_hz: int, gap_s: float) -> None:
    stamps = np.arange(0, 100, 1 / rate_hz)
    kept = stamps[(stamps < 5) | (stamps > 5 + gap_s)]
    xs, jumps = run((at_s, 0.5 * at_s, 0.8 * at_s) for at_s in kept)
    assert jumps == 0
    assert xs[-1] == 0.5 * kept[-1]


def test_a_source_that_repeats_its_poses_does_not_jump() -> None:
    assert run((k / 50, (k // 10) / 5, 0.0) for k in range(200))[1] == 0


def test_poses_that_jitter_do_not_jump() -> None:
    rng = np.random.default_rng(1)
    assert run((k / 30, 0.5 * k / 30 + float(rng.normal(0, 0.05)), 0.0) for k in range(300))[1] == 0


@pytest.mark.parametrize(("frame", "last_x"), [("odom", 0.18), ("robot1/odom", 0.18), ("map", 0.48)])
def test_a_frame_of_odometry_is_continuous_and_one_of_a_map_is_not(tmp_path: Path, frame: str, last_x: float) -> None:
    size, K = (bags.WIDTH, bags.HEIGHT), (bags.FOCAL, bags.FOCAL, (bags.WIDTH - 1) / 2, (bags.HEIGHT - 1) / 2)
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        bag.transform(bags.START_NS, "base_link", "camera", bags.T_BASE_OPTICAL, static=True)
        for k in range(10):
            at = bags.START_NS + k * 50_000_000
            bag.camera_info("/camera/color/camera_info", at, "camera", size, K)
            bag.image("/camera/color/image_raw", at, "camera", bags.color_image(0), "rgb8")
            bag.image("/camera/depth/image_raw", at, "camera", bags.depth_image(), "16UC1")
            x = 0.02 * k + (0.3 if k > 6 else 0.0)
            bag.odometry("/odom", at, make_transform(np.eye(3), [x, 0, 0]), frame_id=frame)
    recording = open_bag_recording(tmp_path / "run.mcap", RecordingRequest())
    assert [*recording.poses()][-1].T_odom_base[0, 3] == pytest.approx(last_x, abs=0.01)
    assert any("the odometry jumps by 0.30 m" in warning for warning in recording.warnings) == (last_x < 0.2)
