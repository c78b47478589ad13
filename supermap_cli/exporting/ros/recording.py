"""The map as an `.mcap` that plays beside the recordings it was built from, with their stamps.

All messages are CDR with ROS 2 definitions, so that `ros2 bag play` takes the file as well as Foxglove.

| topic | type |
| --- | --- |
| /supermap/scene | foxglove_msgs/SceneUpdate |
| /supermap/markers | visualization_msgs/MarkerArray |
| /supermap/objects | vision_msgs/Detection3DArray |
| /supermap/path | nav_msgs/Path |
| /supermap/transforms | foxglove_msgs/FrameTransforms |
| /supermap/changes | foxglove_msgs/Log |
| /tf | tf2_msgs/TFMessage |
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer

from supermap_cli.errors import ExportError
from supermap_cli.exporting.ros import definitions as kinds
from supermap_cli.exporting.ros.messages import MapMessages, StandingThing
from supermap_cli.exporting.selection import ExportSource
from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.memory.stored_values import parsed_transform
from supermap_cli.memory.streaming import stream_keyframes
from supermap_cli.memory.values import StoredInstance, StoredTraversal
from supermap_cli.query.presence_at import describe_presence, presence_at

LIBRARY = "supermap export"
SCENE, MARKERS, OBJECTS = "/supermap/scene", "/supermap/markers", "/supermap/objects"
PATH, TRANSFORMS, CHANGES, TF = "/supermap/path", "/supermap/transforms", "/supermap/changes", "/tf"
BASE, ODOM = "supermap_base", "odom"
"""Frames of the robot and of its odometry; a recording's own tree hangs below its odom (REP-105)."""
STEP_NS, EVERY_NS = 500_000_000, 5_000_000_000
"""ns; changes within the former are told together; what stands is repeated after the latter (chosen)."""
MOST_ENTITIES = 400_000
"""Things in all statements together; in a large map they are made more rarely (about 600 MB before compression)."""
MOST_POSES = 1000
"""Poses of a path; a longer one is thinned."""


@dataclass(frozen=True)
class _Outgoing:
    stamp_ns: int
    topic: str
    kind: str
    data: bytes


def write_mcap(source: ExportSource, path: Path) -> dict[str, int]:
    """Write the recording; returns the number of messages by topic. As of a time, it holds what stood then only.

    Raises `ExportError` for a map without traversals in the selection, and for stamps that ROS cannot hold.
    """
    if not source.traversals:
        raise ExportError("no traversal is selected, and so no time to write at", cure="build a recording into the map")
    messages = MapMessages()
    counts: dict[str, int] = {}
    with path.open("wb") as file:
        writer: Any = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library=LIBRARY)
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        for message in source.with_progress("messages", _all_messages(source, messages)):
            if message.kind not in schemas:
                text = messages.definition(message.kind)
                schemas[message.kind] = writer.register_schema(name=message.kind, encoding="ros2msg", data=text)
            if message.topic not in channels:
                channels[message.topic] = writer.register_channel(message.topic, "cdr", schemas[message.kind])
            writer.add_message(channels[message.topic], message.stamp_ns, message.data, message.stamp_ns)
            counts[message.topic] = counts.get(message.topic, 0) + 1
        writer.finish()
    return counts


def _all_messages(source: ExportSource, messages: MapMessages) -> Iterator[_Outgoing]:
    instances = [
        instance
        for instance in source.reader.iter_instances(visits=False)
        if instance.presence != "doubted" and source.selection.has_label(instance.label)
    ]
    for traversal in sorted(source.traversals, key=lambda traversal: traversal.start_ns):
        shift_ns = traversal.clock_shift_ns
        if traversal.start_ns - shift_ns < 0 or (traversal.end_ns - shift_ns) // 10**9 >= 2**31:
            raise ExportError(
                "a time that ROS has no stamp for (1970 to 2038)",
                where=f"traversal {traversal.name}",
                cure="choose another with --traversal",
            )
        yield from sorted(_of_traversal(source, messages, traversal, instances), key=lambda each: each.stamp_ns)


def _of_traversal(
    source: ExportSource, messages: MapMessages, traversal: StoredTraversal, instances: Sequence[StoredInstance]
) -> Iterator[_Outgoing]:
    """The messages of a traversal in any order, with the stamps of its recording."""
    shift_ns = traversal.clock_shift_ns
    stamps_ns, T_map_base = source.reader.poses(traversal.id)
    for at_ns in _times(source, traversal, instances):
        things = [thing for instance in instances if (thing := standing(source, instance, at_ns)) is not None]
        stamp_ns = at_ns - shift_ns
        yield _Outgoing(stamp_ns, SCENE, kinds.SCENE, messages.scene(stamp_ns, things))
        yield _Outgoing(stamp_ns, MARKERS, kinds.MARKERS, messages.markers(stamp_ns, things))
        yield _Outgoing(stamp_ns, OBJECTS, kinds.DETECTIONS, messages.detections(stamp_ns, things))
        so_far, poses = _thinned(stamps_ns[stamps_ns <= at_ns], T_map_base)
        data = messages.path(stamp_ns, (so_far - shift_ns).tolist(), poses)
        yield _Outgoing(stamp_ns, PATH, kinds.PATH, data)
    yield from _transforms(source, messages, traversal)
    yield from _changes(source, messages, traversal)


