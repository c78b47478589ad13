"""The roles of topics, and how the user names the topics that serve them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from supermap_cli.errors import ConfigError
from supermap_cli.recordings.messages import Kind
from supermap_cli.types.sensing import MAIN_CAMERA

ROLES: Mapping[str, tuple[Kind, ...]] = {
    "color": ("image",),
    "depth": ("image",),
    "camera_info": ("camera_info",),
    "depth_camera_info": ("camera_info",),
    "lidar": ("points",),
    "imu": ("imu",),
    "odometry": ("pose", "transforms"),
    "detections": ("detections",),
    "masks": ("image",),
}
"""Every role and the kinds of topic that can serve it."""

CAMERA_ROLES = ("color", "depth", "camera_info", "depth_camera_info", "detections", "masks")
"""The roles that every camera has for itself; of several cameras each is named "role.camera", as "color.front"."""


@dataclass(frozen=True)
class NamedTopics:
    """The topics the user named, by role: for a lone camera and the robot as a whole, and for cameras by their id."""

    plain: Mapping[str, str] = field(default_factory=dict)
    cameras: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    @property
    def lone_camera(self) -> bool:
        """Whether a role of a camera is named without a camera's id: then there is one camera alone."""
        return not self.plain.keys().isdisjoint(CAMERA_ROLES)

    @property
    def color_cameras(self) -> tuple[str, ...]:
        """The cameras whose colour topics are named, in the order of naming."""
        return tuple(camera_id for camera_id, roles in self.cameras.items() if "color" in roles)

    def of_camera(self, camera_id: str) -> Mapping[str, str]:
        """What is named for a camera; roles without an id are a lone camera's."""
        plain = {role: topic for role, topic in self.plain.items() if role in CAMERA_ROLES}
        return {**(plain if camera_id == MAIN_CAMERA else {}), **self.cameras.get(camera_id, {})}


def role_name(role: str, camera_id: str) -> str:
    """How `--topic` names a camera's role: "color" for a lone camera, "color.front" for one of several."""
    return role if camera_id == MAIN_CAMERA else f"{role}.{camera_id}"


def parse_named_topics(named: Mapping[str, str]) -> NamedTopics:
    """Take "role" and "role.camera" apart. Raises `ConfigError` for what is no role, and for names that contradict."""
    plain: dict[str, str] = {}
    cameras: dict[str, dict[str, str]] = {}
    for key, topic in named.items():
        role, dot, camera_id = key.partition(".")
        if role not in ROLES:
            raise ConfigError(f"unknown role {role!r} in --topic", cure=f"the roles are {', '.join(ROLES)}")
        if not dot:
            plain[role] = topic
        elif role not in CAMERA_ROLES:
            raise ConfigError(f"--topic {key}: {role} is of no single camera", cure=f"write --topic {role}={topic}")
        elif not re.fullmatch(r"[A-Za-z0-9][\w-]*", camera_id):
            raise ConfigError(
                f"--topic {key}: a camera cannot be called {camera_id!r}", cure="write a word, as in color.front"
            )
        else:
            cameras.setdefault(camera_id, {})[role] = topic
    parsed = NamedTopics(plain, cameras)
    if parsed.lone_camera and parsed.cameras:
        role = next(role for role in CAMERA_ROLES if role in plain)
        camera_id = next(iter(cameras))
        raise ConfigError(
            f"--topic {role}= names no camera, while others name the camera {camera_id!r}",
            cure=f"write --topic {role}.{camera_id}=..., or name no camera anywhere",
        )
    _check_cameras(parsed)
    return parsed


def _check_cameras(named: NamedTopics) -> None:
    """Raise `ConfigError` where a camera has no colour topic while others do, or two have one image in common."""
    colors = named.color_cameras
    without = [camera_id for camera_id in named.cameras if camera_id not in colors]
    if colors and without:
        raise ConfigError(
            f"no color topic is named for the camera {without[0]!r}",
            cure=f"add --topic color.{without[0]}=/..., or write one of the cameras {', '.join(colors)}",
        )
    users: dict[str, str] = {}
    for camera_id, roles in named.cameras.items():
        for role, topic in roles.items():
            key = f"{role}.{camera_id}"
            if role in {"color", "depth"} and users.setdefault(topic, key) != key:
                raise ConfigError(
                    f"--topic {key}: {topic} is named for {users[topic]} already", cure="name a topic for each camera"
                )
