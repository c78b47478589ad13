"""Robots: the topics and frames that their own software uses."""

from zoo.robot import Camera, Cloud, Found, Image, Imu, Motion, Robot, Variant
from zoo.shortcuts import color, depth, rgbd

SPOT = "github.com/bdaiinstitute/spot_ros2, spot_driver: image topics, frames (ROS 1: github.com/heuristicus/spot_ros)"
ALIGNED = "aligned_depth_to_color/image_raw"
FISHEYE = "frontleft_fisheye"


def spot_camera(name: str, yaw_deg: float, ros: str = "") -> Camera:
    """One of Spot's grey cameras with its registered depth."""
    frame = f"{name}_fisheye"
    return Camera(
        color(f"{ros}/camera/{name}/image", frame, "mono8"),
        depth(f"{ros}/depth_registered/{name}/image", frame),
        yaw_deg=yaw_deg,
        id=name,
    )


VARIANTS = (
    Variant(
        "TurtleBot 2, Kinect",
        rgbd(
            "/camera/rgb/image_raw/compressed",
            "/camera/depth_registered/image_raw",
            "camera_rgb_optical_frame",
            encoding="jpeg bgr8",
            base="base_footprint",
            motion=Motion(child="base_footprint", tf=True),
        ),
        "wiki.ros.org/turtlebot_bringup, 3dsensor.launch",
        ".bag",
    ),
    Variant(
        "TurtleBot 3 with a RealSense",
        rgbd(
            "/camera/color/image_raw",
            f"/camera/{ALIGNED}",
            "camera_color_optical_frame",
            base="base_footprint",
            motion=Motion(child="base_footprint", tf=True),
            imu=Imu("/imu", "imu_link"),
        ),
        "emanual.robotis.com: TurtleBot3, topics and tf",
    ),
    Variant(
        "TurtleBot 4",
        rgbd(
            "/oakd/rgb/preview/image_raw",
            "/oakd/stereo/image_raw",
            "oakd_rgb_camera_optical_frame",
            encoding="bgr8",
            motion=Motion(tf=True),
            imu=Imu("/imu", "imu_link"),
        ),
        "turtlebot.github.io/turtlebot4-user-manual: sensors; turtlebot4_bringup, oakd",
    ),
    Variant(
        "TurtleBot 4 in a namespace",
        rgbd(
            "/robot1/oakd/rgb/preview/image_raw",
            "/robot1/oakd/stereo/image_raw",
            "oakd_rgb_camera_optical_frame",
            encoding="bgr8",
            namespace="/robot1",
            motion=Motion("/robot1/odom", tf=True),
        ),
        "turtlebot.github.io/turtlebot4-user-manual: multiple robots, namespacing",
    ),
    Variant(
        "Spot, ROS 2, two grey cameras",
        Robot(
            (spot_camera("frontleft", 0.0), spot_camera("frontright", 60.0)),
            base="body",
            motion=Motion("/odometry", child="body", tf=True),
            found=Found(frame=FISHEYE),
        ),
        SPOT,
    ),
    Variant(
        "Spot, ROS 1, two grey cameras",
        Robot(
            (spot_camera("frontleft", 0.0, "/spot"), spot_camera("frontright", 60.0, "/spot")),
            base="body",
            motion=Motion("/spot/odometry", child="body", tf=True),
            found=Found("/darknet_ros/bounding_boxes", "darknet_ros_msgs/msg/BoundingBoxes", frame=FISHEYE),
        ),
        SPOT,
        ".bag",
    ),
    Variant(
        "Spot, hand camera",
        rgbd(
            "/camera/hand/image",
            "/depth_registered/hand/image",
            "hand_color_image_sensor",
            base="body",
            motion=Motion("/odometry", child="body", tf=True),
            others=(depth("/depth/hand/image", "hand_depth_sensor", size=(56, 44), offset=(0.03, 0, 0)),),
        ),
        SPOT,
    ),
    Variant(
        "Stretch",
        rgbd(
            "/camera/color/image_raw",
            f"/camera/{ALIGNED}",
            "camera_color_optical_frame",
            body="camera_link",
            motion=Motion(tf=True),
            imu=Imu("/imu_mobile_base", "imu_mobile_base"),
            others=(Image("/gripper_camera/color/image_rect_raw", "gripper_camera_color_optical_frame", info=""),),
        ),
        "github.com/hello-robot/stretch_ros2, stretch_core: README, API.md",
    ),
    Variant(
        "HSR",
        rgbd(
            "/hsrb/head_rgbd_sensor/rgb/image_rect_color/compressed",
            "/hsrb/head_rgbd_sensor/depth_registered/image_rect_raw",
            "head_rgbd_sensor_rgb_frame",
            encoding="jpeg bgr8",
            base="base_footprint",
            motion=Motion("/hsrb/odom", child="base_footprint", tf=True),
            others=(
                Image("/hsrb/head_l_stereo_camera/image_raw", "head_l_stereo_camera_frame", "bgr8"),
                Image("/hsrb/head_r_stereo_camera/image_raw", "head_r_stereo_camera_frame", "bgr8"),
                Image("/hsrb/hand_camera/image_raw", "hand_camera_frame", "yuv422", offset=(0, 0.4, 0)),
            ),
        ),
        "docs.hsr.io; github.com/hsr-project: hsrb topics of head_rgbd_sensor",
        ".bag",
    ),
    Variant(
        "Fetch",
        rgbd(
            "/head_camera/rgb/image_raw",
            "/head_camera/depth_registered/image_raw",
            "head_camera_rgb_optical_frame",
            motion=Motion(tf=True),
            imu=Imu("/imu", "base_link"),
        ),
        "docs.fetchrobotics.com: robot hardware, head camera; fetch_bringup",
        ".bag",
    ),
    Variant(
        "TIAGo",
        rgbd(
            "/xtion/rgb/image_rect_color",
            "/xtion/depth_registered/image",
            "xtion_rgb_optical_frame",
            depth_encoding="32FC1",
            base="base_footprint",
            motion=Motion("/mobile_base_controller/odom", child="base_footprint", tf=True),
            others=(Image("/xtion/rgb/image_raw", "xtion_rgb_optical_frame"),),
        ),
        "docs.pal-robotics.com: TIAGo, ROS API of the RGB-D camera",
        ".bag",
    ),
    Variant(
        "TIAGo, ROS 2",
        rgbd(
            "/head_front_camera/rgb/image_raw",
            "/head_front_camera/depth_registered/image_raw",
            "head_front_camera_rgb_optical_frame",
            depth_encoding="16UC1",
            base="base_footprint",
            motion=Motion("/mobile_base_controller/odom", child="base_footprint", tf=True),
        ),
        "docs.pal-robotics.com: TIAGo, head_front_camera topics",
    ),
    Variant(
        "PR2",
        rgbd(
            "/head_mount_kinect/rgb/image_color",
            "/head_mount_kinect/depth_registered/image",
            "/head_mount_kinect_rgb_optical_frame",
            depth_encoding="32FC1",
            base="/base_footprint",
            motion=Motion("/base_odometry/odom", frame="odom_combined", child="base_footprint", tf=True),
            others=(
                Image("/wide_stereo/left/image_color", "/wide_stereo_optical_frame", "bgr8"),
                Motion("/robot_pose_ekf/odom_combined", "pose_covariance", frame="odom_combined"),
            ),
        ),
        "wiki.ros.org/Robots/PR2; wiki.ros.org/pr2_bringup",
        ".bag",
    ),
    Variant(
        "Pepper",
        rgbd(
            "/pepper_robot/camera/front/image_raw",
            "/pepper_robot/camera/depth/image_raw",
            "CameraTop_optical_frame",
            depth_frame="CameraDepth_optical_frame",
            offset=(0.0, 0.05, 0.0),
            motion=Motion("/pepper_robot/odom", tf=True),
            others=(Image("/pepper_robot/camera/bottom/image_raw", "CameraBottom_optical_frame", offset=(0, 0.2, 0)),),
        ),
        "github.com/ros-naoqi/naoqi_driver, boot_config.json: camera topics",
        ".bag",
    ),
    Variant(
        "Clearpath Husky, ROS 2",
        rgbd(
            "/a200_0000/sensors/camera_0/color/image",
            "/a200_0000/sensors/camera_0/depth/image",
            "camera_0_color_optical_frame",
            depth_encoding="16UC1",
            body="camera_0_link",
            namespace="/a200_0000",
            motion=Motion("/a200_0000/platform/odom/filtered", tf=True),
            imu=Imu("/a200_0000/sensors/imu_0/data", "imu_0_link"),
            others=(Motion("/a200_0000/platform/odom"),),
        ),
        "docs.clearpathrobotics.com/docs/ros/api: sensors and platform API",
    ),
    Variant(
        "Jackal, ROS 1, with a Velodyne",
        Robot(
            (Camera(Image("/front/image_raw", "front_camera_optical", "bayer_rggb8")),),
            lidar=Cloud("/mid/points", "mid_vlp16", (("intensity", "f4"), ("ring", "u2"), ("time", "f4")), "s"),
            motion=Motion("/odometry/filtered", tf=True),
            imu=Imu("/imu/data", "imu_link"),
            others=(Motion("/jackal_velocity_controller/odom"), Imu("/imu/data_raw", "imu_link")),
        ),
        "github.com/jackal/jackal, jackal_bringup: accessories, topics",
        ".bag",
    ),
    Variant(
        "Unitree Go2 with a RealSense",
        rgbd(
            "/camera/color/image_raw/compressed",
            f"/camera/{ALIGNED}/compressedDepth",
            "camera_color_optical_frame",
            encoding="jpeg rgb8",
            depth_encoding="compressedDepth png",
            motion=Motion("/utlidar/robot_odom", tf=True),
            others=(
                Motion("/utlidar/robot_pose", "pose"),
                Cloud("/utlidar/cloud_deskewed", "odom", (("intensity", "f4"),)),
            ),
        ),
        "github.com/unitreerobotics/unitree_ros2, README: topics of the Go2's LiDAR and odometry",
        roles={"lidar": "/utlidar/cloud_deskewed"},
    ),
    Variant(
        "ANYmal",
        rgbd(
            "/depth_camera_front_upper/color/image_raw",
            "/depth_camera_front_upper/depth/image_rect_raw",
            "depth_camera_front_upper_color_optical_frame",
            depth_frame="depth_camera_front_upper_depth_optical_frame",
            offset=(0.015, 0, 0),
            base="base",
            motion=Motion("/state_estimator/odometry", child="base", tf=True),
            others=(Image("/wide_angle_camera_front/image_color", "wide_angle_camera_front_camera_parent", "bgr8"),),
        ),
        "github.com/ANYbotics/anymal_d_simple_description; ANYmal user documentation: depth cameras",
        ".bag",
    ),
    Variant(
        "LoCoBot",
        rgbd(
            "/locobot/camera/color/image_raw",
            f"/locobot/camera/{ALIGNED}",
            "locobot/camera_color_optical_frame",
            base="locobot/base_link",
            motion=Motion("/locobot/mobile_base/odom", child="locobot/base_link", tf=True),
        ),
        "docs.trossenrobotics.com/interbotix_xslocobots_docs: topics",
    ),
    Variant(
        "drone with MAVROS",
        rgbd(
            "/camera/color/image_raw",
            f"/camera/{ALIGNED}",
            "camera_color_optical_frame",
            motion=Motion("/mavros/local_position/odom", frame="map"),
            imu=Imu("/mavros/imu/data", "base_link"),
            others=(
                Motion("/mavros/local_position/pose", "pose", frame="map"),
                Motion("/mavros/setpoint_position/local", "pose", frame="map", offset=(3.0, 0, 0)),
                Imu("/mavros/imu/data_raw", "base_link"),
            ),
        ),
        "wiki.ros.org/mavros: local_position, setpoint_position",
        ".bag",
    ),
    Variant(
        "three cameras around",
        Robot(
            tuple(
                Camera(
                    color(f"/cam_{name}/color/image_raw", f"cam_{name}_color_optical_frame"),
                    depth(f"/cam_{name}/{ALIGNED}", f"cam_{name}_color_optical_frame"),
                    yaw_deg=yaw,
                    id=name,
                )
                for name, yaw in (("front", 0.0), ("left", 90.0), ("right", -90.0))
            ),
            found=Found(frame="cam_front_color_optical_frame"),
        ),
        "marvinstuede.github.io/Sobi: sensor topics and transformations",
    ),
)
