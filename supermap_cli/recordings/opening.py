"""Opening a recording: what is in it, which topic serves what, the TF tree, the rig, the window of time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from supermap_cli.errors import CalibrationError, ConfigError, RecordingError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import messages
from supermap_cli.recordings.camera_finding import CameraFinder, RecordedRobot, clock_problems, plan_named_cameras
from supermap_cli.recordings.containers import open_storage
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.messages import PoseMessage
from supermap_cli.recordings.motion import PoseSource, find_base_frame, find_pose_source
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.probing import Topic, probe_topics, usual_offset_ns
from supermap_cli.recordings.rig import CameraRig, RigBuilder
from supermap_cli.recordings.roles import parse_named_topics
from supermap_cli.recordings.storage import Channel, Storage
from supermap_cli.recordings.topic_plan import CameraPlan, TopicPlan
from supermap_cli.recordings.topics import plan_topics
from supermap_cli.recordings.transforms import MovingTransforms, TransformTree

MARGIN_NS = 2_000_000_000
"""ns by which poses, sweeps and IMU reach beyond the window, so that images at its ends have them on both sides."""

_SKEWED_CLOCK_NS = 1_000_000_000
"""ns between sensor time and log time from which they are two clocks, and not a message under way."""

_FIRST_TRANSFORMS = 2000
"""Messages of moving transforms that are read to learn the tree's structure: some ten seconds of a robot with 20 of
them at 10 Hz.
"""


@dataclass(frozen=True)
class Window:
    """The part of the recording to read, in sensor time [start_ns, end_ns]; sides the user did not set, or set to no
    effect, are `open`: every image counts there, though its stamp lies before or beyond the time of recording.

    `offset_ns` is sensor time minus log time where the two clocks differ by a second or more, else 0.
    """

    start_ns: int
    end_ns: int
    start_open: bool
    end_open: bool
    offset_ns: int

    def log_range(self, margin_ns: int) -> tuple[int | None, int | None]:
        """[start, end) in log time, widened by a margin on both sides; `None` on an open side."""
        start_ns = None if self.start_open else self.start_ns - self.offset_ns - margin_ns
        end_ns = None if self.end_open else self.end_ns - self.offset_ns + margin_ns + 1
        return start_ns, end_ns

    def holds(self, stamp_ns: int, margin_ns: int = 0) -> bool:
        """Whether a stamp lies in the window, widened by a margin."""
        return (self.start_open or stamp_ns >= self.start_ns - margin_ns) and (
            self.end_open or stamp_ns <= self.end_ns + margin_ns
        )


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
class OpenedRecording:
    """What is known once a recording is open, before any stream is read.

    `problems` stand in the way of any build, the gravest first; `cameras`, the main one first, are those that can be
    used, and none where a problem concerns them.
    `motion_problem` says why there is no motion to be had from it.
    """

    path: Path
    request: RecordingRequest
    storage: Storage
    decoder: Decoder
    notes: Notes
    topics: tuple[Topic, ...]
    plan: TopicPlan
    tree: TransformTree
    pose_source: PoseSource | None
    base_frame: str
    cameras: tuple[OpenedCamera, ...]
    window: Window
    problems: tuple[RecordingError, ...]
    motion_problem: RecordingError | None

    def place(self, topic: str, stamp_ns: int) -> str:
        """File, topic and time (seconds from the first message, as --start counts) for errors and warnings."""
        seconds = (stamp_ns - self.window.offset_ns - self.storage.start_ns) / 1e9
        return f"{self.path}, {topic} at {seconds:.3f} s"

    def transforms(self, base: str, sensors: Collection[str]) -> MovingTransforms:
        """A fresh tree that moves along; the moving topics are left unread where base and sensors do not move."""
        rigid = all(
            base == sensor or (self.tree.connects(base, sensor) and self.tree.is_static(base, sensor))
            for sensor in sensors
        )
        statics = _static_transforms(self.storage, self.decoder, self.topics)
        return MovingTransforms(statics, (lambda: iter(())) if rigid else (lambda: self.moving_transforms(MARGIN_NS)))

    def moving_transforms(self, margin_ns: int) -> Iterator[tuple[int, PoseMessage]]:
        """(sensor time of arrival, transform) of the moving transforms in the window, in the order of log time."""
        names = [topic.name for topic in self.topics if topic.kind == "transforms" and not _is_static(topic)]
        start_ns, end_ns = self.window.log_range(margin_ns)
        raws = self.storage.messages(names, start_ns, end_ns)
        for raw, transforms in self.decoder.each(raws, messages.read_transforms):
            for transform in transforms:
                yield raw.log_ns + self.window.offset_ns, transform


def open_recording(path: Path, request: RecordingRequest) -> OpenedRecording:
    """Open and understand a recording. Raises `RecordingError` only where not even `inspect` could say anything."""
    notes = Notes()
    storage = open_storage(path, notes, request.limits)
    where = str(path)
    decoder = Decoder(where, notes, request.limits, storage.start_ns)
    topics = probe_topics(storage, decoder)
    if not any(channel.count for channel in storage.channels):
        raise RecordingError("no messages in the recording", where=where, cure="record again")
    if request.camera not in {None, "equirectangular"}:
        raise ConfigError(f"unknown camera model {request.camera!r}", cure="only 'equirectangular' can be forced")
    _note_unread(storage, topics, where, notes)
    named = parse_named_topics(request.topics)
    plan = (plan_named_cameras if named.color_cameras else plan_topics)(topics, named, where)
    tree = _first_tree(storage, decoder, topics)
    source, base_frame = None, ""
    cameras: tuple[OpenedCamera, ...] = ()
    problems: list[RecordingError] = []
    try:
        source = find_pose_source(plan, topics, tree, request.frames)
        base_frame = find_base_frame(source, tree, _sensor_frame(plan), request.frames, notes)
        robot = RecordedRobot(tree, base_frame, storage, decoder)
        if named.color_cameras:
            clocks = clock_problems(plan.cameras, robot, where)
            plan = replace(plan, shared_problems=(*plan.shared_problems, *clocks))
        elif not named.lone_camera:
            finder = CameraFinder(topics, plan, named, where)
            plan = finder.lone() if request.camera else finder.find(robot, notes)
        builder = RigBuilder(plan, tree, request.camera, where=where)
        cameras, problems = _open_cameras(plan, lambda camera: builder.build(camera, base_frame, source, notes), notes)
    except CalibrationError as error:
        problems = [*plan.problems, CalibrationError(error.what, where=error.where or where, cure=error.cure)]
    return OpenedRecording(
        path=path,
        request=request,
        storage=storage,
        decoder=decoder,
        notes=notes,
        topics=topics,
        plan=plan,
        tree=tree,
        pose_source=source,
        base_frame=base_frame,
        cameras=cameras,
        window=_window(storage, plan, request, decoder, notes),
        problems=tuple(problems),
        motion_problem=no_poses(where) if source is None and not plan.serves("lidar") else None,
    )


def _note_unread(storage: Storage, topics: tuple[Topic, ...], where: str, notes: Notes) -> None:
    """Name what a build can do without and does: detections and IMUs that cannot be read."""
    for topic in topics:
        if topic.fault is not None and topic.kind in {"detections", "imu"}:
            notes.note(f"unread {topic.name}", f"{where}, {topic.name}: left out: {topic.fault.what}")
    for channel in storage.channels:
        if channel.count and messages.is_near_detections(channel):
            notes.note(f"unread {channel.topic}", f"{where}, {channel.topic}: {unread_detections(channel)}")


def unread_detections(channel: Channel) -> str:
    """What to do about detections of a type that is not read."""
    return (
        f"detections of the type {channel.msgtype} are not read; convert them to vision_msgs/Detection2DArray, or "
        "detect with --detector onnx"
    )


def _open_cameras(
    plan: TopicPlan, build: Callable[[CameraPlan], CameraRig], notes: Notes
) -> tuple[tuple[OpenedCamera, ...], list[RecordingError]]:
    """The cameras with their rigs, and the problems. Of several that were found by themselves those that fail are left
    out with a note, as long as one remains.
    """
    opened: list[OpenedCamera] = []
    failures: list[tuple[CameraPlan, RecordingError]] = []
    for camera in plan.cameras:
        try:
            if camera.problems:
                raise camera.problems[0]
            if not plan.shared_problems:
                opened.append(OpenedCamera(camera, build(camera)))
        except RecordingError as error:
            failures.append((camera, error))
    grave = [failure for camera, failure in failures if camera.named or len(plan.cameras) == 1 or not opened]
    if not grave:
        for camera, failure in failures:
            notes.note(f"camera {camera.camera_id}", f"the camera {camera.camera_id!r} is left out: {failure}")
        return tuple(opened), list(plan.shared_problems)
    of_plans = [problem for camera in plan.cameras for problem in camera.problems]
    return (), [*of_plans, *plan.shared_problems, *(failure for failure in grave if failure not in of_plans)]


def no_poses(where: str) -> RecordingError:
    """The error for a recording that holds no motion."""
    return RecordingError(
        "no poses (no odometry, no odom -> base in TF, no pose topic)",
        where=where,
        cure="record an odometry topic or TF, name it with --topic odometry=/..., or record a LiDAR for LiDAR odometry",
    )


def _sensor_frame(plan: TopicPlan) -> str:
    lidar = plan.topic("lidar")
    return plan.main.frame_id or (lidar.frame_id if lidar else "")


def _is_static(topic: Topic) -> bool:
    return "static" in topic.name


def _static_transforms(storage: Storage, decoder: Decoder, topics: tuple[Topic, ...]) -> Iterator[PoseMessage]:
    names = [topic.name for topic in topics if topic.kind == "transforms" and _is_static(topic)]
    for _, transforms in decoder.each(storage.messages(names), messages.read_transforms):
        yield from transforms


def _first_tree(storage: Storage, decoder: Decoder, topics: tuple[Topic, ...]) -> TransformTree:
    """The tree's structure: all static transforms and the first of the moving ones."""
    tree = TransformTree()
    for transform in _static_transforms(storage, decoder, topics):
        tree.add(transform, static=True)
    names = [topic.name for topic in topics if topic.kind == "transforms" and not _is_static(topic)]
    first = islice(storage.messages(names), _FIRST_TRANSFORMS)
    for _, transforms in decoder.each(first, messages.read_transforms):
        for transform in transforms:
            tree.add(transform, static=False)
    return tree


