"""Foxglove's own schemas, as JSON and as protobuf."""

import numpy as np
import pytest

from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from support import bags
from support.foxglove_bags import Json, Protobuf, write_foxglove


@pytest.mark.parametrize("dialect", [Json(), Protobuf()], ids=["json", "protobuf"])
@pytest.mark.parametrize("compressed", [False, True])
def test_a_foxglove_recording_is_a_recording(tmp_path, dialect, compressed):
    write_foxglove(tmp_path / "run.mcap", dialect, compressed=compressed)
    recording = open_bag_recording(tmp_path / "run.mcap", RecordingRequest())
    assert recording.streams == {"color", "depth", "lidar", "poses"}
    frames = list(recording.frames())
    assert len(frames) == 3
    assert np.array_equal(frames[2].rgb, bags.color_image(2))
    assert np.allclose(frames[0].depth_m, bags.depth_image() / 1000)
    assert frames[0].T_base_camera[0, 3] == pytest.approx(0.2)
    assert np.allclose([pose.T_odom_base[0, 3] for pose in recording.poses()], [0, 0.1, 0.2])
    sweep = next(recording.sweeps())
    assert np.allclose(sweep.points_lidar, [[1, 1, 2]] * 4)
    assert (sweep.point_stamps_ns - sweep.stamp_ns).tolist() == [90_000_000] * 4
