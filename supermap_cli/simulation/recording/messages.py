"""Measurements as ROS 2 messages in an `.mcap` with its schemas embedded, under the topics that real robots use.

- RGB-D camera: /camera/color/image_raw/compressed (JPEG) and /camera/aligned_depth_to_color/image_raw/compressedDepth
  (16-bit PNG, millimetres), each with its camera_info. Raw depth takes 8 ms to write instead of 12, but 27 % more room,
  and every stream that is read from the file has to inflate it. Of several cameras each has its own namespace:
  /camera_front/color/..., /camera_left/color/...
- Panorama: /panorama/image_raw/compressed and its camera_info, whose distortion_model is "equirectangular".
- LiDAR: /livox/lidar, PointCloud2 as livox_ros_driver2 writes it (PointXYZRTLT: each point has its own nanoseconds);
  one with rings: /velodyne_points as the velodyne driver does (PointXYZIRT: each point's seconds since the stamp).
- /imu/data; /odom with /tf and /tf_static; the truth as /ground_truth/odom in the frame "world".
- Detector: /detections (vision_msgs/Detection2DArray), /detections/masks (16UC1, k on the k-th detection, 1-based);
  of several cameras: /camera_front/detections, /camera_front/detections/masks, ...

Everything is logged at its header's stamp, but detections when they are there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import cv2
import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from supermap_cli.geometry.arrays import Float32Array, FloatArray, UInt8Array, UInt16Array
from supermap_cli.geometry.cameras import EquirectangularCamera, PinholeCamera
from supermap_cli.geometry.se3 import quaternion_xyzw_from_rotation
from supermap_cli.recordings.definitions import FALLBACK_DEFINITIONS
from supermap_cli.simulation.recording.point_clouds import LidarNames
from supermap_cli.simulation.rigs import SimulatedCamera, SimulatedRig
from supermap_cli.simulation.sensors.lidar_sensor import LidarScan
from supermap_cli.types.detections import Detections

LIBRARY = "supermap simulate"

IMU_TOPIC = "/imu/data"
ODOMETRY_TOPIC = "/odom"
TRUTH_TOPIC = "/ground_truth/odom"

_JPEG_QUALITY = 90  # percent
_NO_DEPTH_PARAMETERS = bytes(12)  # compressedDepth's header for 16UC1: format and two quantisation parameters, unused
# numpy type -> datatype of sensor_msgs/PointField
_POINT_FIELD = {"<f4": 7, "|u1": 2, "<f8": 8, "<u2": 4}


@dataclass(frozen=True)
class Outgoing:
    """A message ready to be stored: `data` is CDR."""

    topic: str
    msgtype: str
    log_ns: int
    data: bytes


class RigMessages:
    """Turns one rig's measurements into messages. Its methods may be called from several threads."""

    def __init__(self, rig: SimulatedRig) -> None:
        self._rig = rig
        self._store = _typestore()
        self._lidar = LidarNames.of(rig.lidar)
        self._camera_info = {camera.camera_id: _camera_info_fields(camera.model) for camera in rig.cameras}

    def definition(self, msgtype: str) -> str:
        """The text of a message's definition with all that it needs."""
        text, _ = self._store.generate_msgdef(msgtype, ros_version=2)
        return str(text)

    def mounting(self, stamp_ns: int) -> Outgoing:
        """/tf_static: where the sensors sit on the base."""
        sensors = [(camera.frame_id, camera.T_base_camera) for camera in self._rig.cameras]
        if self._rig.imu is not None:
            sensors.append(("imu_link", self._rig.T_base_imu))
        if self._rig.T_base_lidar is not None:
            sensors.append((self._lidar.frame_id, self._rig.T_base_lidar))
        transforms = [self._transform(stamp_ns, "base_link", name, T) for name, T in sensors]
        return self._message("/tf_static", "tf2_msgs/msg/TFMessage", stamp_ns, transforms=transforms)

    def odometry(self, stamp_ns: int, T_odom_base: FloatArray) -> Iterator[Outgoing]:
        """/odom and /tf: where the robot believes to be."""
        yield self._odometry(ODOMETRY_TOPIC, stamp_ns, "odom", T_odom_base)
        transform = self._transform(stamp_ns, "odom", "base_link", T_odom_base)
        yield self._message("/tf", "tf2_msgs/msg/TFMessage", stamp_ns, transforms=[transform])

    def true_pose(self, stamp_ns: int, T_world_base: FloatArray) -> Outgoing:
        """/ground_truth/odom: where it is."""
        return self._odometry(TRUTH_TOPIC, stamp_ns, "world", T_world_base)

    def imu(self, stamp_ns: int, angular_rate: FloatArray, specific_force: FloatArray) -> Outgoing:
        """/imu/data, without an orientation (its covariance begins with -1)."""
        unknown = np.zeros(9)
        return self._message(
            IMU_TOPIC,
            "sensor_msgs/msg/Imu",
            stamp_ns,
            header=self._header(stamp_ns, "imu_link"),
            orientation=self._type("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=np.array([-1.0, *unknown[1:]]),
            angular_velocity=self._vector("Vector3", angular_rate),
            angular_velocity_covariance=unknown,
            linear_acceleration=self._vector("Vector3", specific_force),
            linear_acceleration_covariance=unknown,
        )

    def color(self, camera: SimulatedCamera, stamp_ns: int, rgb: UInt8Array) -> Iterator[Outgoing]:
        """A JPEG of a camera's image (h, w, 3), and its camera_info."""
        yield self._calibration(camera, camera.color_namespace, stamp_ns)
        bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
        jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1]
        topic = f"{camera.color_namespace}/image_raw/compressed"
        yield self._compressed(topic, camera, stamp_ns, "jpeg", jpeg.ravel())

    def depth(self, camera: SimulatedCamera, stamp_ns: int, depth_m: Float32Array) -> Iterator[Outgoing]:
        """Depth (h, w) on the color camera's pixels, 0 = no return, and its camera_info.

        Raises `ValueError` for a camera without depth.
        """
        if camera.depth_namespace is None:
            raise ValueError(f"the camera {camera.camera_id!r} has no depth")
        yield self._calibration(camera, camera.depth_namespace, stamp_ns)
        png = cv2.imencode(".png", np.rint(depth_m * 1000).astype(np.uint16))[1]
        data = np.concatenate([np.frombuffer(_NO_DEPTH_PARAMETERS, np.uint8), png.ravel()])
        topic = f"{camera.depth_namespace}/image_raw/compressedDepth"
        yield self._compressed(topic, camera, stamp_ns, "16UC1; compressedDepth png", data)

    def points(self, stamp_ns: int, scan: LidarScan) -> Outgoing:
        """One scan, on the LiDAR's topic."""
        cloud = self._lidar.cloud(stamp_ns, scan)
        return self._message(
            self._lidar.topic,
            "sensor_msgs/msg/PointCloud2",
            stamp_ns,
            header=self._header(stamp_ns, self._lidar.frame_id),
            height=1,
            width=len(cloud),
            fields=self._point_fields(cloud.dtype),
            is_bigendian=False,
            point_step=cloud.itemsize,
            row_step=cloud.nbytes,
            data=np.frombuffer(cloud.tobytes(), np.uint8),
            is_dense=True,
        )

    def detections(self, found: Detections, log_ns: int) -> Iterator[Outgoing]:
        """The detections of the image of `found.stamp_ns` and `found.camera_id`, published at `log_ns`."""
        camera = self._rig.camera(found.camera_id)
        header = self._header(found.stamp_ns, camera.frame_id)
        yield self._message(
            camera.detections_topic,
            "vision_msgs/msg/Detection2DArray",
            log_ns,
            header=header,
            detections=[self._detection(header, found, k) for k in range(len(found))],
        )
        numbers = number_image(found, camera.model.height, camera.model.width)
        yield self._message(
            f"{camera.detections_topic}/masks",
            "sensor_msgs/msg/Image",
            log_ns,
            header=header,
            height=numbers.shape[0],
            width=numbers.shape[1],
            encoding="16UC1",
            is_bigendian=0,
            step=2 * numbers.shape[1],
            data=numbers.astype("<u2").view(np.uint8).ravel(),
        )

    def _detection(self, header: Any, found: Detections, k: int) -> Any:
        u0, v0, u1, v1 = map(float, found.boxes_xyxy[k])
        pose = self._pose_with_covariance(np.eye(4))
        results = [
            self._type(
                "vision_msgs/msg/ObjectHypothesisWithPose",
                hypothesis=self._type(
                    "vision_msgs/msg/ObjectHypothesis", class_id=hypothesis.label, score=float(hypothesis.score)
                ),
                pose=pose,
            )
            for hypothesis in found.hypotheses[k]
        ]
        middle = self._type("vision_msgs/msg/Point2D", x=(u0 + u1) / 2, y=(v0 + v1) / 2)
        center = self._type("vision_msgs/msg/Pose2D", position=middle, theta=0.0)
        box = self._type("vision_msgs/msg/BoundingBox2D", center=center, size_x=u1 - u0, size_y=v1 - v0)
        return self._type("vision_msgs/msg/Detection2D", header=header, results=results, bbox=box, id="")

    def _odometry(self, topic: str, stamp_ns: int, frame_id: str, T: FloatArray) -> Outgoing:
        still = self._vector("Vector3", np.zeros(3))
        twist = self._type("geometry_msgs/msg/Twist", linear=still, angular=still)
        return self._message(
            topic,
            "nav_msgs/msg/Odometry",
            stamp_ns,
            header=self._header(stamp_ns, frame_id),
            child_frame_id="base_link",
            pose=self._pose_with_covariance(T),
            twist=self._type("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
        )

    def _calibration(self, camera: SimulatedCamera, namespace: str, stamp_ns: int) -> Outgoing:
        roi = self._type(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        header = self._header(stamp_ns, camera.frame_id)
        return self._message(
            f"{namespace}/camera_info",
            "sensor_msgs/msg/CameraInfo",
            stamp_ns,
            header=header,
            roi=roi,
            binning_x=0,
            binning_y=0,
            **self._camera_info[camera.camera_id],
        )

    def _compressed(
        self, topic: str, camera: SimulatedCamera, stamp_ns: int, form: str, data: NDArray[np.uint8]
    ) -> Outgoing:
        header = self._header(stamp_ns, camera.frame_id)
        return self._message(topic, "sensor_msgs/msg/CompressedImage", stamp_ns, header=header, format=form, data=data)

    def _point_fields(self, point: np.dtype[np.void]) -> list[Any]:
        described: Mapping[str, Any] = point.fields or {}
        return [
            self._type("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=_POINT_FIELD[kind.str], count=1)
            for name, (kind, offset) in ((name, described[name][:2]) for name in point.names or ())
        ]

    def _pose_with_covariance(self, T: FloatArray) -> Any:
        position = self._vector("Point", T[:3, 3])
        pose = self._type("geometry_msgs/msg/Pose", position=position, orientation=self._quaternion(T))
        return self._type("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36))

    def _transform(self, stamp_ns: int, parent: str, child: str, T_parent_child: FloatArray) -> Any:
        return self._type(
            "geometry_msgs/msg/TransformStamped",
            header=self._header(stamp_ns, parent),
            child_frame_id=child,
            transform=self._type(
                "geometry_msgs/msg/Transform",
                translation=self._vector("Vector3", T_parent_child[:3, 3]),
                rotation=self._quaternion(T_parent_child),
            ),
        )

    def _quaternion(self, T: FloatArray) -> Any:
        x, y, z, w = map(float, quaternion_xyzw_from_rotation(T[:3, :3]))
        return self._type("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def _vector(self, kind: str, xyz: Sequence[float] | FloatArray) -> Any:
        x, y, z = map(float, xyz)
        return self._type(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)

    def _header(self, stamp_ns: int, frame_id: str) -> Any:
        seconds, nanoseconds = divmod(int(stamp_ns), 1_000_000_000)
        stamp = self._type("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        return self._type("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

    def _message(self, topic: str, msgtype: str, log_ns: int, **fields: Any) -> Outgoing:
        data = bytes(self._store.serialize_cdr(self._type(msgtype, **fields), msgtype))
        return Outgoing(topic, msgtype, int(log_ns), data)

    def _type(self, msgtype: str, **fields: Any) -> Any:
        return self._store.types[msgtype](**fields)


def number_image(found: Detections, height: int, width: int) -> UInt16Array:
    """(h, w) uint16: k on the k-th detection's mask (1-based), 0 elsewhere; where masks overlap, the smaller one."""
    numbers = np.zeros((height, width), np.uint16)
    sized = [(int(mask.pixels.sum()), k, mask) for k, mask in enumerate(found.masks) if mask is not None]
    for _, k, mask in sorted(sized, key=lambda entry: (-entry[0], entry[1])):
        h, w = mask.pixels.shape
        numbers[mask.v0 : mask.v0 + h, mask.u0 : mask.u0 + w][mask.pixels] = k + 1
    return numbers


class RecordingFile:
    """An `.mcap` being written, in the order of log time; a context manager."""

    def __init__(self, path: Path, messages: RigMessages) -> None:
        self._messages = messages
        self._file = path.open("wb")
        self._writer: Any = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library=LIBRARY)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is None:
            self._writer.finish()
        self._file.close()

    def write(self, message: Outgoing) -> None:
        """Append one message."""
        channel = self._channels.get(message.topic)
        if channel is None:
            channel = self._channels[message.topic] = self._register(message.topic, message.msgtype)
        self._writer.add_message(channel, message.log_ns, message.data, message.log_ns)

    def _register(self, topic: str, msgtype: str) -> int:
        if msgtype not in self._schemas:
            text = self._messages.definition(msgtype).encode()
            self._schemas[msgtype] = self._writer.register_schema(name=msgtype, encoding="ros2msg", data=text)
        channel: int = self._writer.register_channel(topic, "cdr", self._schemas[msgtype])
        return channel


def _typestore() -> Typestore:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in FALLBACK_DEFINITIONS["vision_msgs"].items():
        store.register(get_types_from_msg(text, f"vision_msgs/msg/{name}"))
    return store


def _camera_info_fields(camera: PinholeCamera | EquirectangularCamera) -> dict[str, Any]:
    size = {"height": camera.height, "width": camera.width}
    if isinstance(camera, EquirectangularCamera):
        none = {"d": np.zeros(0), "k": np.zeros(9), "r": np.eye(3).ravel(), "p": np.zeros(12)}
        return {**size, "distortion_model": "equirectangular", **none}
    K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    P = np.column_stack([K, np.zeros(3)])
    D = np.array([*camera.distortion, *np.zeros(5)][:5])
    return {**size, "distortion_model": "plumb_bob", "d": D, "k": K.ravel(), "r": np.eye(3).ravel(), "p": P.ravel()}
