"""A survey of a recording: every topic of use, sampled over its length, and what most of its good messages say."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TypeVar

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.recordings import messages
from supermap_cli.recordings.calibration import is_calibrated
from supermap_cli.recordings.cloud_values import CloudValues, cloud_values
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.image_size import PixelLimitError
from supermap_cli.recordings.images import decode_color, decode_depth, is_depth_encoding
from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.messages import CalibrationMessage, ImageMessage, Kind, PoseMessage
from supermap_cli.recordings.storage import Channel, RawMessage, Storage

_TOGETHER_NS = 3_000_000_000
"""ns of log time from the start in which most topics have sent once; the others are looked up one by one.
"""

_MOMENTS, _MOMENT_NS = 8, 500_000_000
"""Moments of a recording, spread evenly from its start to its end, and ns of log time at each, in which every topic is
sampled: two messages of a topic at 4 Hz. Set by hand: a look at each costs a chunk or two.
"""

_FARTHEST_M = 100.0
"""Median depth, in metres, that no depth camera measures: it is millimetres (100 mm is nearer than any begins)."""

_LOOKED_THROUGH = 300
"""Messages of a topic that are looked through where none of its samples is good: ten seconds at 30 Hz."""

_FIRST_STAMPS = 21
"""Messages whose median offset is taken as the usual one: odd, and more than the few that a start-up delays."""

Value = TypeVar("Value", bound=Hashable)


@dataclass(frozen=True)
class Topic:
    """A topic of a known kind and what most of its sampled messages say (`fault`: why none of them could be read).

    `clock_offset_ns` is their stamp minus log time (the median), `offsets_ns` that of every sample, in order of time;
    `child_frame_id` is an odometry's, `poses` are its samples; `frame_ids` are all frames that were named; `doubts` are
    what speaks against some of the samples. `depth_scale` and `point_scale` bring decoded depth and points to metres.
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
    offsets_ns: tuple[int, ...] = ()
    poses: tuple[PoseMessage, ...] = ()
    doubts: tuple[str, ...] = ()
    frame_ids: frozenset[str] = frozenset()
    depth_scale: float = 1.0
    point_scale: float = 1.0

    @property
    def name(self) -> str:
        """The topic's name."""
        return self.channel.topic


@dataclass(frozen=True)
class _Sample:
    """What one message says; `fault` is why it is of no use, though its header may be."""

    offset_ns: int
    frame_id: str = ""
    child_frame_id: str = ""
    image: ImageMessage | None = None
    size: tuple[int, int] | None = None
    depth: float | None = None
    calibration: CalibrationMessage | None = None
    pose: PoseMessage | None = None
    fault: RecordingError | None = None


def survey_topics(storage: Storage, decoder: Decoder) -> tuple[Topic, ...]:
    """All topics of a known kind that hold messages, by name."""
    kinds = {
        (channel.topic, channel.msgtype): kind
        for channel in storage.channels
        if channel.count and (kind := messages.kind_of(channel)) is not None
    }
    found: dict[tuple[str, str], list[RawMessage]] = {}
    for raw in (*_first_messages(storage, kinds), *_later_messages(storage, kinds, _busy_span(storage, kinds))):
        samples = found.setdefault((raw.channel.topic, raw.channel.msgtype), [])
        if not samples or raw.log_ns > samples[-1].log_ns:
            samples.append(raw)
    topics = [_topic(storage, samples, kinds[key], decoder) for key, samples in found.items()]
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


def _busy_span(storage: Storage, kinds: Mapping[tuple[str, str], Kind]) -> tuple[int, int]:
    """Between which log times the sensors ran: not what was latched long before, or added long after.

    The index is asked only where the busiest sensor sends too seldom for the length of the whole.
    """
    span = storage.start_ns, storage.end_ns
    counts = {
        channel.topic: channel.count
        for channel in storage.channels
        if kinds.get((channel.topic, channel.msgtype)) in {"image", "points", "imu", "pose"}
    }
    busiest = max(counts, key=lambda topic: counts[topic], default=None)
    if busiest is None or counts[busiest] * _MOMENT_NS >= span[1] - span[0]:
        return span
    times = [time for _, time in storage.log_times([busiest])]
    return (min(times), max(times)) if times else span


