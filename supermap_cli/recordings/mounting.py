"""What the user says of the mounting: frames by name (`--frame`) and transforms (`--mount`), laid over TF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.errors import ConfigError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import make_transform, quaternion_xyzw_from_rotation
from supermap_cli.recordings.messages import PoseMessage
from supermap_cli.recordings.topic_plan import CameraPlan, TopicChoice, TopicPlan
from supermap_cli.recordings.transforms import Link, TransformTree
from supermap_cli.types.limits import FARTHEST_M

SHARED_SENSORS = ("lidar", "imu")
"""Sensors besides cameras that `--frame` and `--mount` may name."""

BODY_OPTICAL: FloatArray = make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])
"""A camera's optical axes (z forward, x right) in those of its body (x forward, z up), as REP-103 has them."""

_MOST_RAD = 2 * np.pi
"""A larger angle was meant in degrees."""

_SENSOR_REACH_M = 100.0
"""Metres from its parent frame beyond which no sensor is mounted, on the longest crane; it was meant in millimetres."""

EXAMPLE = '--mount camera="0.1 0 1.2 0 0.2 0"'
"""How a mounting is written."""


@dataclass(frozen=True)
class Mount:
    """Where something sits: `T` (4, 4) is `T_parent_name`; `parent` "" is the robot's base. A camera's is that of its
    body, x forward.
    """

    name: str
    parent: str
    T: FloatArray

    @property
    def frame_id(self) -> str:
        """The frame that a sensor mounted so is in: one of its own, which nobody else publishes."""
        return f"{self.name} (as mounted)" if is_sensor(self.name) else self.name

    def message(self, base_frame: str) -> PoseMessage:
        """The mounting as a static transform."""
        T = self.T @ BODY_OPTICAL if is_camera(self.name) else self.T
        quaternion = quaternion_xyzw_from_rotation(T[:3, :3])
        return PoseMessage(0, self.parent or base_frame, self.frame_id, T[:3, 3].copy(), quaternion)


def is_camera(name: str) -> bool:
    """Whether a name is "camera" or "depth", or that of one of several cameras, as "camera.front"."""
    return name.partition(".")[0] in {"camera", "depth"}


def is_sensor(name: str) -> bool:
    """Whether a name is that of a sensor, and not of a frame."""
    return is_camera(name) or name in SHARED_SENSORS


def joint_messages(given: Mapping[str, str], tree: TransformTree) -> tuple[PoseMessage, ...]:
    """The fixed joints of a URDF that TF lacks: of links that nothing in TF leads to. Raises `ConfigError`."""
    joints = []
    for joint in parse_mounts(given, "fixed_joints:"):
        known = tree.parent_of(joint.name) is not None or tree.connects(joint.parent, joint.name)
        if joint.parent and joint.parent != joint.name and not known:
            quaternion = quaternion_xyzw_from_rotation(joint.T[:3, :3])
            joints.append(PoseMessage(0, joint.parent, joint.name, joint.T[:3, 3].copy(), quaternion))
    return tuple(joints)


def parse_mounts(given: Mapping[str, str], option: str = "--mount") -> tuple[Mount, ...]:
    """`{"camera": "0.1 0 1.2 0 0.2 0"}`: [parent] x y z roll pitch yaw. Raises `ConfigError`, naming the option."""
    mounts = []
    for name, text in given.items():
        parent, numbers = "", text.split()
        if len(numbers) == 7:
            parent, *numbers = numbers
        try:
            values = np.array([float(number) for number in numbers])
        except ValueError:
            values = np.zeros(0)
        if values.shape != (6,) or not np.isfinite(values).all():
            raise ConfigError(
                f"{option} {name}={text!r} is not understood",
                cure=f"write metres and radians, x y z roll pitch yaw on the base or after a parent's name: {EXAMPLE}",
            )
        if np.abs(values[3:]).max() > _MOST_RAD:
            raise ConfigError(
                f"{option} {name}={text!r} turns by more than a whole turn", cure="write the angles in radians"
            )
        reach_m = _SENSOR_REACH_M if is_sensor(name) else FARTHEST_M
        if np.abs(values[:3]).max() > reach_m:
            raise ConfigError(
                f"{option} {name}={text!r} lies more than {reach_m:.0f} m away",
                cure=f"write the position in metres: {EXAMPLE}",
            )
        mounts.append(Mount(name, parent, make_transform(_rotation(*values[3:].tolist()), values[:3])))
    return tuple(mounts)


