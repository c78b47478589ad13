"""Opening a recording: what is in it, which topic serves what, the TF tree, the rig, the window of time."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from supermap_cli.errors import ConfigError, RecordingError, SupermapError
from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import messages
from supermap_cli.recordings.camera_rigs import OpenedCamera
from supermap_cli.recordings.containers import open_storage
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.images import decode_depth
from supermap_cli.recordings.messages import ImageMessage, PoseMessage
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.rig_finding import Rig, find_rig
from supermap_cli.recordings.storage import Channel, RawMessage, Storage
from supermap_cli.recordings.survey import Topic, survey_topics
from supermap_cli.recordings.tf_survey import is_static
from supermap_cli.recordings.topics import MissingTopicError
from supermap_cli.recordings.transforms import MovingTransforms, TransformTree
from supermap_cli.recordings.window import MARGIN_NS, RecordedData, Window

__all__ = ["MARGIN_NS", "OpenedCamera", "OpenedRecording", "Window", "no_poses", "open_recording"]


@dataclass(frozen=True)
class OpenedRecording:
    """What is known once a recording is open, before any stream is read.

    `motion_problem` says why there is no motion to be had from it.
    """

    path: Path
    request: RecordingRequest
    storage: Storage
    decoder: Decoder
    notes: Notes
    rig: Rig
    motion_problem: RecordingError | None

    @property
    def tree(self) -> TransformTree:
        """The TF tree's structure, with what the user said of it."""
        return self.rig.frames.tree

    def stamp_ns(self, raw: RawMessage) -> int:
        """The stamp of a message, by the camera's clock."""
        return messages.peek_stamp_ns(raw, self.decoder) + self.shift_ns(raw.channel.topic)

    def stamped(self, raws: Iterable[RawMessage]) -> Iterator[tuple[int, RawMessage]]:
        """(stamp by the camera's clock, message) of all that have a stamp; the others are left out with a note."""
        for stamp_ns, raw in self.decoder.stamped(raws, messages.peek_stamp_ns):
            yield stamp_ns + self.shift_ns(raw.channel.topic), raw

    def shift_ns(self, topic: str) -> int:
        """What is added to the stamps of a topic."""
        return self.rig.shifts_ns.get(topic, 0)

    def depth_m(self, image: ImageMessage, topic: str) -> Float32Array:
        """(h, w) metres of a depth image of a topic; see `images.decode_depth`."""
        scale = next((each.depth_scale for each in self.rig.topics if each.name == topic), 1.0)
        depth_m = decode_depth(image, self.decoder.limits)
        return depth_m if scale == 1.0 else depth_m * np.float32(scale)

    def place(self, topic: str, stamp_ns: int) -> str:
        """File, topic and time (seconds from the first message, as --start counts) for errors and warnings."""
        seconds = (stamp_ns - self.rig.window.offset_ns - self.storage.start_ns) / 1e9
        return f"{self.path}, {topic} at {seconds:.3f} s"

    def transforms(self, base: str, sensors: Collection[str]) -> MovingTransforms:
        """A fresh tree that moves along; the moving topics are left unread where base and sensors do not move."""
        rigid = all(
            base == sensor or (self.tree.connects(base, sensor) and self.tree.is_static(base, sensor))
            for sensor in sensors
        )
        return MovingTransforms(
            self._static_transforms(),
            (lambda: iter(())) if rigid else (lambda: self.moving_transforms(MARGIN_NS)),
            self.rig.frames.links,
        )

    def moving_transforms(self, margin_ns: int) -> Iterator[tuple[int, PoseMessage]]:
        """(sensor time of arrival, transform) of the moving transforms in the window, in the order of log time."""
        names = [topic.name for topic in self.rig.topics if topic.kind == "transforms" and not is_static(topic.name)]
        start_ns, end_ns = self.rig.window.log_range(margin_ns)
        raws = self.storage.messages(names, start_ns, end_ns)
        for raw, transforms in self.decoder.each(raws, messages.read_transforms):
            shift_ns = self.shift_ns(raw.channel.topic)
            for transform in transforms:
                yield raw.log_ns + self.rig.window.offset_ns, transform.later(shift_ns)

    def _static_transforms(self) -> Iterator[PoseMessage]:
        names = [topic.name for topic in self.rig.topics if topic.kind == "transforms" and is_static(topic.name)]
        for _, transforms in self.decoder.each(self.storage.messages(names), messages.read_transforms):
            yield from transforms
        yield from self.rig.frames.given


def open_recording(path: Path, request: RecordingRequest) -> OpenedRecording:
    """Open and understand a recording. Raises `RecordingError` only where not even `inspect` could say anything."""
    notes = Notes()
    try:
        return _open(path, request, notes)
    except SupermapError as error:
        error.add_warnings(notes.lines)
        raise


def _open(path: Path, request: RecordingRequest, notes: Notes) -> OpenedRecording:
    storage = open_storage(path, notes, request.limits)
    where = str(path)
    decoder = Decoder(where, notes, request.limits, storage.start_ns)
    topics = survey_topics(storage, decoder)
    if not any(channel.count for channel in storage.channels):
        raise RecordingError("no messages in the recording", where=where, cure="record again")
    if request.camera not in {None, "equirectangular"}:
        raise ConfigError(f"unknown camera model {request.camera!r}", cure="only 'equirectangular' can be forced")
    _note_unread(storage, topics, where, notes)
    rig = find_rig(RecordedData(storage, decoder, request, where), topics, notes)
    return OpenedRecording(
        path=path,
        request=request,
        storage=storage,
        decoder=decoder,
        notes=notes,
        rig=replace(rig, problems=tuple(_with_near(problem, storage) for problem in rig.problems)),
        motion_problem=None
        if rig.pose_source is not None or rig.plan.serves("lidar")
        else no_poses(where, rig.not_motion),
    )


def _note_unread(storage: Storage, topics: tuple[Topic, ...], where: str, notes: Notes) -> None:
    """Name what a build can do without and does: detections, IMUs and clouds that cannot be read."""
    for topic in topics:
        if topic.fault is not None and topic.kind in {"detections", "imu", "points"}:
            notes.note(f"unread {topic.name}", f"{where}, {topic.name}: left out: {topic.fault.what}")
    for channel in storage.channels:
        if channel.count and messages.is_near_detections(channel):
            notes.note(f"unread {channel.topic}", f"{where}, {channel.topic}: {unread_detections(channel)}")


def _with_near(problem: RecordingError, storage: Storage) -> RecordingError:
    """Where something is missing, what the recording holds in its place that is not read."""
    kinds = problem.kinds if isinstance(problem, MissingTopicError) else ()
    found = [text for channel in storage.channels if (text := messages.near(channel, kinds)) is not None]
    if not found:
        return problem
    return RecordingError(f"{problem.what}; {'; '.join(found)}", where=problem.where, cure=problem.cure)


def unread_detections(channel: Channel) -> str:
    """What to do about detections of a type that is not read."""
    return (
        f"detections of the type {channel.msgtype} are not read; convert them to vision_msgs/Detection2DArray, or "
        "detect with --detector onnx"
    )


def no_poses(where: str, left_out: Mapping[str, str] | None = None) -> RecordingError:
    """The error for a recording that holds no motion; topics of poses that are `left_out`, with the reason."""
    others = "".join(f"; not {name}: {reason}" for name, reason in (left_out or {}).items())
    return RecordingError(
        f"no poses (no odometry, no odom -> base in TF, no pose topic{others})",
        where=where,
        cure="record an odometry topic or TF, name it with --topic odometry=/..., or record a LiDAR for LiDAR odometry",
    )
