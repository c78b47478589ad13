"""Topics of poses that cannot be the robot's motion: goals, markers, what is seen from the robot itself."""

from __future__ import annotations

import re
from collections.abc import Sequence

from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.topic_names import words_of

BASE_NAMES = ("base_link", "base_footprint", "base", "body")
"""Names of the robot's base (REP-105, REP-120), the likeliest first."""

_PREFIXED_BASE = re.compile(r"(.+)[/_](?:base_link|base_footprint)")
"""A base's name behind that of its robot."""

WORLD_NAMES = frozenset({"map", "odom", "world", "earth", "utm", "odom_combined", "odometry", "camera_init"})
"""Names of frames that stand still (REP-105; robot_pose_ekf; LOAM and FAST-LIO), which are no sensor's."""

_OTHERS_WORDS = frozenset(
    {
        *("goal", "target", "setpoint", "waypoint", "waypoints", "initialpose", "clicked", "desired", "reference"),
        *("marker", "markers", "aruco", "apriltag", "tag", "tags", "charuco", "checkerboard"),
        *("object", "objects", "obstacle", "person", "people", "human", "grasp", "gripper", "ee", "eef", "tool", "tcp"),
        *("dock", "plan", "goto"),
    }
)
"""Words in the topics of poses that are not the robot's: goals, set points, markers, things, its own hand."""

ROBOT_WORDS = frozenset(
    {"robot", "base", "slam", "vio", "camera", "odom", "odometry", "localization", "amcl", "ekf", "vehicle", "drone"}
)
"""Words in the topics of poses that are the robot's own."""

_LEAST_POSES, _LEAST_POSES_HZ = 10, 0.2
"""Fewer messages than these (and than half the images), or rarer ones (1/s), follow no robot: goals and relocalisations
are told so seldom.
"""


def why_no_motion(topic: Topic, topics: Sequence[Topic], length_s: float = 0.0) -> str | None:
    """Why a topic of poses cannot be the robot's motion in a recording of that length; `None` if it can."""
    sensors = {"image", "imu"} if is_odometry(topic) else {"image", "points", "imu"}  # LiDAR odometry maps in its frame
    sensor_frames = {other.frame_id for other in topics if other.kind in sensors} - {""}
    words = words_of(topic.name) & _OTHERS_WORDS
    count = topic.channel.count
    images = max((other.channel.count for other in topics if other.kind == "image"), default=0)
    if not is_odometry(topic) and count < max(min(_LEAST_POSES, images / 2), _LEAST_POSES_HZ * length_s):
        return f"it has only {count} messages in {length_s:.0f} s"
    if topic.frame_id in sensor_frames and last_part(topic.frame_id) not in WORLD_NAMES:
        return f"it is given in the sensor's own frame {topic.frame_id!r}"
    if last_part(topic.frame_id) in BASE_NAMES:
        return f"it is given in the robot's own frame {topic.frame_id!r}"
    return f"its name says {min(words)!r}" if words else None


def last_part(frame: str) -> str:
    """r1/base_link -> base_link."""
    return frame.rpartition("/")[2]


def base_prefix(frame: str) -> str | None:
    """What stands before the name of a base: "r1" of r1/base_link and of r1_base_link; `None` for no such frame."""
    found = _PREFIXED_BASE.fullmatch(frame)
    return None if found is None else found.group(1)


def is_base(frame: str) -> bool:
    """Whether a frame is named as a robot's base, with a prefix or without."""
    return last_part(frame) in BASE_NAMES or base_prefix(frame) is not None


def is_odometry(topic: Topic) -> bool:
    """Whether a topic of poses says by its type that they are the robot's."""
    return topic.channel.msgtype.endswith("Odometry")
