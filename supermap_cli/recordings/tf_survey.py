"""The structure of TF as the whole recording shows it: which links there are, and what counts where they conflict."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import inverse
from supermap_cli.recordings import messages
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.messages import PoseMessage
from supermap_cli.recordings.pose_topics import BASE_NAMES, last_part
from supermap_cli.recordings.storage import RawMessage, Storage
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.transforms import Link, TransformTree

_FIRST_TRANSFORMS = 2000
"""Messages of moving transforms that are read from the start: some ten seconds of a robot with 20 of them at 10 Hz."""

_MOMENTS, _MOMENT_NS, _MOMENT_MESSAGES = 16, 1_000_000_000, 150
"""Later moments, spread evenly to the end, ns of log time and messages at each, in which further links are found."""

_MOST_READ = 20_000
"""Messages of moving transforms up to which all of them are read: a second's work."""

_SAME_M, _SAME_RAD = 0.02, np.deg2rad(2.0)
"""Two transforms of one link closer than this agree: what rounding and calibration by hand leave."""

_FASTEST, _JUMPS_SHARE = 10.0, 0.2
"""m/s that no robot's link is faster than, and the share of steps faster than it from which two publishers tell two
places in turn.
"""

_KEPT_SAMPLES = 4000
"""Samples of a moving link that are compared."""

_WORLD = re.compile(r"(^|[/_])(map|odom|odom_combined|odometry|world|earth|utm|camera_init)$")
"""Frames in which a robot moves (REP-105; FAST-LIO's and LOAM's camera_init)."""

_ODOM = re.compile(r"(^|[/_])(odom|odom_combined|odometry)$")


@dataclass
class _Seen:
    """What was seen of one link."""

    static: list[FloatArray] = field(default_factory=list)
    moving: list[tuple[int, FloatArray]] = field(default_factory=list)
    count: int = 0

    def take(self, stamp_ns: int, T: FloatArray, *, static: bool) -> None:
        self.count += 1
        if static:
            self.static.append(T)
        elif len(self.moving) < _KEPT_SAMPLES:
            self.moving.append((stamp_ns, T))

    @property
    def moves(self) -> bool:
        """Whether the moving samples really differ."""
        return any(_apart(self.moving[0][1], T) for _, T in self.moving[1:])


@dataclass(frozen=True)
class SurveyedTransforms:
    """The tree, which of conflicting links counts (`links`, by child), and what is to be said of it (`warnings`).

    `whole` says that every message was read.
    """

    tree: TransformTree
    links: Mapping[str, Link]
    warnings: tuple[str, ...]
    whole: bool


def survey_transforms(
    storage: Storage, decoder: Decoder, topics: Iterable[Topic], *, whole: bool = False
) -> SurveyedTransforms:
    """All static transforms, the first of the moving ones and samples of the later ones; all where `whole`."""
    named = [topic for topic in topics if topic.kind == "transforms"]
    seen: dict[tuple[str, str], _Seen] = {}
    read: list[tuple[PoseMessage, bool]] = []
    for static in (True, False):
        names = [topic.name for topic in named if is_static(topic.name) == static]
        whole = whole or sum(topic.channel.count for topic in named if not is_static(topic.name)) <= _MOST_READ
        raws = storage.messages(names) if static or whole else _sampled(storage, names)
        for _, transforms in decoder.each(raws, messages.read_transforms):
            for message in transforms:
                T = message.transform()
                if T is not None and message.child_frame_id and message.child_frame_id != message.frame_id:
                    key = (message.frame_id, message.child_frame_id)
                    seen.setdefault(key, _Seen()).take(message.stamp_ns, T, static=static)
                    if len(seen[key].static) + len(seen[key].moving) < _KEPT_SAMPLES:
                        read.append((message, static))
    children = _by_child(seen)
    links = {child: _link(child, parents) for child, parents in children.items()}
    links, loops = _without_loops(links, children)
    tree = TransformTree(links)
    for message, static in read:
        tree.add(message, static=static)
    return SurveyedTransforms(tree, links, (*_warnings(seen, links), *loops), whole)


def is_static(topic: str) -> bool:
    """Whether a topic holds transforms that always hold."""
    return "static" in topic


def _sampled(storage: Storage, names: Sequence[str]) -> Iterator[RawMessage]:
    last_ns = storage.start_ns
    for raw in islice(storage.messages(names), _FIRST_TRANSFORMS):
        last_ns = raw.log_ns
        yield raw
    for start_ns in np.linspace(last_ns + 1, max(last_ns + 1, storage.end_ns - _MOMENT_NS), _MOMENTS).tolist():
        yield from islice(storage.messages(names, int(start_ns), int(start_ns) + _MOMENT_NS), _MOMENT_MESSAGES)


def _by_child(seen: Mapping[tuple[str, str], _Seen]) -> dict[str, dict[str, _Seen]]:
    children: dict[str, dict[str, _Seen]] = {}
    for (parent, child), links in seen.items():
        children.setdefault(child, {})[parent] = links
    return children


