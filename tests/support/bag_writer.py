"""Writes bags message by message from plain arrays, in any container format.

    with BagWriter(tmp_path / "run.mcap") as bag:
        bag.image("/image", stamp_ns, "camera_optical_frame", rgb, "rgb8")
        bag.transform(stamp_ns, "base_link", "camera_optical_frame", T, static=True)

The format is that of the suffix: `.mcap`, `.db3` (a bare file), `.bag`, or none for a rosbag2 folder with its
metadata.yaml.
Every method takes `log_ns=` where a message was recorded later than its stamp says.
"""

from __future__ import annotations

import shutil
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import cv2
import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from supermap_cli.geometry.se3 import quaternion_xyzw_from_rotation
from supermap_cli.recordings.definitions import FALLBACK_DEFINITIONS

OLD_VISION = {
    "BoundingBox2D": "geometry_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
    "ObjectHypothesisWithPose": "int64 id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose\n",
    "Detection2D": "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox2D bbox\n",
    "Detection2DArray": "std_msgs/Header header\nDetection2D[] detections\n",
}

Detection = tuple[Sequence[tuple[str, float]], Sequence[float]]
"""((label, score), ...) and (u0, v0, u1, v1)."""


class BagWriter:
    """A bag being written. `old_vision` writes ROS 1's vision_msgs; `mcap` options go to mcap's writer."""

    def __init__(self, path: Path, *, old_vision: bool = False, definitions: bool = True, **mcap: Any) -> None:
        self.path = path
        self._ros1 = path.suffix == ".bag"
        self._store = get_typestore(Stores.ROS1_NOETIC if self._ros1 else Stores.ROS2_JAZZY)
        packages = dict(FALLBACK_DEFINITIONS)
        if old_vision or self._ros1:
            packages["vision_msgs"] = OLD_VISION
        for package, texts in packages.items():
            types: dict[str, Any] = {}
            for name, text in texts.items():
                types |= get_types_from_msg(text, f"{package}/msg/{name}")
            self._store.register(types)
        if self._ros1:
            self._store.register(
                get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", "tf2_msgs/msg/TFMessage")
            )
        self._old_vision = old_vision or self._ros1
        self._definitions = definitions
        self._connections: dict[str, Any] = {}
        self._sequence = 0
        self._backend = _backend(path, mcap)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._backend.close()

    def type(self, name: str, /, **values: Any) -> Any:
        """A message object: `type("std_msgs/msg/String", data="x")`."""
        return self._store.types[name](**values)

    def header(self, stamp_ns: int, frame_id: str) -> Any:
        """A std_msgs/Header."""
        time = self.type("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        extra = {"seq": 0} if self._ros1 else {}
        return self.type("std_msgs/msg/Header", stamp=time, frame_id=frame_id, **extra)

    def write(self, topic: str, msgtype: str, message: Any, log_ns: int) -> None:
        """Any message."""
        if self._ros1:
            data = self._store.serialize_ros1(message, msgtype)
        else:
            data = self._store.serialize_cdr(message, msgtype)
        if topic not in self._connections:
            definition = self._store.generate_msgdef(msgtype, ros_version=1 if self._ros1 else 2)[0]
            self._connections[topic] = self._backend.connect(
                topic, msgtype, definition if self._definitions else "", self._store
            )
        self._backend.write(self._connections[topic], log_ns, bytes(data))

    def image(
        self,
        topic: str,
        stamp_ns: int,
        frame_id: str,
        pixels: np.ndarray,
        encoding: str,
        *,
        padding: int = 0,
        big_endian: bool = False,
        log_ns: int | None = None,
    ) -> None:
        """A sensor_msgs/Image; `padding` bytes are added to every row."""
        array = pixels.astype(pixels.dtype.newbyteorder(">")) if big_endian else pixels
        rows = np.ascontiguousarray(array).view(np.uint8).reshape(len(pixels), -1)
        rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
        message = self.type(
            "sensor_msgs/msg/Image",
            header=self.header(stamp_ns, frame_id),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=int(big_endian),
            step=rows.shape[1],
            data=rows.ravel(),
        )
        self.write(topic, "sensor_msgs/msg/Image", message, stamp_ns if log_ns is None else log_ns)

    def compressed(
        self, topic: str, stamp_ns: int, frame_id: str, data: bytes, form: str, *, log_ns: int | None = None
    ) -> None:
        """A sensor_msgs/CompressedImage."""
        message = self.type(
            "sensor_msgs/msg/CompressedImage",
            header=self.header(stamp_ns, frame_id),
            format=form,
            data=np.frombuffer(data, np.uint8),
        )
        self.write(topic, "sensor_msgs/msg/CompressedImage", message, stamp_ns if log_ns is None else log_ns)

    def camera_info(
        self,
        topic: str,
        stamp_ns: int,
        frame_id: str,
        size: tuple[int, int],
        K: Sequence[float],
        *,
        D: Sequence[float] = (),
        model: str = "plumb_bob",
        binning: tuple[int, int] = (0, 0),
        roi: tuple[int, int, int, int] = (0, 0, 0, 0),
        log_ns: int | None = None,
    ) -> None:
        """A sensor_msgs/CameraInfo; K is (fx, fy, cx, cy), `roi` (x, y, width, height)."""
        fx, fy, cx, cy = K
        matrices = {
            "d": np.array(D, np.float64),
            "k": np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1], np.float64),
            "r": np.eye(3).ravel(),
            "p": np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0], np.float64),
        }
        x, y, width, height = roi
        region = self.type(
            "sensor_msgs/msg/RegionOfInterest", x_offset=x, y_offset=y, height=height, width=width, do_rectify=False
        )
        message = self.type(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(stamp_ns, frame_id),
            width=size[0],
            height=size[1],
            distortion_model=model,
            binning_x=binning[0],
            binning_y=binning[1],
            roi=region,
            **{name.upper() if self._ros1 else name: values for name, values in matrices.items()},
        )
        self.write(topic, "sensor_msgs/msg/CameraInfo", message, stamp_ns if log_ns is None else log_ns)

    def _pose(self, T: np.ndarray) -> Any:
        q = quaternion_xyzw_from_rotation(T[:3, :3])
        return self.type(
            "geometry_msgs/msg/Pose",
            position=self._vector("Point", T[:3, 3]),
            orientation=self.type("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, q), strict=True))),
        )

    def _vector(self, name: str, values: Sequence[float] | np.ndarray) -> Any:
        return self.type(f"geometry_msgs/msg/{name}", **dict(zip("xyz", map(float, values), strict=True)))

    def _pose_with_covariance(self, T: np.ndarray) -> Any:
        return self.type("geometry_msgs/msg/PoseWithCovariance", pose=self._pose(T), covariance=np.zeros(36))

    def odometry(
        self,
        topic: str,
        stamp_ns: int,
        T: np.ndarray,
        *,
        frame_id: str = "odom",
        child_frame_id: str = "base_link",
        log_ns: int | None = None,
        quaternion_scale: float = 1.0,
    ) -> None:
        """A nav_msgs/Odometry. `T` may hold NaN in its translation; the quaternion may be of another length than 1."""
        twist = self.type(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=self.type(
                "geometry_msgs/msg/Twist",
                linear=self._vector("Vector3", (0, 0, 0)),
                angular=self._vector("Vector3", (0, 0, 0)),
            ),
            covariance=np.zeros(36),
        )
        message = self.type(
            "nav_msgs/msg/Odometry",
            header=self.header(stamp_ns, frame_id),
            child_frame_id=child_frame_id,
            pose=self._pose_with_covariance(T),
            twist=twist,
        )
        rotation = message.pose.pose.orientation
        for axis in "xyzw":
            object.__setattr__(rotation, axis, quaternion_scale * getattr(rotation, axis))
        self.write(topic, "nav_msgs/msg/Odometry", message, stamp_ns if log_ns is None else log_ns)

    def pose(
        self,
        topic: str,
        stamp_ns: int,
        frame_id: str,
        T: np.ndarray,
        *,
        covariance: bool = False,
        log_ns: int | None = None,
    ) -> None:
        """A geometry_msgs/PoseStamped, or PoseWithCovarianceStamped."""
        msgtype = "geometry_msgs/msg/PoseWithCovarianceStamped" if covariance else "geometry_msgs/msg/PoseStamped"
        pose = self._pose_with_covariance(T) if covariance else self._pose(T)
        message = self.type(msgtype, header=self.header(stamp_ns, frame_id), pose=pose)
        self.write(topic, msgtype, message, stamp_ns if log_ns is None else log_ns)

    def transform(
        self,
        stamp_ns: int,
        parent: str,
        child: str,
        T: np.ndarray,
        *,
        static: bool = False,
        namespace: str = "",
        log_ns: int | None = None,
    ) -> None:
        """One transform on /tf, or on /tf_static, of a namespace."""
        q = quaternion_xyzw_from_rotation(T[:3, :3])
        motion = self.type(
            "geometry_msgs/msg/Transform",
            translation=self._vector("Vector3", T[:3, 3]),
            rotation=self.type("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, q), strict=True))),
        )
        stamped = self.type(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(stamp_ns, parent),
            child_frame_id=child,
            transform=motion,
        )
        message = self.type("tf2_msgs/msg/TFMessage", transforms=[stamped])
        topic = f"{namespace}/tf_static" if static else f"{namespace}/tf"
        self.write(topic, "tf2_msgs/msg/TFMessage", message, stamp_ns if log_ns is None else log_ns)

    def imu(
        self,
        topic: str,
        stamp_ns: int,
        frame_id: str,
        angular_rate: Sequence[float],
        specific_force: Sequence[float],
        *,
        log_ns: int | None = None,
    ) -> None:
        """A sensor_msgs/Imu."""
        zeros = np.zeros(9)
        message = self.type(
            "sensor_msgs/msg/Imu",
            header=self.header(stamp_ns, frame_id),
            orientation=self.type("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=zeros,
            angular_velocity=self._vector("Vector3", angular_rate),
            angular_velocity_covariance=zeros,
            linear_acceleration=self._vector("Vector3", specific_force),
            linear_acceleration_covariance=zeros,
        )
        self.write(topic, "sensor_msgs/msg/Imu", message, stamp_ns if log_ns is None else log_ns)

    def points(
        self,
        topic: str,
        stamp_ns: int,
        frame_id: str,
        records: np.ndarray,
        *,
        big_endian: bool = False,
        log_ns: int | None = None,
    ) -> None:
        """A sensor_msgs/PointCloud2 of a structured array, whose dtype (names, offsets, itemsize) is the layout."""
        codes = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8, "i8": 9, "u8": 10}
        assert records.dtype.names is not None
        assert records.dtype.fields is not None
        fields = [
            self.type(
                "sensor_msgs/msg/PointField",
                name=name,
                offset=records.dtype.fields[name][1],
                datatype=codes[records.dtype[name].str[1:]],
                count=1,
            )
            for name in records.dtype.names
        ]
        message = self.type(
            "sensor_msgs/msg/PointCloud2",
            header=self.header(stamp_ns, frame_id),
            height=1,
            width=len(records),
            fields=fields,
            is_bigendian=big_endian,
            point_step=records.dtype.itemsize,
            row_step=records.nbytes,
            data=np.frombuffer(records.tobytes(), np.uint8),
            is_dense=False,
        )
        self.write(topic, "sensor_msgs/msg/PointCloud2", message, stamp_ns if log_ns is None else log_ns)

    def livox(
        self,
        topic: str,
        stamp_ns: int,
        frame_id: str,
        points: np.ndarray,
        offsets_ns: np.ndarray,
        *,
        package: str = "livox_ros_driver2",
        log_ns: int | None = None,
    ) -> None:
        """A Livox CustomMsg of (n, 3) points and (n,) nanoseconds."""
        listed = [
            self.type(
                f"{package}/msg/CustomPoint",
                offset_time=int(offset),
                **dict(zip("xyz", map(float, point), strict=True)),
                reflectivity=0,
                tag=0,
                line=0,
            )
            for point, offset in zip(points, offsets_ns, strict=True)
        ]
        message = self.type(
            f"{package}/msg/CustomMsg",
            header=self.header(stamp_ns, frame_id),
            timebase=stamp_ns,
            point_num=len(listed),
            lidar_id=0,
            rsvd=np.zeros(3, np.uint8),
            points=listed,
        )
        self.write(topic, f"{package}/msg/CustomMsg", message, stamp_ns if log_ns is None else log_ns)

    def detections(
        self, topic: str, stamp_ns: int, frame_id: str, found: Sequence[Detection], *, log_ns: int | None = None
    ) -> None:
        """A vision_msgs/Detection2DArray; old layouts have numbers as labels."""
        message = self.type(
            "vision_msgs/msg/Detection2DArray",
            header=self.header(stamp_ns, frame_id),
            detections=[self._detection(stamp_ns, frame_id, *each) for each in found],
        )
        self.write(topic, "vision_msgs/msg/Detection2DArray", message, stamp_ns if log_ns is None else log_ns)

    def _detection(
        self, stamp_ns: int, frame_id: str, hypotheses: Sequence[tuple[str, float]], box_xyxy: Sequence[float]
    ) -> Any:
        u0, v0, u1, v1 = map(float, box_xyxy)
        pose = self._pose_with_covariance(np.eye(4))
        if self._old_vision:
            center = self.type("geometry_msgs/msg/Pose2D", x=(u0 + u1) / 2, y=(v0 + v1) / 2, theta=0.0)
            results = [
                self.type("vision_msgs/msg/ObjectHypothesisWithPose", id=int(label), score=score, pose=pose)
                for label, score in hypotheses
            ]
            extra = {}
        else:
            point = self.type("vision_msgs/msg/Point2D", x=(u0 + u1) / 2, y=(v0 + v1) / 2)
            center = self.type("vision_msgs/msg/Pose2D", position=point, theta=0.0)
            results = [
                self.type(
                    "vision_msgs/msg/ObjectHypothesisWithPose",
                    hypothesis=self.type("vision_msgs/msg/ObjectHypothesis", class_id=label, score=score),
                    pose=pose,
                )
                for label, score in hypotheses
            ]
            extra = {"id": ""}
        box = self.type("vision_msgs/msg/BoundingBox2D", center=center, size_x=u1 - u0, size_y=v1 - v0)
        header = self.header(stamp_ns, frame_id)
        return self.type("vision_msgs/msg/Detection2D", header=header, results=results, bbox=box, **extra)


class _Mcap:
    def __init__(self, path: Path, options: Mapping[str, Any]) -> None:
        self._file = path.open("wb")
        self._writer = McapWriter(self._file, **options)
        self._writer.start(profile="ros2", library="supermap tests")

    def connect(self, topic: str, msgtype: str, definition: str, store: Any) -> int:
        schema = self._writer.register_schema(msgtype, "ros2msg", definition.encode())
        return self._writer.register_channel(topic, "cdr", schema)

    def write(self, connection: int, log_ns: int, data: bytes) -> None:
        self._writer.add_message(connection, log_ns, data, log_ns)

    def close(self) -> None:
        self._writer.finish()
        self._file.close()


class _Rosbags:
    """`rosbags` writers; a bare `.db3` is taken out of the folder that belongs to it."""

    def __init__(self, path: Path) -> None:
        self._target = path
        self._folder = path.with_suffix("") if path.suffix == ".db3" else path
        self._writer: Any = Ros1Writer(path) if path.suffix == ".bag" else Ros2Writer(self._folder, version=9)
        self._writer.open()

    def connect(self, topic: str, msgtype: str, definition: str, store: Any) -> Any:
        return self._writer.add_connection(topic, msgtype, typestore=store)

    def write(self, connection: Any, log_ns: int, data: bytes) -> None:
        self._writer.write(connection, log_ns, data)

    def close(self) -> None:
        self._writer.close()
        if self._target.suffix == ".db3":
            shutil.move(self._folder / self._target.name, self._target)
            shutil.rmtree(self._folder)


def _backend(path: Path, options: Mapping[str, Any]) -> Any:
    return _Mcap(path, options) if path.suffix == ".mcap" else _Rosbags(path)


def compressed_depth_png(depth_mm: np.ndarray) -> bytes:
    """The bytes of a 16UC1 compressedDepth image: the 12-byte header, then a PNG."""
    return struct.pack("<iff", 0, 0.0, 0.0) + cv2.imencode(".png", depth_mm)[1].tobytes()
