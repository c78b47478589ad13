"""The TF tree: static and moving transforms, interpolated at a sensor's stamp."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.errors import CalibrationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import interpolate_transform, inverse
from supermap_cli.recordings.messages import PoseMessage

HOLD_NS = 500_000_000
"""ns by which a moving transform may be carried beyond its last (or before its first) sample; tf2 would refuse, but the
ends of a recording are seldom cut cleanly.
"""

_KEEP_NS = 3_000_000_000
"""ns of samples kept behind the stamp that was last looked up, for stamps that come out of order."""

_LOOK_AHEAD_NS = 1_000_000_000
"""ns of samples read beyond a stamp before it is looked up, for transforms that come late."""


@dataclass
class Edge:
    """`T_parent_child` over time; a static edge, and one of which only one sample was ever seen, always holds."""

    parent: str
    child: str
    static: bool
    samples: list[tuple[int, FloatArray]] = field(default_factory=list)
    seen: int = 0

    def at(self, stamp_ns: int) -> FloatArray | None:
        """`T_parent_child` at a time: SLERP between the samples around it, `None` far from any."""
        if self.static or self.seen <= 1:
            return self.samples[-1][1] if self.samples else None
        after = bisect_left(self.samples, stamp_ns, key=_stamp)
        if after == 0 or after == len(self.samples):
            stamp, T = self.samples[min(after, len(self.samples) - 1)]
            return T if abs(stamp - stamp_ns) <= HOLD_NS or stamp == stamp_ns else None
        (start_ns, T_start), (end_ns, T_end) = self.samples[after - 1], self.samples[after]
        if end_ns == stamp_ns:
            return T_end
        return interpolate_transform(T_start, T_end, (stamp_ns - start_ns) / (end_ns - start_ns))


@dataclass(frozen=True)
class Link:
    """Which link to a frame counts, of several: the parent, and whether its static transform or its moving ones."""

    parent: str
    child: str
    static: bool


def _stamp(sample: tuple[int, FloatArray]) -> int:
    return sample[0]


class TransformTree:
    """Frames and the edges between them. Structural faults are `CalibrationError`s that name the frames."""

    def __init__(self, links: Mapping[str, Link] | None = None) -> None:
        self._edges: dict[str, Edge] = {}
        self._links = links or {}

    def add(self, message: PoseMessage, static: bool) -> bool:
        """Take one transform in; False if it is not finite, joins a frame with itself, or another link to that frame
        counts. Without a choice the last parent counts, as in tf2.
        """
        T = message.transform()
        parent, child = message.frame_id, message.child_frame_id
        if T is None or parent == child or not child:
            return False
        link = self._links.get(child)
        if link is not None and (link.parent, link.static) != (parent, static):
            return False
        edge = self._edges.get(child)
        if edge is None or edge.parent != parent:
            edge = self._edges[child] = Edge(parent, child, static)
        edge.seen += 1
        if static:
            edge.static, edge.samples = True, [(message.stamp_ns, T)]
        elif not edge.static and not (edge.samples and edge.samples[-1][0] == message.stamp_ns):
            if not edge.samples or edge.samples[-1][0] < message.stamp_ns:
                edge.samples.append((message.stamp_ns, T))
            else:
                insort(edge.samples, (message.stamp_ns, T), key=_stamp)
        return True

    def fix(self, message: PoseMessage) -> None:
        """Put a static link in, in place of what leads to that frame. Raises `CalibrationError` for what is none."""
        T = message.transform()
        if T is None or message.frame_id in {message.child_frame_id, ""}:
            raise CalibrationError(
                f"{message.frame_id!r} -> {message.child_frame_id!r} is no mounting", cure="name two different frames"
            )
        self._edges[message.child_frame_id] = Edge(
            message.frame_id, message.child_frame_id, static=True, samples=[(0, T)], seen=1
        )

    @property
    def edges(self) -> tuple[Edge, ...]:
        """All edges, ordered by child."""
        return tuple(self._edges[child] for child in sorted(self._edges))

    @property
    def frames(self) -> frozenset[str]:
        """The names of all frames."""
        return frozenset(self._edges) | {edge.parent for edge in self._edges.values()}

    def parent_of(self, frame: str) -> str | None:
        """The frame above, `None` for a root."""
        edge = self._edges.get(frame)
        return edge.parent if edge else None

    def children_of(self, frame: str) -> tuple[str, ...]:
        """The frames below, by name."""
        return tuple(edge.child for edge in self.edges if edge.parent == frame)

    def roots(self) -> tuple[str, ...]:
        """Frames without a parent, by name."""
        return tuple(sorted(self.frames - self._edges.keys()))

    def to_root(self, frame: str) -> list[str]:
        """`frame` and all frames above it. Raises `CalibrationError` on a loop."""
        chain = [frame]
        while (parent := self.parent_of(chain[-1])) is not None:
            if parent in chain:
                frames = chain[chain.index(parent) :]
                raise CalibrationError(
                    f"the TF tree has a loop: {' -> '.join([parent, *frames[::-1]])}",
                    cure="say where one of these frames sits on a frame outside of it, in metres and radians: --mount "
                    f'{frames[0]}="PARENT X Y Z ROLL PITCH YAW"',
                )
            chain.append(parent)
        return chain

    def path(self, target: str, source: str) -> tuple[list[Edge], list[Edge]]:
        """The edges from the common ancestor down to `target`, and down to `source`. Raises `CalibrationError`."""
        above_target, above_source = self.to_root(target), self.to_root(source)
        common = next((frame for frame in above_target if frame in above_source), None)
        if common is None:
            unknown = [frame for frame in (target, source) if frame not in self.frames]
            what = f"TF knows no frame {unknown[0]!r}" if unknown else f"TF does not connect {target!r} and {source!r}"
            raise CalibrationError(
                what,
                cure=f"record /tf_static with {target!r} -> {source!r}, or name the base frame with --frame base=NAME",
            )
        down_target = [self._edges[frame] for frame in above_target[: above_target.index(common)]]
        down_source = [self._edges[frame] for frame in above_source[: above_source.index(common)]]
        return down_target, down_source

    def connects(self, target: str, source: str) -> bool:
        """Whether there is a chain of transforms between two frames."""
        return target == source or bool(set(self.to_root(target)) & set(self.to_root(source)))

    def is_static(self, target: str, source: str) -> bool:
        """Whether the transform between two connected frames never changes."""
        return all(edge.static for chain in self.path(target, source) for edge in chain)

    def lookup(self, target: str, source: str, stamp_ns: int) -> FloatArray | None:
        """`T_target_source` at a time; `None` where a moving part of the chain is not known at that time."""
        if target == source:
            return np.eye(4)
        down_target, down_source = self.path(target, source)
        T_common_target, T_common_source = _chain(down_target, stamp_ns), _chain(down_source, stamp_ns)
        if T_common_target is None or T_common_source is None:
            return None
        T_target_source: FloatArray = inverse(T_common_target) @ T_common_source
        return T_target_source

    def forget_before(self, stamp_ns: int) -> None:
        """Drop samples that are no longer needed to interpolate after `stamp_ns`."""
        for edge in self._edges.values():
            keep = bisect_left(edge.samples, stamp_ns, key=_stamp) - 1
            if not edge.static and keep > 0:
                del edge.samples[:keep]


def _chain(edges_upwards: list[Edge], stamp_ns: int) -> FloatArray | None:
    T = np.eye(4)
    for edge in edges_upwards:
        step = edge.at(stamp_ns)
        if step is None:
            return None
        T = step @ T
    return T


class MovingTransforms:
    """A tree that moves along with the sensors' time and holds only a few seconds of samples."""

    def __init__(
        self,
        statics: Iterable[PoseMessage],
        moving: Callable[[], Iterator[tuple[int, PoseMessage]]],
        links: Mapping[str, Link] | None = None,
    ) -> None:
        self.tree = TransformTree(links)
        for transform in statics:
            self.tree.add(transform, static=True)
        self._moving = moving()
        self._read_until_ns: int | None = None

    def lookup(self, target: str, source: str, stamp_ns: int) -> FloatArray | None:
        """`T_target_source`; stamps have to come in ascending order, give or take a second."""
        while self._read_until_ns is None or self._read_until_ns < stamp_ns + _LOOK_AHEAD_NS:
            following = next(self._moving, None)
            if following is None:
                self._read_until_ns = 1 << 62
                break
            self._read_until_ns = following[0]
            self.tree.add(following[1], static=False)
        self.tree.forget_before(stamp_ns - _KEEP_NS)
        if not self.tree.connects(target, source):
            return None
        return self.tree.lookup(target, source, stamp_ns)
