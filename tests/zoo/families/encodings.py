"""Encodings of colour and depth images, and of their calibrations."""

from dataclasses import replace

from zoo.robot import Camera, Found, Image, Motion, Other, Robot, Variant
from zoo.shortcuts import color, depth, rgbd

ENCODINGS = "github.com/ros2/common_interfaces, sensor_msgs/include/sensor_msgs/image_encodings.hpp"
TRANSPORT = "github.com/ros-perception/image_transport_plugins, compressed_image_transport"
DEPTH_TRANSPORT = "github.com/ros-perception/image_transport_plugins, compressed_depth_image_transport"
REP118 = "ros.org/reps/rep-0118: depth images"
INFO = "docs.ros.org: sensor_msgs/CameraInfo"
FRAME = "camera_color_optical_frame"
COLOR, DEPTH = "/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw"

RAW = (
    *("rgb8", "bgr8", "rgba8", "bgra8", "8UC3", "8UC4", "mono8", "mono16", "rgb16", "bgr16", "rgba16", "bgra16"),
    *("yuv422", "yuv422_yuy2", "uyvy", "yuyv", "nv12", "nv21", "nv24"),
    *("bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8", "bayer_rggb16", "bayer_grbg16"),
)


def of_color(encoding: str) -> Variant:
    """A colour encoding."""
    return Variant(f"colour {encoding}", rgbd(COLOR, DEPTH, FRAME, encoding=encoding), ENCODINGS)


def of_depth(encoding: str, source: str, topic: str = DEPTH, name: str = "") -> Variant:
    """A depth encoding."""
    return Variant(f"depth {name or encoding}", rgbd(COLOR, topic, FRAME, depth_encoding=encoding), source)


def of_compressed(encoding: str, name: str) -> Variant:
    """A compressed colour image."""
    return Variant(f"colour {name}", rgbd(f"{COLOR}/compressed", DEPTH, FRAME, encoding=encoding), TRANSPORT)


def of_camera(name: str, image: Image, source: str = INFO, behind: Image | None = None, **other: object) -> Variant:
    """A camera of which something is otherwise."""
    return Variant(name, Robot((Camera(image, behind or depth(DEPTH, FRAME)),)), source, **other)  # type: ignore[arg-type]


FISHEYE = color(COLOR, FRAME, model="equidistant", distortion=(0.0,) * 4)

VARIANTS = (
    *(of_color(encoding) for encoding in RAW),
    of_compressed("jpeg", "JPEG, as web cameras say it"),
    of_compressed("jpeg bgr8", "JPEG, as image_transport says it"),
    of_compressed("png", "PNG"),
    of_compressed("png bgr8", "PNG, as image_transport says it"),
    of_depth("16UC1", REP118),
    of_depth("32FC1", REP118),
    of_depth("64FC1", ENCODINGS),
    of_depth("mono16", "wiki.ros.org/openni_camera: depth as mono16"),
    of_depth("compressedDepth", DEPTH_TRANSPORT, f"{DEPTH}/compressedDepth", "compressedDepth, ROS 1"),
    of_depth("compressedDepth png", DEPTH_TRANSPORT, f"{DEPTH}/compressedDepth"),
    of_depth("compressedDepth 32FC1", DEPTH_TRANSPORT, f"{DEPTH}/compressedDepth", "compressedDepth of 32FC1"),
    of_depth("compressedDepth rvl", DEPTH_TRANSPORT, f"{DEPTH}/compressedDepth", "compressedDepth rvl"),
    of_depth("png depth", TRANSPORT, f"{DEPTH}/compressed", "png of 16 bits"),
    of_depth("tiff depth", TRANSPORT, f"{DEPTH}/compressed", "tiff of 16 bits"),
    Variant(
        "depth as JPEG",
        rgbd(COLOR, f"{DEPTH}/compressed", FRAME, depth_encoding="jpeg depth"),
        TRANSPORT,
        refused="lossy depth images of 8 bits ('jpeg'): they hold no distances ({path}, "
        f"{DEPTH}/compressed): record compressedDepth, raw or 16-bit PNG images, or name another topic: "
        "--topic depth=/... or --topic lidar=/...",
    ),
    Variant(
        "colour as H.264",
        rgbd(f"{COLOR}/ffmpeg", DEPTH, FRAME, encoding="h264", info="/camera/color/camera_info"),
        "github.com/ros-misc-utilities/ffmpeg_image_transport",
        refused="unknown image encoding 'h264' ({path}, /camera/color/image_raw/ffmpeg): re-record or convert it ...",
    ),
    *(
        Variant(
            name,
            Robot((), others=(Other(topic, msgtype),), motion=Motion(), found=Found(frame=FRAME), static=False),
            source,
            refused="no camera images among its topics (/detections, /odom); "
            f"{topic} ({msgtype}) holds a video stream, whose images need each other: convert it to Image or "
            "CompressedImage ({path}): record a sensor_msgs Image or CompressedImage topic, or name it: "
            "--topic color=/...",
        )
        for name, topic, msgtype, source in (
            (
                "ffmpeg packets alone",
                f"{COLOR}/ffmpeg",
                "ffmpeg_image_transport_msgs/msg/FFMPEGPacket",
                "github.com/ros-misc-utilities/ffmpeg_image_transport_msgs",
            ),
            ("theora packets alone", f"{COLOR}/theora", "theora_image_transport/msg/Packet", TRANSPORT),
        )
    ),
    of_camera("rows with padding", color(COLOR, FRAME, padding=16), "docs.ros.org: sensor_msgs/Image, step"),
    of_camera("floating depth in millimetres", color(COLOR, FRAME), REP118, depth(DEPTH, FRAME, "32FC1", scale=1000.0)),
    of_camera("K of zeros, P right", color(COLOR, FRAME, info_zero_k=True)),
    of_camera(
        "fisheye (equidistant)", FISHEYE, behind=replace(FISHEYE, topic=DEPTH, encoding="16UC1", content="depth")
    ),
    of_camera("rational_polynomial", color(COLOR, FRAME, model="rational_polynomial", distortion=(0.0,) * 8)),
    of_camera("plumb_bob, five zeros", color(COLOR, FRAME, distortion=(0.0,) * 5)),
    of_camera("distortion model not named", color(COLOR, FRAME, model="")),
    of_camera("calibrated at twice the size", color(COLOR, FRAME, info_size=(128, 96))),
    of_camera("camera_info of another frame", color(COLOR, FRAME, info_frame="camera_link")),
    of_camera("camera_info in another folder", color(COLOR, FRAME, info="/calibration/color")),
    of_camera("image_raw and camera_info apart", color("/image_raw", FRAME, info="/camera_info")),
    of_camera("colour at half the rate", color(COLOR, FRAME, every=2)),
)
