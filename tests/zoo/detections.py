"""The messages of detectors, of the suitcase that stands in the room.

Definitions of vision_msgs 4.x, yolo_ros, ultralytics_ros, darknet_ros, depthai-ros, zed-ros2-interfaces and
jsk_recognition_msgs: the fields, without comments.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from zoo.robot import Found
from zoo.scene import CLASS_NUMBER, box_xyxy, stamp

if TYPE_CHECKING:
    from zoo.writing import ZooBag

_HEADER = "std_msgs/Header header\n"
_YOLO = {
    "Point2D": "float64 x\nfloat64 y\n",
    "Point3D": "float64 x\nfloat64 y\nfloat64 z\n",
    "Vector2": "float64 x\nfloat64 y\n",
    "Pose2D": "{0}/Point2D position\nfloat64 theta\n",
    "BoundingBox2D": "{0}/Pose2D center\n{0}/Vector2 size\n",
    "BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\nstring frame_id\n",
    "Mask": "int32 height\nint32 width\n{0}/Point2D[] data\n",
    "KeyPoint2D": "int32 id\n{0}/Point2D point\nfloat64 score\n",
    "KeyPoint2DArray": "{0}/KeyPoint2D[] data\n",
    "KeyPoint3D": "int32 id\ngeometry_msgs/Point point\nfloat64 score\n",
    "KeyPoint3DArray": "{0}/KeyPoint3D[] data\nstring frame_id\n",
    "Detection": (
        "int32 class_id\nstring class_name\nfloat64 score\nstring id\n{0}/BoundingBox2D bbox\n"
        "{0}/BoundingBox3D bbox3d\n{0}/Mask mask\n{0}/KeyPoint2DArray keypoints\n{0}/KeyPoint3DArray keypoints3d\n"
    ),
    "DetectionArray": _HEADER + "{0}/Detection[] detections\n",
}
_DARKNET = {
    "BoundingBox": "float64 probability\nint64 xmin\nint64 ymin\nint64 xmax\nint64 ymax\nint16 id\nstring Class\n",
    "BoundingBoxes": f"{_HEADER}std_msgs/Header image_header\n{{0}}/BoundingBox[] bounding_boxes\n",
}
_ZED = {
    "Keypoint2Di": "uint32[2] kp\n",
    "Keypoint3D": "float32[3] kp\n",
    "BoundingBox2Di": "{0}/Keypoint2Di[4] corners\n",
    "BoundingBox3D": "{0}/Keypoint3D[8] corners\n",
    "Object": (
        "string label\nint16 label_id\nstring sublabel\nfloat32 confidence\nfloat32[3] position\n"
        "float32[6] position_covariance\nfloat32[3] velocity\nbool tracking_available\nint8 tracking_state\n"
        "int8 action_state\n{0}/BoundingBox2Di bounding_box_2d\n{0}/BoundingBox3D bounding_box_3d\n"
        "float32[3] dimensions_3d\n"
    ),
    "ObjectsStamped": _HEADER + "{0}/Object[] objects\n",
}
_DEPTHAI = {
    "ObjectHypothesis": "string class_id\nfloat64 score\n",
    "SpatialDetection": (
        "vision_msgs/ObjectHypothesis[] results\nvision_msgs/BoundingBox2D bbox\ngeometry_msgs/Point position\n"
        "bool is_tracking\nstring tracking_id\n"
    ),
    "SpatialDetectionArray": _HEADER + "{0}/SpatialDetection[] detections\n",
    "TrackDetection2D": (
        "vision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox2D bbox\nbool is_tracking\n"
        "string tracking_id\nint32 tracking_age\nint32 tracking_status\n"
    ),
    "TrackDetection2DArray": _HEADER + "{0}/TrackDetection2D[] detections\n",
}
_VISION_3D = {
    "BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    "Detection3D": (
        f"{_HEADER}vision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox3D bbox\nstring id\n"
    ),
    "Detection3DArray": f"{_HEADER}vision_msgs/Detection3D[] detections\n",
}
_JSK = {
    "BoundingBox": f"{_HEADER}geometry_msgs/Pose pose\ngeometry_msgs/Vector3 dimensions\nfloat32 value\nuint32 label\n",
    "BoundingBoxArray": _HEADER + "{0}/BoundingBox[] boxes\n",
}
_RECOGNITION = {"ClassificationResult": f"{_HEADER}uint32[] labels\nstring[] label_names\nfloat64[] label_proba\n"}


def _of(package: str, texts: dict[str, str]) -> dict[str, str]:
    return {name: text.replace("{0}", package) for name, text in texts.items()}


DEFINITIONS: dict[str, dict[str, str]] = {
    "vision_msgs": _VISION_3D,
    **{package: _of(package, _YOLO) for package in ("yolo_msgs", "yolov8_msgs")},
    "darknet_ros_msgs": _of("darknet_ros_msgs", _DARKNET),
    **{package: _of(package, _ZED) for package in ("zed_msgs", "zed_interfaces")},
    "depthai_ros_msgs": _of("depthai_ros_msgs", _DEPTHAI),
    "jsk_recognition_msgs": {**_of("jsk_recognition_msgs", _JSK), **_RECOGNITION},
    "velodyne_msgs": {
        "VelodynePacket": "builtin_interfaces/Time stamp\nuint8[1206] data\n",
        "VelodyneScan": f"{_HEADER}velodyne_msgs/VelodynePacket[] packets\n",
    },
    "ouster_sensor_msgs": {"PacketMsg": "uint8[] buf\n"},
    "hesai_ros_driver": {"UdpFrame": f"{_HEADER}uint8[] packets\n"},
    "ffmpeg_image_transport_msgs": {
        "FFMPEGPacket": (
            f"{_HEADER}int32 width\nint32 height\nstring encoding\nuint64 pts\nuint8 flags\nbool is_bigendian\n"
            "uint8[] data\n"
        )
    },
    "theora_image_transport": {"Packet": f"{_HEADER}uint8[] data\nint32 b_o_s\nint32 e_o_s\nint64 granulepos\n"},
    "ultralytics_ros": {"YoloResult": f"{_HEADER}vision_msgs/Detection2DArray detections\nsensor_msgs/Image[] masks\n"},
}
"""Package to its messages' texts; those of packets and videos, too, which are named and not read."""

