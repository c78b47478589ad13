"""The cameras of the robot with their rigs; frames in the body's axes are turned into optical ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import Camera, EquirectangularCamera
from supermap_cli.geometry.se3 import quaternion_xyzw_from_rotation
from supermap_cli.recordings import camera_axes, messages
from supermap_cli.recordings.messages import PoseMessage
from supermap_cli.recordings.motion import PoseSource
from supermap_cli.recordings.mounting import BODY_OPTICAL, in_frame, links_of
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.rig import CameraRig, RigBuilder
from supermap_cli.recordings.topic_plan import CameraPlan, TopicPlan
from supermap_cli.recordings.transforms import Link, TransformTree
from supermap_cli.recordings.window import RecordedData

_NEAR_NS = 150_000_000
"""ns between an image and the pose that is taken for its own where only the axes are asked for."""


@dataclass(frozen=True)
class OpenedCamera:
    """A camera with its topics and its rig."""

    plan: CameraPlan
    rig: CameraRig

    @property
    def camera_id(self) -> str:
        """What the camera is called."""
        return self.plan.camera_id

    @property
    def color(self) -> str:
        """The topic of its colour images."""
        return self.plan.color.name

    @property
    def depth(self) -> str | None:
        """The topic of its depth images."""
        topic = self.plan.topic("depth")
        return topic.name if topic else None


@dataclass(frozen=True)
class RigFrames:
    """Where everything sits: the tree, which of conflicting links count, and the transforms `given` besides TF."""

    tree: TransformTree
    links: Mapping[str, Link]
    given: tuple[PoseMessage, ...] = ()

    def with_given(self, given: Sequence[PoseMessage]) -> RigFrames:
        """The same with further transforms, which count before what TF says."""
        for message in given:
            self.tree.fix(message)
        return RigFrames(self.tree, {**self.links, **links_of(tuple(given))}, (*self.given, *given))


@dataclass(frozen=True)
class RecordedMotion:
    """Poses of the base at single moments, without reading them all."""

    data: RecordedData
    source: PoseSource | None
    base_frame: str
    offset_ns: int
    shifts_ns: Mapping[str, int]

    def at(self, tree: TransformTree, stamp_ns: int) -> FloatArray | None:
        """`T_odom_base` about a stamp; `None` where none is recorded."""
        if self.source is None:
            return None
        if self.source.topic is None:
            return tree.lookup(self.source.odom_frame, self.base_frame, stamp_ns)
        name, log_ns = self.source.topic.name, stamp_ns - self.offset_ns
        nearest: tuple[int, PoseMessage] | None = None
        raws = self.data.storage.messages([name], log_ns - 2 * _NEAR_NS, log_ns + 2 * _NEAR_NS)
        for _, read in self.data.decoder.each(raws, messages.read_pose):
            pose = read.later(self.shifts_ns.get(name, 0))
            off_ns = abs(pose.stamp_ns - stamp_ns)
            if off_ns <= _NEAR_NS and (nearest is None or off_ns < nearest[0]):
                nearest = off_ns, pose
        moved = self.source.child_frame or self.base_frame
        T_odom_moved = nearest[1].transform() if nearest is not None else None
        if T_odom_moved is None or not tree.connects(moved, self.base_frame):
            return None
        T_moved_base = tree.lookup(moved, self.base_frame, stamp_ns)
        return None if T_moved_base is None else T_odom_moved @ T_moved_base


class CameraRigs:
    """Opens the cameras of a plan. `plan` and `frames` change where a camera's frame is turned."""

    def __init__(
        self,
        plan: TopicPlan,
        frames: RigFrames,
        motion: RecordedMotion,
        notes: Notes,
    ) -> None:
        self.plan = plan
        self.frames = frames
        self._motion = motion
        self._forced_model = motion.data.request.camera
        self._where = motion.data.where
        self._notes = notes

    def open_all(self) -> tuple[tuple[OpenedCamera, ...], list[RecordingError]]:
        """The cameras with their rigs, and the problems. Of several that were found by themselves those that fail are
        left out with a note, as long as one remains.
        """
        opened: list[OpenedCamera] = []
        failures: list[tuple[CameraPlan, RecordingError]] = []
        for camera in self.plan.cameras:
            try:
                if camera.problems:
                    raise camera.problems[0]
                if not self.plan.shared_problems:
                    opened.append(self._open(camera))
            except RecordingError as error:
                failures.append((camera, error))
        plan = self.plan
        grave = [failure for camera, failure in failures if camera.named or len(plan.cameras) == 1 or not opened]
        if not grave:
            for camera, failure in failures:
                self._notes.note(
                    f"camera {camera.camera_id}", f"the camera {camera.camera_id!r} is left out: {failure}"
                )
            turned = {camera.camera_id: camera.plan for camera in opened}
            cameras = tuple(turned.get(camera.camera_id, camera) for camera in plan.cameras)
            self.plan = replace(plan, cameras=cameras)
            return tuple(opened), list(plan.shared_problems)
        of_plans = [problem for camera in plan.cameras for problem in camera.problems]
        return (), [*of_plans, *plan.shared_problems, *(failure for failure in grave if failure not in of_plans)]

    def _open(self, camera: CameraPlan) -> OpenedCamera:
        rig = self._build(camera)
        if isinstance(rig.camera, EquirectangularCamera) or camera.recorded_frame_id or rig.color_frame == "":
            return OpenedCamera(camera, rig)
        if camera_axes.is_upright(self.frames.tree, rig.base_frame, rig.color_frame, rather=True):
            camera = self._turned(camera, rig)
        elif "optical" not in rig.color_frame:
            self._note_taken_as_optical(camera, rig.color_frame)
        return OpenedCamera(camera, self._build(camera))

    def _build(self, camera: CameraPlan) -> CameraRig:
        builder = RigBuilder(self.plan, self.frames.tree, self._forced_model, where=self._where)
        return builder.build(camera, self._motion.base_frame, self._motion.source)

    def _turned(self, camera: CameraPlan, rig: CameraRig) -> CameraPlan:
        """The camera in an optical frame, unless the images say that it is in one, though it looks up."""
        frame, optical = rig.color_frame, "optical" in rig.color_frame
        told = self._images_say_turned(camera, rig)
        why = "as the images agree" if told else "which stands upright in TF"
        upright = camera_axes.is_upright(self.frames.tree, rig.base_frame, frame)
        if told is False or (told is None and (optical or not upright)):
            if not optical:
                self._note_taken_as_optical(camera, frame)
            return camera
        below = camera_axes.optical_below(self.frames.tree, frame)
        if below is None:
            below = f"{frame} (turned)"
            quaternion = quaternion_xyzw_from_rotation(BODY_OPTICAL[:3, :3])
            self.frames = self.frames.with_given([PoseMessage(0, frame, below, np.zeros(3), quaternion)])
        self._notes.note(
            f"optical {camera.color.name}",
            f"{self._where}, {camera.color.name}: its frame {frame!r}, {why}, is the camera's body (x forward), no "
            f"optical frame: {below!r} is taken instead (--frame camera={frame} keeps it as it is)",
        )
        return self._with_depth(in_frame(camera, below), frame, below)

    def _with_depth(self, camera: CameraPlan, frame: str, below: str) -> CameraPlan:
        """The depth camera in its optical frame too, where it has an upright frame of its own."""
        depth = camera.topic("depth")
        own = depth.frame_id if depth is not None else ""
        if own in {"", frame, below} or not camera_axes.is_upright(self.frames.tree, self._motion.base_frame, own):
            return camera
        turned = camera_axes.optical_below(self.frames.tree, own)
        if turned is None:
            turned = f"{own} (turned)"
            quaternion = quaternion_xyzw_from_rotation(BODY_OPTICAL[:3, :3])
            self.frames = self.frames.with_given([PoseMessage(0, own, turned, np.zeros(3), quaternion)])
        choices = {
            role: replace(choice, topic=replace(choice.topic, frame_id=turned)) if role.startswith("depth") else choice
            for role, choice in camera.choices.items()
        }
        return replace(camera, choices=choices)

    def _images_say_turned(self, camera: CameraPlan, rig: CameraRig) -> bool | None:
        depth, tree = camera.topic("depth"), self.frames.tree
        if depth is None or rig.depth is None:
            return None
        T_base_camera = camera_axes.placed(tree, rig.base_frame, rig.depth.frame_id)
        if T_base_camera is None:
            return None
        model: Camera = rig.depth.camera
        seen = camera_axes.views(
            self._motion.data.storage,
            self._motion.data.decoder,
            depth,
            model,
            lambda stamp_ns: self._motion.at(tree, stamp_ns + self._motion.shifts_ns.get(depth.name, 0)),
        )
        return camera_axes.images_say_turned(seen, T_base_camera)

    def _note_taken_as_optical(self, camera: CameraPlan, frame: str) -> None:
        """An image's frame should be the optical one (z forward)."""
        optical = sorted(other for other in self.frames.tree.frames if "optical" in other)
        hint = f" (TF also has {', '.join(optical)}: --frame camera={optical[0]})" if optical else ""
        self._notes.note(
            f"optical {camera.color.name}",
            f"{camera.color.name}: its frame {frame!r} is not named an optical frame; it is taken as one, z "
            f"forward{hint}",
        )