def _times(source: ExportSource, traversal: StoredTraversal, instances: Sequence[StoredInstance]) -> list[int]:
    """When it is told what stands: at the start and the end, after changes, and from time to time."""
    selected = source.selection.at_ns
    if selected is not None:
        newest = max(source.traversals, key=lambda begun: begun.start_ns)
        return [selected] if traversal.id == newest.id else []
    start_ns, end_ns = traversal.start_ns, traversal.end_ns
    changed = {
        when
        for instance in instances
        for state in instance.states
        for when in (state.first_seen_ns, state.last_seen_ns + 1, state.gone_ns)
        if when is not None and start_ns < when < end_ns
    }
    every_ns = max(EVERY_NS, (end_ns - start_ns) // 200)
    budget = max(2, MOST_ENTITIES // (max(1, len(instances)) * max(1, len(source.traversals))))
    step_ns = max(STEP_NS, (end_ns - start_ns) // budget)
    steps = {start_ns + -(-(when - start_ns) // step_ns) * step_ns for when in changed}
    steps |= set(range(start_ns, end_ns, max(every_ns, step_ns)))
    return sorted({when for when in steps if when < end_ns} | {start_ns, end_ns})


def standing(source: ExportSource, instance: StoredInstance, at_ns: int) -> StandingThing | None:
    """What is known of an instance at a time, by what was seen until today; `None` where it does not stand, and before
    it was first seen.
    """
    known = presence_at(instance, at_ns)
    if known is None or known.value == "absent" or known.state.first_seen_ns > at_ns:
        return None
    metadata = {
        "label": instance.label,
        "presence": known.value,
        "why": describe_presence(known, at_ns, source.clock),
        "confidence": f"{known.state.confidence:.3f}",
        "first seen": source.clock.text(known.state.first_seen_ns),
        "last seen": source.clock.text(known.state.last_seen_ns),
    }
    certain = known.value == "present"
    return StandingThing(instance.number, instance.id, instance.label, known.state, certain, metadata)


def _thinned(stamps_ns: IntArray, T_map_base: FloatArray) -> tuple[IntArray, FloatArray]:
    """At most `MOST_POSES` of the first poses, the last of them always."""
    count = len(stamps_ns)
    if not count:
        return stamps_ns, T_map_base[:0]
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_POSES)).round().astype(int))
    return stamps_ns[chosen], T_map_base[chosen]


def _transforms(source: ExportSource, messages: MapMessages, traversal: StoredTraversal) -> Iterator[_Outgoing]:
    """At every keyframe, where the robot and its camera were, and where the odometry's frame stands in the map."""
    for row in stream_keyframes(source.reader, traversal.id, source.selection.at_ns):
        stamp_ns = row.stamp_ns - traversal.clock_shift_ns
        what = f"a pose of keyframe {row.id}"
        camera = f"supermap_camera_{row.camera_id}"
        frames = {
            ODOM: traversal.T_map_odom,
            BASE: parsed_transform(row.T_map_base, what),
            camera: parsed_transform(row.T_map_camera, what),
        }
        yield _Outgoing(stamp_ns, TRANSFORMS, kinds.TRANSFORMS, messages.transforms(stamp_ns, frames))
        yield _Outgoing(stamp_ns, TF, kinds.TF, messages.tf(stamp_ns, frames))


def _changes(source: ExportSource, messages: MapMessages, traversal: StoredTraversal) -> Iterator[_Outgoing]:
    """The changes that the traversal found, in words, at the time by which they had happened."""
    edges = [
        edge
        for edge in source.reader.temporal_edges_within(traversal.start_ns, traversal.end_ns)
        if traversal.start_ns <= edge.not_after_ns <= traversal.end_ns
        and source.selection.includes_event(traversal.id, edge.not_after_ns)
    ]
    ids = source.reader.text_ids.of({number for edge in edges for number in (edge.from_number, edge.to_number)})
    for edge in edges:
        first, second = ids[edge.from_number], ids[edge.to_number]
        what = f"{first} {edge.kind}" if first == second else f"{first} {edge.kind} {second}"
        distance = "" if edge.distance_m is None else f" {edge.distance_m:.2f} m"
        between = source.clock.between(edge.not_before_ns, edge.not_after_ns)
        stamp_ns = edge.not_after_ns - traversal.clock_shift_ns
        yield _Outgoing(stamp_ns, CHANGES, kinds.LOG, messages.log(stamp_ns, f"{what}{distance} {between}"))
