"""Which topic serves which role: found by type, told apart by name, rate and frame; the user may name any of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.image_topics import (
    COLOR_LOST,
    MASK_WORDS,
    ColorRanking,
    can_be_depth,
    has_word,
    is_color,
    is_depth,
    is_lossy,
    named_as_no_depth,
    shows_a_camera,
)
from supermap_cli.recordings.images import DEPTH_ENCODINGS
from supermap_cli.recordings.messages import ImageMessage, Kind
from supermap_cli.recordings.pose_topics import WORLD_NAMES, is_odometry, last_part, why_no_motion
from supermap_cli.recordings.roles import NamedTopics, role_name
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.topic_choices import RoleFilling
from supermap_cli.recordings.topic_names import (
    common_parts,
    common_words,
    device_of,
    is_on_colors_pixels,
    names_depth,
    namespace_of,
)
from supermap_cli.recordings.topic_plan import CameraPlan, TopicChoice, TopicPlan
from supermap_cli.types.sensing import MAIN_CAMERA

_NOT_SCAN_WORDS = ("depth", "camera", "color", "map", "ground", "obstacle", "world", "deskew", "filtered", "registered")
"""A point cloud topic whose name holds one of them is no raw scan of a LiDAR."""

_DEPTH_LOST = (
    *("cannot be read", "is named as another camera's", "is named infrared, confidence or disparity"),
    *("is not named aligned", "is not of the colour's frame and size", "is not in the colour's frame"),
    *("is named less like the colour topic", "is not named depth", "has fewer messages"),
)
_INFO_LOST = (
    *("does not stand beside the images", "is in another frame", "stands in another folder", "is of another size"),
    *("is named less like the images", "has fewer messages"),
)
_LIDAR_LOST = ("is in the frame of a camera or of the map", "is named as no raw scan", "has fewer messages")
_IMU_LOST = ("is not named data", "has fewer messages")
_ODOMETRY_LOST = (
    *("is ground truth", "covers less of the recording", "is named wheel, raw, target or goal"),
    *("is not named filtered or fused", "is not named odometry", "has fewer messages"),
)
"""What a topic lacks that lost by each element of the rank of its role."""

_MOST_LISTED = 30
"""Topics that an error lists."""

_GROUND_TRUTH = re.compile(r"ground_?truth|(^|[/_])gt([/_]|$)")
"""Beside an odometry, the truth is there to judge by; a robot does not have it."""


class MissingTopicError(RecordingError):
    """No topic of the recording is of one of `kinds`."""

    def __init__(self, what: str, *, where: str, cure: str, kinds: tuple[Kind, ...]) -> None:
        super().__init__(what, where=where, cure=cure)
        self.kinds = kinds


def plan_topics(topics: Sequence[Topic], named: NamedTopics, where: str) -> TopicPlan:
    """Choose a topic for every role that can be served, for a lone camera.

    Raises `RecordingError` if the user named what is not there.
    """
    shared = plan_shared(topics, named.plain, where)
    planner = CameraPlanner(topics, topics, named.of_camera(MAIN_CAMERA), where, lidar_stands_in="lidar" in shared)
    camera = planner.plan()
    return TopicPlan((camera,), shared, faults(shared.values(), where))


def plan_shared(topics: Sequence[Topic], named: Mapping[str, str], where: str) -> Mapping[str, TopicChoice]:
    """The topics of the roles that are of no single camera."""
    choices = RoleFilling(topics, named, where)
    frames = {topic.frame_id for topic in topics if topic.kind == "image" or is_odometry(topic)}
    clouds = _of(topics, "points")
    sound = [topic for topic in clouds if topic.fault is None]
    needed = not any(topic.kind == "image" and is_depth(topic) for topic in topics)
    choices.choose("lidar", sound or (clouds if needed else []), lambda topic: _lidar_rank(topic, frames), _LIDAR_LOST)
    choices.choose(
        "imu",
        [topic for topic in _of(topics, "imu") if topic.fault is None],
        lambda topic: (has_word(topic, ("data",)), topic.channel.count),
        _IMU_LOST,
    )
    odometries = [topic for topic in _of(topics, "pose") if is_odometry(topic) and why_no_motion(topic, topics) is None]
    most = max((len(topic.poses) for topic in odometries), default=0)
    choices.choose("odometry", odometries, lambda topic: _odometry_rank(topic, most), _ODOMETRY_LOST)
    return choices.chosen


class CameraPlanner:
    """Fills the roles of one camera one after the other; later ones look at earlier ones.

    `own` are the topics that may be its, `topics` all there are (any of them may be named); `lidar_stands_in` says that
    it may go without depth images.
    """

    def __init__(
        self,
        own: Sequence[Topic],
        topics: Sequence[Topic],
        named: Mapping[str, str],
        where: str,
        *,
        lidar_stands_in: bool,
        camera_id: str = MAIN_CAMERA,
    ) -> None:
        self._own = own
        self._topics = topics
        self._named = named
        self._where = where
        self._lidar_stands_in = lidar_stands_in
        self._camera_id = camera_id
        self._choices = RoleFilling(topics, named, where, camera_id)
        self._problems: list[RecordingError] = []
        self._doubts: list[str] = []

    def plan(self) -> CameraPlan:
        """The camera's topics. Raises `RecordingError` if the user named what is not there."""
        choices = self._choices
        choices.choose("detections", self._readable("detections"), lambda topic: (topic.channel.count,))
        choices.choose("masks", self._mask_candidates(), self._mask_rank)
        choices.choose("color", self._color_candidates(), self._color_ranking().rank, COLOR_LOST)
        self._prefer_own_detections()
        self._leave_out_foreign_detections()
        choices.choose("depth", self._depth_candidates(), self._depth_rank, _DEPTH_LOST)
        self._choose_camera_info("camera_info", "color")
        self._choose_camera_info("depth_camera_info", "depth")
        self._note_missing()
        self._problems += faults(choices.chosen.values(), self._where)
        problems, doubts = tuple(self._problems), tuple(self._doubts)
        return CameraPlan(self._camera_id, dict(choices.chosen), problems, bool(self._named), doubts=doubts)

    def _of(self, kind: Kind) -> list[Topic]:
        return _of(self._own, kind)

    def _readable(self, kind: Kind) -> list[Topic]:
        """The topics of a kind that a build can do without, as far as they can be read."""
        return [topic for topic in self._of(kind) if topic.fault is None]

    def _prefer_own_detections(self) -> None:
        """Of several detection topics the one of the colour camera; which images are masks does not change by it."""
        color = self._choices.topic("color")
        if color is None or len(self._readable("detections")) < 2:
            return
        self._choices.choose(
            "detections",
            self._readable("detections"),
            lambda topic: (not self._is_of_other_camera(topic, color), topic.channel.count),
        )
        self._choices.choose("masks", self._mask_candidates(), self._mask_rank)

    def _leave_out_foreign_detections(self) -> None:
        """Detections that bear the frame of another camera are not this one's, whatever their topic is called."""
        color, detections = self._choices.topic("color"), self._choices.topic("detections")
        if color is None or detections is None or not color.frame_id or self._choices.is_named("detections"):
            return
        others = {topic.frame_id for topic in self._topics if shows_a_camera(topic)} - {color.frame_id, ""}
        if detections.frame_ids and detections.frame_ids <= others:
            for role in ("detections", "masks"):
                self._choices.chosen.pop(role, None)
            self._doubts.append(
                f"{detections.name} holds detections in images of the frame {min(detections.frame_ids)!r}, not of "
                f"{color.name} ({color.frame_id!r}): left out"
            )

    def _is_of_other_camera(self, topic: Topic, color: Topic) -> bool:
        """Whether name and frame say that a topic belongs to another colour topic than the chosen one."""
        device = device_of(topic.name)
        others = {device_of(candidate.name) for candidate in self._color_candidates()} - {device_of(color.name)}
        return device in others and topic.frame_id != color.frame_id

    def _mask_candidates(self) -> list[Topic]:
        detections = self._choices.topic("detections")
        if detections is None:
            return []
        return [
            topic
            for topic in self._of("image")
            if topic.image is not None
            and topic.image.encoding.partition(";")[0].strip() in {"16UC1", "mono16", "mono8", "8UC1", "png"}
            and (has_word(topic, MASK_WORDS) or namespace_of(topic.name) == namespace_of(detections.name) != "")
        ]

    def _mask_rank(self, topic: Topic) -> tuple[float, ...]:
        detections = self._choices.topic("detections")
        near = common_parts(topic.name, detections.name) if detections else 0
        return (near, has_word(topic, MASK_WORDS), topic.channel.count)

    def _is_mask(self, topic: Topic) -> bool:
        return topic is self._choices.topic("masks") or has_word(topic, MASK_WORDS)

    def _color_candidates(self) -> list[Topic]:
        return [topic for topic in self._of("image") if is_color(topic) and not self._is_mask(topic)]

    def _color_ranking(self) -> ColorRanking:
        detections = self._choices.topic("detections") if len(self._of("detections")) == 1 else None
        return ColorRanking(
            self._color_candidates(),
            self._depth_images(),
            {namespace_of(info.name) for info in self._of("camera_info")},
            frozenset() if detections is None else detections.frame_ids,
        )

    def _depth_images(self) -> list[Topic]:
        """What can serve as depth, whatever is chosen as colour."""
        images = [topic for topic in self._of("image") if is_depth(topic) and not self._is_mask(topic)]
        return [topic for topic in images if not is_lossy(topic)]

    def _depth_candidates(self) -> list[Topic]:
        color = self._choices.topic("color")
        return [topic for topic in self._depth_images() if topic is not color]

    def _depth_rank(self, topic: Topic) -> tuple[float, ...]:
        color = self._choices.topic("color")
        same_frame = color is not None and topic.frame_id == color.frame_id
        same_size = color is not None and topic.size == color.size
        near = 0 if color is None else common_parts(namespace_of(topic.name), namespace_of(color.name))
        return (
            topic.fault is None,
            color is None or not self._is_of_other_camera(topic, color),
            not named_as_no_depth(topic),
            is_on_colors_pixels(topic.name),
            same_frame and same_size,
            same_frame,
            near,
            names_depth(topic.name),
            topic.channel.count,
        )

    def _choose_camera_info(self, role: str, image_role: str) -> None:
        image = self._choices.topic(image_role)
        if image is None and not self._choices.is_named(role):
            return
        infos = self._of("camera_info")
        candidates = [] if image is None else [info for info in infos if _belongs(info, image)]
        if not candidates and len(infos) == 1:
            candidates = infos
        self._choices.choose(
            role, candidates, lambda info: _belonging(info, image, infos) if image else (0,), _INFO_LOST
        )

    def _note_missing(self) -> None:
        color, depth = self._choices.topic("color"), self._choices.topic("depth")
        if color is None:
            self._miss(
                "no camera images",
                "record a sensor_msgs Image or CompressedImage topic, or name it: "
                f"--topic {role_name('color', self._camera_id)}=/...",
                "image",
            )
        elif depth is None and not self._lidar_stands_in:
            self._miss_depth()
        if depth is not None and depth.image and (not can_be_depth(depth.image) or is_lossy(depth)):
            self._problems.append(self._unsupported_depth(depth, depth.image))

    def _miss_depth(self) -> None:
        """No depth: because of an encoding that is not supported, or because there is none."""
        unsupported = [
            self._unsupported_depth(topic, topic.image)
            for topic in self._of("image")
            if topic.image and (names_depth(topic.name) or topic.fault)
            if topic is not self._choices.topic("color") and not self._is_mask(topic)
            if is_lossy(topic) or not can_be_depth(topic.image)
        ]
        self._problems.extend(unsupported)
        if not unsupported:
            if self._camera_id == MAIN_CAMERA:
                self._miss(
                    "no depth images and no LiDAR",
                    "record an aligned depth topic or a PointCloud2, or name one: --topic depth=/... or "
                    "--topic lidar=/...",
                    *("points", "image"),
                )
            else:
                self._miss(
                    f"no depth images of the camera {self._camera_id!r}",
                    f"record its aligned depth, or name it: --topic depth.{self._camera_id}=/...",
                    "image",
                )

    def _miss(self, what: str, cure: str, *kinds: Kind) -> None:
        names = [topic.name for topic in self._topics[:_MOST_LISTED]]
        more = len(self._topics) - len(names)
        known = ", ".join([*names, *([f"and {more} more"] if more else [])]) or "none of a known type"
        what = f"{what} among its topics ({known})"
        self._problems.append(MissingTopicError(what, where=self._where, cure=cure, kinds=kinds))

    def _unsupported_depth(self, topic: Topic, image: ImageMessage) -> RecordingError:
        if is_lossy(topic):
            return RecordingError(
                f"lossy depth images of 8 bits ({image.encoding.strip()!r}): they hold no distances",
                where=f"{self._where}, {topic.name}",
                cure="record compressedDepth, raw or 16-bit PNG images, or name another topic: "
                f"--topic {role_name('depth', self._camera_id)}=/... or --topic lidar=/...",
            )
        return RecordingError(
            f"depth images with the encoding {image.encoding!r}, which is not supported",
            where=f"{self._where}, {topic.name}",
            cure=f"record them as one of {', '.join(DEPTH_ENCODINGS)}, or name another topic: "
            f"--topic {role_name('depth', self._camera_id)}=/... or --topic lidar=/...",
        )


