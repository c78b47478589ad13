"""Messages of all dialects (ROS 1, ROS 2, Foxglove) as plain values, by what they are and not where they come from."""

from __future__ import annotations

import base64
import re
import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import make_transform, rotation_from_quaternion_xyzw
from supermap_cli.recordings.decoding import Decoder, message_fields
from supermap_cli.recordings.definitions import LIVOX_PACKAGES
from supermap_cli.recordings.storage import Channel, RawMessage
from supermap_cli.types.limits import LARGEST_STAMP_NS

Kind = Literal["image", "camera_info", "points", "imu", "pose", "transforms", "detections"]

_STAMPED_BYTES = 12
"""Bytes up to the end of a header's stamp: 4 before it in CDR (encapsulation) and in ROS 1 (`seq`), 8 of its own."""

LARGEST_POSITION_M = 1e9
"""Metres; no place on Earth has larger coordinates in any system (earth-centred ones reach 6.4e6), and their squares
stay exact.
"""

_LONGEST_FRAME = 1 << 10
"""Characters of a frame's name; those of robots have some thirty."""

KINDS: dict[str, Kind] = {
    "sensor_msgs/msg/Image": "image",
    "sensor_msgs/msg/CompressedImage": "image",
    "foxglove.RawImage": "image",
    "foxglove.CompressedImage": "image",
    "foxglove_msgs/msg/RawImage": "image",
    "foxglove_msgs/msg/CompressedImage": "image",
    "sensor_msgs/msg/CameraInfo": "camera_info",
    "foxglove.CameraCalibration": "camera_info",
    "foxglove_msgs/msg/CameraCalibration": "camera_info",
    "sensor_msgs/msg/PointCloud2": "points",
    "foxglove.PointCloud": "points",
    "foxglove_msgs/msg/PointCloud": "points",
    **{f"{package}/msg/CustomMsg": "points" for package in LIVOX_PACKAGES},
    "sensor_msgs/msg/Imu": "imu",
    "nav_msgs/msg/Odometry": "pose",
    "geometry_msgs/msg/PoseStamped": "pose",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose",
    "geometry_msgs/msg/TransformStamped": "pose",
    "foxglove.PoseInFrame": "pose",
    "foxglove_msgs/msg/PoseInFrame": "pose",
    "tf2_msgs/msg/TFMessage": "transforms",
    "tf/msg/tfMessage": "transforms",
    "foxglove.FrameTransform": "transforms",
    "foxglove.FrameTransforms": "transforms",
    "foxglove_msgs/msg/FrameTransform": "transforms",
    "foxglove_msgs/msg/FrameTransforms": "transforms",
    **dict.fromkeys(
        (
            "vision_msgs/msg/Detection2DArray",
            *("yolo_msgs/msg/DetectionArray", "yolov8_msgs/msg/DetectionArray"),
            *("ultralytics_ros/msg/YoloResult", "darknet_ros_msgs/msg/BoundingBoxes"),
            *("depthai_ros_msgs/msg/SpatialDetectionArray", "depthai_ros_msgs/msg/TrackDetection2DArray"),
            *("zed_msgs/msg/ObjectsStamped", "zed_interfaces/msg/ObjectsStamped"),
        ),
        "detections",
    ),
}
"""What a message type is used for. All others are ignored."""

_NEAR_DETECTIONS = re.compile(
    r"/msg/\w*(Detection|BoundingBox|ObjectArray|ObjectsStamped|TrackedObject|YoloResult)", re.I
)
"""Names of types that hold detections, though of a layout that is not read."""


