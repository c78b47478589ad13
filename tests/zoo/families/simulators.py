"""Simulators: Gazebo of both kinds, Isaac Sim, Webots, CARLA, AirSim."""

from zoo.robot import Camera, Cloud, Found, Image, Imu, Motion, Robot, Variant
from zoo.shortcuts import color, depth, rgbd

CLASSIC = "github.com/ros-simulation/gazebo_ros_pkgs, gazebo_ros_camera, gazebo_ros_openni_kinect: topics"
GZ = "github.com/gazebosim/ros_gz, ros_gz_bridge and ros_gz_sim_demos (rgbd_camera_bridge): topics"
ISAAC = "docs.isaacsim.omniverse.nvidia.com: ROS 2 cameras, publishing camera's data"

VARIANTS = (
    Variant(
        "Gazebo classic, depth camera of ROS 2",
        rgbd(
            "/camera/image_raw",
            "/camera/depth/image_raw",
            "camera_link_optical",
            depth_encoding="32FC1",
            body="camera_link",
            motion=Motion(tf=True),
            others=(Cloud("/camera/points", "camera_link_optical"),),
        ),
        CLASSIC,
    ),
    Variant(
        "Gazebo classic, openni_kinect of ROS 1",
        rgbd(
            "/camera/rgb/image_raw",
            "/camera/depth/image_raw",
            "camera_depth_optical_frame",
            depth_encoding="32FC1",
            base="base_footprint",
            motion=Motion(child="base_footprint", tf=True),
        ),
        CLASSIC,
        ".bag",
    ),
    Variant(
        "Gazebo classic, frame in the body's axes",
        Robot(
            (
                Camera(
                    color("/camera/image_raw", "camera_link"),
                    depth("/camera/depth/image_raw", "camera_link", "32FC1"),
                    body="camera_link",
                ),
            ),
            motion=Motion(tf=True),
        ),
        CLASSIC + "; answers.gazebosim.org: images and optical frames",
        notes=("optical",),
    ),
    Variant(
        "gz, rgbd_camera over ros_gz_bridge",
        rgbd(
            "/rgbd_camera/image",
            "/rgbd_camera/depth_image",
            "camera_optical_frame",
            depth_encoding="32FC1",
            motion=Motion("/model/vehicle/odometry", tf=True),
            others=(Cloud("/rgbd_camera/points", "camera_optical_frame"),),
        ),
        GZ,
    ),
    Variant(
        "gz, scoped frame that TF does not know",
        rgbd(
            "/rgbd_camera/image",
            "/rgbd_camera/depth_image",
            "turtlebot4/oakd_rgb_camera_frame/rgbd_camera",
            depth_encoding="32FC1",
            static=False,
            motion=Motion(tf=True),
        ),
        GZ + "; github.com/turtlebot/turtlebot4_simulator: frames",
        options=('--mount camera="0.1 0 0.8 0 0 0"',),
    ),
    Variant(
        "TurtleBot 4 simulator",
        rgbd(
            "/oakd/rgb/preview/image_raw",
            "/oakd/rgb/preview/depth",
            "oakd_rgb_camera_optical_frame",
            depth_encoding="32FC1",
            motion=Motion(tf=True),
            others=(Motion("/sim_ground_truth_pose", frame="world"),),
        ),
        "github.com/turtlebot/turtlebot4_simulator: ros_ign_bridge, topics",
    ),
    Variant(
        "Isaac Sim, topics without a namespace",
        rgbd(
            "/rgb",
            "/depth",
            "sim_camera",
            depth_encoding="32FC1",
            motion=Motion(tf=True),
            depth_info="/camera_info",
        ),
        ISAAC,
    ),
    Variant(
        "Isaac Sim, segmentation beside",
        rgbd(
            "/camera/rgb",
            "/camera/depth",
            "sim_camera",
            depth_encoding="32FC1",
            motion=Motion("/chassis/odom", tf=True),
            depth_info="/camera/camera_info",
            others=(
                Image("/camera/instance_segmentation", "sim_camera", "32SC1", info="", content="masks"),
                Image("/camera/semantic_segmentation", "sim_camera", "32SC1", info="", content="masks"),
            ),
        ),
        ISAAC,
    ),
    Variant(
        "Isaac Sim, Nova Carter",
        Robot(
            (Camera(color("/front_stereo_camera/left/image_raw", "front_stereo_camera_left_optical")),),
            lidar=Cloud("/front_3d_lidar/lidar_points", "front_3d_lidar"),
            motion=Motion("/chassis/odom", tf=True),
            imu=Imu("/chassis/imu", "chassis_imu"),
            others=(
                Image("/front_stereo_camera/right/image_raw", "front_stereo_camera_right_optical", offset=(0.15, 0, 0)),
            ),
        ),
        "docs.isaacsim.omniverse.nvidia.com: ROS 2 navigation, Nova Carter",
    ),
    Variant(
        "nvblox and r2b data sets",
        rgbd(
            "/camera_0/color/image_raw",
            "/camera_0/depth/image_rect_raw",
            "camera_0_color_optical_frame",
            depth_frame="camera_0_depth_optical_frame",
            offset=(0.015, 0, 0),
            motion=Motion("/visual_slam/tracking/odometry", tf=True),
            others=(Image("/camera_0/infra1/image_rect_raw", "camera_0_infra1_optical_frame", "mono8"),),
        ),
        "nvidia-isaac-ros.github.io: isaac_ros_nvblox, topics; r2b data set",
    ),
    Variant(
        "topics without a folder, names joined by underscores",
        rgbd(
            "/d455_1_rgb_image",
            "/d455_1_depth_image",
            "camera_1_color_optical_frame",
            info="/d455_1_rgb_camera_info",
            depth_info="/d455_1_depth_camera_info",
        ),
        "catalog.ngc.nvidia.com: r2b 2024 data sets, topics",
    ),
    Variant(
        "Webots",
        rgbd(
            "/kinect_color/image_color",
            "/kinect_range/image",
            "kinect_color",
            encoding="bgra8",
            depth_encoding="32FC1",
            motion=Motion(tf=True),
        ),
        "github.com/cyberbotics/webots_ros2, webots_ros2_driver: camera and range finder",
    ),
    Variant(
        "CARLA",
        rgbd(
            "/carla/ego_vehicle/rgb_front/image",
            "/carla/ego_vehicle/depth_front/image",
            "ego_vehicle/rgb_front",
            encoding="bgra8",
            depth_encoding="32FC1",
            depth_frame="ego_vehicle/depth_front",
            base="ego_vehicle",
            motion=Motion("/carla/ego_vehicle/odometry", frame="map", child="ego_vehicle", tf=True),
        ),
        "carla.readthedocs.io/projects/ros-bridge: sensors, camera topics",
        ".bag",
    ),
    Variant(
        "AirSim",
        rgbd(
            "/airsim_node/Drone1/front_center/Scene",
            "/airsim_node/Drone1/front_center/DepthPlanar",
            "front_center_optical",
            encoding="bgr8",
            depth_encoding="32FC1",
            info="/airsim_node/Drone1/front_center/Scene/camera_info",
            depth_info="/airsim_node/Drone1/front_center/DepthPlanar/camera_info",
            base="Drone1",
            motion=Motion("/airsim_node/Drone1/odom_local_enu", frame="world_enu", child="Drone1", tf=True),
        ),
        "microsoft.github.io/AirSim/airsim_ros_pkgs: publishers",
        ".bag",
    ),
    Variant(
        "Habitat, masks and classes by number",
        rgbd(
            "/camera/rgb/image_raw",
            "/camera/depth/image_raw",
            "camera_optical",
            depth_encoding="32FC1",
            found=Found(label="28"),
        ),
        "github.com/ericchen321/ros_x_habitat: topics",
        options=("--option recorded.labels=coco.txt",),
    ),
)
