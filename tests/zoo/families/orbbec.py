"""Orbbec: Astra, Gemini and Femto."""

from zoo.robot import Cloud, Image, Imu, Variant
from zoo.shortcuts import rgbd

SDK2 = "github.com/orbbec/OrbbecSDK_ROS2, docs/all_available_topics.md, launch parameters: depth_registration"
SDK1 = "github.com/orbbec/OrbbecSDK_ROS1, README: topics"
ASTRA = "github.com/orbbec/ros_astra_camera, README: topics"
FRAME, DEPTH = "camera_color_optical_frame", "camera_depth_optical_frame"
SIDE = (0.025, 0.0, 0.0)
IR = Image("/camera/ir/image_raw", "camera_ir_optical_frame", "mono16", offset=SIDE)
POINTS = Cloud("/camera/depth_registered/points", FRAME, (("rgb", "f4"),))

VARIANTS = (
    Variant(
        "Astra, ROS 1",
        rgbd(
            "/camera/rgb/image_raw",
            "/camera/depth/image_raw",
            "camera_rgb_optical_frame",
            depth_frame="camera_depth_optical_frame",
            offset=SIDE,
            body="camera_link",
            others=(IR,),
        ),
        ASTRA,
        ".bag",
    ),
    Variant(
        "Femto and Gemini, depth_registration",
        rgbd("/camera/color/image_raw", "/camera/depth/image_raw", FRAME, body="camera_link", others=(IR, POINTS)),
        SDK2,
    ),
    Variant(
        "Gemini, depth in its own frame, JPEG colour",
        rgbd(
            "/camera/color/image_raw/compressed",
            "/camera/depth/image_raw",
            FRAME,
            encoding="jpeg rgb8",
            depth_frame=DEPTH,
            offset=SIDE,
            depth_size=(80, 50),
            body="camera_link",
            others=(
                Image("/camera/left_ir/image_raw", "camera_left_ir_optical_frame", "mono8"),
                Image("/camera/right_ir/image_raw", "camera_right_ir_optical_frame", "mono8", offset=(0.05, 0, 0)),
            ),
        ),
        SDK2,
    ),
    Variant(
        "Femto Bolt, ROS 1, gyro_accel as IMU",
        rgbd(
            "/camera/color/image_raw",
            "/camera/depth/image_raw",
            FRAME,
            body="camera_link",
            imu=Imu("/camera/gyro_accel/sample", "camera_gyro_optical_frame"),
        ),
        SDK1,
        ".bag",
    ),
    Variant(
        "named camera, YUYV",
        rgbd(
            "/gemini_336/color/image_raw",
            "/gemini_336/depth/image_raw",
            "gemini_336_color_optical_frame",
            encoding="yuyv",
        ),
        SDK2,
    ),
)
