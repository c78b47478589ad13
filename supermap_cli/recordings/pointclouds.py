"""LiDAR sweeps from PointCloud2 of any layout, Livox CustomMsg and Foxglove PointCloud, each point with its own time.

Sources: sensor_msgs/PointCloud2 and PointField; livox_ros_driver2's CustomMsg.msg; foxglove.PointCloud.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.recordings.decoding import FAULTS, Decoder, any_numbers
from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.messages import PoseMessage, bytes_of, header_of
from supermap_cli.recordings.storage import RawMessage
from supermap_cli.types.limits import LARGEST_STAMP_NS

_POINT_FIELD = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8", 9: "i8", 10: "u8"}
"""numpy's name of a sensor_msgs/PointField datatype (9 and 10 are not ROS's, but drivers write them)."""

_FOXGLOVE_FIELD = {1: "u1", 2: "i1", 3: "u2", 4: "i2", 5: "u4", 6: "i4", 7: "f4", 8: "f8"}
"""numpy's name of a foxglove.PackedElementField type."""

_TIME_FIELDS = ("t", "time", "timestamp", "offset_time", "time_offset", "timeoffset", "time_stamp", "timestamps", "ts")
"""Names of the per-point time, as Ouster, Velodyne, Hesai, Livox and others call it, the likeliest first."""

_UNITS_NS = (1e9, 1e6, 1e3, 1.0)
"""ns of the units that a time field may be in: s, ms, us, ns."""

_LONGEST_SWEEP_NS = 2e9
"""ns that a sweep lasts at most: twenty times the usual."""

_SAME_CLOCK_NS = 1e9
"""ns between a point's time and the header's stamp up to which they are of one clock."""

_LIVOX_CDR = np.dtype({"names": ["t", "xyz"], "formats": ["<u4", "<3f4"], "offsets": [0, 4], "itemsize": 20})
"""A CustomPoint in CDR, which aligns every point to four bytes."""

_LIVOX_ROS1 = np.dtype({"names": ["t", "xyz"], "formats": ["<u4", "<3f4"], "offsets": [0, 4], "itemsize": 19})
"""A CustomPoint in ROS 1, which does not align."""


@dataclass(frozen=True)
class PointsMessage:
    """One sweep: (n, 3) float64 finite points and (n,) int64 stamps, the sweep's own where the sensor gives none.

    `foreign_clock` says that the points' times are of a clock that is not the header's: only their differences count.
    `integer_bytes` is the size of coordinates that were whole numbers, 0 where they were floats.
    """

    stamp_ns: int
    frame_id: str
    points: FloatArray
    point_stamps_ns: IntArray
    foreign_clock: bool = False
    integer_bytes: int = 0


class NoCoordinatesError(ValueError):
    """The points of a cloud are at no place: it holds something else."""


def read_points(raw: RawMessage, decoder: Decoder) -> PointsMessage:
    """Read one sweep; one without points, of whatever layout, is empty.

    Raises `MessageError` for a cloud without x, y, z, with too little data, or beyond the limit of points.
    """
    if raw.channel.msgtype.endswith("CustomMsg"):
        try:
            with any_numbers():
                return _read_livox(raw, decoder.limits)
        except FAULTS as error:
            raise decoder.fault(raw, error) from error
    return decoder.read_strictly(raw, partial(_read_cloud, limits=decoder.limits))


def _read_cloud(message: Any, log_ns: int, *, limits: Limits) -> PointsMessage:
    stamp_ns, frame_id = header_of(message, log_ns)
    foxglove = not hasattr(message, "point_step")
    if not len(message.data) or (not foxglove and not int(message.width) * int(message.height)):
        return PointsMessage(stamp_ns, frame_id, np.zeros((0, 3)), np.zeros(0, np.int64))
    cloud = _foxglove_cloud(message, limits) if foxglove else _ros_cloud(message, limits)
    names = {name.lower(): name for name in cloud.dtype.names or ()}
    if not {"x", "y", "z"} <= names.keys():
        raise NoCoordinatesError(f"a point cloud without x, y, z (its fields: {', '.join(names) or 'none'})")
    points = np.column_stack([cloud[names[axis]].astype(np.float64) for axis in "xyz"])
    if foxglove and getattr(message, "pose", None) is not None:
        points = _posed(points, message.pose)
    returned = np.isfinite(points).all(axis=1) & points.any(axis=1)
    time_field = next((names[name] for name in _TIME_FIELDS if name in names), None)
    if time_field is None:
        stamps, foreign = np.full(len(points), stamp_ns, np.int64), False
    else:
        stamps, foreign = point_stamps(cloud[time_field], stamp_ns)
    given = cloud.dtype[names["x"]]
    integer_bytes = given.itemsize if np.issubdtype(given, np.integer) else 0
    return PointsMessage(stamp_ns, frame_id, points[returned], stamps[returned], foreign, integer_bytes)


