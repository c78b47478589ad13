"""Where the robot's motion is recorded: an odometry topic, the TF tree, or a pose topic; and which frame it moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.topic_plan import TopicPlan
from supermap_cli.recordings.transforms import TransformTree

_ODOM_NAMES = ("odom", "odom_combined", "odometry")
"""Names of the frame that odometry is given in (REP-105; odom_combined is robot_pose_ekf's)."""

_MAP_NAMES = ("map", "world")
"""Names of the frame above it, for robots without odom (REP-105)."""

_BASE_NAMES = ("base_link", "base_footprint", "base", "body")
"""Names of the robot's base (REP-105, REP-120), the likeliest first."""


@dataclass(frozen=True)
class PoseSource:
    """Where poses come from: `topic` is `None` for TF. They place `child_frame` in `odom_frame`; "" is unnamed."""

    topic: Topic | None
    odom_frame: str
    child_frame: str

    @property
    def description(self) -> str:
        """For people."""
        frames = f"{self.odom_frame or '?'} -> {self.child_frame or '?'}"
        return f"{self.topic.name} ({frames})" if self.topic else f"TF ({frames})"


def find_pose_source(
    plan: TopicPlan, topics: Sequence[Topic], tree: TransformTree, frames: Mapping[str, str]
) -> PoseSource | None:
    """An Odometry topic, or what the user named; else odom (or map) -> base in TF; else a pose topic."""
    chosen = plan.topic("odometry")
    if chosen is not None and chosen.kind == "pose":
        return PoseSource(chosen, chosen.frame_id, chosen.child_frame_id)
    from_tree = _moving_base(tree, frames)
    if from_tree is not None or chosen is not None:
        return from_tree
    poses = [topic for topic in topics if topic.kind == "pose"]
    if not poses:
        return None
    best = max(poses, key=lambda topic: (topic.channel.count, topic.name))
    return PoseSource(best, best.frame_id, best.child_frame_id)


def _moving_base(tree: TransformTree, frames: Mapping[str, str]) -> PoseSource | None:
    """The frame that moves under odom (or map) in TF, if there is one."""
    named_odom, named_base = frames.get("odom"), frames.get("base")
    roots = (named_odom,) if named_odom else (*_ODOM_NAMES, *_MAP_NAMES)
    for odom in roots:
        if odom not in tree.frames:
            continue
        moving = [named_base] if named_base else [_deepest_moving(tree, child) for child in tree.children_of(odom)]
        for base in sorted(moving, key=lambda frame: (frame not in _BASE_NAMES, frame)):
            if base in tree.frames and tree.connects(odom, base) and not tree.is_static(odom, base):
                return PoseSource(None, odom, base)
    return None


def _deepest_moving(tree: TransformTree, frame: str) -> str:
    """From odom's child down to base_link, where they are a chain: odom -> base_footprint -> base_link."""
    if frame in _ODOM_NAMES:
        return next((_deepest_moving(tree, child) for child in tree.children_of(frame)), frame)
    below = [child for child in tree.children_of(frame) if child in _BASE_NAMES]
    return below[0] if len(below) == 1 and frame != "base_link" else frame


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
    moving = _moving_base(tree, frames)
    if moving is not None:
        base = moving.child_frame
    elif source is None and (known := [name for name in _BASE_NAMES if name in tree.frames]):
        base = known[0]
    else:
        base = tree.to_root(sensor_frame)[-1]
    if source is not None and source.topic is not None:
        notes.note(
            "base",
            f"{source.topic.name} does not say what it moves: {base!r} is assumed (else say --frame base=NAME)",
        )
    return base
