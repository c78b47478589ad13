"""What the simulator writes is what the program's own reader finds."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.geometry.se3 import make_transform
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.inspection import inspect_recording
from supermap_cli.simulation.recording.messages import Outgoing, RecordingFile, RigMessages, number_image
from supermap_cli.simulation.rigs import SimulatedRig, panorama_rig, rgbd_rig
from supermap_cli.simulation.sensors.lidar_sensor import LidarScan
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask, no_detections

START_NS = 1_700_000_000_000_000_000
STEP_NS = 100_000_000
YAW_30 = make_transform([[np.cos(0.5), -np.sin(0.5), 0], [np.sin(0.5), np.cos(0.5), 0], [0, 0, 1]], [1.0, 2.0, 0.0])


def write(path: Path, rig: SimulatedRig, messages: Iterable[Outgoing]) -> Path:
    with RecordingFile(path, RigMessages(rig)) as file:
        for message in messages:
            file.write(message)
    return path


def drive(rig: SimulatedRig, images: int = 3) -> list[Outgoing]:
    """A robot that stands still while the truth says it is 100 m away."""
    writes, sent = RigMessages(rig), []
    (camera,) = rig.cameras
    rgb = np.full((camera.model.height, camera.model.width, 3), (200, 100, 50), np.uint8)
    for k in range(images):
        at = START_NS + k * STEP_NS
        sent += [*([writes.mounting(at)] if k == 0 else []), *writes.odometry(at, YAW_30)]
        sent += [writes.true_pose(at, make_transform(np.eye(3), [100.0, 0, 0]))]
        sent += [writes.imu(at, np.array([0.1, 0.2, 0.3]), np.array([0, 0, 9.81]))]
        sent += writes.color(camera, at, rgb)
        if rig.depth is not None:
            sent += writes.depth(camera, at, np.full(rgb.shape[:2], 1.234, np.float32))
        else:
            scan = LidarScan(
                np.full((5, 3), 2.0, np.float32), at + np.arange(5), np.ones(5, np.float32), np.zeros(5, np.int64)
            )
            sent += [writes.points(at, scan)]
    return sent


def two_detections() -> Detections:
    """A large one, and a small one in front of it."""
    return Detections(
        START_NS,
        np.array([[10, 20, 110, 220.5], [40, 50, 60, 80]], np.float32),
        np.array([0.75, 0.5], np.float32),
        ((Hypothesis("desk", 0.75), Hypothesis("table", 0.25)), (Hypothesis("mug", 0.5),)),
        (RegionMask(10, 20, np.ones((200, 100), bool)), RegionMask(40, 50, np.ones((30, 20), bool))),
    )


def test_the_reader_finds_every_stream_of_the_rgbd_rig(tmp_path: Path) -> None:
    rig = rgbd_rig()
    messages = [*drive(rig), *RigMessages(rig).detections(two_detections(), START_NS + 5 * STEP_NS)]
    recording = open_bag_recording(write(tmp_path / "run.mcap", rig, messages), RecordingRequest(fit_color=False))
    assert recording.streams == {"color", "depth", "poses", "imu", "detections", "masks"}
    frames = list(recording.frames())
    assert [frame.stamp_ns for frame in frames] == [START_NS + k * STEP_NS for k in range(3)]
    assert frames[0].camera == rig.cameras[0].model
    np.testing.assert_allclose(frames[0].T_base_camera, rig.cameras[0].T_base_camera, atol=1e-9)
    np.testing.assert_allclose(frames[0].rgb[100, 100], (200, 100, 50), atol=3)
    np.testing.assert_allclose(frames[0].depth_m, 1.234, atol=1e-6)
    sample = next(recording.imu())
    np.testing.assert_allclose(sample.angular_rate_base, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(sample.specific_force_base, [0, 0, 9.81])


def test_the_robots_own_odometry_is_used_and_not_the_truth(tmp_path: Path) -> None:
    rig = rgbd_rig()
    path = write(tmp_path / "run.mcap", rig, drive(rig))
    report = inspect_recording(path, RecordingRequest())
    assert {role.role: role.topic for role in report.roles}["odometry"] == "/odom"
    assert report.base_frame == "base_link"
    recording = open_bag_recording(path, RecordingRequest())
    np.testing.assert_allclose(next(recording.poses()).T_odom_base, YAW_30, atol=1e-9)


def test_the_truth_serves_where_there_is_nothing_else(tmp_path: Path) -> None:
    rig = rgbd_rig()
    without = [message for message in drive(rig) if message.topic not in {"/odom", "/tf"}]
    recording = open_bag_recording(write(tmp_path / "run.mcap", rig, without), RecordingRequest())
    assert next(recording.poses()).T_odom_base[0, 3] == pytest.approx(100)


def test_the_reader_finds_every_stream_of_the_panorama_rig(tmp_path: Path) -> None:
    rig = panorama_rig()
    recording = open_bag_recording(write(tmp_path / "run.mcap", rig, drive(rig, images=2)), RecordingRequest())
    assert recording.streams == {"color", "lidar", "poses", "imu"}
    assert next(recording.frames()).camera == rig.cameras[0].model
    sweep = next(recording.sweeps())
    np.testing.assert_allclose(sweep.points_lidar, 2.0)
    np.testing.assert_allclose(sweep.point_stamps_ns - START_NS, np.arange(5), atol=256)
    np.testing.assert_allclose(sweep.T_base_lidar, rig.T_base_lidar, atol=1e-9)


def test_detections_come_back_with_all_hypotheses_and_masks_though_they_came_late(tmp_path: Path) -> None:
    rig, found = rgbd_rig(), two_detections()
    messages = [*drive(rig), *RigMessages(rig).detections(found, START_NS + 5 * STEP_NS)]
    recording = open_bag_recording(write(tmp_path / "run.mcap", rig, messages), RecordingRequest(fit_color=False))
    (read,) = recording.detections()
    assert read.stamp_ns == START_NS
    assert read.hypotheses == found.hypotheses
    np.testing.assert_allclose(read.boxes_xyxy, found.boxes_xyxy)
    large, small = (mask.full(480, 640) for mask in found.masks if mask is not None)
    masks = [mask.full(480, 640) for mask in read.masks if mask is not None]
    np.testing.assert_array_equal(masks[0], large & ~small)
    np.testing.assert_array_equal(masks[1], small)


def test_an_image_without_detections_is_told_as_such(tmp_path: Path) -> None:
    rig = rgbd_rig()
    messages = [*drive(rig), *RigMessages(rig).detections(no_detections(START_NS), START_NS + 5 * STEP_NS)]
    recording = open_bag_recording(write(tmp_path / "run.mcap", rig, messages), RecordingRequest(fit_color=False))
    assert [len(found) for found in recording.detections()] == [0]


def test_no_detections_give_an_empty_number_image() -> None:
    assert not number_image(no_detections(0), 4, 6).any()
