"""Motion, frames, TF and clocks: how robots say where they and their sensors are."""

from dataclasses import replace

from zoo import damage
from zoo.robot import Camera, Cloud, Found, Image, Imu, Motion, Robot, Variant
from zoo.scene import START_NS
from zoo.shortcuts import color, depth, rgbd

FRAME = "camera_color_optical_frame"
COLOR, DEPTH = "/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw"
REP105, REP103 = "ros.org/reps/rep-0105: frames of mobile platforms", "ros.org/reps/rep-0103: suffix frames"
TF2 = "wiki.ros.org/tf2/Migration: tf_prefix; docs.ros.org: tf2"
STAMPS = "docs.ros.org: std_msgs/Header, stamp"
MOUNT = '--mount camera="0.1 0 0.8 0 0 0"'
POINTS = Cloud("/points", "lidar", (("intensity", "f4"), ("time", "f4")), "s")


def moved(name: str, motion: Motion | None, source: str, suffix: str = ".mcap", **other: object) -> Variant:
    """Motion that is recorded in another way."""
    base = other.pop("base", "base_link")
    beside = other.pop("others", ())
    links = other.pop("links", {})
    robot = rgbd(COLOR, DEPTH, FRAME, motion=motion, base=base, others=beside, links=links)
    return Variant(name, robot, source, suffix, **other)  # type: ignore[arg-type]


def framed(name: str, frame: str, source: str, **other: object) -> Variant:
    """Images in another frame."""
    suffix = str(other.pop("suffix", ".mcap"))
    given = {key: other.pop(key) for key in ("static", "base", "motion", "body", "info", "namespace") if key in other}
    robot = rgbd(COLOR, DEPTH, frame, **given)
    return Variant(name, robot, source, suffix, **other)  # type: ignore[arg-type]


