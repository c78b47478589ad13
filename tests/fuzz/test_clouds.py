"""Point clouds of any layout, and point times of any clock: finite points with times come out, or one line."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from rosbags.typesys import Stores, get_typestore

from supermap_cli.recordings.decoding import Decoder, any_numbers
from supermap_cli.recordings.pointclouds import point_stamps, read_points
from supermap_cli.recordings.rvl import decode_rvl
from supermap_cli.recordings.storage import Channel, RawMessage
from supermap_cli.types.limits import LARGEST_STAMP_NS
from support.fuzzing import MUTATIONS, Edit, fuzzing, mutated, one_input, one_line
from support.hostile_messages import default_message

STORE = get_typestore(Stores.ROS2_JAZZY)
SMALL = st.integers(0, 40)
LARGE = st.sampled_from([2**31 - 1, 2**32 - 1, 2**24, 65536])
NAMES = st.sampled_from(
    ["x", "y", "z", "X", "t", "time", "timestamp", "offset_time", "intensity", "", "x", "rgb", "\0"]
)
FIELDS = st.lists(
    st.tuples(NAMES, st.one_of(SMALL, LARGE), st.one_of(st.integers(0, 12), st.just(255)), st.one_of(SMALL, LARGE)),
    max_size=8,
)
USUAL = [("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1), ("t", 12, 6, 1)]


@fuzzing(150, share=2)
@given(
    st.one_of(FIELDS, st.just(USUAL), st.builds(lambda more: [*USUAL[:3], *more], FIELDS)),
    *(st.one_of(SMALL, LARGE),) * 4,
    st.one_of(st.binary(max_size=600), st.sampled_from([b"\xff" * 1600, bytes(1600), b"\x7f" * 1600])),
    st.booleans(),
    st.integers(0, 2**31 - 1),
)
def test_any_layout(fields, width, height, point_step, row_step, data, big_endian, seconds) -> None:
    message = default_message(STORE, "sensor_msgs/msg/PointCloud2")
    field = message.fields[0]
    message.fields[:] = [
        type(field)(name=name, offset=offset, datatype=datatype, count=count)
        for name, offset, datatype, count in fields
    ]
    message.header.stamp.sec = seconds
    message.width, message.height, message.point_step, message.row_step = width, height, point_step, row_step
    message.data, message.is_bigendian = np.frombuffer(data, np.uint8), big_endian
    with one_input("cloud"):
        _read("sensor_msgs/msg/PointCloud2", bytes(STORE.serialize_cdr(message, "sensor_msgs/msg/PointCloud2")))


def _read(msgtype: str, data: bytes, serialization: str = "cdr") -> None:
    raw = RawMessage(Channel("/points", msgtype, serialization, b"", "ros2msg", 1), 7, data)
    read = one_line(lambda: read_points(raw, Decoder("here")))
    if read is not None:
        assert np.isfinite(read.points).all()
        assert read.points.shape == (len(read.point_stamps_ns), 3)


LIVOX = b"\0\1\0\0" + bytes(8) + b"\6\0\0\0lidar\0\0\0" + bytes(8) + b"\2\0\0\0" + bytes(4) + b"\2\0\0\0" + bytes(40)


@fuzzing(80)
@given(MUTATIONS, st.sampled_from(["cdr", "ros1"]))
def test_changed_livox_messages(changes: list[Edit], serialization: str) -> None:
    with one_input("cloud of Livox"):
        _read("livox_ros_driver2/msg/CustomMsg", mutated(LIVOX, changes), serialization)


KINDS = st.sampled_from(["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"])


@fuzzing(150, share=2)
@given(KINDS.flatmap(lambda kind: arrays.arrays(np.dtype(kind), st.integers(0, 8))), st.integers(0, 2**63 - 1))
def test_times_of_points_of_any_clock(times: np.ndarray, stamp_ns: int) -> None:
    with one_input("times of points"), any_numbers():
        stamps_ns, _ = point_stamps(times, min(stamp_ns, LARGEST_STAMP_NS))
        assert stamps_ns.dtype == np.int64
        assert len(stamps_ns) == len(times)


@fuzzing(80)
@given(st.binary(max_size=200), st.sampled_from([0, 1, 7, 64, 4096, 1 << 20]))
def test_any_rvl(data: bytes, pixels: int) -> None:
    with one_input("image rvl"):
        one_line(lambda: decode_rvl(data, pixels), ValueError)
