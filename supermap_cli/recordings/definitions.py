"""Message definitions for recordings that came without any (older `.db3`): packages outside of the ROS distributions.

Sources: vision_msgs 4.x (github.com/ros-perception/vision_msgs), livox_ros_driver, livox_ros_driver2, livox_interfaces.
"""

from __future__ import annotations

from collections.abc import Mapping

_VISION: Mapping[str, str] = {
    "Point2D": "float64 x\nfloat64 y\n",
    "Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
    "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
    "ObjectHypothesis": "string class_id\nfloat64 score\n",
    "ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n",
    "Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id\n"
    ),
    "Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections\n",
}


def _older_vision(id_type: str, tail: str) -> Mapping[str, str]:
    """vision_msgs before 4.0: a label beside its score, a plain Pose2D as the middle of a box, other ends."""
    return {
        "BoundingBox2D": "geometry_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
        "ObjectHypothesisWithPose": f"{id_type} id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose\n",
        "Detection2D": (
            "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
            f"vision_msgs/BoundingBox2D bbox\n{tail}"
        ),
        "Detection2DArray": _VISION["Detection2DArray"],
    }


_IMAGE, _TRACKED = "sensor_msgs/Image source_img\n", "bool is_tracking\nstring tracking_id\n"
"""What a Detection2D of vision_msgs 1 to 3 ends with (Dashing and ROS 1; Foxy and Galactic)."""

OLDER_DEFINITIONS: Mapping[str, tuple[Mapping[str, str], ...]] = {
    "vision_msgs": tuple(
        _older_vision(id_type, tail)
        for id_type in ("string", "int64")
        for tail in (_IMAGE + _TRACKED, _IMAGE, "", "string id\n")
    )
}
"""Package name to older layouts of the messages in `FALLBACK_DEFINITIONS`, for bytes that do not fit those."""

_LIVOX = {
    "CustomPoint": "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n",
    "CustomMsg": (
        "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n"
        "CustomPoint[] points\n"
    ),
}

LIVOX_PACKAGES = ("livox_ros_driver", "livox_ros_driver2", "livox_interfaces")
"""The packages under which Livox's drivers publish the same CustomMsg."""

FALLBACK_DEFINITIONS: Mapping[str, Mapping[str, str]] = {
    "vision_msgs": _VISION,
    **dict.fromkeys(LIVOX_PACKAGES, _LIVOX),
}
"""Package name to its messages' texts."""
