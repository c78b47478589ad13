"""Several robots in one recording: told apart by the namespaces of their topics and the prefixes of their frames."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import pairwise

import numpy as np

from supermap_cli.errors import CalibrationError, ConfigError, RecordingError
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.pose_topics import base_prefix, is_base
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.topic_names import namespace_of
from supermap_cli.recordings.transforms import TransformTree

_ONE_MOMENT_NS = 300_000_000
"""ns up to which two poses are of one moment of the survey."""

_OTHER_WAY_M, _OTHER_WAY_SHARE, _LEAST_STEPS = 0.2, 0.4, 3
"""m, and share of the longer way, by which the ways of one robot differ at most by two odometries between two moments,
and how many such steps tell: slipping wheels and drifting cameras are better than that.
"""


def topics_of_robot(  # noqa: PLR0917 - what is known of the robots
    topics: Sequence[Topic],
    wanted: str | None,
    named: Collection[str],
    where: str,
    notes: Notes,
    tree: Callable[[], TransformTree] = TransformTree,
) -> tuple[str | None, tuple[Topic, ...]]:
    """The robot's name, and its topics with those of no robot and those that the user `named`; all for a lone robot.

    `tree` is asked for TF where topics tell no robots apart. `wanted` is the robot's name; without it the only one with
    images is taken (noted). Raises `RecordingError` where several have images, `ConfigError` for a name that no robot
    has.
    """
    robots = find_robots(topics) or robots_in(tree())
    owners = {topic.name: _owner(topic, robots) for topic in topics}
    if wanted is not None:
        chosen = wanted.strip("/")
        if chosen not in robots:
            chosen, robots = _by_namespace(topics, chosen, robots)
            owners = {topic.name: _owner(topic, robots) for topic in topics}
    elif len(robots) < 2:
        return None, tuple(topics)
    else:
        chosen = _only_one_with_images(topics, robots, owners, named, where)
        others = ", ".join(robot for robot in robots if robot != chosen)
        notes.note(
            "robots",
            f"{where}: {len(robots)} robots are in it; {chosen} is mapped, which alone has camera images or was named "
            f"(others: {others}; choose with --robot)",
        )
    return chosen, tuple(topic for topic in topics if owners[topic.name] in {None, chosen} or topic.name in named)


def find_robots(topics: Sequence[Topic]) -> tuple[str, ...]:
    """The robots' names, in order; () where there is but one.

    Each has a TF of its own (/r1/tf, /r2/tf), or moves a frame of its own (r1/base_link, r1_base_link), or has odometry
    of the same name in another namespace, which differs by a number alone (/r1/odom, /r2/odom) or goes another way, or
    behind another prefix (/r1_odom, /r2_odom) and goes another way.
    """
    tf = {namespace_of(topic.name).strip("/") for topic in topics if topic.kind == "transforms"} - {""}
    if len(tf) > 1:
        return tuple(sorted(tf))
    odometry = [topic for topic in topics if topic.kind == "pose" and topic.channel.msgtype.endswith("Odometry")]
    prefixes = {topic.child_frame_id.rpartition("/")[0] or base_prefix(topic.child_frame_id) for topic in odometry}
    prefixes -= {"", None}
    if len(prefixes) > 1:
        return tuple(sorted(prefix for prefix in prefixes if prefix))
    for sign in "/_":
        alike: dict[str, list[Topic]] = {}
        for topic in odometry:
            first, _, rest = topic.name.strip("/").partition(sign)
            if first and rest:
                alike.setdefault(rest, []).append(topic)
        found = (names for group in alike.values() if len(names := _of_several(group, sign)) > 1)
        if names := next(found, ()):
            return names
    return ()


def robots_in(tree: TransformTree) -> tuple[str, ...]:
    """The robots that one TF tells apart: each moves a base of its own, named with its prefix (r1/base_link,
    r1_base_link), none of which is mounted on another (an arm's on a robot).
    """
    bases = {frame: prefix for frame in tree.frames if (prefix := base_prefix(frame)) is not None}
    found = set()
    for frame, prefix in bases.items():
        try:
            above = tree.to_root(frame)[1:]
        except CalibrationError:
            continue
        moves = any(not edge.static for edge in tree.edges if edge.child in {frame, *above})
        if moves and not any(is_base(each) and base_prefix(each) != prefix for each in above):
            found.add(prefix)
    return tuple(sorted(found)) if len(found) > 1 else ()


def _of_several(odometries: Sequence[Topic], sign: str) -> tuple[str, ...]:
    """The namespaces, or prefixes before "_", of odometries of one name that are of several robots: namespaces that are
    numbered alike, or either moving differently.
    """
    spaces = {topic.name.strip("/").partition(sign)[0]: topic for topic in odometries}
    first, *others = spaces.values() if spaces else (None,)
    apart = first is not None and any(_moves_otherwise(first, other) for other in others)
    if sign == "_":
        return tuple(sorted(spaces)) if apart else ()
    numbered = Counter(re.sub(r"\d+", "#", space) for space in spaces if re.search(r"\d", space))
    if numbered and max(numbered.values()) > 1:
        usual = numbered.most_common(1)[0][0]
        return tuple(sorted(space for space in spaces if re.sub(r"\d+", "#", space) == usual))
    return tuple(sorted(spaces)) if apart else ()


def _moves_otherwise(a: Topic, b: Topic) -> bool:
    """Whether two odometries go different lengths between the moments of the survey: not one robot's two estimates."""
    stamps = np.array([pose.stamp_ns for pose in b.poses], np.int64)
    pairs = []
    for pose in a.poses if len(stamps) else ():
        nearest = int(np.argmin(np.abs(stamps - pose.stamp_ns)))
        if abs(int(stamps[nearest]) - pose.stamp_ns) < _ONE_MOMENT_NS:
            pairs.append((pose.position, b.poses[nearest].position))
    steps = [(np.linalg.norm(p - q), np.linalg.norm(r - s)) for (p, r), (q, s) in pairwise(pairs)]
    different = sum(abs(m - n) > _OTHER_WAY_M + _OTHER_WAY_SHARE * max(m, n) for m, n in steps)
    return len(steps) >= _LEAST_STEPS and different > len(steps) / 2


def _owner(topic: Topic, robots: Collection[str]) -> str | None:
    """The robot whose namespace a topic stands in, or whose prefix its frame has; `None` for no single one's."""
    for robot in sorted(robots, key=len, reverse=True):
        if _begins_with(topic.name.strip("/"), robot):
            return robot
    frames = (topic.frame_id, topic.child_frame_id)
    owners = {robot for robot in robots if any(_begins_with(frame, robot) for frame in frames)}
    return owners.pop() if len(owners) == 1 else None


def _begins_with(name: str, robot: str) -> bool:
    return name.startswith((f"{robot}/", f"{robot}_"))


def _by_namespace(topics: Sequence[Topic], wanted: str, robots: Collection[str]) -> tuple[str, tuple[str, ...]]:
    """A robot that nothing but its namespace shows: every first part of a topic's name is then a robot's."""
    spaces = {topic.name.strip("/").partition("/")[0] for topic in topics if topic.name.strip("/").count("/")}
    if wanted not in spaces and any(_begins_with(topic.name.strip("/"), wanted) for topic in topics):
        spaces |= {wanted}
    if wanted in spaces and not robots:
        return wanted, tuple(sorted(spaces))
    listed = ", ".join(robots or sorted(spaces)) or "none, its topics have no namespaces"
    raise ConfigError(f"--robot {wanted}: there is no such robot", cure=f"the namespaces are: {listed}")


def _only_one_with_images(
    topics: Sequence[Topic],
    robots: Sequence[str],
    owners: Mapping[str, str | None],
    named: Collection[str],
    where: str,
) -> str:
    of_named = {owner for name in named if (owner := owners.get(name)) is not None}
    with_images = {owner for topic in topics if topic.kind == "image" and (owner := owners[topic.name]) is not None}
    for found in (of_named, with_images):
        if len(found) == 1:
            return found.pop()
    raise RecordingError(
        f"{len(robots)} robots are in it ({', '.join(robots)}), and "
        + ("more than one has camera images" if with_images else "no camera is in the namespace of one of them"),
        where=where,
        cure=f"choose one with --robot {sorted(with_images or robots)[0]}",
    )
