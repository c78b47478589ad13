"""Which topic serves which role of which camera, and of the robot as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.roles import role_name
from supermap_cli.recordings.survey import Topic


@dataclass(frozen=True)
class TopicChoice:
    """The topic that serves a role, and why it rather than another; `named` says that the user named it."""

    role: str
    topic: Topic
    reason: str
    named: bool = False


@dataclass(frozen=True)
class CameraPlan:
    """Which topic serves which role of one camera (`CAMERA_ROLES`), and what stands in its way.

    `named` says that the user named some of its topics; `recorded_frame_id` is what its images say, where they were put
    into another frame; `doubts` are what was left out, and why.
    """

    camera_id: str
    choices: Mapping[str, TopicChoice]
    problems: tuple[RecordingError, ...] = ()
    named: bool = False
    recorded_frame_id: str = ""
    doubts: tuple[str, ...] = ()

    def topic(self, role: str) -> Topic | None:
        """The topic of a role, if there is one."""
        choice = self.choices.get(role)
        return choice.topic if choice else None

    @property
    def color(self) -> Topic:
        """The colour images. Raises `KeyError` where there are none (`problems` says so)."""
        return self.choices["color"].topic

    @property
    def frame_id(self) -> str:
        """The colour images' frame: their own, else their camera_info's; "" where neither says."""
        topics = (self.topic(role) for role in ("color", "camera_info"))
        return next((topic.frame_id for topic in topics if topic is not None and topic.frame_id), "")


@dataclass(frozen=True)
class TopicPlan:
    """Which topic serves which role, and what stands in the way (`problems`, each with its cure).

    `shared` holds the roles of the robot as a whole (LiDAR, IMU, odometry); `cameras`, of which the main one is the
    first, those of each camera. A lone camera is there also where it has no topic.
    """

    cameras: tuple[CameraPlan, ...]
    shared: Mapping[str, TopicChoice]
    shared_problems: tuple[RecordingError, ...] = ()

    @property
    def main(self) -> CameraPlan:
        """The main camera."""
        return self.cameras[0]

    @property
    def problems(self) -> tuple[RecordingError, ...]:
        """What stands in the way, the cameras' first."""
        return (*(problem for camera in self.cameras for problem in camera.problems), *self.shared_problems)

    @property
    def choices(self) -> Mapping[str, TopicChoice]:
        """All choices by the role's name for `--topic`: "color" of a lone camera, "color.front" of several."""
        of_cameras = {
            role_name(role, camera.camera_id): choice
            for camera in self.cameras
            for role, choice in camera.choices.items()
        }
        return {**of_cameras, **self.shared}

    def topic(self, role: str) -> Topic | None:
        """The topic of a role, if there is one; of the main camera, for the role of a camera."""
        choice = self.main.choices.get(role) or self.shared.get(role)
        return choice.topic if choice else None

    def serves(self, role: str) -> bool:
        """Whether there is a topic for a role, of any camera."""
        return role in self.shared or any(role in camera.choices for camera in self.cameras)