def _link(child: str, parents: Mapping[str, _Seen]) -> Link:
    """Which of a frame's links counts: a static mounting, else that under odom, else the one told most often.

    A static link right under a world frame mounts nothing: it stands in for one that moves, where there is such a one.
    """

    def rank(parent: str) -> tuple[object, ...]:
        seen = parents[parent]
        return (bool(seen.static) and not _is_world(parent), bool(_ODOM.search(parent)), seen.count, parent)

    parent = max(parents, key=rank)
    seen = parents[parent]
    return Link(parent, child, static=bool(seen.static) and not (_is_world(parent) and seen.moving and seen.moves))


def _without_loops(
    links: Mapping[str, Link], children: Mapping[str, Mapping[str, _Seen]]
) -> tuple[dict[str, Link], list[str]]:
    """The links without those that close a loop, as far as it can be told which these are, and what is said of it.

    A world or a base frame under a frame of its own is turned round: another parent of it counts, or none. A loop of
    other frames stays, and whoever follows it says so.
    """
    kept, said = dict(links), []
    for frame in sorted(links):
        loop = _loop_through(kept, frame)
        tops = [each for each in loop if _is_world(each) or last_part(each) in BASE_NAMES]
        if not tops:
            continue
        top = min(tops, key=lambda each: (not _is_world(each), each))
        wrong = kept[top].parent
        others = {parent: seen for parent, seen in children[top].items() if parent not in loop}
        kept[top] = _link(top, others) if others else Link("", top, static=True)
        if _loop_through(kept, top):
            kept[top] = Link("", top, static=True)
        said.append(
            f"TF: {' -> '.join([*loop, loop[0]])} is a loop; {wrong!r} -> {top!r} is left out, as {top!r} bears the "
            f'others (else say which link holds: --mount FRAME="PARENT X Y Z ROLL PITCH YAW")'
        )
    return kept, said


def _loop_through(links: Mapping[str, Link], frame: str) -> list[str]:
    """The frames of the loop that leads through a frame, from parent to child; [] if there is none."""
    chain = [frame]
    while (link := links.get(chain[-1])) is not None and link.parent:
        if link.parent == frame:
            return chain[::-1]
        if link.parent in chain:
            return []
        chain.append(link.parent)
    return []


def _is_world(frame: str) -> bool:
    return _WORLD.search(frame) is not None


def _warnings(seen: Mapping[tuple[str, str], _Seen], links: Mapping[str, Link]) -> Iterator[str]:
    for child, parents in sorted(_by_child(seen).items()):
        link = links[child]
        if not link.parent:
            continue
        if len(parents) > 1:
            listed = " and ".join(repr(parent) for parent in sorted(parents))
            why = "the static mounting counts" if link.static else "this one counts"
            others = ", ".join(repr(parent) for parent in sorted(parents) if parent != link.parent)
            yield (
                f"TF: {child!r} has two parents, {listed}; {link.parent!r} -> {child!r}: {why}, and not that under "
                f"{others}"
                if len(parents) == 2
                else f"TF: {child!r} has {len(parents)} parents, {listed}; {link.parent!r} -> {child!r}: {why}"
            )
        yield from _disagreements(link, parents[link.parent])


def _disagreements(link: Link, seen: _Seen) -> Iterator[str]:
    """Two publishers of one link that say different things."""
    name = f"TF: {link.parent!r} -> {link.child!r}"
    if seen.static and any(_apart(seen.static[0], T) for T in seen.static[1:]):
        yield f"{name} is given several times in /tf_static, not always the same; the last one counts"
    if seen.static and seen.moving and any(_apart(seen.static[-1], T) for _, T in seen.moving):
        yield (
            f"{name} is static and moves too, and the two differ; the static one counts"
            if link.static
            else f"{name} is static and moves too; the moving one counts, as no mounting stands under {link.parent!r}"
        )
    elif not link.static and _is_told_twice(seen.moving):
        yield (
            f"{name} jumps to and fro, as if two nodes published it; name a motion with --topic odometry=/..., or "
            "record with one of them switched off"
        )


def _is_told_twice(samples: Sequence[tuple[int, FloatArray]]) -> bool:
    """Whether samples lie further apart than anything moves, and the next step leads back, again and again."""
    ordered = sorted(samples, key=lambda sample: sample[0])
    steps_m = np.diff(np.array([T[:3, 3] for _, T in ordered]).reshape(-1, 3), axis=0)
    most_m = np.maximum(0.1, _FASTEST * np.diff([stamp_ns for stamp_ns, _ in ordered]) / 1e9)
    far = np.linalg.norm(steps_m, axis=1) > most_m
    back = np.einsum("ij,ij->i", steps_m[:-1], steps_m[1:]) < 0
    jumps = int(np.count_nonzero(far[:-1] & far[1:] & back))
    return jumps > max(4, _JUMPS_SHARE * len(ordered))


def _apart(a: FloatArray, b: FloatArray) -> bool:
    """Whether two transforms differ by more than rounding."""
    T = inverse(a) @ b
    turn = np.arccos(np.clip((np.trace(T[:3, :3]) - 1) / 2, -1, 1))
    return bool(np.linalg.norm(T[:3, 3]) > _SAME_M or turn > _SAME_RAD)
