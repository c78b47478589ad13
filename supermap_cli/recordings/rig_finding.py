"""The robot as one rig: which topics, frames and clocks belong together, and where the sensors sit on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from supermap_cli.errors import CalibrationError, RecordingError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.recordings.camera_finding import CameraFinder, RecordedRobot, clock_problems, plan_named_cameras
from supermap_cli.recordings.camera_rigs import CameraRigs, OpenedCamera, RecordedMotion, RigFrames
from supermap_cli.recordings.clock_by_motion import MotionClock
from supermap_cli.recordings.messages import PoseMessage
from supermap_cli.recordings.motion import MotionFinder, PoseSource, find_base_frame
from supermap_cli.recordings.motion_agreement import MotionAgreement
from supermap_cli.recordings.mounting import check_frames, joint_messages, parse_mounts, same_frames, with_given_frames
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.robots import topics_of_robot
from supermap_cli.recordings.roles import NamedTopics, parse_named_topics
from supermap_cli.recordings.sensor_clocks import OTHER_CLOCK_NS, check_clocks, sensor_clocks
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.tf_survey import SurveyedTransforms, is_static, survey_transforms
from supermap_cli.recordings.topic_plan import TopicPlan
from supermap_cli.recordings.topics import plan_topics
from supermap_cli.recordings.transforms import TransformTree
from supermap_cli.recordings.window import RecordedData, Window, find_window
from supermap_cli.types.limits import FARTHEST_M


@dataclass(frozen=True)
class Rig:
    """What was found in a recording.

    `robot` is the one that is meant, of several; `problems` stand in the way of any build, the gravest first;
    `cameras`, the main one first, are those that can be used, and none where a problem concerns them. `shifts_ns` are
    added to the stamps of topics whose clock is not the camera's; `origin` (3,) in metres is taken off recorded
    positions. `not_motion` are topics of poses that are not the robot's, with the reason.
    """

    robot: str | None
    topics: tuple[Topic, ...]
    plan: TopicPlan
    frames: RigFrames
    pose_source: PoseSource | None
    base_frame: str
    cameras: tuple[OpenedCamera, ...]
    window: Window
    shifts_ns: dict[str, int]
    origin: FloatArray
    problems: tuple[RecordingError, ...]
    not_motion: Mapping[str, str] = field(default_factory=dict)
    notes: Notes = field(default_factory=Notes)


def find_rig(data: RecordedData, topics: Sequence[Topic], notes: Notes) -> Rig:
    """The rig that the recording is of, as one robot. Where samples of TF do not connect it, all of TF is read.

    Raises `RecordingError` where it cannot be told which robot is meant, and `ConfigError` for options of no meaning.
    """
    finder = _RigFinder(data, topics, notes)
    surveyed = finder.surveyed or survey_transforms(data.storage, data.decoder, finder.topics)
    rig = finder.find(surveyed)
    if (rig.problems or rig.pose_source is None) and not surveyed.whole:
        rig = finder.find(survey_transforms(data.storage, data.decoder, finder.topics, whole=True))
    notes.take(rig.notes)
    return rig


class _RigFinder:
    """Finds the rig, with one knowledge of TF or another."""

    def __init__(self, data: RecordedData, topics: Sequence[Topic], notes: Notes) -> None:
        self._data = data
        self._request = request = data.request
        self._where = where = data.where
        check_frames(request.frames)
        check_clocks(request.clocks, [channel.topic for channel in data.storage.channels])
        self._mounts = {mount.name: mount for mount in parse_mounts(request.mounts)}
        self._named: NamedTopics = parse_named_topics(request.topics)
        named = set(request.topics.values())
        self.surveyed: SurveyedTransforms | None = None

        def tree() -> TransformTree:
            self.surveyed = survey_transforms(data.storage, data.decoder, topics)
            return self.surveyed.tree

        self.robot, self.topics = topics_of_robot(topics, request.robot, named, where, notes, tree)
        if len(self.topics) < len(topics):
            self.surveyed = None
        planned = (plan_named_cameras if self._named.color_cameras else plan_topics)(self.topics, self._named, where)
        self._plan = planned

    def find(self, surveyed: SurveyedTransforms) -> Rig:
        """The rig, its problems among what is found."""
        notes = Notes()
        for line in surveyed.warnings:
            notes.note(line, f"{self._where}, {line}")
        plan = with_given_frames(self._plan, self._request.frames, self._mounts)
        frames = RigFrames(surveyed.tree, surveyed.links)
        source, base_frame = None, ""
        cameras: tuple[OpenedCamera, ...] = ()
        problems: list[RecordingError] = []
        shifts: dict[str, int] = {}
        not_motion: dict[str, str] = {}
        window = find_window(self._data, _leading(plan), notes)
        try:
            frames = frames.with_given([mount.message("") for mount in self._mounts.values() if mount.parent])
            frames = self._with_joints(frames, notes)
            length_s = (self._data.storage.end_ns - self._data.storage.start_ns) / 1e9
            motion = MotionFinder(self.topics, frames.tree, self._request.frames, length_s)
            source, not_motion = motion.find(plan, notes), motion.not_motion()
            if source is not None:
                source = MotionAgreement(self._data, self.topics, frames.tree).checked(source, plan, notes)
            base_frame = self._base_frame(plan, source, frames.tree, notes)
            frames = frames.with_given(self._links(source, base_frame, frames.tree, notes))
            plan = self._cameras_of(
                plan, RecordedRobot(frames.tree, base_frame, self._data.storage, self._data.decoder), notes
            )
            plan = with_given_frames(plan, self._request.frames, self._mounts)
            shifts, of_clocks = self._clocks(plan, source, (frames.tree, base_frame), notes)
            plan = replace(plan, shared_problems=(*plan.shared_problems, *of_clocks))
            moved = RecordedMotion(self._data, source, base_frame, window.offset_ns, shifts)
            rigs = CameraRigs(plan, frames, moved, notes)
            cameras, problems = rigs.open_all()
            plan, frames = rigs.plan, rigs.frames
        except CalibrationError as error:
            problems = [*plan.problems, CalibrationError(error.what, where=error.where or self._where, cure=error.cure)]
        _note_doubts(plan, source, self._where, notes)
        origin = _origin(source, frames.tree, self._where, notes)
        return Rig(
            self.robot,
            self.topics,
            plan,
            frames,
            source,
            base_frame,
            cameras,
            window,
            shifts,
            origin,
            tuple(problems),
            not_motion,
            notes,
        )

    def _with_joints(self, frames: RigFrames, notes: Notes) -> RigFrames:
        """With the URDF's fixed joints where TF has none."""
        joints = joint_messages(self._request.fixed_joints, frames.tree)
        if joints:
            named = ", ".join(f"{joint.frame_id} -> {joint.child_frame_id}" for joint in joints[:3])
            more = f" and {len(joints) - 3} more" if len(joints) > 3 else ""
            notes.note("fixed joints", f"{self._where}: TF lacks {named}{more}: taken from the robot's URDF")
        return frames.with_given(joints)

    def _base_frame(self, plan: TopicPlan, source: PoseSource | None, tree: TransformTree, notes: Notes) -> str:
        lidar = plan.topic("lidar")
        sensor_frame = plan.main.frame_id or (lidar.frame_id if lidar else "")
        mounted = {mount.frame_id for mount in self._mounts.values() if not mount.parent}
        if sensor_frame in mounted:
            sensor_frame = ""
        return find_base_frame(source, tree, sensor_frame, self._request.frames, notes) or "base_link"

    def _links(
        self, source: PoseSource | None, base_frame: str, tree: TransformTree, notes: Notes
    ) -> list[PoseMessage]:
        """The mountings on the base, and the link that joins what odometry moves with the base that the user named."""
        links = [mount.message(base_frame) for mount in self._mounts.values() if not mount.parent]
        moved = source.child_frame if source is not None else ""
        if "base" in self._request.frames and (same := same_frames(tree, moved, base_frame)) is not None:
            notes.note(
                "same frame",
                f"{self._where}: TF does not connect {moved!r}, which odometry moves, and {base_frame!r}: they are "
                f'taken as one frame (else say where it sits: --mount {moved}="{base_frame} x y z roll pitch yaw")',
            )
            links.append(same)
        return links

    def _cameras_of(self, plan: TopicPlan, robot: RecordedRobot, notes: Notes) -> TopicPlan:
        """The plan with several cameras where there are several."""
        if self._named.color_cameras:
            given = self._request.clocks.keys()
            cameras = [camera for camera in plan.cameras if camera.color.name not in given]
            clocks = clock_problems(cameras, robot, self._where)
            return replace(plan, shared_problems=(*plan.shared_problems, *clocks))
        if self._named.lone_camera:
            return plan
        finder = CameraFinder(self.topics, plan, self._named, self._where)
        return finder.lone() if self._request.camera else finder.find(robot, notes)

    def _clocks(
        self, plan: TopicPlan, source: PoseSource | None, moved: tuple[TransformTree, str], notes: Notes
    ) -> tuple[dict[str, int], list[CalibrationError]]:
        """What is added to the stamps of each topic, and what cannot be decided of it; `moved` is TF and the base."""
        sensors = [topic for role in ("depth", "lidar", "imu") if (topic := plan.topic(role)) is not None]
        if source is not None and source.topic is not None:
            sensors.append(source.topic)
        moving = [topic for topic in self.topics if topic.kind == "transforms" and not is_static(topic.name)]
        reference = plan.main.choices["color"].topic if "color" in plan.main.choices else None

        def by_motion(topic: Topic, shift_ns: int) -> bool | None:
            if source is None or reference is None:
                return None
            told = [source.topic] if source.topic is not None else moving
            if any(abs(each.clock_offset_ns - reference.clock_offset_ns) >= OTHER_CLOCK_NS for each in told):
                return None
            return MotionClock(self._data, source, *moved, tuple(moving)).is_off(topic, shift_ns)

        shifts, problems = sensor_clocks(
            reference, [*sensors, *moving], self._request.clocks, by_motion, self._where, notes
        )
        for camera in plan.cameras:
            color = camera.topic("color")
            for role in ("detections", "masks"):
                topic = camera.topic(role)
                if color is not None and topic is not None and color.name in shifts:
                    shifts.setdefault(topic.name, shifts[color.name])
        return shifts, problems


