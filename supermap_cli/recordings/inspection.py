"""What is in a recording, what a build would use for what, what is missing, and how to mend it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings.bag_recording import BagRecording
from supermap_cli.recordings.depth_values import depth_problem
from supermap_cli.recordings.doctor import RoleVerdict, explicit_settings, verdicts
from supermap_cli.recordings.opening import OpenedCamera, OpenedRecording, open_recording
from supermap_cli.recordings.roles import CAMERA_ROLES, ROLES
from supermap_cli.recordings.storage import Channel
from supermap_cli.recordings.topic_plan import TopicChoice

_GAP_PERIODS = 5
"""Periods of a topic that a pause must last to be reported as a gap."""


@dataclass(frozen=True)
class TopicReport:
    """One topic in the window: its rate in Hz (the median's), its longest gap in seconds and when that began.

    `role` is what a build would use it for, "" for nothing; `frame_id` is that of its first message.
    """

    topic: str
    type: str
    count: int
    rate_hz: float | None
    longest_gap_s: float | None
    gap_at_s: float | None
    frame_id: str
    role: str

    @property
    def has_gap(self) -> bool:
        """Whether its longest gap is much longer than its period."""
        return bool(self.rate_hz and self.longest_gap_s and self.longest_gap_s * self.rate_hz > _GAP_PERIODS)


@dataclass(frozen=True)
class RoleReport:
    """The topic that serves a role and why; `topic` is `None` where none does.

    `camera` is the id of the camera that it serves, of several; `None` for a lone camera and the robot as a whole.
    """

    role: str
    topic: str | None
    reason: str
    camera: str | None = None


@dataclass(frozen=True)
class CameraReport:
    """One camera a build would use: its colour topic and frame, its model, and how many usable frames it has."""

    camera_id: str
    topic: str
    frame_id: str
    model: str
    usable_frames: int


@dataclass(frozen=True)
class EdgeReport:
    """One link of the TF tree."""

    parent: str
    child: str
    static: bool


@dataclass(frozen=True)
class ProblemReport:
    """Something that keeps a build from working, and its cure."""

    what: str
    where: str | None
    cure: str | None


@dataclass(frozen=True)
class Inspection:
    """The whole report. A build can work if there are no `problems`.

    `poses` says where motion comes from ("LiDAR odometry" without recorded poses), `usable_frames` counts colour images
    that have what a build needs, of all `cameras` together; `verdicts` judge every role; `settings` are the entries of
    `[build.recording]` that make all choices explicit; `camera` is the main camera's model with its size.
    """

    path: Path
    start_ns: int
    end_ns: int
    topics: tuple[TopicReport, ...]
    roles: tuple[RoleReport, ...]
    transforms: tuple[EdgeReport, ...]
    base_frame: str
    poses: str | None
    camera: str | None
    cameras: tuple[CameraReport, ...]
    usable_frames: int
    problems: tuple[ProblemReport, ...]
    warnings: tuple[str, ...]
    verdicts: tuple[RoleVerdict, ...]
    settings: Mapping[str, object]

    @property
    def duration_s(self) -> float:
        """Seconds of the window."""
        return (self.end_ns - self.start_ns) / 1e9

    @property
    def can_build(self) -> bool:
        """Whether a build could work, given a detector where no detections are recorded."""
        return not self.problems

    @property
    def without_detections(self) -> str | None:
        """What a build needs because no detections are recorded; `None` where they are."""
        return next((role.reason for role in self.roles if role.role == "detections" and role.topic is None), None)


def inspect_recording(path: Path, request: RecordingRequest) -> Inspection:
    """Look through a recording: its index, the first messages of each topic, one frame, one pose.

    Raises `RecordingError` where nothing can be said (no recording at all), and for topics named that are not there.
    """
    opened = open_recording(path, request)
    problems: list[RecordingError] = list(opened.rig.problems)
    cameras: list[CameraReport] = []
    start_ns, end_ns = opened.rig.window.start_ns, opened.rig.window.end_ns
    if not problems:
        recording = BagRecording(opened)
        cameras, problems = _try_streams(opened, recording)
        if cameras and all(camera.usable_frames for camera in cameras):
            start_ns, end_ns = recording.start_ns, recording.end_ns
    if opened.motion_problem is not None:
        problems.append(opened.motion_problem)
    source = opened.rig.pose_source
    has_lidar = opened.rig.plan.serves("lidar")
    reports = tuple(_topic_reports(opened))
    gaps_s = {report.topic: report.longest_gap_s for report in reports if report.has_gap and report.longest_gap_s}
    return Inspection(
        path=path,
        start_ns=start_ns,
        end_ns=end_ns,
        topics=reports,
        roles=tuple(_role_reports(opened)),
        transforms=tuple(EdgeReport(edge.parent, edge.child, edge.static) for edge in opened.tree.edges),
        base_frame=opened.rig.base_frame,
        poses=source.description if source else ("LiDAR odometry" if has_lidar else None),
        camera=_model_text(opened.rig.cameras[0]) if opened.rig.cameras else None,
        cameras=tuple(cameras),
        usable_frames=sum(camera.usable_frames for camera in cameras),
        problems=tuple(ProblemReport(problem.what, problem.where, problem.cure) for problem in problems),
        warnings=opened.notes.lines,
        verdicts=tuple(verdicts(opened, problems, opened.notes.lines, gaps_s)),
        settings=explicit_settings(opened),
    )


def _try_streams(opened: OpenedRecording, recording: BagRecording) -> tuple[list[CameraReport], list[RecordingError]]:
    """The cameras with their usable frames, and what goes wrong when the first frame, pose, sweep and detections are
    read.
    """
    problems: list[RecordingError] = []
    try:
        camera_ids = recording.cameras
    except RecordingError as error:
        return [], [error]
    reports = []
    for camera in opened.rig.cameras:
        if camera.camera_id not in camera_ids:
            continue
        usable = 0
        try:
            stamps = recording.frame_stamps_ns(camera.camera_id)
            usable = len(stamps)
            first = set(stamps[:1].tolist())
            next(recording.frames(first.__contains__, camera.camera_id), None)
        except RecordingError as error:
            problems.append(error)
        if camera.depth is not None and (problem := depth_problem(opened, camera.depth)) is not None:
            problems.append(problem)
        plan = camera.plan
        reports.append(CameraReport(plan.camera_id, camera.color, plan.frame_id, _model_text(camera), usable))
    streams: list[tuple[str, Callable[[], Iterator[object]]]] = [
        ("poses", recording.poses),
        ("lidar", recording.sweeps),
        *(("detections", partial(recording.detections, camera_id)) for camera_id in camera_ids),
    ]
    for role, stream in streams:
        try:
            if role in recording.streams:
                list(islice(stream(), 1))
                if role == "detections":
                    [recording.detection_stamps_ns(camera_id) for camera_id in camera_ids]
        except RecordingError as error:
            problems.append(error)
    return reports, problems


def _topic_reports(opened: OpenedRecording) -> Iterator[TopicReport]:
    times: dict[str, list[int]] = {channel.topic: [] for channel in opened.storage.channels}
    start_ns, end_ns = opened.rig.window.log_range(0)
    for topic, log_ns in opened.storage.log_times(times.keys(), start_ns, end_ns):
        times[topic].append(log_ns)
    frames = {topic.name: topic.frame_id for topic in opened.rig.topics}
    roles = {choice.topic.name: role for role, choice in reversed(tuple(opened.rig.plan.choices.items()))}
    by_type = _times_by_type(opened, start_ns, end_ns)
    for channel in opened.storage.channels:
        frame_id, role = frames.get(channel.topic, ""), roles.get(channel.topic, "")
        yield _topic_report(
            channel, by_type.get((channel.topic, channel.msgtype), times[channel.topic]), opened, frame_id, role=role
        )


def _times_by_type(
    opened: OpenedRecording, start_ns: int | None, end_ns: int | None
) -> dict[tuple[str, str], list[int]]:
    """The log times of topics on which messages of several types were sent, by topic and type."""
    channels = opened.storage.channels
    types = Counter(channel.topic for channel in channels)
    found: dict[tuple[str, str], list[int]] = {
        (each.topic, each.msgtype): [] for each in channels if types[each.topic] > 1
    }
    if found:
        for raw in opened.storage.messages({topic for topic, _ in found}, start_ns, end_ns):
            found[raw.channel.topic, raw.channel.msgtype].append(raw.log_ns)
    return found


def _topic_report(
    channel: Channel, times_ns: Sequence[int], opened: OpenedRecording, frame_id: str, *, role: str
) -> TopicReport:
    count, kind = len(times_ns), channel.msgtype
    if count < 2:
        return TopicReport(channel.topic, kind, count, None, None, None, frame_id, role)
    ordered = np.sort(np.array(times_ns, np.int64))
    gaps = np.diff(ordered)
    period_s = float(np.median(gaps)) / 1e9 or float(ordered[-1] - ordered[0]) / 1e9 / (count - 1)
    longest = int(np.argmax(gaps))
    return TopicReport(
        channel.topic,
        kind,
        count,
        round(1 / period_s, 3) if period_s > 0 else None,
        float(gaps[longest]) / 1e9,
        (int(ordered[longest]) - opened.storage.start_ns) / 1e9,
        frame_id,
        role,
    )


def _role_reports(opened: OpenedRecording) -> Iterator[RoleReport]:
    plan = opened.rig.plan
    several = len(plan.cameras) > 1
    for role in ROLES:
        if role in CAMERA_ROLES:
            for camera in plan.cameras:
                camera_id = camera.camera_id if several else None
                yield _role_report(role, camera.choices.get(role), camera_id)
        elif role == "odometry" and role not in plan.shared and opened.rig.pose_source is not None:
            yield RoleReport(role, opened.rig.pose_source.description, "no odometry topic")
        else:
            yield _role_report(role, plan.shared.get(role))


def _role_report(role: str, choice: TopicChoice | None, camera_id: str | None = None) -> RoleReport:
    if choice is None:
        return RoleReport(role, None, _WITHOUT.get(role, ""), camera_id)
    return RoleReport(role, choice.topic.name, choice.reason, camera_id)


_WITHOUT = {
    "depth": "depth is then made from the LiDAR, if there is one",
    "camera_info": "needed, unless --camera equirectangular is forced",
    "depth_camera_info": "the colour camera's is used, if depth is aligned with it",
    "imu": "the map is then levelled by the scene",
    "odometry": "motion is then estimated from the LiDAR, if there is one",
    "detections": "a detector that looks at images, e.g. --detector onnx, needs a model (--option onnx.model=PATH)",
    "masks": "boxes are then cut out by depth",
}
"""What happens when nothing serves a role."""


def _model_text(opened: OpenedCamera) -> str:
    camera, depth = opened.rig.camera, opened.rig.depth
    name = type(camera).__name__.removesuffix("Camera").lower()
    how = "" if depth is None else (", depth aligned" if depth.aligned else ", depth to be registered")
    return f"{name} {camera.width} x {camera.height}, {camera.focal_px():.0f} px a radian{how}"
