"""The real recording beside the project, and the same in other formats."""

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from support import bags

REDKITCHEN = Path(__file__).parents[3] / "shared" / "data" / "redkitchen.mcap"
pytestmark = pytest.mark.skipif(not REDKITCHEN.is_file(), reason=f"the real recording is not there: {REDKITCHEN}")


def digest(path: Path) -> str:
    recording = open_bag_recording(path, RecordingRequest(fit_color=False))
    stamps = set(recording.frame_stamps_ns()[::50].tolist())
    content = hashlib.sha256()
    for frame in recording.frames(stamps.__contains__):
        content.update(str(frame.stamp_ns).encode() + frame.rgb.tobytes() + frame.depth_m.tobytes())
    for pose in recording.poses():
        content.update(str(pose.stamp_ns).encode() + pose.T_odom_base.tobytes())
    return content.hexdigest()


def test_all_frames_and_poses_are_read():
    recording = open_bag_recording(REDKITCHEN, RecordingRequest(fit_color=False))
    stamps = recording.frame_stamps_ns()
    assert len(stamps) == 500
    assert len(list(recording.poses())) == 500
    assert recording.streams == {"color", "depth", "poses"}
    frame = next(recording.frames(lambda stamp_ns: stamp_ns == stamps[100]))
    assert frame.camera == PinholeCamera(640, 480, 585, 585, 320, 240)
    assert np.allclose(frame.T_base_camera[:3, :3], [[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    assert 0.8 < (frame.depth_m > 0).mean() < 0.95
    assert recording.warnings == ()


def test_the_same_recording_in_other_formats_gives_the_same_frames(tmp_path):
    convert = Path(sys.executable).with_name("rosbags-convert")
    expected = digest(REDKITCHEN)
    for target in (tmp_path / "kitchen.bag", tmp_path / "kitchen"):
        subprocess.run([convert, "--src", REDKITCHEN, "--dst", target], check=True, capture_output=True)
        assert digest(target) == expected


def test_cut_off_it_is_read_up_to_the_cut(tmp_path):
    recording = open_bag_recording(
        bags.cut_file(REDKITCHEN, tmp_path / "cut.mcap", 0.3), RecordingRequest(fit_color=False)
    )
    count = len(recording.frame_stamps_ns())
    assert 120 < count < 180
    assert any("cut off" in line for line in recording.warnings)
    last = int(recording.frame_stamps_ns()[-1])
    assert [frame.stamp_ns for frame in recording.frames(lambda stamp_ns: stamp_ns == last)] == [last]
