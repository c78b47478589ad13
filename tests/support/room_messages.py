"""Writes the synthetic room's measurements as ROS 2 messages into an `.mcap` with its schemas."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import cv2
import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from supermap_cli.geometry.se3 import quaternion_xyzw_from_rotation

# vision_msgs 4.x, https://github.com/ros-perception/vision_msgs (Apache-2.0): the fields, without comments
VISION_MSGS = {
    "Point2D": "float64 x\nfloat64 y",
    "Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "ObjectHypothesis": "string class_id\nfloat64 score",
    "ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "Detection2D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox2D bbox\nstring id",
    "Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
}

NO, YES = False, True


class RoomBag:
    """An `.mcap` being written; a context manager."""

    def __init__(self, path: Path) -> None:
        self._store = get_typestore(Stores.ROS2_HUMBLE)
        for name, text in VISION_MSGS.items():
            self._store.register(get_types_from_msg(text, f"vision_msgs/msg/{name}"))
        self._file = path.open("wb")
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="supermap synthetic room")
        self._channels: dict[str, int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._writer.finish()
        self._file.close()

    def write_pose(self, stamp_ns: int, T_odom_base: np.ndarray) -> None:
        """`/odom` and `/tf`."""
        self._write("/odom", "nav_msgs/msg/Odometry", stamp_ns, self._odometry(stamp_ns, T_odom_base))
        self._write("/tf", "tf2_msgs/msg/TFMessage", stamp_ns, self._tf("odom", "base_link", T_odom_base, stamp_ns))

    def write_static_transform(self, parent: str, child: str, T_parent_child: np.ndarray, stamp_ns: int) -> None:
        """`/tf_static`."""
        transform = self._tf(parent, child, T_parent_child, stamp_ns)
        self._write("/tf_static", "tf2_msgs/msg/TFMessage", stamp_ns, transform)

    def write_camera_info(self, stamp_ns: int, width: int, height: int, focal: float) -> None:
        """A pinhole without distortion, its principal point at the image's centre, for colour and depth."""
        K = np.array([focal, 0, width / 2, 0, focal, height / 2, 0, 0, 1.0])
        roi = self._new("sensor_msgs/RegionOfInterest", 0, 0, 0, 0, NO)
        header, P = self._header(stamp_ns, "camera_optical_frame"), np.insert(K, [3, 6, 9], 0.0)
        info = self._new(
            "sensor_msgs/CameraInfo",
            header,
            height,
            width,
            "plumb_bob",
            np.zeros(5),
            K,
            np.eye(3).ravel(),
            P,
            0,
            0,
            roi,
        )
        for camera in ("color", "depth"):
            self._write(f"/camera/{camera}/camera_info", "sensor_msgs/msg/CameraInfo", stamp_ns, info)

    def write_colour(self, stamp_ns: int, rgb: np.ndarray) -> None:
        """`/camera/color/image_raw/compressed`, JPEG."""
        jpeg = cv2.imencode(".jpg", rgb[:, :, ::-1])[1]
        message = self._new(
            "sensor_msgs/CompressedImage", self._header(stamp_ns, "camera_optical_frame"), "jpeg", jpeg.ravel()
        )
        topic = "/camera/color/image_raw/compressed"
        self._write(topic, "sensor_msgs/msg/CompressedImage", stamp_ns, message)

    def write_depth(self, stamp_ns: int, depth_m: np.ndarray) -> None:
        """`/camera/depth/image_rect_raw`, 16UC1 millimetres, aligned to colour."""
        self._write_uint16("/camera/depth/image_rect_raw", stamp_ns, np.round(depth_m * 1000).astype(np.uint16))

    def write_detections(
        self,
        stamp_ns: int,
        labels: Sequence[str],
        others: Sequence[str | None],
        scores: Sequence[float],
        masks: Sequence[Any],
    ) -> None:
        """`/detections` with up to two hypotheses each, and `/detections/masks` (k = the k-th detection, 1-based)."""
        detections = []
        image = np.zeros((240, 320), np.uint16)
        for k, (label, other, score, mask) in enumerate(zip(labels, others, scores, masks, strict=True), start=1):
            image[mask] = k
            rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
            low, high = np.array([columns[0], rows[0]], float), np.array([columns[-1] + 1, rows[-1] + 1], float)
            detections.append(self._detection(stamp_ns, {label: score, other: 0.1}, (low + high) / 2, high - low))
        header = self._header(stamp_ns, "camera_optical_frame")
        array = self._new("vision_msgs/Detection2DArray", header, detections)
        self._write("/detections", "vision_msgs/msg/Detection2DArray", stamp_ns, array)
        self._write_uint16("/detections/masks", stamp_ns, image)

    def write_points(self, stamp_ns: int, points_lidar: np.ndarray, offsets_s: np.ndarray) -> None:
        """`/lidar/points`: x, y, z, time (float32 seconds since the stamp)."""
        cloud = np.column_stack([points_lidar, offsets_s]).astype("<f4")
        fields = [self._new("sensor_msgs/PointField", n, 4 * k, 7, 1) for k, n in enumerate(("x", "y", "z", "time"))]
        data, header = cloud.view(np.uint8).ravel(), self._header(stamp_ns, "lidar")
        message = self._new(
            "sensor_msgs/PointCloud2", header, 1, len(cloud), fields, NO, 16, 16 * len(cloud), data, YES
        )
        self._write("/lidar/points", "sensor_msgs/msg/PointCloud2", stamp_ns, message)

    def write_imu(self, stamp_ns: int, angular_rate: np.ndarray, specific_force: np.ndarray) -> None:
        """`/imu/data`."""
        still, unknown = self._new("geometry_msgs/Quaternion", 0.0, 0.0, 0.0, 1.0), np.zeros(9)
        no_orientation = np.array([-1.0, *np.zeros(8)])
        rate, force = (self._new("geometry_msgs/Vector3", *map(float, each)) for each in (angular_rate, specific_force))
        header = self._header(stamp_ns, "imu")
        message = self._new("sensor_msgs/Imu", header, still, no_orientation, rate, unknown, force, unknown)
        self._write("/imu/data", "sensor_msgs/msg/Imu", stamp_ns, message)

    def _detection(self, stamp_ns: int, scores: dict[str | None, float], center: np.ndarray, size: np.ndarray) -> Any:
        pose = self._new("geometry_msgs/PoseWithCovariance", self._pose(np.eye(4)), np.zeros(36))
        hypotheses = [
            self._new(
                "vision_msgs/ObjectHypothesisWithPose", self._new("vision_msgs/ObjectHypothesis", label, score), pose
            )
            for label, score in scores.items()
            if label is not None
        ]
        middle = self._new("vision_msgs/Pose2D", self._new("vision_msgs/Point2D", *map(float, center)), 0.0)
        box = self._new("vision_msgs/BoundingBox2D", middle, *map(float, size))
        return self._new("vision_msgs/Detection2D", self._header(stamp_ns, "camera_optical_frame"), hypotheses, box, "")

    def _odometry(self, stamp_ns: int, T_odom_base: np.ndarray) -> Any:
        zero = self._new("geometry_msgs/Vector3", 0.0, 0.0, 0.0)
        twist = self._new(
            "geometry_msgs/TwistWithCovariance", self._new("geometry_msgs/Twist", zero, zero), np.zeros(36)
        )
        pose = self._new("geometry_msgs/PoseWithCovariance", self._pose(T_odom_base), np.zeros(36))
        return self._new("nav_msgs/Odometry", self._header(stamp_ns, "odom"), "base_link", pose, twist)

    def _pose(self, T: np.ndarray) -> Any:
        turn = self._new("geometry_msgs/Quaternion", *map(float, quaternion_xyzw_from_rotation(T[:3, :3])))
        return self._new("geometry_msgs/Pose", self._new("geometry_msgs/Point", *map(float, T[:3, 3])), turn)

    def _tf(self, parent: str, child: str, T_parent_child: np.ndarray, stamp_ns: int) -> Any:
        turn = self._new("geometry_msgs/Quaternion", *map(float, quaternion_xyzw_from_rotation(T_parent_child[:3, :3])))
        shift = self._new("geometry_msgs/Vector3", *map(float, T_parent_child[:3, 3]))
        transform = self._new("geometry_msgs/Transform", shift, turn)
        stamped = self._new("geometry_msgs/TransformStamped", self._header(stamp_ns, parent), child, transform)
        return self._new("tf2_msgs/TFMessage", [stamped])

    def _write_uint16(self, topic: str, stamp_ns: int, image: np.ndarray) -> None:
        header, (height, width) = self._header(stamp_ns, "camera_optical_frame"), image.shape
        data = image.astype("<u2").view(np.uint8).ravel()
        message = self._new("sensor_msgs/Image", header, height, width, "16UC1", 0, 2 * width, data)
        self._write(topic, "sensor_msgs/msg/Image", stamp_ns, message)

    def _header(self, stamp_ns: int, frame: str) -> Any:
        return self._new("std_msgs/Header", self._new("builtin_interfaces/Time", *divmod(stamp_ns, 10**9)), frame)

    def _new(self, name: str, *values: Any) -> Any:
        package, kind = name.split("/")
        return self._store.types[f"{package}/msg/{kind}"](*values)

    def _write(self, topic: str, kind: str, stamp_ns: int, message: Any) -> None:
        if topic not in self._channels:
            text, _ = self._store.generate_msgdef(kind, ros_version=2)
            schema = self._writer.register_schema(name=kind, encoding="ros2msg", data=text.encode())
            self._channels[topic] = self._writer.register_channel(topic, "cdr", schema)
        data = bytes(self._store.serialize_cdr(message, kind))
        self._writer.add_message(self._channels[topic], stamp_ns, data, stamp_ns)
