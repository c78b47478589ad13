"""How a robot like that of a recording is recorded: the topics that a build uses, compression, quality of service.

The options are those of `ros2 bag record` since Humble (ros2/rosbag2: README, rosbag2_storage_mcap/README; ROS 2's
documentation: "Overriding QoS Policies"), and of ROS 1's `rosbag record`.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass

from supermap_cli.recordings.opening import OpenedRecording
from supermap_cli.recordings.tf_survey import is_static

QOS_FILE = "record_qos.yaml"
_STATIC = "/tf_static"
_LATCHED = ("history: keep_all", "reliability: reliable", "durability: transient_local")
"""What /tf_static is published with (tf2_ros, StaticTransformBroadcaster): who asks for less gets nothing if it starts
after the robot."""


@dataclass(frozen=True)
class RecordProfile:
    """`topics` to record, `latched` ones among them, and `notes`: what this recording lacks or could have smaller."""

    ros1: bool
    topics: tuple[str, ...]
    latched: tuple[str, ...]
    notes: tuple[str, ...]

    def script(self) -> str:
        """Lines for a shell: the file of the quality of service, then the command."""
        names = " ".join(map(shlex.quote, self.topics))
        if self.ros1:  # rosbag keeps latched messages by itself
            return f"rosbag record --lz4 {names}\n"
        policies = "".join(f"{topic}:\n" + "".join(f"  {line}\n" for line in _LATCHED) for topic in self.latched)
        command = f"ros2 bag record --storage mcap --storage-preset-profile zstd_fast {_overrides(self.latched)}{names}"
        written = f"cat > {QOS_FILE} <<'END'\n{policies}END\n" if policies else ""
        return f"{written}{command}\n"


def _overrides(latched: tuple[str, ...]) -> str:
    return f"--qos-profile-overrides-path {QOS_FILE} " if latched else ""


def record_profile(opened: OpenedRecording) -> RecordProfile:
    """What to record of a robot like this one."""
    ros1 = any(channel.serialization == "ros1" for channel in opened.storage.channels)
    used = tuple(dict.fromkeys(_used(opened)))
    transforms = tuple(_transforms(opened))
    static = tuple(name for name in transforms if is_static(name))
    latched = static or (_STATIC,)
    topics = tuple(dict.fromkeys((*used, *transforms, *latched)))
    return RecordProfile(ros1, topics, latched, tuple(_notes(opened, static=bool(static))))


def _used(opened: OpenedRecording) -> Iterator[str]:
    """The topics that serve a role, the cameras' first."""
    for name, choice in opened.rig.plan.choices.items():
        if name != "odometry":
            yield choice.topic.name
    source = opened.rig.pose_source
    if source is not None and source.topic is not None:
        yield source.topic.name


def _transforms(opened: OpenedRecording) -> Iterator[str]:
    """The topics of TF: the static ones, and those that move where the motion or a mounting is in them."""
    rig, tree = opened.rig, opened.rig.frames.tree
    source = rig.pose_source
    sensors = {choice.topic.frame_id for choice in rig.plan.choices.values() if choice.topic.frame_id}
    mounted = all(
        sensor == rig.base_frame or (tree.connects(rig.base_frame, sensor) and tree.is_static(rig.base_frame, sensor))
        for sensor in sensors
    )
    moving_needed = source is None or source.topic is None or not mounted
    for topic in rig.topics:
        if topic.kind == "transforms" and (moving_needed or is_static(topic.name)):
            yield topic.name


def _notes(opened: OpenedRecording, *, static: bool) -> Iterator[str]:
    rig = opened.rig
    if not static:
        yield f"this recording has no {_STATIC}: see that the robot publishes where its sensors sit"
    if rig.pose_source is None:
        yield "this recording has no motion: add the odometry's topic, or /tf with odom -> base, if the robot has one"
    for camera in rig.plan.cameras:
        for role, what in (("camera_info", "calibration"), ("depth", "depth images")):
            if camera.topic(role) is None and not (role == "depth" and rig.plan.serves("lidar")):
                yield f"this recording has no {what} of the camera: add their topic, if the robot has it"
    types = {channel.topic: channel.msgtype for channel in opened.storage.channels}
    for role, choice in rig.plan.choices.items():
        name = choice.topic.name
        if role.partition(".")[0] == "color" and types.get(name, "").endswith("/Image"):
            yield f"{name} is not compressed: {name}/compressed is smaller, if the robot publishes it"
