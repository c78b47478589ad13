"""Luxonis OAK-D: depthai-ros, of old and new versions."""

from zoo.robot import Found, Image, Imu, Variant
from zoo.shortcuts import rgbd

DRIVER = "github.com/luxonis/depthai-ros, depthai_ros_driver: README, published topics"
BRIDGE = "github.com/luxonis/depthai-ros, depthai_bridge/src: converters"
EXAMPLES = "github.com/luxonis/depthai-ros, depthai_examples/launch"
FRAME = "oak_rgb_camera_optical_frame"
MONO = (
    Image("/oak/left/image_rect", "oak_left_camera_optical_frame", "mono8", offset=(-0.0375, 0, 0)),
    Image("/oak/right/image_rect", "oak_right_camera_optical_frame", "mono8", offset=(0.0375, 0, 0)),
)

VARIANTS = (
    Variant(
        "depthai_ros_driver",
        rgbd(
            "/oak/rgb/image_raw", "/oak/stereo/image_raw", FRAME, encoding="bgr8", body="oak-d-base-frame", others=MONO
        ),
        DRIVER,
    ),
    Variant(
        "depthai_ros_driver, depth of the right camera",
        rgbd(
            "/oak/rgb/image_raw",
            "/oak/stereo/image_raw",
            FRAME,
            encoding="bgr8",
            depth_frame="oak_right_camera_optical_frame",
            offset=(0.0375, 0, 0),
            depth_size=(80, 50),
            body="oak",
            others=MONO[:1],
        ),
        DRIVER,
    ),
    Variant(
        "compressed streams, spatial detections",
        rgbd(
            "/oak/rgb/image_raw/compressed",
            "/oak/stereo/image_raw/compressedDepth",
            FRAME,
            encoding="jpeg bgr8",
            depth_encoding="compressedDepth png",
            body="oak",
            found=Found("/oak/nn/spatial_detections", "depthai_ros_msgs/msg/SpatialDetectionArray"),
            imu=Imu("/oak/imu/data", "oak_imu_frame"),
        ),
        BRIDGE,
    ),
    Variant(
        "rgb_stereo_publisher of depthai_examples",
        rgbd(
            "/color/video/image",
            "/stereo/depth",
            FRAME,
            encoding="bgr8",
            body="oak-d_frame",
            depth_info="/stereo/camera_info",
            found=Found("/color/mobilenet_detections", "vision_msgs/msg/Detection2DArray"),
            others=(Image("/color/preview/image", FRAME, "bgr8", size=(30, 30)),),
        ),
        EXAMPLES,
    ),
    Variant(
        "tracked detections",
        rgbd(
            "/oak/rgb/image_raw",
            "/oak/stereo/image_raw",
            FRAME,
            encoding="bgr8",
            found=Found("/oak/nn/tracklets", "depthai_ros_msgs/msg/TrackDetection2DArray"),
        ),
        BRIDGE,
    ),
)
