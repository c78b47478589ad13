"""Whether what is taken as the robot's motion agrees with what else tells it: other odometries, and TF."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from supermap_cli.errors import CalibrationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import inverse, rotation_angle_rad
from supermap_cli.recordings import messages
from supermap_cli.recordings.motion import PoseSource, moving_base
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.pose_topics import is_odometry, why_no_motion
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.tf_survey import is_static
from supermap_cli.recordings.topic_plan import TopicPlan
from supermap_cli.recordings.transforms import TransformTree
from supermap_cli.recordings.window import RecordedData

_STILL_M, _MOVED_M = 0.02, 0.3
"""Metres that a source whose robot stands may tell, noise of SLAM included, and from which a robot has moved."""

_METRES_A_RADIAN = 0.5
"""A turn counts as the way of a point this far, in metres, from the axis: the size of a robot."""

_DIFFERS_M, _DIFFERS_RAD, _DIFFERS_SHARE = 0.2, np.deg2rad(10.0), 0.3
"""Two steps differ by more than this, and than that share of the longer one: far more than wheels slip or SLAM jumps.
"""

_NEAR_NS = 150_000_000
"""ns around a time in which a pose is one of that time, to within 15 cm of a robot at 1 m/s."""

_LEAST_STEPS = 3
"""Steps between looked at times that must be of both sources for a comparison to say anything."""

_MOST_COMPARED = 8
"""Other sources that one is compared with, TF first: each reads a chunk at every moment; no robot has more."""

Samples = list[tuple[int, FloatArray]]


@dataclass(frozen=True)
class MotionAgreement:
    """Compares sources of motion at the moments at which topics were looked at."""

    data: RecordedData
    topics: Sequence[Topic]
    tree: TransformTree

    def checked(self, source: PoseSource, plan: TopicPlan, notes: Notes) -> PoseSource:
        """The source; another instead where this one stands while that moves, and the user named nothing. Sources that
        disagree with the one that is used are noted, with the option that takes them.
        """
        frames, choice = self.data.request.frames, plan.shared.get("odometry")
        others = [other for other in self._others(plan) if _name(other) != _name(source)][:_MOST_COMPARED]
        named = (choice is not None and choice.named) or bool(frames.keys() & {"base", "odom"})
        own = self._samples(source)
        stands = not named and len(own) > _LEAST_STEPS and _way_m(own) <= _STILL_M
        for other in others:
            other_m = _way_m(self._samples(other))
            if stands and other_m >= _MOVED_M:
                notes.note(
                    "motion stands",
                    f"{self.data.where}, {source.description}: it stands still while {other.description} moves by "
                    f"{other_m:.1f} m: that is taken as the motion (--topic odometry={_option(source, self.topics)} "
                    "takes this one)",
                )
                return other
        for other in others:
            if self._disagree(source, other):
                notes.note(
                    f"motion differs {_name(other)}",
                    f"{self.data.where}, {source.description}: {other.description} tells another motion of the same "
                    f"robot; the first is used (--topic odometry={_option(other, self.topics)} takes the other)",
                )
        return source

    def _others(self, plan: TopicPlan) -> Iterator[PoseSource]:
        """All that tell the robot's motion: TF first, then each topic of odometry."""
        from_tree = moving_base(self.tree, self.data.request.frames, plan.main.frame_id)
        if from_tree is not None:
            yield from_tree
        for topic in self.topics:
            told = topic.kind == "pose" and is_odometry(topic) and topic.fault is None
            if told and why_no_motion(topic, self.topics) is None:
                yield PoseSource(topic, topic.frame_id, topic.child_frame_id)

    def _samples(self, source: PoseSource) -> Samples:
        """(stamp, pose) of what was looked at, at the times that were sampled."""
        if source.topic is not None:
            posed = ((pose.stamp_ns, pose.transform()) for pose in source.topic.poses)
            return [(stamp_ns, T) for stamp_ns, T in posed if T is not None]
        _, chain = self.tree.path(source.odom_frame, source.child_frame)
        leading = max((edge for edge in chain if not edge.static), key=lambda edge: len(edge.samples), default=None)
        stamps_ns = [] if leading is None else [stamp_ns for stamp_ns, _ in leading.samples]
        chosen = (
            [stamps_ns[at] for at in np.unique(np.linspace(0, len(stamps_ns) - 1, 20).astype(int))] if stamps_ns else []
        )
        looked_up = ((at_ns, self.tree.lookup(source.odom_frame, source.child_frame, at_ns)) for at_ns in chosen)
        return [(at_ns, T) for at_ns, T in looked_up if T is not None]

    def _disagree(self, first: PoseSource, second: PoseSource) -> bool:
        """Whether most of the steps that either tells of the robot are others than those of the other."""
        if first.topic is None:
            first, second = second, first
        if first.topic is None or (T_first_second := self._rigid(first, second)) is None:
            return False
        pairs = []
        for stamp_ns, T in self._samples(first):
            other = self._near(second, stamp_ns, first.topic.clock_offset_ns)
            if other is not None:
                pairs.append((T @ T_first_second, other))
        steps = [(inverse(a0) @ a1, inverse(b0) @ b1) for (a0, b0), (a1, b1) in pairwise(pairs)]
        moving = [step for step in steps if max(_length_m(step[0]), _length_m(step[1])) > _DIFFERS_M / 2]
        differ = sum(_differ(a, b) for a, b in moving)
        return len(moving) >= _LEAST_STEPS and 2 * differ > len(moving)

    def _rigid(self, first: PoseSource, second: PoseSource) -> FloatArray | None:
        """Where what the second moves sits on what the first moves, if both are one body."""
        if not (first.child_frame and second.child_frame):
            return None
        if first.child_frame == second.child_frame:
            return np.eye(4)
        try:
            if not self.tree.is_static(first.child_frame, second.child_frame):
                return None
            return self.tree.lookup(first.child_frame, second.child_frame, 0)
        except CalibrationError:
            return None

    def _near(self, source: PoseSource, stamp_ns: int, offset_ns: int) -> FloatArray | None:
        """The pose of a source at a time, if it tells one close to it."""
        if source.topic is None:
            _, chain = self.tree.path(source.odom_frame, source.child_frame)
            for edge in chain:
                near = edge.static or any(abs(at_ns - stamp_ns) <= _NEAR_NS for at_ns, _ in edge.samples)
                if not near:
                    return None
            return self.tree.lookup(source.odom_frame, source.child_frame, stamp_ns)
        log_ns = stamp_ns - offset_ns
        raws = self.data.storage.messages([source.topic.name], log_ns - _NEAR_NS, log_ns + _NEAR_NS)
        read = [pose for _, pose in self.data.decoder.each(raws, messages.read_pose)]
        best = min(read, key=lambda pose: abs(pose.stamp_ns - stamp_ns), default=None)
        return best.transform() if best is not None and abs(best.stamp_ns - stamp_ns) <= _NEAR_NS else None


