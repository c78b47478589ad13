"""`supermap inspect --doctor` and `--write-config`."""

import tomllib

import numpy as np
import pytest
from typer.testing import CliRunner

from supermap_cli.commands.build_options import request
from supermap_cli.config import UserConfig
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.main import make_app
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.inspection import inspect_recording
from support import bags

FRAME = "camera_optical_frame"


@pytest.fixture
def in_tmp(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(make_app(), ["inspect", *map(str, arguments)])


def verdicts_of(path, **request):
    report = inspect_recording(path, RecordingRequest(**request))
    return {each.role: each for each in report.verdicts}


def write_upright(path):
    """A camera whose frame is its body, and a LiDAR in TAI."""
    with bags.BagWriter(path) as bag:
        bag.transform(bags.START_NS, "base_link", "camera_link", np.eye(4), static=True)
        bag.transform(bags.START_NS, "base_link", "lidar", np.eye(4), static=True)
        for index in range(10):
            bags.write_images(bag, index, frame_id="camera_link")
            bag.odometry("/odom", bags.stamp(index), np.eye(4))
            at = bags.stamp(index)
            bag.points("/points", at + 37 * 10**9, "lidar", bags.wall_points(index), log_ns=at)
    return path


def test_every_role_has_a_verdict_with_the_option_that_mends_it(tmp_path):
    path = write_upright(tmp_path / "run.mcap")
    found = verdicts_of(path)
    assert {role: each.verdict for role, each in found.items()} == {
        "color": "weak",
        "depth": "good",
        "camera_info": "good",
        "detections": "missing",
        "masks": "weak",
        "mounting": "weak",
        "lidar": "weak",
        "imu": "weak",
        "motion": "good",
    }
    assert "--clock /points=" in found["lidar"].cure
    assert "--frame camera=camera_link" in found["mounting"].cure
    assert "--detector onnx" in found["detections"].cure


def test_a_problem_makes_its_role_missing(tmp_path):
    path = bags.write_recording(tmp_path / "run.mcap", without={"tf_static"})
    found = verdicts_of(path)
    assert found["mounting"].verdict == "missing"
    assert "--mount camera=" in found["mounting"].cure


def test_the_table_is_printed(in_tmp):
    result = run(write_upright(in_tmp / "run.mcap"), "--doctor")
    assert result.exit_code == 0
    assert "lidar        weak" in result.stdout
    assert "mend it: --clock /points=" in result.stdout


def test_the_written_configuration_gives_the_same_rig_and_is_never_overwritten(in_tmp):
    path = write_upright(in_tmp / "run.mcap")
    before = inspect_recording(path, RecordingRequest())
    assert run(path, "--write-config").exit_code == 0
    config = UserConfig.model_validate(tomllib.loads((in_tmp / "supermap.toml").read_text()))
    recording = config.build.recording
    assert recording.clocks == {"/points": -37.0}
    assert recording.mounts == {"camera": "camera_link 0 0 0 0 0 0"}
    after = inspect_recording(
        path,
        RecordingRequest(
            topics=recording.topics, frames=recording.frames, mounts=recording.mounts, clocks=recording.clocks
        ),
    )
    assert (after.poses, after.camera, after.usable_frames) == (before.poses, before.camera, before.usable_frames)
    assert not [line for line in after.warnings if "clock" in line or "frame" in line]
    again = run(path, "--write-config")
    assert isinstance(again.exception, Exception)
    assert "there is one already" in str(again.exception)


def test_the_written_configuration_keeps_all_that_was_given(in_tmp):
    path = write_upright(in_tmp / "run.mcap")
    given = ("--start", "0.2", "--end", "0.9", "--detection-tolerance", "0.05", "--limit", "image_pixels=1000000")
    assert run(path, *given, "--write-config").exit_code == 0
    config = UserConfig.model_validate(tomllib.loads((in_tmp / "supermap.toml").read_text())).build
    wanted = request(config, None, None)
    assert (wanted.start_s, wanted.end_s, wanted.detection_tolerance_s) == (0.2, 0.9, 0.05)
    assert wanted.limits.model_dump(exclude_defaults=True) == {"image_pixels": 1_000_000}
    assert open_bag_recording(path, wanted).fingerprint() == (
        open_bag_recording(path, RecordingRequest(start_s=0.2, end_s=0.9)).fingerprint()
    )
    assert request(config, 0.5, None).start_s == 0.5
