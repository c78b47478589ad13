"""An odometry inside a session: it is pushed what it wants, and its poses are the motion."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.backends import session_backends
from supermap_cli.drivers.odometry import run_odometry
from supermap_cli.errors import OdometryError
from supermap_cli.geometry.se3 import inverse, make_transform
from supermap_cli.plugin_manager import load_plugins
from supermap_cli.session import MappingSession
from supermap_cli.stages.session_state import SessionBackends
from supermap_cli.types.memory import MapDelta, coalesce
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose
from support import fakes as f
from support import scenes as s
from support.synthetic_room import T_BASE_CAMERA, room_sweeps

KITCHEN = (*s.ROOM, s.TABLE, s.CUP)
T_ODOM_ROBOT = make_transform(np.eye(3), [0.5, 0, 0])
"""Where the robot's own odometry puts the origin of the odometry below."""


@dataclass
class OffsetOdometry(f.FakeOdometry):
    """Moves what the robot's odometry says, at images if it wants the main camera's. Keeps what it was told."""

    inputs: frozenset[str] = frozenset({"poses", "imu", "color"})
    warnings: list[str] = field(default_factory=list)
    samples: list[ImuSample] = field(default_factory=list)
    poses: list[StampedPose] = field(default_factory=list)
    frames: list[tuple[str, int]] = field(default_factory=list)
    finished: bool = False

    def add_imu(self, sample: ImuSample) -> None:
        self.samples.append(sample)

    def register_pose(self, pose: StampedPose) -> StampedPose | None:
        self.poses.append(pose)
        return None if "color" in self.inputs else self._moved(pose)

    def register_frame(self, frame: CameraFrame) -> StampedPose | None:
        known = any(stamp_ns == frame.stamp_ns for _, stamp_ns in self.frames)
        self.frames.append((frame.camera_id, frame.stamp_ns))
        return self._moved(self.poses[-1]) if "color" in self.inputs and not known else None

    def finish(self) -> None:
        self.finished = True

    def _moved(self, pose: StampedPose) -> StampedPose:
        return StampedPose(pose.stamp_ns, T_ODOM_ROBOT @ pose.T_odom_base)


def session_with(odometry: OffsetOdometry) -> MappingSession:
    config = f.config(keyframes={"placing_s": 0.2})
    return MappingSession(config, SessionBackends(f.FakeTracker, odometry=odometry), align="none")


def push(into: MappingSession, cameras: tuple[str, ...] = ("front",)) -> list[MapDelta]:
    deltas = []
    for scene in f.film(KITCHEN):
        keyframe = scene.keyframe
        lever_arm = make_transform(np.eye(3), [0.1, 0.2, 0.3])
        into.add_imu(ImuSample(keyframe.stamp_ns, np.zeros(3), np.array([0, 0, 9.81]), lever_arm))
        into.add_pose(StampedPose(keyframe.stamp_ns, keyframe.T_map_camera @ inverse(f.T_BASE_CAMERA)))
        frame = CameraFrame(keyframe.stamp_ns, "x", keyframe.rgb, keyframe.depth_m, keyframe.camera, f.T_BASE_CAMERA)
        for camera_id in cameras:
            into.add_frame(replace(frame, camera_id=camera_id), awaits_detections=False)
        deltas += into.step()
    return [*deltas, *into.close()]


def test_its_poses_are_the_motion_and_not_those_that_are_pushed() -> None:
    odometry = OffsetOdometry()
    records = coalesce(push(session_with(odometry))).keyframes
    assert len(records) == 12
    placed = [record.T_map_base[0, 3] for record in records]
    robot = [scene.keyframe.T_map_camera[0, 3] for scene in f.film(KITCHEN)]
    np.testing.assert_allclose(np.subtract(placed, robot), 0.5, atol=0.1)
    assert len(odometry.poses) == len(odometry.frames) == 12
    assert odometry.finished


def test_an_imu_sample_reaches_it_in_its_own_frame_with_its_lever_arm() -> None:
    odometry = OffsetOdometry()
    push(session_with(odometry))
    assert len(odometry.samples) == 12
    for sample in odometry.samples:
        np.testing.assert_array_equal(sample.T_base_imu[:3, 3], [0.1, 0.2, 0.3])
        np.testing.assert_array_equal(sample.specific_force_imu, [0, 0, 9.81])


@pytest.mark.parametrize(
    ("inputs", "cameras"),
    [
        ({"color"}, {"front"}),
        ({"color.left"}, {"left"}),
        ({"color", "color.left"}, {"front", "left"}),
        ({"color", "color.front"}, {"front"}),
        (set(), set()),
    ],
)
def test_it_is_pushed_the_frames_of_the_cameras_it_wants(inputs: set[str], cameras: set[str]) -> None:
    odometry = OffsetOdometry(frozenset({"poses", *inputs}))
    push(session_with(odometry), ("front", "left", "rear"))
    assert {camera_id for camera_id, _ in odometry.frames} == cameras
    assert len(odometry.frames) == 12 * len(cameras)
    of_a_recording = OffsetOdometry(odometry.inputs)
    recording = f.FakeRecording(f.film(KITCHEN), cameras=("front", "left", "rear"))
    assert len(list(run_odometry(of_a_recording, recording))) == 12
    assert of_a_recording.frames == odometry.frames


def test_what_it_does_not_name_it_is_not_told() -> None:
    odometry = OffsetOdometry(frozenset({"poses"}))
    push(session_with(odometry))
    assert odometry.samples == odometry.frames == []
    assert len(odometry.poses) == 12


# -- the installed ones


def config_with(odometry: str | None) -> BuildConfig:
    return f.config(keyframes={"placing_s": 0.5}, backends={"odometry": odometry})


def test_kiss_icp_maps_sweeps_that_are_pushed() -> None:
    config = config_with("kiss-icp")
    into = MappingSession(config, session_backends(load_plugins(), config))
    sweeps, truth = room_sweeps(12.0)
    camera = f.film(KITCHEN)[0].keyframe.camera
    image = np.zeros((camera.height, camera.width, 3), np.uint8)
    deltas = []
    for index, sweep in enumerate(sweeps[:30]):
        if index % 4 == 3:
            frame = CameraFrame(sweep.stamp_ns - 50_000_000, "camera", image, None, camera, T_BASE_CAMERA)
            into.add_frame(frame, awaits_detections=False)
        into.add_sweep(sweep)
        deltas += into.step()
    records = coalesce([*deltas, *into.close()]).keyframes
    assert len(records) >= 6
    way = inverse(records[0].T_map_base) @ records[-1].T_map_base
    first, last = truth.T_odom_base(records[0].stamp_ns), truth.T_odom_base(records[-1].stamp_ns)
    np.testing.assert_allclose(way[:3, 3], (inverse(first) @ last)[:3, 3], atol=0.1)


def test_recorded_odometry_means_pushed_poses() -> None:
    config = config_with("recorded")
    into = MappingSession(config, session_backends(load_plugins(), config))
    assert len(coalesce(push(into)).keyframes) == 12
    without = MappingSession(config, session_backends(load_plugins(), config))
    with pytest.raises(OdometryError, match=r"no usable pose was pushed \(pushed poses\): push poses"):
        without.close()


def test_where_none_is_named_pushed_poses_are_the_motion() -> None:
    assert session_backends(load_plugins(), config_with(None)).odometry is None