_PACKETS = "the raw packets of a LiDAR: replay them through its driver, and record the PointCloud2 that it publishes"
_VIDEO = "a video stream, whose images need each other: convert it to Image or CompressedImage"
_NEAR: tuple[tuple[Kind, re.Pattern[str], str], ...] = (
    ("points", re.compile(r"(Velodyne|Pandar|Rslidar|Hesai|Lslidar|Robosense)\w*(Scan|Packet)$", re.I), _PACKETS),
    ("points", re.compile(r"(UdpFrame|/PacketMsg|UdpPacket)$"), _PACKETS),
    ("points", re.compile(r"/(LaserScan|MultiEchoLaserScan)$"), "a scan in one plane, which gives images no depth"),
    ("points", re.compile(r"sensor_msgs/msg/PointCloud$"), "the old PointCloud: convert it to PointCloud2"),
    ("image", re.compile(r"FFMPEGPacket$|H264|H265|theora|CompressedVideo$|VideoPacket$", re.I), _VIDEO),
)
"""Names of types that hold what is looked for, though of a layout that is not read; what they are, and what helps."""


def near(channel: Channel, kinds: Collection[Kind]) -> str | None:
    """What a channel holds that is near to one of the kinds and not read, for people; `None` for other channels."""
    if channel.count and kind_of(channel) is None:
        for kind, names, what in _NEAR:
            if kind in kinds and names.search(channel.msgtype):
                return f"{channel.topic} ({channel.msgtype}) holds {what}"
    return None


@dataclass(frozen=True)
class ImageMessage:
    """An image before decoding. `step` is bytes a row (0: unpadded); compressed images do not say their size."""

    stamp_ns: int
    frame_id: str
    encoding: str
    data: bytes | memoryview
    width: int = 0
    height: int = 0
    step: int = 0
    big_endian: bool = False
    compressed: bool = False


@dataclass(frozen=True)
class CalibrationMessage:
    """A `sensor_msgs/CameraInfo`: K and R (3, 3), P (3, 4), the region of interest as (x, y, width, height)."""

    stamp_ns: int
    frame_id: str
    width: int
    height: int
    model: str
    D: tuple[float, ...]
    K: FloatArray
    P: FloatArray
    binning: tuple[int, int]
    roi: tuple[int, int, int, int]


_LARGEST_STRETCH = 0.1
"""How much longer or shorter than 1 the quaternion of a pose may be, of rounding: a tenth of what a byte rounds to."""


@dataclass(frozen=True)
class PoseMessage:
    """Where something is: `child_frame_id` is "" where the message does not say what. May be non-finite.

    `covariance` (6, 6) is that of x, y, z and of rotations about the axes of `frame_id`, `None` where it is unknown.
    """

    stamp_ns: int
    frame_id: str
    child_frame_id: str
    position: FloatArray
    orientation_xyzw: FloatArray
    covariance: FloatArray | None = None

    def later(self, by_ns: int) -> PoseMessage:
        """The same with another stamp."""
        return replace(self, stamp_ns=self.stamp_ns + by_ns) if by_ns else self

    @property
    def fault(self) -> str | None:
        """Why this is no pose of a robot; `None` if it is one. tf2 takes no quaternion that is off by a hundredth; here
        one that was rounded passes, and none that was never set, or is of something else.
        """
        if not all(np.isfinite(values).all() for values in (self.position, self.orientation_xyzw)):
            return "a pose that is not finite"
        if (np.abs(self.position) >= LARGEST_POSITION_M).any():
            return "a pose at no place on earth"
        with np.errstate(over="ignore"):
            length = float(np.linalg.norm(self.orientation_xyzw))
        if abs(length - 1.0) > _LARGEST_STRETCH:
            return f"a quaternion of length {length:.3g}, which is no rotation"
        return None

    def transform(self) -> FloatArray | None:
        """`T_frame_child`; `None` for a pose that is not finite, of no place, or has a zero quaternion."""
        if not all((np.abs(values) < LARGEST_POSITION_M).all() for values in (self.position, self.orientation_xyzw)):
            return None
        try:
            return make_transform(rotation_from_quaternion_xyzw(self.orientation_xyzw), self.position)
        except ValueError:
            return None


