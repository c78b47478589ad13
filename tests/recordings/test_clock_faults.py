"""Recordings whose clocks cannot be trusted: said in one line, and never a map of two times in one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.errors import RecordingError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.bag_recording import BagRecording
from supermap_cli.recordings.clock_faults import LONGEST_PAUSE_NS, StepForward, outliers, step_back, step_forward
from support import bags

FRAME = "camera_optical_frame"
SIZE, K = (bags.WIDTH, bags.HEIGHT), (bags.FOCAL, bags.FOCAL, (bags.WIDTH - 1) / 2, (bags.HEIGHT - 1) / 2)
S = 10**9
COUNT = 60


def record(
    path: Path,
    camera: Callable[[int], int] = bags.stamp,
    odometry: Callable[[int], int] = bags.stamp,
    count: int = COUNT,
) -> Path:
    """A recording at 10 Hz of log time, with the stamps of the camera and of the odometry as told."""
    with bags.BagWriter(path) as bag:
        bag.transform(bags.START_NS, "base_link", FRAME, bags.T_BASE_OPTICAL, static=True)
        for index in range(count):
            log_ns, at = bags.stamp(index), camera(index)
            bag.odometry("/odom", odometry(index), bags.pose_at(index), log_ns=log_ns)
            for topic in ("/camera/color/camera_info", "/camera/depth/camera_info"):
                bag.camera_info(topic, at, FRAME, SIZE, K, log_ns=log_ns)
            bag.image("/camera/color/image_raw", at, FRAME, bags.color_image(index), "rgb8", log_ns=log_ns)
            bag.image("/camera/depth/image_raw", at, FRAME, bags.depth_image(), "16UC1", log_ns=log_ns)
    return path


def opened(path: Path) -> BagRecording:
    recording = open_bag_recording(path, RecordingRequest())
    assert isinstance(recording, BagRecording)
    return recording


def astray(*which: int, by_ns: int) -> Callable[[int], int]:
    return lambda index: bags.stamp(index) + (by_ns if index in which else 0)


def set_back(at: int, by_s: float) -> Callable[[int], int]:
    return lambda index: bags.stamp(index) - (round(by_s * S) if index >= at else 0)


def images_with_their_poses(recording: BagRecording) -> list[tuple[int, float]]:
    """The number of each image, by its colour, and how far the robot had gone then by the pose of its stamp."""
    way = {pose.stamp_ns: pose.T_odom_base[0, 3] for pose in recording.poses()}
    return [(int(frame.rgb[0, 0, 0]), way.get(frame.stamp_ns, np.nan)) for frame in recording.frames()]


@pytest.mark.parametrize("name", ["run.mcap", "run.bag"])
@pytest.mark.parametrize("which", [(0,), (7,), (COUNT - 1,), (3, 40)])
@pytest.mark.parametrize("by_ns", [-bags.START_NS + 12345, 300 * S, 10**17])
def test_images_with_a_stamp_far_off_all_others_are_left_out_with_a_warning(tmp_path, name, which, by_ns):
    recording = opened(record(tmp_path / name, astray(*which, by_ns=by_ns)))
    found = images_with_their_poses(recording)
    assert found == [(i, pytest.approx(i / 10)) for i in range(COUNT) if i not in which]
    (warning,) = [line for line in recording.warnings if "color" in line and "far off all others" in line]
    assert f"{len(which)} of {COUNT} images" in warning
    assert (recording.start_ns, recording.end_ns) == (bags.stamp(0), bags.stamp(COUNT - 1))


@pytest.mark.parametrize("by_s", [1.0, 3.0, 50.0, 300.0])
def test_a_clock_that_was_set_back_is_an_error(tmp_path, by_s):
    clock = set_back(30, by_s)
    recording = opened(record(tmp_path / "run.mcap", clock, clock))
    with pytest.raises(RecordingError, match=rf"set back by {by_s - 0.1:.1f} s, at image 31 of 60.*cut the recording"):
        recording.frame_stamps_ns()


def test_stamps_that_start_at_zero_again_are_an_error(tmp_path):
    clock = lambda index: (index % 30 + 1) * S // 10  # noqa: E731 - a simulation that was started again
    with pytest.raises(RecordingError, match=r"set back by 2\.9 s"):
        opened(record(tmp_path / "run.mcap", clock, clock)).frame_stamps_ns()


def test_an_odometry_that_was_set_back_is_left_out_and_that_is_said(tmp_path):
    recording = opened(record(tmp_path / "run.mcap", odometry=set_back(30, 2.0)))
    found = dict(images_with_their_poses(recording))
    assert [found[index] for index in range(29)] == pytest.approx([index / 10 for index in range(29)])
    assert any("poses" in line and "left out" in line for line in recording.warnings)


def test_an_odometry_stamp_far_off_moves_nothing(tmp_path):
    recording = opened(record(tmp_path / "run.mcap", odometry=astray(5, 20, by_ns=-10 * S)))
    poses = [(pose.stamp_ns, pose.T_odom_base[0, 3]) for pose in recording.poses()]
    assert [pose for pose in poses if pose[0] >= bags.START_NS] == [
        (bags.stamp(i), pytest.approx(i / 10)) for i in range(COUNT) if i not in {5, 20}
    ]


def test_unset_stamps_are_the_time_of_recording(tmp_path):
    recording = opened(record(tmp_path / "run.mcap", lambda index: bags.stamp(index) if index % 2 else 0))
    assert recording.frame_stamps_ns().tolist() == [bags.stamp(i) for i in range(COUNT)]
    assert not recording.warnings


def test_clocks_that_start_near_zero_differ_or_drift_are_no_fault(tmp_path):
    for number, clock in enumerate(
        (
            lambda index: (index + 1) * S // 10,
            lambda index: bags.stamp(index) - 3600 * S,
            lambda index: bags.START_NS + index * S,  # ten times as fast as it was written
        )
    ):
        recording = opened(record(tmp_path / f"{number}.mcap", clock, clock))
        assert recording.frame_stamps_ns().tolist() == [clock(i) for i in range(COUNT)]
        assert not [line for line in recording.warnings if "far off" in line]


@given(st.lists(st.integers(0, 400_000_000), min_size=1, max_size=50))
def test_lateness_within_the_tolerance_is_no_step(late_ns: Sequence[int]) -> None:
    stamps_ns = np.arange(len(late_ns), dtype=np.int64) * S // 10 + bags.START_NS - np.array(late_ns)
    assert step_back(np.sort(stamps_ns)) is None
    assert not outliers(stamps_ns, np.arange(len(late_ns), dtype=np.int64) * S // 10 + bags.START_NS).any()


def test_a_stream_of_one_or_none_has_no_faults() -> None:
    for stamps_ns in (np.zeros(0, np.int64), np.array([5 * S])):
        assert step_back(stamps_ns) is None
        assert step_forward(stamps_ns, stamps_ns) is None
        assert not outliers(stamps_ns, np.zeros_like(stamps_ns)).any()


@given(st.integers(1, 59), st.integers(1_100_000_000, LONGEST_PAUSE_NS // 2))
def test_a_step_forward_is_found_where_it_is(at: int, by_ns: int) -> None:
    log_ns = bags.START_NS + np.arange(60, dtype=np.int64) * S // 10
    stamps_ns = log_ns + np.where(np.arange(60) >= at, by_ns, 0)
    assert step_forward(stamps_ns, log_ns) == StepForward(at, by_ns)
    assert step_forward(stamps_ns, stamps_ns) is None  # a pause


@given(st.lists(st.integers(0, 5 * S), min_size=2, max_size=60))
def test_images_that_are_written_late_are_no_step_forward(late_ns: Sequence[int]) -> None:
    stamps_ns = bags.START_NS + np.arange(60, dtype=np.int64) * S // 10
    log_ns = stamps_ns.copy()
    log_ns[:: max(60 // len(late_ns), 2)] += np.resize(late_ns, len(log_ns[:: max(60 // len(late_ns), 2)]))
    order = np.argsort(log_ns, kind="stable")
    assert step_forward(np.maximum.accumulate(stamps_ns[order]), log_ns[order]) is None


def test_a_step_of_days_is_one_by_either_clock() -> None:
    log_ns = bags.START_NS + np.arange(60, dtype=np.int64) * S // 10
    jump_ns = np.where(np.arange(60) >= 20, 2 * LONGEST_PAUSE_NS, 0)
    by_ns = 2 * LONGEST_PAUSE_NS + S // 10
    assert step_forward(log_ns + jump_ns, log_ns + jump_ns) == StepForward(20, by_ns, too_far=True, log_too=True)
    assert step_forward(log_ns + jump_ns, log_ns) == StepForward(20, by_ns, too_far=True)
    assert step_forward(log_ns, log_ns + jump_ns) == StepForward(20, by_ns, too_far=True)
