"""Stereolabs ZED: zed-ros-wrapper and zed-ros2-wrapper."""

from zoo.robot import Found, Image, Motion, Variant
from zoo.shortcuts import depth, rgbd

ROS1 = "stereolabs.com/docs/ros/zed-node: published topics"
ROS2 = "stereolabs.com/docs/ros2/zed-node: published topics"
NODE = "/zed/zed_node"
FRAME, RIGHT = "zed_left_camera_optical_frame", "zed_right_camera_optical_frame"
BASELINE = (0.12, 0.0, 0.0)
ODOM = Motion(f"{NODE}/odom", child="zed_camera_link", tf=True)
POSE = Motion(f"{NODE}/pose", "pose", frame="map")

OLD_STREAMS = (
    Image(f"{NODE}/left/image_rect_color", FRAME, "bgra8"),
    Image(f"{NODE}/right/image_rect_color", RIGHT, "bgra8", offset=BASELINE),
    Image(f"{NODE}/stereo/image_rect_color", FRAME, "bgra8", info="", size=(128, 48)),
    Image(f"{NODE}/rgb_raw/image_raw_color", FRAME, "bgra8"),
    depth(f"{NODE}/confidence/confidence_map", FRAME, "32FC1", scale=20.0, info=""),
)
NEW_STREAMS = (
    Image(f"{NODE}/left/color/rect/image", FRAME, "bgra8"),
    Image(f"{NODE}/left/gray/rect/image", FRAME, "mono8"),
    Image(f"{NODE}/right/color/rect/image", RIGHT, "bgra8", offset=BASELINE),
    Image(f"{NODE}/rgb/color/raw/image", FRAME, "bgra8"),
    depth(f"{NODE}/confidence/confidence_map", FRAME, "32FC1", scale=20.0, info=""),
)

VARIANTS = (
    Variant(
        "ROS 1, /zed/zed_node",
        rgbd(
            f"{NODE}/rgb/image_rect_color",
            f"{NODE}/depth/depth_registered",
            FRAME,
            encoding="bgra8",
            depth_encoding="32FC1",
            base="base_link",
            motion=Motion(f"{NODE}/odom", tf=True),
            others=(*OLD_STREAMS, POSE),
        ),
        ROS1,
        ".bag",
    ),
    Variant(
        "ROS 2, up to 4.x",
        rgbd(
            f"{NODE}/rgb/image_rect_color",
            f"{NODE}/depth/depth_registered",
            FRAME,
            encoding="bgra8",
            depth_encoding="32FC1",
            base="zed_camera_link",
            motion=ODOM,
            others=(*OLD_STREAMS, POSE),
        ),
        ROS2,
    ),
    Variant(
        "ROS 2, from 5.1, with object detection",
        rgbd(
            f"{NODE}/rgb/color/rect/image",
            f"{NODE}/depth/depth_registered",
            FRAME,
            encoding="bgra8",
            depth_encoding="32FC1",
            base="zed_camera_link",
            motion=ODOM,
            found=Found(f"{NODE}/obj_det/objects", "zed_msgs/msg/ObjectsStamped", "Suitcase"),
            others=(*NEW_STREAMS, POSE),
        ),
        ROS2,
    ),
    Variant(
        "object detection of ROS 1",
        rgbd(
            f"{NODE}/rgb/image_rect_color",
            f"{NODE}/depth/depth_registered",
            FRAME,
            encoding="bgra8",
            depth_encoding="32FC1",
            found=Found(f"{NODE}/obj_det/objects", "zed_interfaces/msg/ObjectsStamped", "Suitcase"),
        ),
        ROS1,
        ".bag",
    ),
    Variant(
        "compressed colour, compressedDepth of floats",
        rgbd(
            f"{NODE}/left/image_rect_color/compressed",
            f"{NODE}/depth/depth_registered/compressedDepth",
            FRAME,
            encoding="jpeg bgr8",
            depth_encoding="compressedDepth 32FC1",
            base="zed_camera_link",
            motion=ODOM,
        ),
        ROS2,
    ),
    Variant(
        "depth in OpenNI's millimetres",
        rgbd(
            f"{NODE}/rgb/image_rect_color",
            f"{NODE}/depth/depth_registered",
            FRAME,
            encoding="bgra8",
            base="zed_camera_link",
            motion=ODOM,
        ),
        ROS2 + ", depth.openni_depth_mode",
    ),
)