NO_MOTION = (
    "no poses (no odometry, no odom -> base in TF, no pose topic) ({path}): record an odometry topic or TF, name it "
    "with --topic odometry=/..., or record a LiDAR for LiDAR odometry"
)
VARIANTS = (
    moved("odom -> base_link in TF alone", Motion(kind="tf"), REP105),
    moved("map -> base_link in TF alone", Motion(kind="tf", frame="map"), REP105),
    moved("PoseStamped of a SLAM", Motion("/slam/pose", "pose", frame="map"), "github.com/UZ-SLAMLab/ORB_SLAM3: ROS"),
    moved(
        "PoseWithCovarianceStamped",
        Motion("/robot_pose_ekf/odom_combined", "pose_covariance", frame="odom_combined"),
        "wiki.ros.org/robot_pose_ekf",
        ".bag",
    ),
    moved(
        "TransformStamped of a motion capture",
        Motion("/vicon/robot/robot", "transform", frame="world", child="base_link"),
        "github.com/ethz-asl/vicon_bridge",
        ".bag",
    ),
    moved(
        "odometry of a filter beside that of the wheels",
        Motion("/odometry/filtered", tf=True),
        "docs.ros.org: robot_localization",
        others=(Motion("/wheel/odometry", offset=(0.5, 0.0, 0.0)),),
    ),
    moved(
        "ground truth beside",
        Motion(tf=True),
        "gazebosim.org: p3d plugin",
        others=(Motion("/ground_truth/state", frame="world", offset=(9.0, 0.0, 0.0)),),
    ),
    moved(
        "RTAB-Map's odometry",
        Motion("/rtabmap/odom", tf=True),
        "wiki.ros.org/rtabmap_ros",
        others=(Motion("/rtabmap/localization_pose", "pose_covariance", frame="map"),),
    ),
    moved(
        "goals and set points beside TF",
        Motion(kind="tf"),
        "docs.nav2.org: topics",
        others=(Motion("/goal_pose", "pose", frame="map", offset=(4.0, 0.0, 0.0)),),
    ),
    moved(
        "base_footprint is moved, base_link bears the sensors",
        Motion(child="base_footprint", tf=True),
        REP105,
        base="base_footprint",
    ),
    moved(
        "UTM coordinates",
        Motion(offset=(465_400.0, 5_572_100.0, 0.0)),
        "docs.ros.org: navsat_transform_node",
        notes=("UTM",),
    ),
    moved(
        "child frame not named",
        Motion(child=""),
        "docs.ros.org: nav_msgs/Odometry",
        notes=("does not say what it moves",),
    ),
    moved(
        "leading slashes of tf 1", Motion(frame="/odom", child="/base_link", tf=True), TF2, ".bag", base="/base_link"
    ),
    moved("no motion at all", None, REP105, refused=NO_MOTION),
    framed(
        "frames with a robot's name before them",
        "robot1/camera_color_optical_frame",
        TF2,
        base="robot1/base_link",
        motion=Motion("/robot1/odom", frame="robot1/odom", child="robot1/base_link", tf=True),
    ),
    framed("TF in a namespace", FRAME, TF2, namespace="/robot1", motion=Motion("/robot1/odom", tf=True)),
    framed("camera frame in the body's axes", "camera_link", REP103, body="camera_link", notes=("optical",)),
    Variant(
        "no frame in the images, one in camera_info",
        Robot((Camera(color(COLOR, "", info_frame=FRAME), depth(DEPTH, "")),), found=Found(frame="")),
        STAMPS,
    ),
    framed("no frame anywhere", "", STAMPS, static=False, options=(MOUNT,)),
    framed("frame unknown to TF", "oak_rgb", REP103, static=False, options=(MOUNT,)),
    framed(
        "frame unknown to TF, no option",
        "oak_rgb",
        REP103,
        static=False,
        refused="TF knows no frame 'base_link'; /odom (odom -> base_link) moves 'base_link' "
        "({path}, /camera/color/image_raw): "
        'say where it sits on the base, in metres and radians: --mount camera="X Y Z ROLL PITCH YAW", or name the '
        "robot's URDF: --rig robot.urdf, or record /tf_static with 'base_link' -> 'oak_rgb'",
    ),
    Variant(
        "depth in floats, colour in a frame of its own",
        Robot(
            (
                Camera(
                    color(COLOR, FRAME),
                    depth(
                        "/camera/depth/image_rect_raw", "camera_depth_optical_frame", "32FC1", offset=(0.0, 0.05, 0.0)
                    ),
                ),
            )
        ),
        REP103,
    ),
    Variant(
        "LiDAR in TAI",
        Robot((Camera(color(COLOR, FRAME)),), lidar=replace(POINTS, clock_s=37.0)),
        "docs.ros.org: ptp and TAI",
        notes=("TAI",),
    ),
    Variant(
        "LiDAR in another time zone",
        Robot((Camera(color(COLOR, FRAME)),), lidar=replace(POINTS, clock_s=7200.0)),
        STAMPS,
        notes=("clock",),
    ),
    Variant(
        "camera that counts from its start",
        Robot(
            (
                Camera(
                    color(COLOR, FRAME, late_ns=-1_699_999_000 * 10**9),
                    depth(DEPTH, FRAME, late_ns=-1_699_999_000 * 10**9),
                ),
            ),
            found=Found(late_ns=-1_699_999_000 * 10**9),
        ),
        STAMPS,
        notes=("clock",),
    ),
    Variant(
        "depth 10 ms after colour",
        Robot((Camera(color(COLOR, FRAME), depth(DEPTH, FRAME, late_ns=10_000_000)),)),
        "docs.ros.org: message_filters, ApproximateTime",
    ),
    Variant(
        "IMU in g",
        rgbd(COLOR, DEPTH, FRAME, imu=Imu("/imu/data", "imu_link", unit=9.80665)),
        "REP-145: ros.org/reps/rep-0145",
    ),
    Variant(
        "instance masks beside",
        rgbd(COLOR, DEPTH, FRAME, others=(Image("/detections/masks", FRAME, "16UC1", info="", content="masks"),)),
        "docs of this project",
        roles={"masks": "/detections/masks"},
    ),
    Variant(
        "neither depth nor LiDAR",
        Robot((Camera(color(COLOR, FRAME)),)),
        "sensor_msgs/Image",
        refused="no depth images and no LiDAR among its topics (/camera/color/camera_info, /camera/color/image_raw, "
        "/detections, /odom, /tf_static) ({path}): record an aligned depth topic or a PointCloud2, or name one: "
        "--topic depth=/... or --topic lidar=/...",
    ),
    Variant(
        "stereo pair without depth, LiDAR",
        Robot(
            (Camera(color("/stereo/left/image_rect_color", "stereo_left_optical")),),
            lidar=POINTS,
            others=(Image("/stereo/right/image_rect_color", "stereo_right_optical", offset=(0.3, 0, 0)),),
        ),
        "wiki.ros.org/stereo_image_proc",
    ),
    moved(
        "VINS, odometry whose child is the world",
        Motion("/vins_estimator/odometry", frame="world", child="world"),
        "github.com/HKUST-Aerial-Robotics/VINS-Fusion, visualization.cpp",
        ".bag",
        base="body",
        options=("--frame base=body",),
    ),
    moved(
        "LIO-SAM, child unknown to TF",
        Motion("/lio_sam/mapping/odometry", child="odom_mapping"),
        "github.com/TixiaoShan/LIO-SAM, mapOptmization.cpp",
        ".bag",
        others=(Motion(kind="tf"),),
        roles={"odometry": "/lio_sam/mapping/odometry"},
        notes=("taken as the motion",),
    ),
    Variant(
        "mountings on /tf, again and again",
        rgbd(COLOR, DEPTH, FRAME, mountings_move=True),
        "wiki.ros.org/tf: static_transform_publisher of tf 1",
        ".bag",
    ),
    Variant(
        "simulated time from 0",
        rgbd(COLOR, DEPTH, FRAME, motion=Motion(tf=True), shift_ns=5 * 10**9 - START_NS),
        "docs.ros.org: use_sim_time",
    ),
    Variant(
        "simulated time from 0, also of recording",
        rgbd(COLOR, DEPTH, FRAME, motion=Motion(tf=True), shift_ns=5 * 10**9 - START_NS),
        "docs.ros.org: ros2 bag record --use-sim-time",
        damage=damage.rewritten(lambda n, at, t: (at - START_NS + 5 * 10**9, t)),
    ),
    Variant(
        "camera_info once",
        Robot((Camera(color(COLOR, FRAME, info_once=True), depth(DEPTH, FRAME, info_once=True)),)),
        "docs.ros.org: camera_info_manager, latched",
    ),
    Variant(
        "camera_info of size 0",
        Robot((Camera(color(COLOR, FRAME, info_zero_size=True), depth(DEPTH, FRAME)),)),
        "docs.ros.org: sensor_msgs/CameraInfo, width",
    ),
    Variant(
        "raw and compressed images beside each other",
        rgbd(
            COLOR,
            DEPTH,
            FRAME,
            others=(
                Image(f"{COLOR}/compressed", FRAME, "jpeg bgr8"),
                depth(f"{DEPTH}/compressedDepth", FRAME, "compressedDepth png"),
            ),
        ),
        "wiki.ros.org/image_transport",
    ),
    Variant(
        "depth camera's cloud without depth images",
        Robot(
            (Camera(color(COLOR, FRAME)),), lidar=Cloud("/camera/depth/color/points", "lidar_link", (("rgb", "f4"),))
        ),
        "wiki.ros.org/depth_image_proc",
    ),
    Variant(
        "two odometries of wheels, one of them still",
        rgbd(
            COLOR,
            DEPTH,
            FRAME,
            motion=Motion(tf=True),
            others=(Motion("/imu_odom", "odometry", frame="imu_odom", child="imu_link"),),
        ),
        REP105,
    ),
    Variant(
        "two LiDARs",
        Robot(
            (Camera(color(COLOR, FRAME)),),
            lidar=Cloud("/front/points", "front", POINTS.fields, "s"),
            others=(Cloud("/rear/points_filtered", "rear", POINTS.fields, "s"),),
        ),
        "several LiDARs",
    ),
)