def _of(topics: Iterable[Topic], kind: Kind) -> list[Topic]:
    return [topic for topic in topics if topic.kind == kind]


def _lidar_rank(topic: Topic, others_frames: set[str]) -> tuple[float, ...]:
    return (
        last_part(topic.frame_id) not in WORLD_NAMES and topic.frame_id not in others_frames,
        not has_word(topic, _NOT_SCAN_WORDS),
        topic.channel.count,
    )


def _odometry_rank(topic: Topic, most_poses: int) -> tuple[float, ...]:
    return (
        _GROUND_TRUTH.search(topic.name.lower()) is None,
        2 * len(topic.poses) >= most_poses,
        not has_word(topic, ("wheel", "raw", "target", "goal")),
        has_word(topic, ("filtered", "fused")),
        topic.name in {"/odom", "/odometry"},
        topic.channel.count,
    )


def faults(choices: Iterable[TopicChoice], where: str) -> tuple[RecordingError, ...]:
    """Why topics that were chosen cannot be read; not for depth of an unsupported encoding, reported before."""
    return tuple(
        RecordingError(fault.what, where=fault.where or f"{where}, {choice.topic.name}", cure=fault.cure)
        for choice in choices
        if (fault := choice.topic.fault) is not None
        and not (choice.role == "depth" and choice.topic.image and not can_be_depth(choice.topic.image))
    )


def _belongs(info: Topic, image: Topic) -> bool:
    """Same namespace, or the same non-empty frame."""
    same_frame = info.frame_id == image.frame_id != ""
    return same_frame or namespace_of(info.name) == namespace_of(image.name)


def _belonging(info: Topic, image: Topic, infos: Sequence[Topic]) -> tuple[float, ...]:
    """A folder of its own says more than the frame, and this more than a folder that several cameras share."""
    calibration = info.calibration
    together = namespace_of(info.name) == namespace_of(image.name)
    alone = sum(namespace_of(other.name) == namespace_of(image.name) for other in infos) == 1
    same_size = calibration is not None and (calibration.width, calibration.height) == image.size
    return (
        together and alone,
        info.frame_id == image.frame_id != "",
        together,
        same_size,
        common_words(info.name, image.name),
        info.channel.count,
    )
