"""Definitions of detection messages that other packages publish, by package and name."""

from __future__ import annotations

HEADER = "std_msgs/Header header\n"
BOX = "geometry_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n"
TYPES = {
    "yolo_msgs": {
        "Point2D": "float64 x\nfloat64 y\n",
        "Vector2": "float64 x\nfloat64 y\n",
        "Pose2D": "yolo_msgs/Point2D position\nfloat64 theta\n",
        "BoundingBox2D": "yolo_msgs/Pose2D center\nyolo_msgs/Vector2 size\n",
        "Mask": "int32 height\nint32 width\nyolo_msgs/Point2D[] data\n",
        "Detection": (
            "int32 class_id\nstring class_name\nfloat64 score\nyolo_msgs/BoundingBox2D bbox\nyolo_msgs/Mask mask\n"
        ),
        "DetectionArray": f"{HEADER}yolo_msgs/Detection[] detections\n",
    },
    "darknet_ros_msgs": {
        "BoundingBox": (
            "float64 probability\nint64 xmin\nint64 ymin\nint64 xmax\nint64 ymax\nint16 id\nstring class_id\n"
        ),
        "BoundingBoxes": f"{HEADER}std_msgs/Header image_header\ndarknet_ros_msgs/BoundingBox[] bounding_boxes\n",
    },
    "depthai_ros_msgs": {
        "ObjectHypothesis": "string class_id\nfloat64 score\n",
        "BoundingBox2D": BOX,
        "SpatialDetection": (
            "depthai_ros_msgs/ObjectHypothesis[] results\ndepthai_ros_msgs/BoundingBox2D bbox\n"
            "geometry_msgs/Point position\nbool is_tracking\nstring tracking_id\n"
        ),
        "SpatialDetectionArray": f"{HEADER}depthai_ros_msgs/SpatialDetection[] detections\n",
    },
    "zed_msgs": {
        "Keypoint2Di": "uint32[2] kp\n",
        "BoundingBox2Di": "zed_msgs/Keypoint2Di[4] corners\n",
        "Object": "string label\nint16 label_id\nfloat32 confidence\nzed_msgs/BoundingBox2Di bounding_box_2d\n",
        "ObjectsStamped": f"{HEADER}zed_msgs/Object[] objects\n",
    },
}
