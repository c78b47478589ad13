"""Where the robot's motion is recorded: an odometry topic, the TF tree, or a pose topic; and which frame it moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.pose_topics import BASE_NAMES, ROBOT_WORDS, is_base, is_odometry, last_part, why_no_motion
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.topic_names import words_of
from supermap_cli.recordings.topic_plan import TopicPlan
from supermap_cli.recordings.transforms import TransformTree

_ODOM_NAMES = ("odom", "odom_combined", "odometry")
"""Names of the frame that odometry is given in (REP-105; odom_combined is robot_pose_ekf's)."""

_MAP_NAMES = ("map", "world", "utm", "earth")
"""Names of the frame above it, for robots without odom (REP-105)."""


@dataclass(frozen=True)
class PoseSource:
    """Where poses come from: `topic` is `None` for TF. They place `child_frame` in `odom_frame`; "" is unnamed."""

    topic: Topic | None
    odom_frame: str
    child_frame: str

    @property
    def is_continuous(self) -> bool:
        """Whether the poses are in a frame of odometry, which never jumps; one of a map may (REP-105)."""
        return _is_odom(self.odom_frame)

    @property
    def description(self) -> str:
        """For people."""
        frames = f"{self.odom_frame or '?'} -> {self.child_frame or '?'}"
        return f"{self.topic.name} ({frames})" if self.topic else f"TF ({frames})"


@dataclass(frozen=True)
class MotionFinder:
    """Looks for the robot's motion. `topics` are all topics of the robot, `length_s` is the recording's."""

    topics: Sequence[Topic]
    tree: TransformTree
    frames: Mapping[str, str]
    length_s: float

    def not_motion(self) -> dict[str, str]:
        """Topics of poses that cannot be the robot's motion, and why."""
        poses = [topic for topic in self.topics if topic.kind == "pose"]
        told = {topic.name: why_no_motion(topic, self.topics, self.length_s) for topic in poses}
        return {name: reason for name, reason in told.items() if reason is not None}

    def find(self, plan: TopicPlan, notes: Notes) -> PoseSource | None:
        """An Odometry topic, or what the user named; else odom (or map) -> base in TF; else a pose topic."""
        chosen = plan.shared.get("odometry")
        if chosen is not None and chosen.topic.kind == "pose":
            told = PoseSource(chosen.topic, chosen.topic.frame_id, chosen.topic.child_frame_id)
            return self._connected(plan, told, notes)
        from_tree = moving_base(self.tree, self.frames, _color_frame(plan))
        if from_tree is not None or chosen is not None:
            return from_tree
        poses = [topic for topic in self.topics if topic.kind == "pose"]
        reasons = self.not_motion()
        for name, reason in reasons.items():
            notes.note(
                f"no motion {name}",
                f"{name} is not taken as the robot's motion: {reason} (--topic odometry={name} takes it)",
            )
        fitting = [topic for topic in poses if topic.name not in reasons]
        if not fitting:
            return None
        best = max(
            fitting, key=lambda topic: (_named_as_robots(topic), len(topic.poses), topic.channel.count, topic.name)
        )
        return PoseSource(best, best.frame_id, best.child_frame_id)

    def _connected(self, plan: TopicPlan, source: PoseSource, notes: Notes) -> PoseSource:
        """The source itself; another odometry or TF's motion instead, where TF connects with the camera what that
        moves, and not what the source moves; and the user named nothing.
        """
        frame, choice = _color_frame(plan), plan.shared["odometry"]
        if not (frame and source.child_frame) or choice.named or self.frames.keys() & {"base", "odom"}:
            return source
        if self.tree.connects(source.child_frame, frame):
            return source
        odometries = [topic for topic in self.topics if topic.kind == "pose" and is_odometry(topic)]
        others = [
            *(PoseSource(topic, topic.frame_id, topic.child_frame_id) for topic in odometries if topic.poses),
            moving_base(self.tree, self.frames, frame),
        ]
        for other in others:
            known = other is not None and other.child_frame in self.tree.frames
            if other is None or not known or not self.tree.connects(other.child_frame, frame):
                continue
            if other.topic is not None and why_no_motion(other.topic, self.topics) is not None:
                continue
            notes.note(
                "motion instead",
                f"{source.description} moves a frame that TF does not connect with the camera: {other.description} is "
                f"taken as the motion (--frame base={other.child_frame} takes the two frames as one)",
            )
            return other
        return source


def _named_as_robots(topic: Topic) -> bool:
    return not words_of(topic.name).isdisjoint(ROBOT_WORDS)


def _color_frame(plan: TopicPlan) -> str:
    return plan.main.frame_id


def moving_base(tree: TransformTree, frames: Mapping[str, str], sensor_frame: str = "") -> PoseSource | None:
    """The frame that moves under odom (or map) in TF, if there is one; of several that which bears the sensor.
    Where TF knows the sensor, a marker or a thing that moves under the map beside it is none.

    Prefixes of frames are looked through: r1/odom is an odom.
    """
    named_odom, named_base = frames.get("odom"), frames.get("base")
    found: list[PoseSource] = []
    for name in (named_odom,) if named_odom else (*_ODOM_NAMES, *_MAP_NAMES):
        for odom in sorted(frame for frame in tree.frames if frame == name or (not named_odom and _ends(frame, name))):
            moving = [named_base] if named_base else [_deepest_moving(tree, child) for child in tree.children_of(odom)]
            found += [
                PoseSource(None, odom, base)
                for base in sorted(moving, key=lambda frame: (last_part(frame) not in BASE_NAMES, frame))
                if base in tree.frames and tree.connects(odom, base) and not tree.is_static(odom, base)
            ]
    bearing = [source for source in found if sensor_frame and tree.connects(source.child_frame, sensor_frame)]
    rigid = [source for source in bearing if tree.is_static(source.child_frame, sensor_frame)]
    if sensor_frame in tree.frames and not named_base:
        found = [source for source in found if _is_odom(source.odom_frame) or is_base(source.child_frame)]
    return next(iter((*rigid, *bearing, *found)), None)


def _is_odom(frame: str) -> bool:
    return any(frame == name or _ends(frame, name) for name in _ODOM_NAMES)


def _bases(tree: TransformTree) -> list[str]:
    """Frames that are named as a base, the likeliest first."""
    return [frame for name in BASE_NAMES for frame in sorted(tree.frames) if last_part(frame) == name]


def _ends(frame: str, name: str) -> bool:
    return frame.endswith((f"/{name}", f"_{name}"))


def _deepest_moving(tree: TransformTree, frame: str) -> str:
    """From odom's child down to base_link, where they are a chain: odom -> base_footprint -> base_link."""
    if _is_odom(frame):
        return next((_deepest_moving(tree, child) for child in tree.children_of(frame)), frame)
    below = [child for child in tree.children_of(frame) if last_part(child) in BASE_NAMES]
    return below[0] if len(below) == 1 and last_part(frame) != "base_link" else frame


def find_base_frame(
    source: PoseSource | None,
    tree: TransformTree,
    sensor_frame: str,
    frames: Mapping[str, str],
    notes: Notes,
) -> str:
    """The frame that poses move: named by the user; else the pose's own; else the child of odom in TF; else a guess.

    A pose without a name for what it moves is taken as that of the sensor's root in TF (noted), as is a recording
    without any poses.
    """
    if named := frames.get("base"):
        return named
    if source is not None and source.child_frame:
        return source.child_frame
    moving = moving_base(tree, frames, sensor_frame)
    if moving is not None:
        base = moving.child_frame
    elif source is None and (known := _bases(tree)):
        base = known[0]
    else:
        base = tree.to_root(sensor_frame)[-1]
    if source is not None and source.topic is not None:
        notes.note(
            "base",
            f"{source.topic.name} does not say what it moves: {base!r} is assumed (else say --frame base=NAME)",
        )
    return base
