"""Messages of every type that is read, sound but for some fields that hold what no sensor sends: values come out, or an
error of one line.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from supermap_cli.recordings.definitions import FALLBACK_DEFINITIONS
from supermap_cli.recordings.messages import KINDS
from support import bag_writer, bags
from support.bag_writer import BagWriter
from support.detection_types import TYPES
from support.foxglove_bags import SCHEMAS, Json, write_foxglove
from support.fuzzing import fuzzing, one_input
from support.hostile_messages import CHANGES, default_message, hostile
from support.whole_recordings import read_everything

Changes = Sequence[tuple[float, int]]

Kept = tuple[str, str, bytes, int]
"""Topic, type, CDR and time (ns) of a message."""

ALIASES = {"yolov8_msgs": "yolo_msgs", "zed_interfaces": "zed_msgs"}
"""Packages whose messages have the layout of another package's."""


def _known() -> Typestore:
    """ROS 2's types, and those of detectors."""
    store = get_typestore(Stores.ROS2_JAZZY)
    packages = {**FALLBACK_DEFINITIONS, **TYPES}
    for alias, package in ALIASES.items():
        packages[alias] = {name: text.replace(package, alias) for name, text in TYPES[package].items()}
    for package, texts in packages.items():
        store.register(
            {
                found: fields
                for name, text in texts.items()
                for found, fields in get_types_from_msg(text, f"{package}/msg/{name}").items()
            }
        )
    return store


STORE = _known()
OTHER_TYPES = tuple(sorted(name for name in KINDS if name in STORE.fielddefs))
"""ROS types, each on a topic of its own beside a sound recording."""

TOPICS = (
    *("/camera/color/image_raw", "/camera/color/camera_info", "/camera/depth/image_raw", "/camera/depth/camera_info"),
    *("/odom", "/tf", "/tf_static", "/detections", "/masks", "/points", "/imu"),
)


