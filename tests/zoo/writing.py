"""Writes a robot's recording, message by message, with `bags.BagWriter`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from supermap_cli.geometry.se3 import inverse, make_transform
from support.bag_writer import BagWriter
from zoo import pixels
from zoo.detections import DEFINITIONS, detection_message
from zoo.robot import Camera, Cloud, Found, Image, Imu, Motion, Other, Robot, Variant
from zoo.scene import (
    CENTER,
    FRAMES,
    RATE_HZ,
    START_NS,
    T_BASE_BODY,
    T_BASE_LIDAR,
    T_BODY_OPTICAL,
    T_world_base,
    intrinsics,
    render,
    scan,
    stamp,
)

POSES_HZ = 20.0
"""Rate of everything that says motion, 1/s; IMUs too."""


def write_variant(variant: Variant, folder: Path) -> Path:
    """The recording of a variant, damaged if it is to be."""
    path = folder / f"run{variant.suffix}"
    if variant.write is not None:
        variant.write(path)
    else:
        with ZooBag(path, **variant.writer) as bag:
            write_robot(bag, variant.robot)
    return path if variant.damage is None else variant.damage(path)


def write_robot(bag: ZooBag, robot: Robot) -> None:
    """Everything a robot records."""
    bag.shift_ns = robot.shift_ns
    if robot.static:
        for index in range(FRAMES if robot.mountings_move else 1):
            _write_mountings(bag, robot, stamp(index))
    streams = _streams(robot)
    _write_motion(bag, robot, [each for each in streams if isinstance(each, Motion)])
    for index in range(FRAMES):
        write_moment(bag, robot, index)
    for imu in (each for each in streams if isinstance(each, Imu)):
        for step in range(round((FRAMES - 1) / RATE_HZ * POSES_HZ) + 1):
            at = START_NS + round(step / POSES_HZ * 1e9)
            bag.imu(imu.topic, at, imu.frame, (0, 0, 0), (0, 0, 9.80665 / imu.unit))


def _streams(robot: Robot) -> list[Image | Cloud | Motion | Imu | Found | Other]:
    images = [image for camera in robot.cameras for image in (camera.color, camera.depth)]
    given = (*robot.others, robot.motion, robot.lidar, robot.imu, robot.found, *images)
    return [each for each in given if each is not None]


def write_moment(bag: ZooBag, robot: Robot, index: int) -> None:
    """Images, sweeps and detections of image `index`."""
    yaws = {image.topic: camera.yaw_deg for camera in robot.cameras for image in (camera.color, camera.depth) if image}
    infos: set[str] = set()
    for each in _streams(robot):
        if isinstance(each, Image) and index % each.every == 0:
            _write_image(bag, each, index, yaws.get(each.topic, 0.0), infos)
        elif isinstance(each, Cloud):
            for half in (index, index + 0.5):
                write_cloud(bag, each, half)
        elif isinstance(each, Other):
            bag.write(each.topic, each.msgtype, bag.make(each.msgtype), stamp(index))
        elif isinstance(each, Found):
            _write_found(bag, each, index, robot.cameras[0].color.frame if each.frame is None else each.frame)


def _write_mountings(bag: ZooBag, robot: Robot, at: int) -> None:
    """Where TF says that the sensors sit on the base."""
    placed = {motion.frame for motion in (robot.motion, *robot.others) if isinstance(motion, Motion)}

    def place(parent: str, child: str, T: np.ndarray) -> None:
        if child and child != parent and child not in placed:
            placed.add(child)
            bag.transform(at, parent, child, T, static=not robot.mountings_move, namespace=robot.namespace)

    for camera in robot.cameras:
        c, s = np.cos(np.deg2rad(camera.yaw_deg)), np.sin(np.deg2rad(camera.yaw_deg))
        T_base_body = make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [0, 0, 0]) @ T_BASE_BODY
        place(robot.base, camera.body, T_base_body)
        parent, T = (camera.body, np.eye(4)) if camera.body else (robot.base, T_base_body)
        place(parent, camera.color.frame, T @ T_BODY_OPTICAL)
        place(parent, camera.color.info_frame or "", T @ T_BODY_OPTICAL)
        if camera.depth is not None:
            place(parent, camera.depth.frame, T @ T_BODY_OPTICAL @ make_transform(np.eye(3), camera.depth.offset))
    for image in (each for each in robot.others if isinstance(each, Image)):
        parent = robot.cameras[0].body or robot.base
        T = np.eye(4) if robot.cameras[0].body else T_BASE_BODY
        place(parent, image.frame, T @ T_BODY_OPTICAL @ make_transform(np.eye(3), image.offset))
    for cloud in (each for each in (robot.lidar, *robot.others) if isinstance(each, Cloud)):
        place(robot.base, cloud.frame, T_BASE_LIDAR)
    for imu in (each for each in (robot.imu, *robot.others) if isinstance(each, Imu)):
        place(robot.base, imu.frame, np.eye(4))
    for parent, child in robot.links.items():
        place(parent, child, np.eye(4))


def _write_motion(bag: ZooBag, robot: Robot, motions: list[Motion]) -> None:
    for step in range(round((FRAMES - 1) / RATE_HZ * POSES_HZ) + 3):
        at, T = START_NS + round((step - 1) / POSES_HZ * 1e9), T_world_base((step - 1) / POSES_HZ * RATE_HZ)
        for motion in motions:
            write_pose(bag, motion, at, make_transform(np.eye(3), motion.offset) @ T, robot.namespace)


def write_pose(bag: ZooBag, motion: Motion, at: int, T: np.ndarray, namespace: str = "") -> None:
    """One pose, as the topic has it, and in TF."""
    if motion.kind == "odometry":
        bag.odometry(motion.topic, at, T, frame_id=motion.frame, child_frame_id=motion.child)
    elif motion.kind in {"pose", "pose_covariance"}:
        bag.pose(motion.topic, at, motion.frame, T, covariance=motion.kind == "pose_covariance")
    elif motion.kind == "transform":
        bag.stamped_transform(motion.topic, at, motion.frame, motion.child, T)
    if motion.tf or motion.kind == "tf":
        bag.transform(at, motion.frame, motion.child, T, namespace=namespace)


def _write_image(bag: ZooBag, image: Image, index: int, yaw_deg: float, infos: set[str]) -> None:
    at, log_ns = stamp(index) + image.late_ns, stamp(index)
    depth, seen, rgb = render(index, image.offset, image.size, fisheye=image.model == "equidistant")
    if yaw_deg:
        depth, seen, rgb = np.full_like(depth, 2.0), np.zeros_like(seen), np.full_like(rgb, 90)
    info = image.topic if image.info == "beside" else image.info
    if image.info == "beside":
        folder = image.topic.split("/")
        info = "/".join(folder[: -2 if folder[-1] in pixels.TRANSPORTS else -1]) + "/camera_info"
    if info and info not in infos and not (image.info_once and index):
        infos.add(info)
        size = image.info_size or image.size
        frame = image.frame if image.info_frame is None else image.info_frame
        bag.calibration(info, at, frame, image, size, log_ns)
    shown: np.ndarray
    if image.content == "depth":
        shown = depth * image.scale
    elif image.content == "masks":
        shown = seen.astype(np.uint16)
    else:
        shown = rgb
    packed = pixels.pack(shown, image.encoding)
    if isinstance(packed, bytes):
        bag.compressed(image.topic, at, image.frame, packed, pixels.format_of(image.encoding), log_ns=log_ns)
    else:
        bag.raw_image(image.topic, at, image.frame, packed, image.encoding, image.size, image.padding, log_ns)


def _write_found(bag: ZooBag, found: Found, index: int, frame: str) -> None:
    message, at = detection_message(bag, found, index, frame)
    bag.write(found.topic, found.msgtype, message, at)


def write_cloud(bag: ZooBag, cloud: Cloud, index: float) -> None:
    """One sweep in the layout of a topic."""
    points, offsets_s, rings = scan(index)
    at, clock_ns = stamp(index), round(cloud.clock_s * 1e9)
    if cloud.msgtype.endswith("CustomMsg"):
        package = cloud.msgtype.partition("/")[0]
        some = slice(None, None, 5)
        offsets_ns = np.round(offsets_s[some] * 1e9).astype(np.int64)
        bag.livox(cloud.topic, at + clock_ns, cloud.frame, points[some], offsets_ns, package=package, log_ns=at)
        return
    stamp_ns = at + round(offsets_s.max() * 1e9) if cloud.time == "until_end" else at
    kind = [(axis, cloud.xyz) for axis in "xyz"]
    kind += [(name if name != "_" else f"_{i}", dtype) for i, (name, dtype) in enumerate(cloud.fields)]
    order = ">" if cloud.big_endian else "<"
    records = np.zeros(len(points), np.dtype([(name, f"{order}{dtype}") for name, dtype in kind]))
    for axis, values in zip("xyz", points.T, strict=True):
        records[axis] = values
    for name, _ in cloud.fields:
        if name in {"ring", "line", "channel"}:
            records[name] = rings
        elif name in TIME_NAMES:
            records[name] = _times(cloud.time, offsets_s, at + clock_ns)
    bag.cloud(cloud, stamp_ns + clock_ns, records, at)


TIME_NAMES = frozenset({"t", "time", "timestamp", "offset_time", "time_offset", "time_stamp", "timeOffset", "t_ns"})
"""Fields that hold the time of a point."""

_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


def _times(how: str, offsets_s: np.ndarray, stamp_ns: int) -> np.ndarray:
    if how == "absolute":
        return stamp_ns / 1e9 + offsets_s
    if how == "absolute_ns":
        return stamp_ns + np.round(offsets_s * 1e9)
    if how == "until_end":
        return offsets_s - offsets_s.max()
    return np.round(offsets_s * _UNITS[how]) if how != "s" else offsets_s


class ZooBag(BagWriter):
    """A `BagWriter` that knows the message types of detectors and makes messages of zeros."""

    _stores: ClassVar[dict[tuple[bool, bool], Any]] = {}

    def __init__(self, path: Path, **options: Any) -> None:
        super().__init__(path, **options)
        key = (self._ros1, self._old_vision)
        if key in self._stores:
            self._store = self._stores[key]
            return
        self._stores[key] = self._store
        for package, texts in DEFINITIONS.items():
            if options.get("old_vision") and package == "vision_msgs":
                continue
            types: dict[str, Any] = {}
            for name, text in texts.items():
                types |= get_types_from_msg(text, f"{package}/msg/{name}")
            self._store.register({name: kind for name, kind in types.items() if name not in self._store.types})

    shift_ns = 0

    def header(self, stamp_ns: int, frame_id: str) -> Any:
        """A std_msgs/Header by the robot's clock."""
        return super().header(stamp_ns + self.shift_ns, frame_id)

    def make(self, name: str, /, **given: Any) -> Any:
        """A message object of zeros and empty texts, but for what is given."""
        values = {}
        for field, node in self._store.fielddefs[name][1]:
            values[field] = given.pop(field) if field in given else self._zero(*node)
        assert not given, f"{name} has no fields {list(given)}"
        return self._store.types[name](**values)

    def _zero(self, node: Nodetype, detail: Any) -> Any:
        if node == Nodetype.BASE:
            return {"string": "", "bool": False}.get(detail[0], 0.0 if detail[0].startswith("float") else 0)
        if node == Nodetype.NAME:
            return self.make(detail)
        (inner, what), length = detail if node == Nodetype.ARRAY else (detail[0], 0)
        if inner == Nodetype.NAME or what[0] == "string":
            return [self._zero(inner, what) for _ in range(length)]
        return np.zeros(length, {"octet": "uint8"}.get(what[0], what[0]))

    def calibration(
        self, topic: str, stamp_ns: int, frame: str, image: Image, size: tuple[int, int], log_ns: int
    ) -> None:
        """A sensor_msgs/CameraInfo of an image's camera."""
        fx, fy, cx, cy = intrinsics(size)
        matrices = {
            "d": np.array(image.distortion, np.float64),
            "k": np.zeros(9) if image.info_zero_k else np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1.0]),
            "r": np.eye(3).ravel(),
            "p": np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0.0]),
        }
        message = self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(stamp_ns, frame),
            width=0 if image.info_zero_size else size[0],
            height=0 if image.info_zero_size else size[1],
            distortion_model=image.model,
            **{name.upper() if self._ros1 else name: values for name, values in matrices.items()},
        )
        self.write(topic, "sensor_msgs/msg/CameraInfo", message, log_ns)

    def raw_image(
        self,
        topic: str,
        stamp_ns: int,
        frame: str,
        rows: np.ndarray,
        encoding: str,
        size: tuple[int, int],
        padding: int,
        log_ns: int,
    ) -> None:
        """A sensor_msgs/Image of rows of bytes, of which there may be more or fewer than lines."""
        rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
        message = self.make(
            "sensor_msgs/msg/Image",
            header=self.header(stamp_ns, frame),
            width=size[0],
            height=size[1],
            encoding=encoding,
            step=rows.shape[1],
            data=rows.ravel(),
        )
        self.write(topic, "sensor_msgs/msg/Image", message, log_ns)

    def cloud(self, cloud: Cloud, stamp_ns: int, records: np.ndarray, log_ns: int) -> None:
        """A PointCloud2; fields that begin with "_" are bytes unused."""
        if cloud.organized:
            height, width = 1, len(records)
            height = len(np.unique(records["ring"])) if "ring" in (records.dtype.names or ()) else 1
            width = len(records) // height
            records = np.ascontiguousarray(records.reshape(width, height).T).ravel()
        else:
            height, width = 1, len(records)
        names = [name for name in records.dtype.names or () if not name.startswith("_")]
        codes = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
        fields = [
            self.make(
                "sensor_msgs/msg/PointField",
                name=name,
                offset=records.dtype.fields[name][1],
                datatype=codes[records.dtype[name].str[1:]],
                count=1,
            )
            for name in names
        ]
        message = self.make(
            "sensor_msgs/msg/PointCloud2",
            header=self.header(stamp_ns, cloud.frame),
            height=height,
            width=width,
            fields=fields,
            is_bigendian=cloud.big_endian,
            point_step=records.dtype.itemsize,
            row_step=records.dtype.itemsize * width,
            data=np.frombuffer(records.tobytes(), np.uint8),
            is_dense=True,
        )
        self.write(cloud.topic, "sensor_msgs/msg/PointCloud2", message, log_ns)

    def stamped_transform(self, topic: str, stamp_ns: int, parent: str, child: str, T: np.ndarray) -> None:
        """A geometry_msgs/TransformStamped on a topic of its own, as motion capture has it."""
        pose = self._pose(T)
        message = self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(stamp_ns, parent),
            child_frame_id=child,
            transform=self.make(
                "geometry_msgs/msg/Transform",
                translation=self._vector("Vector3", T[:3, 3]),
                rotation=pose.orientation,
            ),
        )
        self.write(topic, "geometry_msgs/msg/TransformStamped", message, stamp_ns)

    def point_xyz(self, index: float) -> Any:
        """The middle of the suitcase in the main camera's optical frame, geometry_msgs/Point."""
        T = T_world_base(index) @ T_BASE_BODY @ T_BODY_OPTICAL
        return self._vector("Point", (inverse(T) @ np.append(CENTER, 1.0))[:3])


def frames_of(camera: Camera) -> tuple[str, ...]:
    """The frames of a camera's images."""
    return tuple(image.frame for image in (camera.color, camera.depth) if image is not None)
