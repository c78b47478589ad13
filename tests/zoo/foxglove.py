"""The suitcase recorded by Foxglove's SDK: its own schemas as JSON or protobuf, with detections of ROS 2 beside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap.writer import Writer

from supermap_cli.geometry.se3 import quaternion_xyzw_from_rotation
from support.foxglove_bags import Json, Protobuf
from zoo.detections import detection_message
from zoo.robot import Found
from zoo.scene import FRAMES, HEIGHT, START_NS, T_BASE_BODY, T_BODY_OPTICAL, WIDTH, K, T_world_base, render, stamp
from zoo.writing import ZooBag

FRAME = "camera_optical_frame"
POSES_A_FRAME = 5


def write_foxglove(dialect: Json | Protobuf, *, jpeg: bool = False) -> Any:
    """A writer of a whole recording."""

    def write(path: Path) -> None:
        detections = ZooBag(path.with_name("types.mcap"))
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start(profile="", library="foxglove-sdk")
            channels: dict[str, int] = {}

            def put(topic: str, name: str, at: int, values: dict[str, Any]) -> None:
                if topic not in channels:
                    schema = writer.register_schema(f"foxglove.{name}", dialect.schema_encoding, dialect.schema())
                    channels[topic] = writer.register_channel(topic, dialect.encoding, schema)
                writer.add_message(channels[topic], at, dialect.encode(name, values), at)

            mount = _link(dialect, START_NS, "base_link", FRAME, T_BASE_BODY @ T_BODY_OPTICAL)
            put("/camera_mount", "FrameTransform", START_NS, mount)
            for step in range((FRAMES - 1) * POSES_A_FRAME + 1):
                at = stamp(step / POSES_A_FRAME)
                moving = _link(dialect, at, "odom", "base_link", T_world_base(step / POSES_A_FRAME))
                put("/tf", "FrameTransforms", at, {"transforms": [moving]})
            for index in range(FRAMES):
                for topic, name, values in _images(dialect, index, jpeg=jpeg):
                    put(topic, name, stamp(index), values)
            _write_detections(writer, detections)
            writer.finish()

    return write


def _link(dialect: Json | Protobuf, at: int, parent: str, child: str, T: np.ndarray) -> dict[str, Any]:
    q = quaternion_xyzw_from_rotation(T[:3, :3])
    return {
        "timestamp": dialect.time(at),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": dict(zip("xyz", map(float, T[:3, 3]), strict=True)),
        "rotation": dict(zip("xyzw", map(float, q), strict=True)),
    }


def _images(dialect: Json | Protobuf, index: int, *, jpeg: bool) -> list[tuple[str, str, dict[str, Any]]]:
    depth_m, _, rgb = render(index)
    head, size = {"timestamp": dialect.time(stamp(index)), "frame_id": FRAME}, {"width": WIDTH, "height": HEIGHT}
    fx, fy, cx, cy = map(float, K)
    intrinsics = {"K": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], "D": [0.0] * 5, "R": [], "P": []}
    depth = np.round(depth_m * 1000).astype("<u2").tobytes()
    packed = cv2.imencode(".jpg", rgb[..., ::-1])[1].tobytes()
    color: tuple[str, str, dict[str, Any]] = (
        ("/camera/image", "CompressedImage", {**head, "format": "jpeg", "data": packed})
        if jpeg
        else (
            "/camera/image",
            "RawImage",
            {**head, **size, "encoding": "rgb8", "step": 3 * WIDTH, "data": rgb.tobytes()},
        )
    )
    return [
        ("/camera/calibration", "CameraCalibration", {**head, **size, "distortion_model": "plumb_bob", **intrinsics}),
        color,
        ("/camera/depth", "RawImage", {**head, **size, "encoding": "16UC1", "step": 2 * WIDTH, "data": depth}),
    ]


def _write_detections(writer: Writer, bag: ZooBag) -> None:
    found = Found()
    definition = bag._store.generate_msgdef(found.msgtype, ros_version=2)[0]
    schema = writer.register_schema(found.msgtype, "ros2msg", definition.encode())
    channel = writer.register_channel(found.topic, "cdr", schema)
    for index in range(FRAMES):
        message, at = detection_message(bag, found, index, FRAME)
        writer.add_message(channel, at, bytes(bag._store.serialize_cdr(message, found.msgtype)), at)