def _rotation(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Fixed axes x, y, z, as in URDF: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(angle), np.sin(angle)) for angle in (roll, pitch, yaw))
    Rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    Ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    Rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    R: FloatArray = Rz @ Ry @ Rx
    return R


def check_frames(frames: Mapping[str, str]) -> None:
    """Raise `ConfigError` for what `--frame` does not know."""
    for name in frames:
        if name not in {"base", "odom"} and not is_sensor(name):
            raise ConfigError(
                f"unknown role {name!r} in --frame",
                cure="it names the frame of base, odom, camera, depth, lidar or imu, and of one camera as camera.front",
            )


def with_given_frames(plan: TopicPlan, frames: Mapping[str, str], mounts: Mapping[str, Mount]) -> TopicPlan:
    """The plan with the sensors in the frames that the user says."""
    given = {name: mount.frame_id for name, mount in mounts.items() if is_sensor(name)}
    given.update({name: frame for name, frame in frames.items() if is_sensor(name)})
    shared = {
        role: replace(choice, topic=replace(choice.topic, frame_id=given[role])) if role in given else choice
        for role, choice in plan.shared.items()
    }
    cameras = []
    for index, camera in enumerate(plan.cameras):
        names = [camera.camera_id, *([""] if index == 0 else [])]
        color = next((frame for name in names if (frame := given.get(_camera_name("camera", name)))), None)
        depth = next((frame for name in names if (frame := given.get(_camera_name("depth", name)))), None)
        turned = camera if color is None else in_frame(camera, color)
        cameras.append(turned if depth is None else _depth_in_frame(turned, depth))
    return replace(plan, shared=shared, cameras=tuple(cameras))


def _camera_name(role: str, camera_id: str) -> str:
    return f"{role}.{camera_id}" if camera_id else role


def in_frame(camera: CameraPlan, frame_id: str) -> CameraPlan:
    """A camera whose colour images, and all else in their frame, are in another frame."""
    recorded = camera.frame_id
    return replace(
        camera,
        choices={
            role: _moved(choice, frame_id) if role == "color" or choice.topic.frame_id in {recorded, ""} else choice
            for role, choice in camera.choices.items()
        },
        recorded_frame_id=camera.recorded_frame_id or recorded,
    )


def _depth_in_frame(camera: CameraPlan, frame_id: str) -> CameraPlan:
    return replace(
        camera,
        choices={
            role: _moved(choice, frame_id) if role in {"depth", "depth_camera_info"} else choice
            for role, choice in camera.choices.items()
        },
    )


def _moved(choice: TopicChoice, frame_id: str) -> TopicChoice:
    return replace(choice, topic=replace(choice.topic, frame_id=frame_id))


def same_frames(tree: TransformTree, moved: str, base: str) -> PoseMessage | None:
    """The link that makes what odometry moves and the base one frame, where TF does not connect them; else `None`."""
    if not moved or moved == base or tree.connects(moved, base):
        return None
    parent, child = (base, moved) if tree.parent_of(moved) is None else (moved, base)
    return PoseMessage(0, parent, child, np.zeros(3), np.array([0.0, 0, 0, 1]))


def links_of(given: Iterator[PoseMessage] | tuple[PoseMessage, ...]) -> dict[str, Link]:
    """The given transforms as links that count before all others."""
    return {message.child_frame_id: Link(message.frame_id, message.child_frame_id, static=True) for message in given}