SCORE = 0.9


def detection_message(bag: ZooBag, found: Found, index: int, frame: str) -> tuple[Any, int]:
    """The message of image `index`, and when it is recorded, ns."""
    package, _, name = found.msgtype.partition("/msg/")
    at, log_ns = stamp(index) + found.late_ns, stamp(index) + max(found.late_ns, 40_000_000)
    maker = _MAKERS.get(package) or _MAKERS[f"{package}/{name}"]
    return maker(bag, found, bag.header(at, frame), index), log_ns


def _vision(bag: ZooBag, found: Found, header: Any, index: int) -> Any:
    if found.msgtype.endswith("Detection3DArray"):
        one = bag.make("vision_msgs/msg/Detection3D", header=header, results=[_hypothesis(bag, found.label)])
        return bag.make(found.msgtype, header=header, detections=[one])
    one = bag.make(
        "vision_msgs/msg/Detection2D", header=header, results=[_hypothesis(bag, found.label)], bbox=_box(bag, index)
    )
    return bag.make(found.msgtype, header=header, detections=[one])


def _hypothesis(bag: ZooBag, label: str) -> Any:
    name = "vision_msgs/msg/ObjectHypothesisWithPose"
    if "hypothesis" not in [field for field, _ in bag._store.fielddefs[name][1]]:
        return bag.make(name, id=int(label) if label.isdigit() else CLASS_NUMBER, score=SCORE)
    inner = bag.make("vision_msgs/msg/ObjectHypothesis", class_id=label, score=SCORE)
    return bag.make(name, hypothesis=inner)