@dataclass(frozen=True)
class ImuMessage:
    """Angular rate (rad/s) and specific force (m/s^2), (3,) each, in the sensor's own frame."""

    stamp_ns: int
    frame_id: str
    angular_rate: FloatArray
    specific_force: FloatArray


def kind_of(channel: Channel) -> Kind | None:
    """What a channel is used for; `None` for types that are not supported."""
    if channel.serialization in {"protobuf", "json"}:
        return KINDS.get(channel.msgtype) if channel.msgtype.startswith("foxglove.") else None
    return KINDS.get(channel.msgtype)


def is_near_detections(channel: Channel) -> bool:
    """Whether a channel seems to hold detections of a type that is not read."""
    return kind_of(channel) is None and _NEAR_DETECTIONS.search(channel.msgtype) is not None


def stamp_ns_of(time: Any) -> int:
    """Nanoseconds of a ROS time (sec, nanosec), a Foxglove JSON time (sec, nsec) or a protobuf Timestamp."""
    seconds = int(message_fields(time, "sec", "secs", "seconds"))
    stamp_ns = seconds * 1_000_000_000 + int(message_fields(time, "nanosec", "nsec", "nsecs", "nanos"))
    if not -LARGEST_STAMP_NS < stamp_ns < LARGEST_STAMP_NS:
        raise ValueError(f"a stamp of {seconds} s, which no clock shows")
    return stamp_ns


def peek_stamp_ns(raw: RawMessage, decoder: Decoder) -> int:
    """The header's stamp, without decoding ROS messages (their header comes first); the log time where it is unset.

    Raises `MessageError` for a message without a whole header.
    """
    channel, data = raw.channel, raw.data
    if channel.serialization in {"ros1", "cdr"} and len(data) < _STAMPED_BYTES:
        raise decoder.fault(raw, ValueError(f"only {len(data)} bytes"))
    if channel.serialization == "ros1":
        seconds, nanoseconds = struct.unpack_from("<II", data, 4)
    elif channel.serialization == "cdr" and not channel.msgtype.startswith("foxglove"):
        seconds, nanoseconds = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
    else:
        return decoder.read_strictly(raw, header_of)[0]
    return int(seconds) * 1_000_000_000 + int(nanoseconds) or raw.log_ns


def header_of(message: Any, log_ns: int) -> tuple[int, str]:
    """(stamp_ns, frame_id) of a ROS or Foxglove message; the log time where the stamp is unset."""
    if hasattr(message, "header"):
        return stamp_ns_of(message.header.stamp) or log_ns, frame_name(message.header.frame_id)
    return stamp_ns_of(message.timestamp) or log_ns, frame_name(getattr(message, "frame_id", ""))


def frame_name(value: Any) -> str:
    """The name of a frame, without the leading slash that tf (1) wrote. Raises `ValueError` for what is no name."""
    name = str(value)
    if len(name) > _LONGEST_FRAME:
        raise ValueError(f"the name of a frame has {len(name)} characters")
    return name.lstrip("/")


def bytes_of(data: Any) -> bytes | memoryview:
    """A message's byte array: numpy, bytes, or base64 in JSON."""
    if isinstance(data, str):
        return base64.b64decode(data)
    if isinstance(data, np.ndarray):
        return np.ascontiguousarray(data).data.cast("B")
    return bytes(data)


def read_image(message: Any, log_ns: int) -> ImageMessage:
    """Of an Image, a CompressedImage, or Foxglove's RawImage and CompressedImage."""
    stamp_ns, frame_id = header_of(message, log_ns)
    data = bytes_of(message.data)
    if not hasattr(message, "encoding"):
        return ImageMessage(stamp_ns, frame_id, str(message.format), data, compressed=True)
    return ImageMessage(
        stamp_ns,
        frame_id,
        str(message.encoding),
        data,
        int(message.width),
        int(message.height),
        int(message.step),
        bool(getattr(message, "is_bigendian", False)),
    )