def _later_messages(storage: Storage, wanted: Iterable[tuple[str, str]], span: tuple[int, int]) -> Iterator[RawMessage]:
    """A message of every channel at each later moment of a span; rare ones where they happen to come."""
    begin_ns, end_ns = span
    length_ns = end_ns - begin_ns
    keys = set(wanted)
    topics = {topic for topic, _ in keys}
    counts = {(channel.topic, channel.msgtype): channel.count for channel in storage.channels}
    often = {key for key in keys if counts[key] * _MOMENT_NS >= 2 * length_ns}
    last_ns = max(begin_ns, end_ns - _MOMENT_NS // 2)
    for start_ns in np.unique(np.linspace(begin_ns, last_ns, _MOMENTS).astype(np.int64)).tolist():
        if start_ns == storage.start_ns:
            continue
        seen: set[tuple[str, str]] = set()
        for raw in storage.messages(topics, start_ns, start_ns + _MOMENT_NS):
            key = (raw.channel.topic, raw.channel.msgtype)
            if key in keys and key not in seen:
                seen.add(key)
                yield raw
            if often and often <= seen:
                break


def _topic(storage: Storage, raws: Sequence[RawMessage], kind: Kind, decoder: Decoder) -> Topic:
    """What the samples say together; where none of them is good, what the topic's further messages say."""
    samples: list[_Sample] = []
    for raw in raws:
        known = any(sample.fault is None for sample in samples)
        samples.append(_sample(raw, kind, decoder, thorough=not known))
    channel = raws[0].channel
    if all(sample.fault is not None for sample in samples):
        for raw in islice(storage.messages({channel.topic}), _LOOKED_THROUGH):
            further = _sample(raw, kind, decoder, thorough=True) if raw.channel.msgtype == channel.msgtype else None
            if further is not None and further.fault is None:
                samples.append(further)
                break
    good = [sample for sample in samples if sample.fault is None]
    said = good or samples
    offsets_ns = tuple(sample.offset_ns for sample in samples if sample.frame_id or sample.fault is None)
    topic = Topic(
        channel,
        kind,
        _most(said, lambda sample: sample.frame_id),
        _most(said, lambda sample: sample.child_frame_id),
        int(np.median(offsets_ns or (0,))),
        calibration=_usual_calibration([sample.calibration for sample in said if sample.calibration]),
        fault=None if good or (kind == "camera_info" and samples[0].calibration) else samples[0].fault,
        offsets_ns=offsets_ns,
        poses=tuple(sample.pose for sample in good if sample.pose and sample.pose.transform() is not None),
        doubts=tuple(_doubts(samples, good)) if kind != "detections" else (),
        frame_ids=frozenset(sample.frame_id for sample in said if sample.frame_id),
    )
    if kind == "points":
        return _with_points(topic, cloud_values(raws, decoder))
    return _with_image(topic, [sample for sample in said if sample.image]) if kind == "image" else topic


def _with_points(topic: Topic, values: CloudValues) -> Topic:
    """The topic with what its clouds hold."""
    doubts = topic.doubts if values.doubt is None else (*topic.doubts, values.doubt)
    return replace(topic, point_scale=values.scale, doubts=doubts, fault=topic.fault or values.fault)


def _most(samples: Iterable[_Sample], said: Callable[[_Sample], Value]) -> Value:
    """What most samples say, of equally many what was said first; "" counts only where nothing else is said."""
    values = [said(sample) for sample in samples]
    return Counter([value for value in values if value] or values).most_common(1)[0][0]


def _usual_calibration(said: Sequence[CalibrationMessage]) -> CalibrationMessage | None:
    """The calibration that most messages give."""
    if not said:
        return None
    usual, _ = Counter(_calibration_key(calibration) for calibration in said).most_common(1)[0]
    return next(calibration for calibration in said if _calibration_key(calibration) == usual)


def _calibration_key(said: CalibrationMessage) -> tuple[object, ...]:
    return (said.width, said.height, said.model, said.D, said.K.tobytes(), said.P.tobytes(), said.binning, said.roi)


def _doubts(samples: Sequence[_Sample], good: Sequence[_Sample]) -> Iterator[str]:
    """What speaks against some of the samples, one sentence each."""
    faults = [sample.fault for sample in samples if sample.fault is not None]
    if good and faults:
        yield f"{len(faults)} of {len(samples)} messages looked at are of no use ({faults[0].what}), the others count"
    frames = Counter(sample.frame_id for sample in good if sample.frame_id)
    if len(frames) > 1:
        listed = ", ".join(f"{frame!r} in {count}" for frame, count in frames.most_common(3))
        yield f"its messages name several frames ({listed} of {len(good)} looked at), the first of these counts"
    calibrations = Counter(_calibration_key(sample.calibration) for sample in good if sample.calibration)
    if len(calibrations) > 1:
        most = calibrations.most_common(1)[0][1]
        sizes = Counter((sample.calibration.width, sample.calibration.height) for sample in good if sample.calibration)
        of_sizes = f" (for {' and '.join(f'{w} x {h}' for w, h in list(sizes)[:3])} pixels)" if len(sizes) > 1 else ""
        yield (
            f"{len(calibrations)} different calibrations in it{of_sizes}, that of {most} of {len(good)} looked at "
            "counts"
        )


def _with_image(topic: Topic, said: Sequence[_Sample]) -> Topic:
    """The topic with the encoding and the size that most images have; a compressed one says its size when decoded."""
    images = [sample.image for sample in said if sample.image is not None]
    if not images:
        return topic
    forms = Counter((image.encoding, image.width, image.height) for image in images)
    usual, _ = forms.most_common(1)[0]
    image = next(image for image in images if (image.encoding, image.width, image.height) == usual)
    size = (image.width, image.height) if image.width else next((each.size for each in said if each.size), None)
    doubts = topic.doubts
    if len(forms) > 1:
        listed = ", ".join(f"{encoding} {width} x {height}" for encoding, width, height in list(forms)[:3])
        doubts = (*doubts, f"its images are not all alike ({listed}), those of {usual[1]} x {usual[2]} pixels count")
    scale = 1.0
    if "32FC1" in image.encoding and any(each.depth is not None and each.depth > _FARTHEST_M for each in said):
        scale = 1e-3
        doubts = (*doubts, "its depth is in millimetres, though floats are metres (REP-118): divided by 1000")
    return replace(topic, image=image, size=size, doubts=doubts, depth_scale=scale)


def _sample(raw: RawMessage, kind: Kind, decoder: Decoder, *, thorough: bool) -> _Sample:
    """What a message says. Only `thorough` looks decode images, and messages of which the header alone counts."""
    try:
        return _read(raw, kind, decoder, thorough=thorough)
    except RecordingError as error:
        return _Sample(0, fault=error)


def _read(raw: RawMessage, kind: Kind, decoder: Decoder, *, thorough: bool) -> _Sample:
    log_ns = raw.log_ns
    if kind in {"points", "imu", "detections"} and not thorough and (header := _peek_header(raw)) is not None:
        return _Sample((header[0] or log_ns) - log_ns, header[1])
    if kind == "transforms":
        first = next(iter(decoder.read_strictly(raw, messages.read_transforms)), None)
        return _Sample(first.stamp_ns - log_ns if first else 0)
    if kind == "image":
        return _image_sample(decoder.read_strictly(raw, messages.read_image), log_ns, decoder.limits, thorough=thorough)
    if kind == "camera_info":
        calibration = decoder.read_strictly(raw, messages.read_calibration)
        fault = None if is_calibrated(calibration) else RecordingError("the camera is not calibrated (K is zero)")
        offset_ns = calibration.stamp_ns - log_ns
        return _Sample(offset_ns, calibration.frame_id, calibration=calibration, fault=fault)
    if kind == "pose":
        pose = decoder.read_strictly(raw, messages.read_pose)
        return _Sample(pose.stamp_ns - log_ns, pose.frame_id, pose.child_frame_id, pose=pose)
    stamp_ns, frame_id = decoder.read_strictly(raw, messages.header_of)
    return _Sample(stamp_ns - log_ns, frame_id)


def _peek_header(raw: RawMessage) -> tuple[int, str] | None:
    """(stamp in ns, frame) of a ROS message that begins with a header, without decoding it; `None` for others."""
    data, order, at = raw.data, "<", 4
    if raw.channel.msgtype.startswith("foxglove") or raw.channel.serialization not in {"ros1", "cdr"} or len(data) < 16:
        return None
    if raw.channel.serialization == "cdr" and not data[1] & 1:
        order = ">"
    seconds, nanoseconds, length = struct.unpack_from(f"{order}III", data, at)
    frame = bytes(data[at + 12 : at + 12 + length]).rstrip(b"\0").decode(errors="replace")
    return seconds * 1_000_000_000 + nanoseconds, frame.lstrip("/")


def _image_sample(image: ImageMessage, log_ns: int, limits: Limits, *, thorough: bool) -> _Sample:
    """Whether an image can be used. Raw ones say their size; compressed ones are decoded for it, where thorough."""
    offset_ns, fault, size, depth = image.stamp_ns - log_ns, None, None, None
    if not len(image.data) or not (thorough or image.width or image.compressed):
        fault = RecordingError("the first image is broken: it is empty", cure="name another topic")
    elif thorough:
        try:
            pixels = decode_depth(image, limits) if is_depth_encoding(image) else decode_color(image, limits)
            size = (pixels.shape[1], pixels.shape[0])
            depth = float(np.median(pixels[pixels > 0])) if is_depth_encoding(image) and (pixels > 0).any() else None
        except RecordingError as error:
            fault = error
        except PixelLimitError as error:
            cure = f"raise it with --limit image_pixels={error.pixels}, or name another topic"
            fault = RecordingError(f"the first image is too large: {error}", cure=cure)
        except ValueError as error:
            fault = RecordingError(f"the first image is broken: {error}", cure="name another topic")
    return _Sample(offset_ns, image.frame_id, image=image, size=size, depth=depth, fault=fault)
