"""Writes small recordings in Foxglove's own schemas, as JSON and as protobuf."""

import base64
import json

import cv2
import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.writer import Writer

from support import bags

FIELD = descriptor_pb2.FieldDescriptorProto
SCHEMAS = {
    "Time": [("seconds", "int64"), ("nanos", "int32")],
    "Vector3": [("x", "double"), ("y", "double"), ("z", "double")],
    "Quaternion": [("x", "double"), ("y", "double"), ("z", "double"), ("w", "double")],
    "Pose": [("position", "Vector3"), ("orientation", "Quaternion")],
    "PackedElementField": [("name", "string"), ("offset", "fixed32"), ("type", "int32")],
    "CompressedImage": [("timestamp", "Time"), ("frame_id", "string"), ("data", "bytes"), ("format", "string")],
    "RawImage": [
        ("timestamp", "Time"), ("frame_id", "string"), ("width", "fixed32"), ("height", "fixed32"),
        ("encoding", "string"), ("step", "fixed32"), ("data", "bytes"),
    ],
    "CameraCalibration": [
        ("timestamp", "Time"), ("frame_id", "string"), ("width", "fixed32"), ("height", "fixed32"),
        ("distortion_model", "string"), ("D", "double*"), ("K", "double*"), ("R", "double*"), ("P", "double*"),
    ],
    "FrameTransform": [
        ("timestamp", "Time"), ("parent_frame_id", "string"), ("child_frame_id", "string"), ("translation", "Vector3"),
        ("rotation", "Quaternion"),
    ],
    "FrameTransforms": [("transforms", "FrameTransform*")],
    "PointCloud": [
        ("timestamp", "Time"), ("frame_id", "string"), ("pose", "Pose"), ("point_stride", "fixed32"),
        ("fields", "PackedElementField*"), ("data", "bytes"),
    ],
}  # fmt: skip


def descriptors():
    file = descriptor_pb2.FileDescriptorProto(name="foxglove.proto", package="foxglove", syntax="proto3")
    for name, fields in SCHEMAS.items():
        message = file.message_type.add(name=name)
        for number, (field, kind) in enumerate(fields, 1):
            label = FIELD.LABEL_REPEATED if kind.endswith("*") else FIELD.LABEL_OPTIONAL
            element = kind.removesuffix("*")
            if element in SCHEMAS:
                of = {"type": FIELD.TYPE_MESSAGE, "type_name": f".foxglove.{element}"}
            else:
                of = {"type": getattr(FIELD, f"TYPE_{element.upper()}")}
            message.field.add(name=field, number=number, label=label, **of)
    return descriptor_pb2.FileDescriptorSet(file=[file])


class Json:
    encoding, schema_encoding = "json", "jsonschema"

    def schema(self):
        return b"{}"

    def time(self, stamp_ns):
        return {"sec": stamp_ns // 10**9, "nsec": stamp_ns % 10**9}

    def encode(self, name, values):
        return json.dumps(values, default=lambda data: base64.b64encode(data).decode()).encode()


class Protobuf:
    encoding, schema_encoding = "protobuf", "protobuf"

    def __init__(self):
        self._files = descriptors()
        self._pool = descriptor_pool.DescriptorPool()
        self._pool.Add(self._files.file[0])

    def schema(self):
        return self._files.SerializeToString()

    def time(self, stamp_ns):
        return {"seconds": stamp_ns // 10**9, "nanos": stamp_ns % 10**9}

    def encode(self, name, values):
        message = message_factory.GetMessageClass(self._pool.FindMessageTypeByName(f"foxglove.{name}"))
        return message(**values).SerializeToString()


def write_foxglove(path, dialect, *, compressed):
    camera, K = "camera_optical_frame", [60.0, 0, 31.5, 0, 60.0, 23.5, 0, 0, 1]
    q_identity = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="tests")
        channels = {}

        def put(topic, name, stamp_ns, values):
            if topic not in channels:
                schema = writer.register_schema(f"foxglove.{name}", dialect.schema_encoding, dialect.schema())
                channels[topic] = writer.register_channel(topic, dialect.encoding, schema)
            writer.add_message(channels[topic], stamp_ns, dialect.encode(name, values), stamp_ns)

        for index in range(3):
            at, time = bags.stamp(index), dialect.time(bags.stamp(index))
            link = {"timestamp": time, "rotation": q_identity}
            place = {"x": index / 10, "y": 0.0, "z": 0.0}
            moving = {**link, "parent_frame_id": "odom", "child_frame_id": "base_link", "translation": place}
            fixed = {
                **link,
                "parent_frame_id": "base_link",
                "child_frame_id": camera,
                "translation": {**place, "x": 0.2},
            }
            put("/tf", "FrameTransforms", at, {"transforms": [moving]})
            put("/camera_mount", "FrameTransform", at, fixed)
            size = {"width": 64, "height": 48}
            D = [0.0] * 5
            calibration = {"distortion_model": "plumb_bob", "D": D, "K": K, "R": [], "P": []}
            put(
                "/camera/calibration",
                "CameraCalibration",
                at,
                {"timestamp": time, "frame_id": camera, **size, **calibration},
            )
            image = {"timestamp": time, "frame_id": camera}
            rgb = bags.color_image(index)
            if compressed:
                png = cv2.imencode(".png", rgb[..., ::-1])[1].tobytes()
                put("/camera/image", "CompressedImage", at, {**image, "format": "png", "data": png})
            else:
                raw = {"encoding": "rgb8", "step": 192, "data": rgb.tobytes()}
                put("/camera/image", "RawImage", at, {**image, **size, **raw})
            depth = {"encoding": "16UC1", "step": 128, "data": bags.depth_image().tobytes()}
            put("/camera/depth", "RawImage", at, {**image, **size, **depth})
            records = np.ones(4, np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("t", "<u4")]))
            records["t"] = 90_000_000
            fields = [
                {"name": n, "offset": o, "type": t} for n, o, t in (("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("t", 12, 5))
            ]
            pose = {"position": {"x": 0.0, "y": 0.0, "z": 1.0}, "orientation": q_identity}
            cloud = {"point_stride": 16, "fields": fields, "data": records.tobytes(), "pose": pose}
            put("/lidar", "PointCloud", at, {"timestamp": time, "frame_id": "base_link", **cloud})
        writer.finish()
