"""An odometry is pushed a whole recording: its poses, in the order of time."""

from __future__ import annotations

import heapq
from collections.abc import Iterator

from supermap_cli.protocols import Odometry, Recording, SensorMessage
from supermap_cli.stages.checked_answers import checked_pose
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose, Sweep


def run_odometry(odometry: Odometry, recording: Recording) -> Iterator[StampedPose]:
    """`T_odom_base`, each later than the last; "color" are the main camera's frames, "color.left" those of "left".

    Raises `OdometryError` when there is no usable motion.
    """
    streams: list[Iterator[SensorMessage]] = []
    if "imu" in odometry.inputs:
        streams.append(recording.imu())
    if "poses" in odometry.inputs:
        streams.append(recording.poses())
    if "lidar" in odometry.inputs:
        streams.append(recording.sweeps())
    streams += [recording.frames(camera_id=camera_id) for camera_id in _cameras(odometry, recording)]
    for message in heapq.merge(*streams, key=lambda message: message.stamp_ns):
        pose = checked_pose(_register(odometry, message), odometry)
        if pose is not None:
            yield pose
    odometry.finish()


def _cameras(odometry: Odometry, recording: Recording) -> Iterator[str]:
    """The cameras whose frames an odometry is pushed."""
    if any(stream.partition(".")[0] == "color" for stream in odometry.inputs):
        for camera_id in recording.cameras:
            main = camera_id == recording.cameras[0]
            if f"color.{camera_id}" in odometry.inputs or (main and "color" in odometry.inputs):
                yield camera_id


def _register(odometry: Odometry, message: SensorMessage) -> StampedPose | None:
    match message:
        case ImuSample():
            odometry.add_imu(message)
            return None
        case StampedPose():
            return odometry.register_pose(message)
        case Sweep():
            return odometry.register_sweep(message)
        case CameraFrame():
            return odometry.register_frame(message)
        case _:
            raise ValueError(f"no odometry takes {type(message).__name__}")
