"""Which topic serves which role: found by type, told apart by name, rate and frame; the user may name any of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from supermap_cli.errors import ConfigError, RecordingError
from supermap_cli.recordings.images import DEPTH_ENCODINGS, is_depth_encoding
from supermap_cli.recordings.messages import ImageMessage, Kind
from supermap_cli.recordings.probing import Topic

ROLES: Mapping[str, tuple[Kind, ...]] = {
    "color": ("image",),
    "depth": ("image",),
    "camera_info": ("camera_info",),
    "depth_camera_info": ("camera_info",),
    "lidar": ("points",),
    "imu": ("imu",),
    "odometry": ("pose", "transforms"),
    "detections": ("detections",),
    "masks": ("image",),
}
"""Every role and the kinds of topic that can serve it."""

_TRANSPORTS = ("compressedDepth", "compressed", "theora", "zstd", "ffmpeg")
_MASK_WORDS = ("mask", "instance", "segment", "label")
_NO_COLOR = ("infra", "/ir", "thermal", "depth", "confidence", "disparity", "debug", "overlay", "annotated", "result")
_NO_SCAN = ("depth", "camera", "color", "map", "ground", "obstacle", "world", "deskew", "filtered", "registered")

_GROUND_TRUTH = re.compile(r"ground_?truth|(^|[/_])gt([/_]|$)")
"""Beside an odometry, the truth is there to judge by; a robot does not have it."""


@dataclass(frozen=True)
class TopicChoice:
    """The topic that serves a role, and why it rather than another."""

    role: str
    topic: Topic
    reason: str


@dataclass(frozen=True)
class TopicPlan:
    """Which topic serves which role, and what stands in the way (`problems`, each with its cure)."""

    choices: Mapping[str, TopicChoice]
    problems: tuple[RecordingError, ...]

    def topic(self, role: str) -> Topic | None:
        """The topic of a role, if there is one."""
        choice = self.choices.get(role)
        return choice.topic if choice else None

    def serves(self, role: str) -> bool:
        """Whether there is a topic for a role."""
        return role in self.choices


def plan_topics(topics: Sequence[Topic], named: Mapping[str, str], where: str) -> TopicPlan:
    """Choose a topic for every role that can be served. Raises if the user named what is not there."""
    return _Planner(topics, named, where).plan()


def namespace_of(topic: str) -> str:
    """/camera/color/image_raw/compressed -> /camera/color: where its camera_info stands too."""
    parts = topic.split("/")
    if parts[-1] in _TRANSPORTS:
        parts = parts[:-1]
    return "/".join(parts[:-1])


def is_rectified(topic: str) -> bool:
    """Whether an image topic is named as image_proc's rectified output (image_rect, image_rect_color, image_rect_raw).

    RealSense's depth/image_rect_raw is meant too: its distortion is zero anyhow.
    """
    return "rect" in topic.removeprefix(namespace_of(topic))


def _has(topic: Topic, words: Iterable[str]) -> bool:
    name = topic.name.lower()
    return any(word in name for word in words)


def _common_prefix(a: str, b: str) -> int:
    pairs = zip(a.split("/"), b.split("/"), strict=False)
    return next((index for index, (x, y) in enumerate(pairs) if x != y), min(a.count("/"), b.count("/")) + 1)


class _Planner:
    """Fills the roles one after the other; later ones look at earlier ones."""

    def __init__(self, topics: Sequence[Topic], named: Mapping[str, str], where: str) -> None:
        self._topics = topics
        self._named = named
        self._where = where
        self._choices: dict[str, TopicChoice] = {}
        self._problems: list[RecordingError] = []

    def plan(self) -> TopicPlan:
        unknown = sorted(self._named.keys() - ROLES.keys())
        if unknown:
            raise ConfigError(f"unknown role {unknown[0]!r} in --topic", cure=f"the roles are {', '.join(ROLES)}")
        self._choose("detections", self._of("detections"), lambda topic: (topic.channel.count,))
        self._choose("masks", self._mask_candidates(), self._mask_rank)
        self._choose("color", self._color_candidates(), self._color_rank)
        self._choose("depth", self._depth_candidates(), self._depth_rank)
        self._choose_camera_info("camera_info", "color")
        self._choose_camera_info("depth_camera_info", "depth")
        self._choose("lidar", self._of("points"), self._lidar_rank)
        self._choose("imu", self._of("imu"), lambda topic: (_has(topic, ("data",)), topic.channel.count))
        self._choose("odometry", self._odometry_candidates(), self._odometry_rank)
        self._note_missing()
        return TopicPlan(dict(self._choices), tuple(self._problems))

    def _of(self, kind: Kind) -> list[Topic]:
        return [topic for topic in self._topics if topic.kind == kind]

    def _choose(self, role: str, candidates: Sequence[Topic], rank: Callable[[Topic], tuple[float, ...]]) -> None:
        if role in self._named:
            self._choices[role] = TopicChoice(role, self._named_topic(role), "named by the user")
            return
        usable = sorted(candidates, key=lambda topic: topic.name)
        if not usable:
            return
        best = max(usable, key=rank)
        others = [topic.name for topic in usable if topic is not best]
        reason = f"rather than {', '.join(others)}" if others else "the only one of its kind"
        self._choices[role] = TopicChoice(role, best, reason)

    def _named_topic(self, role: str) -> Topic:
        name = self._named[role]
        fitting = [topic for topic in self._topics if topic.kind in ROLES[role]]
        for topic in fitting:
            if topic.name == name:
                return topic
        listed = ", ".join(topic.name for topic in fitting) or "none"
        there = any(topic.name == name for topic in self._topics)
        what = f"topic {name} cannot serve as {role}" if there else f"no messages on topic {name}, named for {role}"
        raise RecordingError(what, where=self._where, cure=f"topics that could be: {listed}")

    def _mask_candidates(self) -> list[Topic]:
        detections = self._chosen("detections")
        if detections is None:
            return []
        return [
            topic
            for topic in self._of("image")
            if topic.image is not None
            and topic.image.encoding.partition(";")[0].strip() in {"16UC1", "mono16", "mono8", "8UC1", "png"}
            and (_has(topic, _MASK_WORDS) or namespace_of(topic.name) == namespace_of(detections.name) != "")
        ]

    def _mask_rank(self, topic: Topic) -> tuple[float, ...]:
        detections = self._chosen("detections")
        near = _common_prefix(topic.name, detections.name) if detections else 0
        return (near, _has(topic, _MASK_WORDS), topic.channel.count)

    def _is_mask(self, topic: Topic) -> bool:
        return topic is self._chosen("masks") or _has(topic, _MASK_WORDS)

    def _is_depth(self, topic: Topic) -> bool:
        """By its encoding; 16-bit grey and plain PNG only if the name says so too."""
        image = topic.image
        if image is None or self._is_mask(topic):
            return False
        return is_depth_encoding(image) or (_has(topic, ("depth",)) and _can_be_depth(image))

    def _color_candidates(self) -> list[Topic]:
        return [
            each for each in self._of("image") if each.image and not self._is_depth(each) and not self._is_mask(each)
        ]

    def _color_rank(self, topic: Topic) -> tuple[float, ...]:
        encoding = topic.image.encoding if topic.image else ""
        has_info = any(namespace_of(info.name) == namespace_of(topic.name) for info in self._of("camera_info"))
        return (
            topic.fault is None,
            not _has(topic, _NO_COLOR),
            has_info,
            _has(topic, ("color", "rgb")),
            "mono" not in encoding and "8UC1" not in encoding,
            not _has(topic, ("right",)),
            topic.channel.count,
        )

    def _depth_candidates(self) -> list[Topic]:
        return [topic for topic in self._of("image") if self._is_depth(topic) and topic is not self._chosen("color")]

    def _depth_rank(self, topic: Topic) -> tuple[float, ...]:
        color = self._chosen("color")
        same_frame = color is not None and topic.frame_id == color.frame_id
        same_size = color is not None and topic.size == color.size
        near = 0 if color is None else _common_prefix(namespace_of(topic.name), namespace_of(color.name))
        return (
            topic.fault is None,
            not _has(topic, ("infra", "/ir", "confidence", "disparity")),
            _has(topic, ("aligned", "registered")),
            same_frame and same_size,
            same_frame,
            near,
            _has(topic, ("depth",)),
            topic.channel.count,
        )

    def _choose_camera_info(self, role: str, image_role: str) -> None:
        image = self._chosen(image_role)
        if image is None and role not in self._named:
            return
        candidates = [] if image is None else [info for info in self._of("camera_info") if _belongs(info, image)]
        if not candidates and len(self._of("camera_info")) == 1:
            candidates = self._of("camera_info")
        self._choose(role, candidates, lambda info: _belonging(info, image) if image else (0,))

    def _lidar_rank(self, topic: Topic) -> tuple[float, ...]:
        cameras = {each.frame_id for each in self._of("image")}
        return (
            topic.frame_id not in {"map", "odom", "world"} and topic.frame_id not in cameras,
            not _has(topic, _NO_SCAN),
            topic.channel.count,
        )

    def _odometry_candidates(self) -> list[Topic]:
        return [topic for topic in self._of("pose") if topic.channel.msgtype.endswith("Odometry")]

    def _odometry_rank(self, topic: Topic) -> tuple[float, ...]:
        return (
            _GROUND_TRUTH.search(topic.name.lower()) is None,
            not _has(topic, ("wheel", "raw", "target", "goal")),
            _has(topic, ("filtered", "fused")),
            topic.name in {"/odom", "/odometry"},
            topic.channel.count,
        )

    def _chosen(self, role: str) -> Topic | None:
        choice = self._choices.get(role)
        return choice.topic if choice else None

    def _note_missing(self) -> None:
        if "color" not in self._choices:
            self._miss(
                "no camera images",
                "record a sensor_msgs Image or CompressedImage topic, or name it: --topic color=/...",
            )
        elif "depth" not in self._choices and "lidar" not in self._choices:
            self._miss_depth()
        for choice in self._choices.values():
            if choice.role == "depth" and choice.topic.image and not _can_be_depth(choice.topic.image):
                self._problems.append(_unsupported_depth(choice.topic, choice.topic.image, self._where))
            elif (fault := choice.topic.fault) is not None:
                place = fault.where or f"{self._where}, {choice.topic.name}"
                self._problems.append(RecordingError(fault.what, where=place, cure=fault.cure))

    def _miss_depth(self) -> None:
        """No depth: because of an encoding that nobody here reads, or because there is none."""
        unsupported = [
            _unsupported_depth(topic, topic.image, self._where)
            for topic in self._of("image")
            if topic.image and (_has(topic, ("depth",)) or topic.fault)
            if topic is not self._chosen("color") and not self._is_mask(topic) and not _can_be_depth(topic.image)
        ]
        self._problems.extend(unsupported)
        if not unsupported:
            self._miss(
                "no depth images and no LiDAR",
                "record an aligned depth topic or a PointCloud2, or name one: --topic depth=/... or --topic lidar=/...",
            )

    def _miss(self, what: str, cure: str) -> None:
        known = ", ".join(topic.name for topic in self._topics) or "none of a known type"
        self._problems.append(RecordingError(f"{what} among its topics ({known})", where=self._where, cure=cure))


def _can_be_depth(image: ImageMessage) -> bool:
    """By its encoding: 16-bit grey and plain PNG may be depth or not."""
    return is_depth_encoding(image) or image.encoding.partition(";")[0].strip() in {"mono16", "png"}


def _unsupported_depth(topic: Topic, image: ImageMessage, where: str) -> RecordingError:
    return RecordingError(
        f"depth images with the encoding {image.encoding!r}, which is not supported",
        where=f"{where}, {topic.name}",
        cure=f"record them as one of {', '.join(DEPTH_ENCODINGS)}, or name another topic: --topic depth=/... or "
        f"--topic lidar=/...",
    )


def _belongs(info: Topic, image: Topic) -> bool:
    """Same namespace, or the same non-empty frame."""
    same_frame = info.frame_id == image.frame_id != ""
    return same_frame or namespace_of(info.name) == namespace_of(image.name)


def _belonging(info: Topic, image: Topic) -> tuple[float, ...]:
    calibration = info.calibration
    same_size = calibration is not None and (calibration.width, calibration.height) == image.size
    return (
        namespace_of(info.name) == namespace_of(image.name),
        same_size,
        _common_prefix(info.name, image.name),
        info.channel.count,
    )