def point_stamps(times: NDArray[np.generic], stamp_ns: int) -> tuple[IntArray, bool]:
    """(n,) int64 stamps from a time field of any unit, absolute or relative to the header's stamp.

    Absolute in the unit in which it falls within a second of the stamp; else relative in the largest unit in which a
    sweep is not longer than two seconds; else of a foreign clock (the second value), counted from its first point.
    """
    if not len(times):
        return np.zeros(0, np.int64), False
    finite = np.where(np.isfinite(times.astype(np.float64)), times, times.dtype.type(0))
    first = finite.min()
    for unit in _UNITS_NS:
        if stamp_ns > _LONGEST_SWEEP_NS and abs(float(first) * unit - stamp_ns) < _SAME_CLOCK_NS:
            return _nanoseconds(finite, unit), False
    largest = float(np.abs(finite.astype(np.float64)).max())
    foreign = largest > _LONGEST_SWEEP_NS
    if foreign:
        finite = finite - first
        largest = float(finite.max())
    is_integer = np.issubdtype(finite.dtype, np.integer)
    unit = next((candidate for candidate in _UNITS_NS[is_integer:] if largest * candidate <= _LONGEST_SWEEP_NS), 1.0)
    return stamp_ns + _nanoseconds(finite, unit), foreign


def _nanoseconds(times: NDArray[np.generic], unit_ns: float) -> IntArray:
    """Times as ns; what no clock shows is 0."""
    exact = times.astype(np.float64) * unit_ns
    possible = np.abs(exact) < LARGEST_STAMP_NS
    if np.issubdtype(times.dtype, np.integer):
        return np.where(possible, times, 0).astype(np.int64) * int(unit_ns)
    return np.rint(np.where(possible, exact, 0.0)).astype(np.int64)


def _ros_cloud(message: Any, limits: Limits) -> NDArray[np.void]:
    order = ">" if message.is_bigendian else "<"
    kind = _record(message.fields, _POINT_FIELD, "datatype", int(message.point_step), order)
    data = np.frombuffer(bytes_of(message.data), np.uint8)
    width, height, row = int(message.width), int(message.height), int(message.width) * int(message.point_step)
    step = int(message.row_step) or row
    if height > 1 and step > row and len(data) >= step * height:
        data = np.ascontiguousarray(data[: step * height].reshape(height, step)[:, :row]).ravel()
    return _records(data, kind, width * height, limits)


def _foxglove_cloud(message: Any, limits: Limits) -> NDArray[np.void]:
    kind = _record(message.fields, _FOXGLOVE_FIELD, "type", int(message.point_stride), "<")
    data = np.frombuffer(bytes_of(message.data), np.uint8)
    return _records(data, kind, len(data) // max(kind.itemsize, 1), limits)


def _record(fields: Any, formats: dict[int, str], type_name: str, size: int, order: str) -> np.dtype[np.void]:
    known = [point_field for point_field in fields if int(getattr(point_field, type_name)) in formats]
    return np.dtype(
        {
            "names": [str(point_field.name) for point_field in known],
            "formats": [order + formats[int(getattr(point_field, type_name))] for point_field in known],
            "offsets": [int(point_field.offset) for point_field in known],
            "itemsize": size,
        }
    )


def _records(data: NDArray[np.uint8], kind: np.dtype[np.void], count: int, limits: Limits) -> NDArray[np.void]:
    if not kind.itemsize:
        raise ValueError(f"a point cloud of {count} points of 0 bytes")
    if count > limits.cloud_points:
        raise ValueError(f"{count} points, the limit cloud_points allows {limits.cloud_points}")
    if len(data) < count * kind.itemsize:
        raise ValueError(f"{len(data)} bytes do not hold {count} points of {kind.itemsize} bytes")
    records: NDArray[np.void] = data[: count * kind.itemsize].view(kind)
    return records


def _posed(points: FloatArray, pose: Any) -> FloatArray:
    position, q = pose.position, pose.orientation
    message = PoseMessage(
        0, "", "", np.array([position.x, position.y, position.z], float), np.array([q.x, q.y, q.z, q.w], float)
    )
    T = message.transform()
    return points if T is None else transform_points(T, points)


def _read_livox(raw: RawMessage, limits: Limits) -> PointsMessage:
    """Straight from the bytes: a CustomMsg's points are 20 (CDR; the last has 19) or 19 (ROS 1) bytes each.

    Fields: header, uint64 timebase, uint32 point_num, uint8 lidar_id, uint8[3] rsvd, CustomPoint[] points, where a
    point is uint32 offset_time (ns), float32 x, y, z, uint8 reflectivity, tag, line.
    """
    data = bytes(raw.data)
    ros1 = raw.channel.serialization == "ros1"
    try:
        seconds, nanoseconds, length = struct.unpack_from("<III", data, 4)
        frame_id = data[16 : 16 + length].rstrip(b"\0").decode()
        position = 16 + length
        if not ros1:
            position = 4 + (position - 4 + 7) // 8 * 8
        position += 8 + 4 + 4
        (count,) = struct.unpack_from("<I", data, position)
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f"a Livox message that does not fit its definition: {error}") from error
    kind = _LIVOX_ROS1 if ros1 else _LIVOX_CDR
    if count > limits.cloud_points:
        raise ValueError(f"{count} points, the limit cloud_points allows {limits.cloud_points}")
    body = data[position + 4 :] + b"\0"
    if len(body) < count * kind.itemsize:
        raise ValueError(f"{len(body)} bytes do not hold {count} Livox points")
    records = np.frombuffer(body, kind, count)
    stamp_ns = seconds * 1_000_000_000 + nanoseconds or raw.log_ns
    points = records["xyz"].astype(np.float64)
    returned = np.isfinite(points).all(axis=1) & points.any(axis=1)
    stamps = stamp_ns + records["t"].astype(np.int64)
    return PointsMessage(stamp_ns, frame_id.lstrip("/"), points[returned], stamps[returned])