def read_calibration(message: Any, log_ns: int) -> CalibrationMessage:
    """Of a CameraInfo or Foxglove's CameraCalibration."""
    stamp_ns, frame_id = header_of(message, log_ns)
    region = getattr(message, "roi", None)
    projection = np.array(message_fields(message, "p", "P"), np.float64)
    intrinsics = np.array(message_fields(message, "k", "K"), np.float64)
    return CalibrationMessage(
        stamp_ns,
        frame_id,
        int(message.width),
        int(message.height),
        str(message.distortion_model),
        tuple(float(coefficient) for coefficient in message_fields(message, "d", "D")),
        intrinsics.reshape(3, 3) if intrinsics.size == 9 else np.zeros((3, 3)),
        projection.reshape(3, 4) if projection.size == 12 else np.zeros((3, 4)),
        (max(1, int(getattr(message, "binning_x", 1))), max(1, int(getattr(message, "binning_y", 1)))),
        (int(region.x_offset), int(region.y_offset), int(region.width), int(region.height)) if region else (0, 0, 0, 0),
    )


def _xyz(vector: Any) -> FloatArray:
    return np.array([float(vector.x), float(vector.y), float(vector.z)])


def _xyzw(quaternion: Any) -> FloatArray:
    return np.array([float(quaternion.x), float(quaternion.y), float(quaternion.z), float(quaternion.w)])


def read_pose(message: Any, log_ns: int) -> PoseMessage:
    """Of an Odometry, PoseStamped, PoseWithCovarianceStamped, TransformStamped (as motion capture has it) or Foxglove's
    PoseInFrame.
    """
    if hasattr(message, "transform"):
        return next(iter(read_transforms(SimpleNamespace(transforms=[message]), log_ns)))
    stamp_ns, frame_id = header_of(message, log_ns)
    pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
    child = frame_name(getattr(message, "child_frame_id", ""))
    covariance = read_covariance(getattr(message.pose, "covariance", ()))
    return PoseMessage(stamp_ns, frame_id, child, _xyz(pose.position), _xyzw(pose.orientation), covariance)


def read_covariance(values: Any) -> FloatArray | None:
    """(6, 6) of a PoseWithCovariance's 36 values, row by row; `None` for all zeros, for what is not finite and for a
    negative variance: drivers write these where they know none.
    """
    covariance = np.array(values, np.float64)
    if covariance.size != 36 or not covariance.any() or not np.isfinite(covariance).all():
        return None
    covariance = covariance.reshape(6, 6)
    return None if (np.diag(covariance) < 0).any() else covariance


def read_transforms(message: Any, log_ns: int) -> tuple[PoseMessage, ...]:
    """Of a TFMessage or Foxglove's FrameTransform and FrameTransforms."""
    return tuple(_transforms(message, log_ns))


def _transforms(message: Any, log_ns: int) -> Iterator[PoseMessage]:
    for stamped in getattr(message, "transforms", None) or ([message] if hasattr(message, "parent_frame_id") else []):
        if hasattr(stamped, "parent_frame_id"):
            yield PoseMessage(
                stamp_ns_of(stamped.timestamp) or log_ns,
                frame_name(stamped.parent_frame_id),
                frame_name(stamped.child_frame_id),
                _xyz(stamped.translation),
                _xyzw(stamped.rotation),
            )
        else:
            stamp_ns, frame_id = header_of(stamped, log_ns)
            child = frame_name(stamped.child_frame_id)
            motion = stamped.transform
            yield PoseMessage(stamp_ns, frame_id, child, _xyz(motion.translation), _xyzw(motion.rotation))


def read_imu(message: Any, log_ns: int) -> ImuMessage:
    """Of a `sensor_msgs/Imu`."""
    stamp_ns, frame_id = header_of(message, log_ns)
    return ImuMessage(stamp_ns, frame_id, _xyz(message.angular_velocity), _xyz(message.linear_acceleration))
