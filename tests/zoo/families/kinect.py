"""Microsoft Kinect of three generations."""

from zoo.robot import Cloud, Image, Imu, Motion, Variant
from zoo.shortcuts import depth, rgbd

OPENNI = "wiki.ros.org/openni_launch, published topics; wiki.ros.org/freenect_launch"
TUM = "cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats: topics of the bags"
BRIDGE = "github.com/code-iai/iai_kinect2, kinect2_bridge/README: topics, use_png"
AZURE = "github.com/microsoft/Azure_Kinect_ROS_Driver, docs/usage.md: topics"
RGB, DEPTH = "camera_rgb_optical_frame", "camera_depth_optical_frame"
SIDE = (-0.025, 0.0, 0.0)
K2 = "kinect2_rgb_optical_frame"
K2_BESIDE = (
    Image("/kinect2/hd/image_color_rect", K2, "bgr8", size=(96, 72)),
    Image("/kinect2/qhd/image_mono_rect", K2, "mono8"),
    depth("/kinect2/sd/image_depth_rect", "kinect2_ir_optical_frame", size=(48, 36), offset=(0.05, 0, 0)),
    Image("/kinect2/sd/image_ir_rect", "kinect2_ir_optical_frame", "mono16", size=(48, 36), offset=(0.05, 0, 0)),
    Cloud("/kinect2/qhd/points", K2, (("_", "u4"), ("rgb", "f4"))),
)
RATIONAL = {"model": "rational_polynomial", "distortion": (0.0,) * 8}
AZURE_BESIDE = (
    depth("/depth/image_raw", "depth_camera_link", "32FC1", size=(60, 60), offset=(-0.032, 0, 0)),
    Image("/ir/image_raw", "depth_camera_link", "mono16", size=(60, 60), offset=(-0.032, 0, 0)),
    Image("/rgb_to_depth/image_raw", "depth_camera_link", "bgra8", size=(60, 60), offset=(-0.032, 0, 0)),
    Cloud("/points2", "depth_camera_link"),
    Imu("/imu", "imu_link"),
)

VARIANTS = (
    Variant(
        "v1, openni_launch, registered by the device",
        rgbd(
            "/camera/rgb/image_rect_color",
            "/camera/depth_registered/hw_registered/image_rect_raw",
            RGB,
            encoding="bgr8",
            depth_info="/camera/depth_registered/camera_info",
            others=(Image("/camera/rgb/image_raw", RGB, "bayer_grbg8"),),
        ),
        OPENNI,
        ".bag",
    ),
    Variant(
        "v1, freenect_launch, floating depth registered in software",
        rgbd(
            "/camera/rgb/image_raw",
            "/camera/depth_registered/image",
            RGB,
            depth_encoding="32FC1",
            others=(depth("/camera/depth/image_raw", DEPTH, offset=SIDE),),
        ),
        OPENNI,
        ".bag",
    ),
    Variant(
        "v1, raw Bayer colour, depth of its own frame",
        rgbd(
            "/camera/rgb/image_raw",
            "/camera/depth/image_raw",
            RGB,
            encoding="bayer_grbg8",
            depth_frame=DEPTH,
            offset=SIDE,
            body="camera_link",
            others=(Image("/camera/ir/image_raw", DEPTH, "mono16", offset=SIDE),),
        ),
        OPENNI,
        ".bag",
    ),
    Variant(
        "v1, TUM RGB-D benchmark, motion capture in TF",
        rgbd(
            "/camera/rgb/image_color",
            "/camera/depth/image",
            "/openni_rgb_optical_frame",
            depth_encoding="32FC1",
            base="/kinect",
            body="/openni_camera",
            motion=Motion(kind="tf", frame="/world", child="/kinect"),
        ),
        TUM,
        ".bag",
    ),
    Variant(
        "v2, qhd, depth as PNG",
        rgbd(
            "/kinect2/qhd/image_color_rect/compressed",
            "/kinect2/qhd/image_depth_rect/compressed",
            K2,
            encoding="jpeg bgr8",
            depth_encoding="png depth",
            others=K2_BESIDE,
        ),
        BRIDGE,
        ".bag",
    ),
    Variant(
        "v2, qhd, depth as TIFF (the driver's default)",
        rgbd(
            "/kinect2/qhd/image_color_rect/compressed",
            "/kinect2/qhd/image_depth_rect/compressed",
            K2,
            encoding="jpeg bgr8",
            depth_encoding="tiff depth",
        ),
        BRIDGE,
        ".bag",
    ),
    Variant(
        "v2, sd, colour on the depth's pixels",
        rgbd(
            "/kinect2/sd/image_color_rect",
            "/kinect2/sd/image_depth_rect",
            "kinect2_ir_optical_frame",
            encoding="bgr8",
            others=(Image("/kinect2/sd/image_ir_rect", "kinect2_ir_optical_frame", "mono16"),),
        ),
        BRIDGE,
        ".bag",
    ),
    Variant(
        "Azure, depth_to_rgb",
        rgbd(
            "/rgb/image_raw",
            "/depth_to_rgb/image_raw",
            "rgb_camera_link",
            encoding="bgra8",
            depth_encoding="32FC1",
            body="camera_base",
            others=AZURE_BESIDE,
            **RATIONAL,
        ),
        AZURE,
        ".bag",
    ),
    Variant(
        "Azure, 16-bit depth, JPEG colour, in a namespace",
        rgbd(
            "/k4a/rgb/image_raw/compressed",
            "/k4a/depth_to_rgb/image_raw/compressed",
            "rgb_camera_link",
            encoding="jpeg bgr8",
            depth_encoding="png depth",
            body="camera_base",
            **RATIONAL,
        ),
        AZURE,
    ),
    Variant(
        "Azure, raw depth alone",
        rgbd(
            "/rgb/image_raw",
            "/depth/image_raw",
            "rgb_camera_link",
            encoding="bgra8",
            depth_encoding="32FC1",
            depth_frame="depth_camera_link",
            offset=(-0.032, 0, 0),
            depth_size=(60, 60),
            body="camera_base",
            others=(Image("/ir/image_raw", "depth_camera_link", "mono16", size=(60, 60)),),
            **RATIONAL,
        ),
        AZURE,
        ".bag",
    ),
)
