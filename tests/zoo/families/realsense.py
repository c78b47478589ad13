"""Intel RealSense: realsense2_camera of ROS 1 and ROS 2, with the topics of old and new versions."""

from zoo.robot import Cloud, Image, Imu, Motion, Variant
from zoo.shortcuts import depth, rgbd

ROS1 = "github.com/IntelRealSense/realsense-ros (ros1-legacy), README: published topics, align_depth"
ROS2 = "github.com/IntelRealSense/realsense-ros, README: published topics, camera_name and camera_namespace"
FRAME, DEPTH_FRAME = "camera_color_optical_frame", "camera_depth_optical_frame"
SIDE = (0.015, 0.0, 0.0)
"""Metres from the colour to the depth camera of a D435."""


def beside(prefix: str) -> tuple[Image | Cloud | Imu, ...]:
    """What the driver publishes besides: depth in its own frame, both infrared cameras, points, the IMU."""
    return (
        depth(f"{prefix}/depth/image_rect_raw", DEPTH_FRAME, offset=SIDE),
        Image(f"{prefix}/infra1/image_rect_raw", "camera_infra1_optical_frame", "mono8", offset=SIDE),
        Image(f"{prefix}/infra2/image_rect_raw", "camera_infra2_optical_frame", "8UC1", offset=(-0.035, 0, 0)),
    )


ALIGNED = "aligned_depth_to_color/image_raw"

VARIANTS = (
    Variant(
        "ROS 1, aligned depth",
        rgbd("/camera/color/image_raw", f"/camera/{ALIGNED}", FRAME, body="camera_link", others=beside("/camera")),
        ROS1,
        ".bag",
    ),
    Variant(
        "ROS 1, compressed colour, compressedDepth",
        rgbd(
            "/camera/color/image_raw/compressed",
            f"/camera/{ALIGNED}/compressedDepth",
            FRAME,
            encoding="jpeg rgb8",
            depth_encoding="compressedDepth",
            body="camera_link",
        ),
        ROS1,
        ".bag",
    ),
    Variant(
        "ROS 2, /camera",
        rgbd("/camera/color/image_raw", f"/camera/{ALIGNED}", FRAME, body="camera_link", others=beside("/camera")),
        ROS2,
    ),
    Variant(
        "ROS 2 from 4.55, /camera/camera",
        rgbd(
            "/camera/camera/color/image_raw",
            f"/camera/camera/{ALIGNED}",
            FRAME,
            body="camera_link",
            others=beside("/camera/camera"),
        ),
        ROS2,
    ),
    Variant(
        "depth in its own frame",
        rgbd(
            "/camera/camera/color/image_raw/compressed",
            "/camera/camera/depth/image_rect_raw",
            FRAME,
            encoding="jpeg rgb8",
            depth_frame=DEPTH_FRAME,
            offset=SIDE,
            body="camera_link",
        ),
        ROS2,
    ),
    Variant(
        "depth in its own frame and size",
        rgbd(
            "/camera/color/image_raw",
            "/camera/depth/image_rect_raw",
            FRAME,
            depth_frame=DEPTH_FRAME,
            offset=SIDE,
            depth_size=(80, 60),
            body="camera_link",
        ),
        ROS2,
    ),
    Variant(
        "YUYV colour, as the ROS 2 driver passes it through",
        rgbd("/camera/color/image_raw", f"/camera/{ALIGNED}", FRAME, encoding="yuv422_yuy2", body="camera_link"),
        ROS2 + ", rgb_camera.color_format",
    ),
    Variant(
        "T265 odometry beside a D435",
        rgbd(
            "/d400/color/image_raw",
            f"/d400/{ALIGNED}",
            "d400_color_optical_frame",
            base="t265_pose_frame",
            motion=Motion("/t265/odom/sample", frame="t265_odom_frame", child="t265_pose_frame", tf=True),
            others=(
                Image("/t265/fisheye1/image_raw", "t265_fisheye1_optical_frame", "mono8", model="equidistant"),
                Image("/t265/fisheye2/image_raw", "t265_fisheye2_optical_frame", "mono8", model="equidistant"),
            ),
        ),
        "github.com/IntelRealSense/realsense-ros (ros1-legacy), launch/rs_d400_and_t265.launch",
        ".bag",
    ),
)