def _leading(plan: TopicPlan) -> Topic | None:
    """The topic whose clock is the recording's."""
    return next((topic for role in ("color", "lidar", "odometry") if (topic := plan.topic(role))), None)


def _note_doubts(plan: TopicPlan, source: PoseSource | None, where: str, notes: Notes) -> None:
    """What speaks against samples of topics that are used."""
    used = {choice.topic.name: choice.topic for choice in plan.choices.values()}
    if source is not None and source.topic is not None:
        used[source.topic.name] = source.topic
    for camera in plan.cameras:
        for doubt in camera.doubts:
            notes.note(doubt, f"{where}, {doubt}")
    for topic in used.values():
        for doubt in topic.doubts:
            notes.note(f"doubt {topic.name} {doubt}", f"{where}, {topic.name}: {doubt}")


_FAR_M = 4_000.0
"""Metres from the origin from which positions are of the world (as UTM) and not of a robot's way: what is mapped keeps
its millimetres in 32 bits up to there (steps of 0.24 mm below 4,096 m).
"""

ORIGIN_STEP_M = 100.0
"""Metres to which an origin is rounded, so that two recordings of one place mostly have the same one."""


def _origin(source: PoseSource | None, tree: TransformTree, where: str, notes: Notes) -> FloatArray:
    """(3,) metres that are taken off positions, so that they are near 0: none for what is near it already. A receiver
    without a fix tells 0 at first; what most samples say counts.
    """
    origin: FloatArray = np.zeros(3)
    if source is None:
        return origin
    positions = [pose.position for pose in source.topic.poses] if source.topic else _moving_positions(source, tree)
    if not positions:
        return origin
    middle = np.median(positions, axis=0)
    near = [position for position in positions if np.abs(position - middle).max() < FARTHEST_M]
    usual = near[0] if near else min(positions, key=lambda position: float(np.abs(position - middle).max()))
    if np.abs(usual).max() < _FAR_M:
        return origin
    origin[:2] = np.round(usual[:2] / ORIGIN_STEP_M) * ORIGIN_STEP_M
    if abs(usual[2]) >= _FAR_M:
        origin[2] = np.round(usual[2] / ORIGIN_STEP_M) * ORIGIN_STEP_M
    x, y, z = origin
    notes.note(
        "origin",
        f"{where}, {source.description}: positions are in coordinates of the world, as UTM; ({x:.0f}, {y:.0f}, "
        f"{z:.0f}) m are taken off them, add it to places in the map",
    )
    return origin


def _moving_positions(source: PoseSource, tree: TransformTree) -> list[FloatArray]:
    """(3,) each: where the samples of TF have the base in odom, each of its moving links as far as it was sampled."""
    _, chain = tree.path(source.odom_frame, source.child_frame)
    moving = [edge for edge in chain if edge.samples]
    if all(edge.static for edge in moving):
        return []
    leading = max((edge for edge in moving if not edge.static), key=lambda edge: len(edge.samples))
    others = [edge.samples[len(edge.samples) // 2][1] for edge in moving]
    at = moving.index(leading)
    positions = []
    for _, T in leading.samples:
        T_odom_base = np.eye(4)
        for edge_T in reversed([*others[:at], T, *others[at + 1 :]]):
            T_odom_base = T_odom_base @ edge_T
        positions.append(T_odom_base[:3, 3])
    return positions