class _Kept(BagWriter):
    """Keeps the messages of a sound recording, with an IMU for the LiDAR, instead of writing them."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.messages: list[Kept] = []

    def write(self, topic: str, msgtype: str, message: Any, log_ns: int) -> None:
        self.messages.append((topic, msgtype, bytes(self._store.serialize_cdr(message, msgtype)), log_ns))
        if topic == "/points":
            self.imu("/imu", log_ns, "base_link", (0, 0, 0), (0, 0, 9.81))


@cache
def sound(depth_encoding: str) -> tuple[Kept, ...]:
    with TemporaryDirectory(prefix="supermap-fuzz-") as folder:
        kept: list[_Kept] = []

        def writer(path: Path) -> _Kept:
            kept.append(_Kept(path))
            return kept[0]

        path = Path(folder) / "run.mcap"
        bags.write_recording(path, frames=3, lidar=True, depth_encoding=depth_encoding, writer=writer)
        return tuple(kept[0].messages)


def write(path: Path, messages: Iterable[tuple[str, str, bytes | Any, int]]) -> None:
    """Write messages, serialized or not, with their definitions, by the format of the suffix."""
    backend, connections = bag_writer._backend(path, {}), {}
    for topic, msgtype, message, log_ns in messages:
        data = message if isinstance(message, bytes) else bytes(STORE.serialize_cdr(message, msgtype))
        if path.suffix == ".bag":
            data = bytes(STORE.cdr_to_ros1(data, msgtype))
        if topic not in connections:
            connections[topic] = backend.connect(topic, msgtype, _definition(msgtype), STORE)
        backend.write(connections[topic], log_ns, data)
    backend.close()


@cache
def _definition(msgtype: str) -> str:
    return str(STORE.generate_msgdef(msgtype, ros_version=2)[0])


@pytest.mark.parametrize("name", ["run.mcap", "run.db3"])
def test_changed_fields(name: str) -> None:
    @fuzzing(25, share=1 if name == "run.mcap" else 0.2)
    @given(st.sampled_from(TOPICS), CHANGES, st.sampled_from(["16UC1", "compressedDepth"]))
    def changed(topic: str, changes: Changes, depth_encoding: str) -> None:
        with TemporaryDirectory(prefix="supermap-fuzz-") as folder, one_input(f"messages in {name}"):
            messages = [
                (each[0], each[1], hostile(STORE, each[1], STORE.deserialize_cdr(each[2], each[1]), changes), each[3])
                if each[0] == topic
                else each
                for each in sound(depth_encoding)
            ]
            write(Path(folder) / name, messages)
            read_everything(Path(folder) / name)

    changed()


@fuzzing(40)
@given(st.sampled_from(OTHER_TYPES), CHANGES, st.booleans())
def test_every_type(msgtype: str, changes: Changes, alone: bool) -> None:
    kind = KINDS[msgtype]
    others = [each for each in sound("16UC1") if not (alone and KINDS[each[1]] == kind)]
    message = hostile(STORE, msgtype, default_message(STORE, msgtype), changes)
    own = [("/other", msgtype, message, bags.stamp(index)) for index in range(3)]
    with TemporaryDirectory(prefix="supermap-fuzz-") as folder, one_input("messages of any type"):
        write(Path(folder) / "run.mcap", sorted([*others, *own], key=lambda each: each[3]))
        read_everything(Path(folder) / "run.mcap")


JSON_VALUES = st.sampled_from(
    [
        *(None, True, 0, -1, 2**63, 2**70, 1e308, float("nan"), float("inf"), "", "x" * 1000, "not base64!", [], {}),
        *([[]], [1, 2], {"sec": -1}, {"nsec": 2**40}, "NaN", "AAAA", 1.5, -(2**31), "\0"),
    ]
)


class _HostileJson(Json):
    def __init__(self, schema: str, field: str, value: object) -> None:
        super().__init__()
        self._schema, self._field, self._value = schema, field, value

    def encode(self, name: str, values: Mapping[str, Any]) -> bytes:
        if name.rpartition(".")[2] == self._schema:
            values = {**values, self._field: self._value}
        encoded: bytes = super().encode(name, values)
        return encoded


@fuzzing(40)
@given(st.data(), st.booleans())
def test_fields_of_foxglove_json(data: st.DataObject, compressed: bool) -> None:
    schema = data.draw(st.sampled_from(sorted(SCHEMAS)))
    field = data.draw(st.sampled_from([name for name, _ in SCHEMAS[schema]]))
    with TemporaryDirectory(prefix="supermap-fuzz-") as folder, one_input("messages in JSON"):
        path = Path(folder) / "run.mcap"
        write_foxglove(path, _HostileJson(schema, field, data.draw(JSON_VALUES)), compressed=compressed)
        read_everything(path)


LINKS = st.lists(
    st.tuples(
        *(st.sampled_from(["odom", "base_link", "camera_optical_frame", "lidar", "map", "", "x" * 2000, "\x1b"]),) * 2,
        st.lists(st.sampled_from([0.0, 1.0, -1.0, 1e30, np.nan, np.inf, 1e-320]), min_size=7, max_size=7),
        st.integers(-5, 10),
        st.booleans(),
    ),
    min_size=1,
    max_size=8,
)


@fuzzing(30)
@given(LINKS, st.sets(st.sampled_from(["tf", "tf_static", "odom"])))
def test_any_tree_of_transforms(links: list[Any], without: set[str]) -> None:
    """Loops, two parents, frames of no name, rotations of no length, times before all else."""
    links_of = [
        ("/tf_static" if static else "/tf", "tf2_msgs/msg/TFMessage", _link(parent, child, values, index), index)
        for parent, child, values, index, static in links
    ]
    own = [(topic, msgtype, message, bags.stamp(max(index, 0))) for topic, msgtype, message, index in links_of]
    others = [each for each in sound("16UC1") if each[0].removeprefix("/") not in without]
    with TemporaryDirectory(prefix="supermap-fuzz-") as folder, one_input("transforms"):
        write(Path(folder) / "run.mcap", sorted([*others, *own], key=lambda each: each[3]))
        read_everything(Path(folder) / "run.mcap")


def _link(parent: str, child: str, values: Sequence[float], index: int) -> Any:
    message = default_message(STORE, "tf2_msgs/msg/TFMessage")
    link = message.transforms.pop()
    message.transforms[:] = [link]
    link.header.frame_id, link.child_frame_id = parent, child
    link.header.stamp.sec, link.header.stamp.nanosec = divmod(bags.stamp(index), 10**9)
    for axis, value in zip("xyz", values[:3], strict=True):
        setattr(link.transform.translation, axis, value)
    for axis, value in zip("xyzw", values[3:], strict=True):
        setattr(link.transform.rotation, axis, value)
    return message
