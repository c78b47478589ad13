"""What the names of topics say: the namespace of an image, the device it is of, and what tells cameras apart."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence, Set
from itertools import takewhile

Device = tuple[str, ...]
"""The parts of a topic's name that say which device it is of, in lower case; () for a name of stream words alone."""

_TRANSPORTS = ("compressedDepth", "compressed", "theora", "zstd", "ffmpeg")
"""Last parts that image_transport's plugins append to the topic of the raw images."""

_STREAM_WORDS = frozenset(
    {
        *("camera", "cam", "sensor", "sensors", "stereo", "rgbd", "data", "stream", "video", "info", "republished"),
        *("rgb", "bgr", "color", "colour", "gray", "grey", "mono", "depth", "image", "images", "img", "raw"),
        *("rect", "rectified", "registered", "unregistered", "aligned", "align", "to", "hw", "sw"),
        *("compressed", "compresseddepth", "theora", "zstd", "ffmpeg"),
        *("detection", "detections", "detector", "objects", "mask", "masks", "instance", "instances"),
        *("segmentation", "segments", "labels"),
        *("hd", "fhd", "qhd", "sd", "low", "high", "small", "large", "res", "lowres", "resized", "scaled"),
        *("downscaled", "downsampled", "half", "quarter", "preview", "throttle", "throttled"),
    }
)
"""Words that name a stream of a device (its kind, encoding, processing or size) and not the device, as they stand in
the topics of realsense-ros, zed-ros-wrapper, depthai-ros, azure_kinect_ros_driver, kinect2_bridge, spot_ros and Gazebo.
"""


def namespace_of(topic: str) -> str:
    """/camera/color/image_raw/compressed -> /camera/color: where its camera_info stands too."""
    parts = topic.split("/")
    if parts[-1] in _TRANSPORTS:
        parts = parts[:-1]
    return "/".join(parts[:-1])


def is_rectified(topic: str) -> bool:
    """Whether an image topic is named as rectified: as image_proc's output (image_rect, image_rect_color,
    image_rect_raw), or by a folder of its own (ZED's rgb/color/rect/image).

    RealSense's depth/image_rect_raw is meant too: its distortion is zero anyhow.
    """
    return "rect" in topic.removeprefix(namespace_of(topic)) or not {"rect", "rectified"}.isdisjoint(topic.split("/"))


def is_on_colors_pixels(topic: str) -> bool:
    """Whether a depth topic is named as brought onto the colour camera's pixels; "unaligned" is not."""
    return not words_of(topic).isdisjoint(_ON_COLORS_PIXELS)


_ON_COLORS_PIXELS = frozenset({"aligned", "registered"})
"""realsense-ros and Spot: aligned_depth_to_color, depth_registered; OpenNI, ZED: depth_registered, hw_registered."""


def names_depth(topic: str) -> bool:
    """Whether a topic's name says depth: of the parts that speak of depth or colour the last counts.

    /camera/depth/image_raw, /camera/aligned_depth_to_color/image_raw; not /depth_camera_front/color/image_raw.
    """
    spoken = [part for part in topic.lower().split("/") if any(word in part for word in ("depth", *COLOR_WORDS))]
    return bool(spoken) and "depth" in spoken[-1]


COLOR_WORDS = ("color", "colour", "rgb")
"""A topic whose name holds one of them says that its images are coloured."""


def is_infrared(topic: str) -> bool:
    """Whether a topic is named as infrared: /camera/ir/image_raw, /camera/left_ir/image_raw, image_ir_rect."""
    return any(re.fullmatch(r"n?ir\d*", word) for word in words_of(topic))


def common_parts(a: str, b: str) -> int:
    """How many leading parts two topic names share."""
    pairs = zip(a.split("/"), b.split("/"), strict=False)
    return next((index for index, (x, y) in enumerate(pairs) if x != y), min(a.count("/"), b.count("/")) + 1)


def common_words(a: str, b: str) -> int:
    """How many leading words two topic names share: /d455_rgb_image and /d455_rgb_camera_info share two."""
    pairs = zip(re.split(r"[/_]+", a.lower()), re.split(r"[/_]+", b.lower()), strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs)) - 1


def device_of(topic: str) -> Device:
    """/camera_front/color/image_raw and /camera_front/aligned_depth_to_color/image_raw -> ("camera_front",).

    /spot/camera/frontleft/image and /spot/depth/frontleft/image -> ("spot", "frontleft").
    """
    parts = [part.lower() for part in topic.split("/") if part]
    return tuple(part for part in parts if not words_of(part) <= _STREAM_WORDS)


def words_of(name: str) -> frozenset[str]:
    """The words of a topic's name or of one part of it, in lower case."""
    return frozenset(word for word in re.split(r"[^a-z0-9]+", name.lower()) if word)


def camera_ids(devices: Sequence[Device]) -> tuple[str, ...]:
    """A short name for each of several different devices: what distinguishes it ("front", "cam0", "kinect_1")."""
    shared_parts = set(devices[0]).intersection(*devices)
    words = [_words(part for part in device if part not in shared_parts) for device in devices]
    distinctive = [set(own) for own in words if own]
    shared_words = set.intersection(*distinctive) if len(distinctive) > 1 else set()
    if any(own <= shared_words | _STREAM_WORDS for own in distinctive):
        shared_words = set()
    ids = tuple(_camera_id(own, device, shared_words) for own, device in zip(words, devices, strict=True))
    if len(set(ids)) < len(ids):
        ids = tuple("_".join(_words(device)) or "camera" for device in devices)
    return ids if len(set(ids)) == len(ids) else tuple(f"camera_{number}" for number in range(1, len(ids) + 1))


def _camera_id(own_words: Sequence[str], device: Device, shared_words: Set[str]) -> str:
    """The first of ever longer names that is more than a number."""
    short = [word for word in own_words if word not in shared_words and word not in _STREAM_WORDS]
    for name in (short, own_words, _words(device)):
        if any(not word.isdigit() for word in name):
            return "_".join(name)
    return "_".join(["camera", *_words(device)])


def _words(parts: Iterable[str]) -> list[str]:
    """The words of several parts, in order."""
    return [word for part in parts for word in re.split(r"[^a-z0-9]+", part) if word]