def _box(bag: ZooBag, index: int) -> Any:
    """vision_msgs/BoundingBox2D, of either layout."""
    u0, v0, u1, v1 = box_xyxy(index)
    (_, (_, center_type)), *_ = bag._store.fielddefs["vision_msgs/msg/BoundingBox2D"][1]
    u, v = (u0 + u1) / 2, (v0 + v1) / 2
    if center_type == "geometry_msgs/msg/Pose2D":
        center = bag.make(center_type, x=u, y=v)
    else:
        center = bag.make(center_type, position=bag.make("vision_msgs/msg/Point2D", x=u, y=v))
    return bag.make("vision_msgs/msg/BoundingBox2D", center=center, size_x=u1 - u0, size_y=v1 - v0)


def _yolo(bag: ZooBag, found: Found, header: Any, index: int) -> Any:
    package = found.msgtype.partition("/")[0]
    u0, v0, u1, v1 = box_xyxy(index)
    one = bag.make(
        f"{package}/msg/Detection",
        class_id=CLASS_NUMBER,
        class_name=found.label,
        score=SCORE,
        bbox=bag.make(
            f"{package}/msg/BoundingBox2D",
            center=bag.make(
                f"{package}/msg/Pose2D",
                position=bag.make(f"{package}/msg/Point2D", x=(u0 + u1) / 2, y=(v0 + v1) / 2),
            ),
            size=bag.make(f"{package}/msg/Vector2", x=u1 - u0, y=v1 - v0),
        ),
    )
    return bag.make(found.msgtype, header=header, detections=[one])


def _darknet(bag: ZooBag, found: Found, header: Any, index: int) -> Any:
    u0, v0, u1, v1 = map(int, box_xyxy(index))
    one = bag.make(
        "darknet_ros_msgs/msg/BoundingBox",
        probability=SCORE,
        xmin=u0,
        ymin=v0,
        xmax=u1,
        ymax=v1,
        id=CLASS_NUMBER,
        Class=found.label,
    )
    image_header = bag.header(stamp(index), header.frame_id)
    return bag.make(found.msgtype, header=header, image_header=image_header, bounding_boxes=[one])


def _zed(bag: ZooBag, found: Found, header: Any, index: int) -> Any:
    package = found.msgtype.partition("/")[0]
    u0, v0, u1, v1 = map(int, box_xyxy(index))
    corners = [
        bag.make(f"{package}/msg/Keypoint2Di", kp=np.array(corner, np.uint32))
        for corner in ((u0, v0), (u1, v0), (u1, v1), (u0, v1))
    ]
    box = bag.make(f"{package}/msg/BoundingBox2Di", corners=corners)
    one = bag.make(f"{package}/msg/Object", label=found.label, confidence=100 * SCORE, bounding_box_2d=box)
    return bag.make(found.msgtype, header=header, objects=[one])


def _depthai(bag: ZooBag, found: Found, header: Any, index: int) -> Any:
    if found.msgtype.endswith("SpatialDetectionArray"):
        one = bag.make(
            "depthai_ros_msgs/msg/SpatialDetection",
            results=[bag.make("vision_msgs/msg/ObjectHypothesis", class_id=found.label, score=SCORE)],
            bbox=_box(bag, index),
            position=bag.point_xyz(index),
        )
    else:
        one = bag.make(
            "depthai_ros_msgs/msg/TrackDetection2D", results=[_hypothesis(bag, found.label)], bbox=_box(bag, index)
        )
    return bag.make(found.msgtype, header=header, detections=[one])


def _ultralytics(bag: ZooBag, found: Found, header: Any, index: int) -> Any:
    inner = _vision(bag, Found(label=found.label), header, index)
    return bag.make(found.msgtype, header=header, detections=inner)


def _jsk(bag: ZooBag, found: Found, header: Any, index: int) -> Any:
    one = bag.make("jsk_recognition_msgs/msg/BoundingBox", header=header, label=CLASS_NUMBER, value=SCORE)
    return bag.make(found.msgtype, header=header, boxes=[one])


_MAKERS = {
    "vision_msgs": _vision,
    "yolo_msgs": _yolo,
    "yolov8_msgs": _yolo,
    "darknet_ros_msgs": _darknet,
    "zed_msgs": _zed,
    "zed_interfaces": _zed,
    "depthai_ros_msgs": _depthai,
    "ultralytics_ros": _ultralytics,
    "jsk_recognition_msgs": _jsk,
}