def _window(storage: Storage, plan: TopicPlan, request: RecordingRequest, decoder: Decoder, notes: Notes) -> Window:
    """Seconds of `--start` and `--end` count from the first message, in log time; streams follow the sensors' clock."""
    where = decoder.where
    leading = next((topic for role in ("color", "lidar", "odometry") if (topic := plan.topic(role))), None)
    offset_ns = leading.clock_offset_ns if leading else 0
    if leading is not None and abs(offset_ns) >= _SKEWED_CLOCK_NS:
        offset_ns = usual_offset_ns(storage, leading, decoder)
    if abs(offset_ns) < _SKEWED_CLOCK_NS:
        offset_ns = 0
    else:
        notes.note(
            "clock", f"{where}: sensor stamps are {offset_ns / 1e9:+.1f} s off the time of recording, stamps count"
        )
    first, last = storage.start_ns + offset_ns, storage.end_ns + offset_ns
    start_ns = first if request.start_s is None else first + round(request.start_s * 1e9)
    end_ns = last if request.end_s is None else first + round(request.end_s * 1e9) - 1
    if start_ns > last or end_ns < max(first, start_ns):
        raise RecordingError(
            f"nothing between --start {request.start_s or 0:g} and --end "
            f"{'the end' if request.end_s is None else f'{request.end_s:g}'}",
            where=where,
            cure=f"the recording lasts {(last - first) / 1e9:.1f} s",
        )
    return Window(max(start_ns, first), min(end_ns, last), start_ns <= first, end_ns >= last, offset_ns)
