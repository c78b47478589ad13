"""What is in a recording, what a build would use for what, what is missing, and how to mend it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings.bag_recording import BagRecording
from supermap_cli.recordings.opening import OpenedRecording, open_recording
from supermap_cli.recordings.storage import Channel
from supermap_cli.recordings.topics import ROLES
from supermap_cli.recordings.transforms import TransformTree

_GAP_PERIODS = 5


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
    """The topic that serves a role and why; `topic` is `None` where none does."""

    role: str
    topic: str | None
    reason: str


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
    that have what a build needs; `camera` is the camera model's name and size.
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
    usable_frames: int
    problems: tuple[ProblemReport, ...]
    warnings: tuple[str, ...]

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
        return next((each.reason for each in self.roles if each.role == "detections" and each.topic is None), None)


def inspect_recording(path: Path, request: RecordingRequest) -> Inspection:
    """Look through a recording: its index, the first messages of each topic, one frame, one pose.

    Raises `RecordingError` where nothing can be said (no recording at all), and for topics named that are not there.
    """
    opened = open_recording(path, request)
    problems, usable_frames = list(opened.problems), 0
    start_ns, end_ns = opened.window.start_ns, opened.window.end_ns
    if not problems:
        recording = BagRecording(opened)
        usable_frames, problems = _try_streams(recording)
        if usable_frames:
            start_ns, end_ns = recording.start_ns, recording.end_ns
    if opened.motion_problem is not None:
        problems.append(opened.motion_problem)
    source = opened.pose_source
    has_lidar = opened.plan.serves("lidar")
    return Inspection(
        path=path,
        start_ns=start_ns,
        end_ns=end_ns,
        topics=tuple(_topic_reports(opened)),
        roles=tuple(_role_reports(opened)),
        transforms=tuple(EdgeReport(edge.parent, edge.child, edge.static) for edge in opened.tree.edges),
        base_frame=opened.base_frame,
        poses=source.description if source else ("LiDAR odometry" if has_lidar else None),
        camera=_camera_text(opened),
        usable_frames=usable_frames,
        problems=tuple(ProblemReport(each.what, each.where, each.cure) for each in problems),
        warnings=(*opened.notes.lines, *_conflicts(opened.tree)),
    )


def _try_streams(recording: BagRecording) -> tuple[int, list[RecordingError]]:
    """How many frames there are, and what goes wrong when the first frame, pose, sweep and detections are read."""
    problems: list[RecordingError] = []
    usable = 0
    try:
        stamps = recording.frame_stamps_ns()
        usable = len(stamps)
        first = set(stamps[:1].tolist())
        next(recording.frames(first.__contains__), None)
    except RecordingError as error:
        problems.append(error)
    for role, stream in (
        ("poses", recording.poses),
        ("lidar", recording.sweeps),
        ("detections", recording.detections),
    ):
        try:
            if role in recording.streams:
                list(islice(stream(), 1))
        except RecordingError as error:
            problems.append(error)
    return usable, problems


def _topic_reports(opened: OpenedRecording) -> Iterator[TopicReport]:
    times: dict[str, list[int]] = {channel.topic: [] for channel in opened.storage.channels}
    start_ns, end_ns = opened.window.log_range(0)
    for topic, log_ns in opened.storage.log_times(times.keys(), start_ns, end_ns):
        times[topic].append(log_ns)
    frames = {topic.name: topic.frame_id for topic in opened.topics}
    roles = {choice.topic.name: role for role, choice in reversed(tuple(opened.plan.choices.items()))}
    for channel in opened.storage.channels:
        frame_id, role = frames.get(channel.topic, ""), roles.get(channel.topic, "")
        yield _topic_report(channel, times[channel.topic], opened, frame_id, role=role)


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
    for role in ROLES:
        choice = opened.plan.choices.get(role)
        if choice is not None:
            yield RoleReport(role, choice.topic.name, choice.reason)
        elif role == "odometry" and opened.pose_source is not None:
            yield RoleReport(role, opened.pose_source.description, "no odometry topic")
        else:
            yield RoleReport(role, None, _WITHOUT.get(role, ""))


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


def _camera_text(opened: OpenedRecording) -> str | None:
    if opened.rig is None:
        return None
    camera, depth = opened.rig.camera, opened.rig.depth
    name = type(camera).__name__.removesuffix("Camera").lower()
    how = "" if depth is None else (", depth aligned" if depth.aligned else ", depth to be registered")
    return f"{name} {camera.width} x {camera.height}, {camera.focal_px():.0f} px a radian{how}"


def _conflicts(tree: TransformTree) -> Iterator[str]:
    for child, (old, new) in sorted(tree.conflicts.items()):
        yield f"TF: {child!r} has two parents, {old!r} and {new!r}; the last one counts"
