"""The latest LiDAR sweeps as the depth of an image."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from supermap_cli.geometry.se3 import make_transform
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.stages.sweep_buffer import HALF_WINDOW_NS, SweepBuffer
from supermap_cli.types.sensing import StampedPose, Sweep
from support import bags

STEP_NS = 20_000_000


def pose_at(stamp_ns: int) -> StampedPose:
    """1 m/s along x."""
    return StampedPose(stamp_ns, make_transform(np.eye(3), [(stamp_ns - bags.START_NS) / 1e9, 0, 0]))


def straight(seconds: float) -> Trajectory:
    return Trajectory(pose_at(bags.START_NS + k * STEP_NS) for k in range(-10, round(seconds * 1e9 / STEP_NS)))


def sweep_at(stamp_ns: int) -> Sweep:
    return Sweep(stamp_ns, "lidar", np.ones((3, 3)), np.full(3, stamp_ns), np.eye(4))


def test_a_sweep_becomes_a_depth_image_that_holds_together(tmp_path: Path) -> None:
    path = bags.write_recording(tmp_path / "run.mcap", frames=8, without={"depth"}, lidar=True)
    recording = open_bag_recording(path, RecordingRequest())
    buffer = SweepBuffer(straight(2.0))
    for sweep in recording.sweeps():
        buffer.add(sweep)
    for index, frame in enumerate(recording.frames()):
        complete = buffer.complete(frame)
        assert complete.depth_m is not None
        assert complete.returns_camera is not None
        depth = complete.depth_m
        assert np.allclose(depth[depth > 0], bags.WALL_M + 0.4 - index / 10, atol=2e-3)
        assert (depth > 0).mean() > 0.95


def test_beyond_the_trajectory_there_is_no_depth(tmp_path: Path) -> None:
    path = bags.write_recording(tmp_path / "run.mcap", frames=2, without={"depth"}, lidar=True)
    recording = open_bag_recording(path, RecordingRequest())
    buffer = SweepBuffer(Trajectory())
    for sweep in recording.sweeps():
        buffer.add(sweep)
    complete = buffer.complete(next(recording.frames()))
    assert complete.depth_m is not None
    assert not complete.depth_m.any()


def test_an_image_waits_for_the_sweeps_about_it_and_for_their_poses() -> None:
    trajectory = Trajectory()
    buffer = SweepBuffer(trajectory)
    buffer.add(sweep_at(0))
    buffer.add(sweep_at(100_000_000))
    assert not buffer.is_complete(0)  # further ones may come within the window
    buffer.add(sweep_at(200_000_000))
    assert not buffer.is_complete(0)  # no poses yet
    trajectory.append(StampedPose(100_000_000, np.eye(4)))
    assert buffer.is_complete(0)


def test_what_no_image_needs_is_forgotten() -> None:
    buffer = SweepBuffer(Trajectory())
    for k in range(100):
        buffer.add(sweep_at(k * 100_000_000))
        buffer.forget_before(k * 100_000_000)
    assert buffer.nearest(9_900_000_000) is not None
    assert buffer.nearest(9_900_000_000 - 5 * HALF_WINDOW_NS) is None


def test_two_lidars_may_share_a_stamp() -> None:
    buffer = SweepBuffer(straight(1.0))
    for frame_id, count in (("front", 10), ("rear", 25)):
        points = np.full((count, 3), 2.0)
        stamps_ns = np.full(count, bags.START_NS)
        buffer.add(Sweep(bags.START_NS, frame_id, points, stamps_ns, np.eye(4)))
    assert len(buffer.returns_about(bags.START_NS, np.eye(4))) == 35
