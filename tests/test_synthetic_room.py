from pathlib import Path

import numpy as np
import pytest

from supermap_cli.geometry.se3 import transform_points
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.mapping.structure import coarse_depth
from supermap_cli.recordings import open_bag_recording
from support import synthetic_room as room


@pytest.mark.parametrize(
    ("rig", "streams"),
    [
        ("rgbd", {"color", "depth", "poses", "detections", "masks"}),
        ("lidar", {"color", "lidar", "imu", "detections", "masks"}),
    ],
)
def test_a_rig_records_its_streams(tmp_path: Path, rig: room.Rig, streams: set[str]) -> None:
    room.write_room_recording(tmp_path / "room.mcap", seconds=1.0, rig=rig)
    recording = open_bag_recording(tmp_path / "room.mcap", RecordingRequest())
    assert recording.streams == streams
    assert not recording.warnings
    assert len(list(recording.detections())) == 5


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        room.write_room_recording(tmp_path / name, seconds=0.6, seed=seed)
    a, b, c = ((tmp_path / name).read_bytes() for name in "abc")
    assert a == b
    assert a != c


def test_masked_depth_lies_in_the_true_boxes(tmp_path: Path) -> None:
    path = tmp_path / "room.mcap"
    truth = room.write_room_recording(path, seconds=2.0, noise=0.0)
    recording = open_bag_recording(path, RecordingRequest())
    trajectory = Trajectory(recording.poses())
    for frame, detections in zip(recording.frames(), recording.detections(), strict=True):
        T_odom_base = trajectory.at(frame.stamp_ns)
        assert T_odom_base is not None
        depth = coarse_depth(frame, T_odom_base, step_px=1)
        assert depth is not None
        for label, mask in zip(detections.labels, detections.masks, strict=True):
            assert mask is not None
            rows, columns = np.nonzero(mask.full(room.HEIGHT, room.WIDTH))
            pixels_uv = np.column_stack([columns, rows]).astype(float)
            points = frame.camera.back_project(pixels_uv, depth.depth_m[rows, columns].astype(float))
            center = np.median(transform_points(depth.T_frame_camera, points), axis=0)
            boxes = [obj.box for obj in truth.objects if obj.label == label]
            assert min(np.abs(center - box.center).max() - box.size.max() / 2 for box in boxes) < 0.05


def test_the_second_visit_differs_by_three_things(tmp_path: Path) -> None:
    first, second = (
        {obj.name: obj.box.center.tolist() for obj in room.write_visit(tmp_path / f"{k}", k, seconds=0.4).objects}
        for k in (1, 2)
    )
    assert first.keys() - second.keys() == {"cup-2"}
    assert second.keys() - first.keys() == {"suitcase"}
    assert [name for name in first.keys() & second.keys() if first[name] != second[name]] == ["chair-3"]
