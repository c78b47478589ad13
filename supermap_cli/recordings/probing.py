"""A first look: the first message of every topic that could be of use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.recordings import messages
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.images import decode_color, decode_depth, is_depth_encoding
from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.messages import CalibrationMessage, ImageMessage, Kind
from supermap_cli.recordings.storage import Channel, RawMessage, Storage

_TOGETHER_NS = 3_000_000_000
"""ns of log time from the start in which most topics have sent once; the others are looked up one by one.
"""

_FIRST_STAMPS = 21
"""Messages whose median offset is taken as the usual one: odd, and more than the few that a start-up delays."""


@dataclass(frozen=True)
class Topic:
    """A topic of a known kind and what its first message says (`fault`: why it could not be read).

    `clock_offset_ns` is its stamp minus its log time; `child_frame_id` is an odometry's.
    """

    channel: Channel
    kind: Kind
    frame_id: str = ""
    child_frame_id: str = ""
    clock_offset_ns: int = 0
    image: ImageMessage | None = None
    size: tuple[int, int] | None = None
    calibration: CalibrationMessage | None = None
    fault: RecordingError | None = None

    @property
    def name(self) -> str:
        """The topic's name."""
        return self.channel.topic


def probe_topics(storage: Storage, decoder: Decoder) -> tuple[Topic, ...]:
    """All topics of a known kind that hold messages, by name."""
    kinds = {
        channel: kind
        for channel in storage.channels
        if channel.count and (kind := messages.kind_of(channel)) is not None
    }
    by_name = {(channel.topic, channel.msgtype): kind for channel, kind in kinds.items()}
    topics = [
        _probe(raw, by_name[raw.channel.topic, raw.channel.msgtype], decoder)
        for raw in _first_messages(storage, by_name)
    ]
    return tuple(sorted(topics, key=lambda topic: topic.name))


def usual_offset_ns(storage: Storage, topic: Topic, decoder: Decoder) -> int:
    """Sensor time minus log time of a topic: the median of its first messages, of which one may be an outlier."""
    first = islice(storage.messages([topic.name]), _FIRST_STAMPS)
    offsets_ns = [stamp_ns - raw.log_ns for stamp_ns, raw in decoder.stamped(first, messages.peek_stamp_ns)]
    return int(np.median(offsets_ns)) if offsets_ns else 0


def _first_messages(storage: Storage, wanted: Iterable[tuple[str, str]]) -> Iterator[RawMessage]:
    """Each channel's first message: those of the first seconds in one pass, the others each on its own."""
    missing = set(wanted)
    for raw in storage.messages({topic for topic, _ in missing}, None, storage.start_ns + _TOGETHER_NS):
        key = (raw.channel.topic, raw.channel.msgtype)
        if key in missing:
            missing.remove(key)
            yield raw
        if not missing:
            return
    for topic, msgtype in sorted(missing):
        first = next((raw for raw in storage.messages({topic}) if raw.channel.msgtype == msgtype), None)
        if first is not None:
            yield first


def _probe(raw: RawMessage, kind: Kind, decoder: Decoder) -> Topic:
    try:
        return _read(raw, kind, decoder)
    except RecordingError as error:
        return Topic(raw.channel, kind, fault=error)


def _read(raw: RawMessage, kind: Kind, decoder: Decoder) -> Topic:
    channel, log_ns = raw.channel, raw.log_ns
    if kind == "points" and channel.msgtype.endswith("CustomMsg"):
        stamp_ns, frame_id = decoder.read_strictly(raw, messages.header_of)
        return Topic(channel, kind, frame_id, "", stamp_ns - log_ns)
    if kind == "transforms":
        first = next(iter(decoder.read_strictly(raw, messages.read_transforms)), None)
        return Topic(channel, kind, clock_offset_ns=first.stamp_ns - log_ns if first else 0)
    if kind == "image":
        return _read_image(raw, decoder.read_strictly(raw, messages.read_image), decoder.limits)
    if kind == "camera_info":
        calibration = decoder.read_strictly(raw, messages.read_calibration)
        return Topic(channel, kind, calibration.frame_id, "", calibration.stamp_ns - log_ns, calibration=calibration)
    if kind == "pose":
        pose = decoder.read_strictly(raw, messages.read_pose)
        return Topic(channel, kind, pose.frame_id, pose.child_frame_id, pose.stamp_ns - log_ns)
    stamp_ns, frame_id = decoder.read_strictly(raw, messages.header_of)
    return Topic(channel, kind, frame_id, "", stamp_ns - log_ns)


def _read_image(raw: RawMessage, image: ImageMessage, limits: Limits) -> Topic:
    """An image's topic; the size of a compressed one is known only once it is decoded."""
    size = (image.width, image.height) if image.width else None
    fault = None
    try:
        pixels = decode_depth(image, limits) if is_depth_encoding(image) else decode_color(image, limits)
        size = (pixels.shape[1], pixels.shape[0])
    except RecordingError as error:
        fault = error
    except ValueError as error:
        fault = None if size else RecordingError(f"the first image is broken: {error}", cure="name another topic")
    offset_ns = image.stamp_ns - raw.log_ns
    return Topic(raw.channel, "image", image.frame_id, "", offset_ns, image=image, size=size, fault=fault)