def _length_m(step: FloatArray) -> float:
    return float(np.linalg.norm(step[:3, 3])) + _METRES_A_RADIAN * rotation_angle_rad(step[:3, :3])


def _way_m(samples: Samples) -> float:
    """The farthest from its first pose that a source tells, turns counted in metres."""
    return max((_length_m(inverse(samples[0][1]) @ T) for _, T in samples), default=0.0)


def _differ(first: FloatArray, second: FloatArray) -> bool:
    ways = [float(np.linalg.norm(step[:3, 3])) for step in (first, second)]
    turns = [rotation_angle_rad(step[:3, :3]) for step in (first, second)]
    apart_m = float(np.linalg.norm(first[:3, 3] - second[:3, 3]))
    apart_rad = rotation_angle_rad(first[:3, :3].T @ second[:3, :3])
    far = apart_m > max(_DIFFERS_M, _DIFFERS_SHARE * max(ways))
    return far or apart_rad > max(_DIFFERS_RAD, _DIFFERS_SHARE * max(turns))


def _name(source: PoseSource) -> str:
    return source.topic.name if source.topic is not None else ""


def _option(source: PoseSource, topics: Sequence[Topic]) -> str:
    """What `--topic odometry=` takes the source by."""
    if source.topic is not None:
        return source.topic.name
    return min((each.name for each in topics if each.kind == "transforms" and not is_static(each.name)), default="/tf")
