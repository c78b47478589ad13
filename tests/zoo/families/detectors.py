"""Detections as detectors record them."""

from zoo.robot import Found, Variant
from zoo.shortcuts import rgbd

FRAME = "camera_color_optical_frame"
COLOR, DEPTH = "/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw"
VISION = "github.com/ros-perception/vision_msgs: "
YOLO = "github.com/mgonzs13/yolo_ros, yolo_msgs/msg"
NAMED = "--option recorded.labels=coco.txt"


def of(
    name: str, msgtype: str, source: str, topic: str = "/detections", label: str = "suitcase", **other: object
) -> Variant:
    """Detections of a type on a topic."""
    package, _, kind = msgtype.partition("/")
    found = {key: other.pop(key) for key in ("late_ns", "frame") if key in other}
    robot = rgbd(COLOR, DEPTH, FRAME, found=Found(topic, f"{package}/msg/{kind}", label, **found))
    return Variant(name, robot, source, **other)  # type: ignore[arg-type]


UNREAD = (
    "{{path}}, {}: detections of the type {} are not read; convert them to vision_msgs/Detection2DArray, or detect "
    "with --detector onnx. Without them ..."
)

VARIANTS = (
    of("vision_msgs 4.x", "vision_msgs/Detection2DArray", VISION + "ros2"),
    of("vision_msgs 4.x, class numbers", "vision_msgs/Detection2DArray", VISION + "ros2", label="28", options=(NAMED,)),
    of("vision_msgs 4.x, Foxglove spelling", "vision_msgs/Detection2DArray", VISION + "ros2", label="Suitcase"),
    of(
        "vision_msgs of ROS 1, class numbers",
        "vision_msgs/Detection2DArray",
        VISION + "noetic-devel",
        label="28",
        suffix=".bag",
        options=(NAMED,),
    ),
    of(
        "vision_msgs of Foxy without definitions, class numbers",
        "vision_msgs/Detection2DArray",
        VISION + "foxy",
        label="28",
        suffix=".db3",
        writer={"old_vision": True},
        options=(NAMED,),
    ),
    of("yolo_msgs", "yolo_msgs/DetectionArray", YOLO, "/yolo/detections"),
    of("yolov8_msgs", "yolov8_msgs/DetectionArray", YOLO, "/yolo/tracking"),
    of("ultralytics_ros", "ultralytics_ros/YoloResult", "github.com/Alpaca-zip/ultralytics_ros, msg", "/yolo_result"),
    of(
        "darknet_ros",
        "darknet_ros_msgs/BoundingBoxes",
        "github.com/leggedrobotics/darknet_ros, darknet_ros_msgs/msg",
        "/darknet_ros/bounding_boxes",
        suffix=".bag",
        late_ns=80_000_000,
    ),
    of(
        "depthai SpatialDetectionArray",
        "depthai_ros_msgs/SpatialDetectionArray",
        "github.com/luxonis/depthai-ros, depthai_ros_msgs/msg",
        "/oak/nn/spatial_detections",
    ),
    of(
        "stamped when the detector was done",
        "vision_msgs/Detection2DArray",
        "github.com/dusty-nv/ros_deep_learning: stamps of detectnet",
        late_ns=70_000_000,
        options=("--detection-tolerance 0.1",),
    ),
    of(
        "isaac_ros_yolov8",
        "vision_msgs/Detection2DArray",
        "nvidia-isaac-ros.github.io",
        "/detections_output",
        "28",
        options=(NAMED,),
    ),
    of("frame not named", "vision_msgs/Detection2DArray", VISION + "header", frame=""),
    of(
        "Detection3DArray",
        "vision_msgs/Detection3DArray",
        VISION + "ros2",
        "/oak/nn/spatial_detections",
        refused=UNREAD.format("/oak/nn/spatial_detections", "vision_msgs/msg/Detection3DArray"),
    ),
    of(
        "jsk BoundingBoxArray",
        "jsk_recognition_msgs/BoundingBoxArray",
        "jsk-docs.readthedocs.io",
        "/boxes",
        refused=UNREAD.format("/boxes", "jsk_recognition_msgs/msg/BoundingBoxArray"),
    ),
)
