"""What an image topic shows, by its encoding and its name, and which of several is the colour camera's best stream."""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Set

from supermap_cli.recordings.images import is_depth_encoding
from supermap_cli.recordings.messages import ImageMessage
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.topic_names import (
    COLOR_WORDS,
    device_of,
    is_infrared,
    is_rectified,
    names_depth,
    namespace_of,
)

MASK_WORDS = ("mask", "instance", "segment", "label")
"""An image topic whose name holds one of them shows instance masks, not colours."""

NOT_COLOR_WORDS = (
    *("infra", "thermal", "confidence", "disparity"),
    *("debug", "overlay", "annotated", "result"),
)
"""An image topic whose name holds one of them is chosen as colour only where there is no other."""

_NO_DEPTH_WORDS = ("infra", "confidence", "disparity")
"""A topic of depth's encodings whose name holds one of them shows something else."""

_PNG_BIT_DEPTH_AT = 24
"""Where a PNG says how many bits a sample has (RFC 2083, section 4.1.1)."""


def has_word(topic: Topic, words: Iterable[str]) -> bool:
    """Whether a topic's name holds one of the words, in any case."""
    name = topic.name.lower()
    return any(word in name for word in words)


def is_depth(topic: Topic) -> bool:
    """Whether an image topic shows depth: by its encoding; 16-bit grey and plain PNG only if the name says so too."""
    image = topic.image
    return image is not None and (is_depth_encoding(image) or (names_depth(topic.name) and can_be_depth(image)))


def is_color(topic: Topic) -> bool:
    """Whether an image topic shows what a camera sees (or instance masks, which only its name tells apart)."""
    return topic.image is not None and not is_depth(topic)


def shows_a_camera(topic: Topic) -> bool:
    """Whether a topic holds what a colour camera sees: no masks, no infrared, no pictures of results."""
    return (
        topic.kind == "image" and is_color(topic) and not has_word(topic, MASK_WORDS) and not named_as_no_color(topic)
    )


def named_as_no_color(topic: Topic) -> bool:
    """Whether an image topic's name says infrared, depth, confidence, or a picture of results."""
    return has_word(topic, NOT_COLOR_WORDS) or names_depth(topic.name) or is_infrared(topic.name)


def named_as_no_depth(topic: Topic) -> bool:
    """Whether a topic of depth's encodings is named infrared, confidence or disparity."""
    return has_word(topic, _NO_DEPTH_WORDS) or is_infrared(topic.name)


def can_be_depth(image: ImageMessage) -> bool:
    """By its encoding: 16-bit grey, plain PNG and TIFF may be depth or not."""
    return is_depth_encoding(image) or image.encoding.partition(";")[0].strip() in {"mono16", "png", "tiff"}


def is_lossy(topic: Topic) -> bool:
    """Whether a depth topic's compressed images are JPEG, or PNG of 8 bits: neither holds millimetres."""
    if topic.image is None or not topic.image.compressed or "compressedDepth" in topic.image.encoding:
        return False
    head = bytes(topic.image.data[: _PNG_BIT_DEPTH_AT + 1])
    is_depth_topic = is_depth_encoding(topic.image) or names_depth(topic.name)
    small_png = head[:4] == b"\x89PNG" and head[_PNG_BIT_DEPTH_AT:] == b"\x08"
    return is_depth_topic and (head[:2] == b"\xff\xd8" or small_png)


COLOR_LOST = (
    *("cannot be read", "is named as no colour image", "has no camera_info beside it"),
    *("is not in the frame of the detections", "is of a device without depth", "is not named colour", "is grey"),
    *("has no depth on its pixels", "is a smaller copy", "is raw Bayer", "is not rectified", "is a right camera"),
    "has fewer messages",
)
"""What a topic lacks that lost by each element of `ColorRanking.rank`."""


class ColorRanking:
    """Compares images as the colour of one camera: of a device's streams the one counts that its depth lies on.

    `depths` are what can be its depth, `calibrated` the namespaces with a camera_info, `detection_frames` the frames
    that detections name.
    """

    def __init__(
        self, colors: Sequence[Topic], depths: Sequence[Topic], calibrated: Set[str], detection_frames: Set[str]
    ) -> None:
        self._calibrated = calibrated
        self._detection_frames = detection_frames
        self._devices = {device_of(depth.name) for depth in depths}
        shown = [depth for depth in depths if depth.fault is None and not named_as_no_depth(depth)]
        self._depth_pixels = {(depth.frame_id, depth.size) for depth in shown if depth.size is not None}
        self._largest: dict[str, int] = {}
        for color in colors:
            if color.fault is None:
                self._largest[color.frame_id] = max(self._largest.get(color.frame_id, 0), _pixels(color))

    def rank(self, topic: Topic) -> tuple[float, ...]:
        """The larger, the better; see `COLOR_LOST`."""
        encoding = topic.image.encoding if topic.image else ""
        return (
            topic.fault is None,
            not named_as_no_color(topic),
            namespace_of(topic.name) in self._calibrated,
            topic.frame_id in self._detection_frames,
            device_of(topic.name) in self._devices,
            has_word(topic, COLOR_WORDS),
            "mono" not in encoding and "8UC1" not in encoding,
            (topic.frame_id, topic.size) in self._depth_pixels,
            _pixels(topic) >= self._largest.get(topic.frame_id, 0),
            not encoding.startswith("bayer"),
            is_rectified(topic.name),
            not has_word(topic, ("right",)),
            topic.channel.count,
        )


def _pixels(topic: Topic) -> int:
    return 0 if topic.size is None else topic.size[0] * topic.size[1]
