"""Recorded motion as `T_odom_base`: from an odometry or pose topic, or from the TF tree."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from supermap_cli.errors import UnusablePosesError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.recordings import messages
from supermap_cli.recordings.continuous_poses import ContinuousPoses
from supermap_cli.recordings.motion import PoseSource
from supermap_cli.recordings.opening import MARGIN_NS, OpenedRecording
from supermap_cli.recordings.rig_finding import ORIGIN_STEP_M
from supermap_cli.recordings.survey import Topic
from supermap_cli.types.limits import FARTHEST_M
from supermap_cli.types.sensing import StampedPose


def recorded_poses(opened: OpenedRecording, source: PoseSource) -> Iterator[StampedPose]:
    """Poses in the window and a little beyond it, in the order they were recorded.

    Poses that are not finite are left out with a note. Raises `UnusablePosesError` with the reasons if none is left.
    """
    skipped = _SkippedPoses(opened, source.topic.name if source.topic else "TF")
    if source.topic is None:
        poses = _from_tree(opened, source, skipped)
    else:
        poses = _from_topic(opened, source, source.topic, skipped)
    count = 0
    near = _near_origin(opened, poses, skipped)
    for pose in _continuous(opened, source, near) if source.is_continuous else near:
        if opened.rig.window.holds(pose.stamp_ns, MARGIN_NS):
            count += 1
            yield pose
    if not count:
        raise UnusablePosesError(
            f"no usable poses in the window{skipped.summary}",
            where=f"{opened.path}, {source.description}{skipped.first_time}",
            cure="widen --start/--end, name another source with --topic odometry=/..., or record again",
        )


def _continuous(opened: OpenedRecording, source: PoseSource, poses: Iterator[StampedPose]) -> Iterator[StampedPose]:
    """The poses without the jumps of their frame, each of which is noted; those that go back in time as they are."""
    continuous, last_ns = ContinuousPoses(), None
    for pose in poses:
        if last_ns is not None and pose.stamp_ns <= last_ns:
            yield pose
            continue
        last_ns = pose.stamp_ns
        moved, jump = continuous.add(pose)
        if jump is not None:
            place = opened.place(source.topic.name if source.topic else "TF", pose.stamp_ns)
            opened.notes.note(
                f"jump at {pose.stamp_ns}",
                f"{place}: the odometry jumps by {jump.distance_m:.2f} m and {jump.turn_deg:.1f} degrees, farther than "
                "anything moves: the poses after it are brought back to where the robot went on",
            )
        yield moved


class _SkippedPoses:
    """Counts poses that had to be left out and keeps the note on them."""

    def __init__(self, opened: OpenedRecording, topic: str) -> None:
        self._opened = opened
        self._topic = topic
        self._counts: dict[str, int] = {}
        self._first_ns: dict[str, int] = {}

    def add(self, why: str, stamp_ns: int) -> None:
        """One more pose left out."""
        self._counts[why] = self._counts.get(why, 0) + 1
        place = self._opened.place(self._topic, self._first_ns.setdefault(why, stamp_ns))
        self._opened.notes.note(f"poses {why}", f"{place}: {why}, {self._counts[why]} pose(s) left out")

    @property
    def first_time(self) -> str:
        """When the first one was left out, to end a place; "" for none."""
        if not self._first_ns:
            return ""
        return " at " + self._opened.place("", min(self._first_ns.values())).rpartition(" at ")[2]

    @property
    def summary(self) -> str:
        """What was left out and why, to end an error's sentence; "" for nothing."""
        counts = ", ".join(f"{count} left out ({why})" for why, count in self._counts.items())
        return f": {'all ' if len(self._counts) == 1 else ''}{counts}" if counts else ""


def _from_topic(
    opened: OpenedRecording, source: PoseSource, topic: Topic, skipped: _SkippedPoses
) -> Iterator[StampedPose]:
    moved = source.child_frame or opened.rig.base_frame
    transforms = opened.transforms(moved, {opened.rig.base_frame})
    raws, shift_ns = (
        opened.storage.messages([topic.name], *opened.rig.window.log_range(MARGIN_NS)),
        opened.shift_ns(topic.name),
    )
    for _, read in opened.decoder.each(raws, messages.read_pose):
        message = read.later(shift_ns)
        fault, T_odom_moved = message.fault, message.transform()
        if fault is not None or T_odom_moved is None:
            skipped.add(fault or "a pose that is not finite", message.stamp_ns)
            continue
        T_moved_base = transforms.lookup(moved, opened.rig.base_frame, message.stamp_ns)
        if T_moved_base is None:
            skipped.add(f"TF does not place {opened.rig.base_frame!r} on {moved!r}", message.stamp_ns)
            continue
        covariance = None
        if message.covariance is not None:
            covariance = carried_covariance(message.covariance, T_odom_moved[:3, :3] @ T_moved_base[:3, 3])
        yield StampedPose(message.stamp_ns, T_odom_moved @ T_moved_base, covariance)


def _near_origin(
    opened: OpenedRecording, poses: Iterator[StampedPose], skipped: _SkippedPoses
) -> Iterator[StampedPose]:
    """The poses with their positions counted from the recording's origin, without those that no map reaches: of a
    receiver that has no fix yet, at 0.
    """
    origin = opened.rig.origin
    for pose in poses:
        T_odom_base = pose.T_odom_base
        if origin.any():
            T_odom_base = T_odom_base.copy()
            T_odom_base[:3, 3] -= origin
        if np.abs(T_odom_base[:3, 3]).max() > FARTHEST_M + ORIGIN_STEP_M:
            skipped.add("a pose more than 10 km from where the others are", pose.stamp_ns)
            continue
        yield replace(pose, T_odom_base=T_odom_base)


def carried_covariance(covariance: FloatArray, lever_arm: FloatArray) -> FloatArray:
    """The covariance (6, 6) of a pose, carried over to a point on the same body, `lever_arm` (3,) away.

    Both are along the fixed axes of odom, as in ROS, so that nothing is turned: what the rotation is off by moves the
    point across the lever arm.
    """
    x, y, z = lever_arm
    J: FloatArray = np.eye(6)
    J[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    carried: FloatArray = J @ covariance @ J.T
    return carried


def _from_tree(opened: OpenedRecording, source: PoseSource, skipped: _SkippedPoses) -> Iterator[StampedPose]:
    """The chain odom -> base at every stamp of its moving link next to odom."""
    _, chain = opened.tree.path(source.odom_frame, opened.rig.base_frame)
    moving = [edge for edge in chain if not edge.static]
    if not moving:
        return
    leading = moving[-1].child
    transforms = opened.transforms(source.odom_frame, {opened.rig.base_frame})
    for _, message in opened.moving_transforms(MARGIN_NS):
        if message.child_frame_id != leading:
            continue
        if (fault := message.fault) is not None:
            skipped.add(f"{leading!r} is at {fault}", message.stamp_ns)
            continue
        T_odom_base = transforms.lookup(source.odom_frame, opened.rig.base_frame, message.stamp_ns)
        if T_odom_base is None:
            skipped.add(f"TF does not connect {source.odom_frame!r} and {opened.rig.base_frame!r}", message.stamp_ns)
            continue
        yield StampedPose(message.stamp_ns, T_odom_base)
