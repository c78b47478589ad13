"""LiDARs beside a colour camera: the layouts of their points, as the drivers publish them.

After x, y, z come the fields named; "_" stands for bytes that a PCL point leaves unused.
"""

from dataclasses import replace

from zoo.robot import Camera, Cloud, Image, Imu, Motion, Other, Robot, Variant

CAMERA = (Camera(Image("/camera/image_raw/compressed", "camera_optical_frame", "jpeg bgr8")),)
PAD, INTENSITY, RING = ("_", "u4"), ("intensity", "f4"), ("ring", "u2")
LIVOX = "github.com/Livox-SDK/livox_ros_driver2, README: xfer_format"
LIVOX_FIELDS = (INTENSITY, ("tag", "u1"), ("line", "u1"), ("timestamp", "f8"))
OUSTER = "github.com/ouster-lidar/ouster-ros, include/ouster_ros/os_point.h, sensor_point_types.h"
OUSTER_FIELDS = (PAD, INTENSITY, ("t", "u4"), ("reflectivity", "u2"), RING, ("ambient", "u2"), ("range", "u4"))
VELODYNE = "github.com/ros-drivers/velodyne, velodyne_pointcloud: point types, README"
HESAI = "github.com/HesaiTechnology/HesaiLidar_ROS_2.0, README and point type PointXYZIRT"
ROBOSENSE = "github.com/RoboSense-LiDAR/rslidar_sdk, README 1.2: point types XYZI, XYZIRT"


def robot(cloud: Cloud, **other: object) -> Robot:
    """A colour camera, a LiDAR and odometry."""
    return Robot(CAMERA, lidar=cloud, **other)  # type: ignore[arg-type]


VELODYNE_CLOUD = Cloud("/velodyne_points", "velodyne", (INTENSITY, RING, ("time", "f4")), "s")
OUSTER_CLOUD = Cloud("/ouster/points", "os_sensor", (*OUSTER_FIELDS, ("_", "u8")), "ns")

VARIANTS = (
    Variant("Velodyne", robot(VELODYNE_CLOUD), VELODYNE),
    Variant(
        "Velodyne, ROS 1, times before the stamp", robot(replace(VELODYNE_CLOUD, time="until_end")), VELODYNE, ".bag"
    ),
    Variant(
        "Velodyne, without times, PCL's padding",
        robot(Cloud("/velodyne_points", "velodyne", (PAD, INTENSITY, RING, ("_", "u2"), ("_", "u8")))),
        VELODYNE,
        ".bag",
    ),
    Variant(
        "Velodyne, alone: LiDAR odometry",
        robot(VELODYNE_CLOUD, motion=None),
        VELODYNE,
        roles={"odometry": ""},
    ),
    Variant("Ouster", robot(OUSTER_CLOUD, imu=Imu("/ouster/imu", "os_imu")), OUSTER),
    Variant("Ouster, organised", robot(replace(OUSTER_CLOUD, organized=True)), OUSTER),
    Variant(
        "Ouster, ROS 1, legacy profile",
        robot(
            Cloud(
                "/os_cloud_node/points",
                "os_sensor",
                (PAD, ("t", "u4"), RING, ("_", "u2"), ("range", "u4"), ("signal", "u4"), ("reflectivity", "u4")),
                "ns",
            )
        ),
        OUSTER,
        ".bag",
    ),
    Variant(
        "Ouster, PTP time (TAI)",
        robot(replace(OUSTER_CLOUD, clock_s=37.0)),
        "github.com/ouster-lidar/ouster-ros, README: timestamp_mode TIME_FROM_PTP_1588, ptp_utc_tai_offset",
        notes=("TAI",),
    ),
    Variant(
        "Ouster, time since it was switched on",
        robot(replace(OUSTER_CLOUD, clock_s=-1_699_999_000.0)),
        "github.com/ouster-lidar/ouster-ros, README: timestamp_mode TIME_FROM_INTERNAL_OSC",
        notes=("since",),
    ),
    Variant(
        "Hesai, absolute times",
        robot(Cloud("/lidar_points", "hesai_lidar", (INTENSITY, RING, ("timestamp", "f8")), "absolute")),
        HESAI,
    ),
    Variant(
        "Hesai Pandar, ROS 1",
        robot(Cloud("/hesai/pandar", "PandarXT-32", (PAD, INTENSITY, PAD, ("timestamp", "f8"), RING), "absolute")),
        "github.com/HesaiTechnology/HesaiLidar_General_ROS, README: topics; PPoint",
        ".bag",
    ),
    Variant(
        "RoboSense, XYZIRT",
        robot(Cloud("/rslidar_points", "rslidar", (INTENSITY, RING, ("timestamp", "f8")), "absolute")),
        ROBOSENSE,
    ),
    Variant("RoboSense, XYZI", robot(Cloud("/rslidar_points", "rslidar", (INTENSITY,))), ROBOSENSE, ".bag"),
    Variant(
        "RoboSense, integer intensity",
        robot(Cloud("/rslidar_points", "rslidar", (("intensity", "u1"), RING, ("timestamp", "f8")), "absolute")),
        ROBOSENSE,
        ".bag",
    ),
    Variant(
        "Livox CustomMsg, livox_ros_driver2",
        robot(Cloud("/livox/lidar", "livox_frame", msgtype="livox_ros_driver2/msg/CustomMsg")),
        LIVOX,
    ),
    Variant(
        "Livox CustomMsg, livox_ros_driver of ROS 1",
        robot(Cloud("/livox/lidar", "livox_frame", msgtype="livox_ros_driver/msg/CustomMsg")),
        LIVOX,
        ".bag",
    ),
    Variant(
        "Livox CustomMsg, livox_interfaces",
        robot(Cloud("/livox/lidar", "livox_frame", msgtype="livox_interfaces/msg/CustomMsg")),
        "github.com/Livox-SDK/livox_ros2_driver, livox_interfaces/msg",
    ),
    Variant(
        "Livox PointCloud2, ns in doubles",
        robot(Cloud("/livox/lidar", "livox_frame", LIVOX_FIELDS, "absolute_ns")),
        LIVOX,
    ),
    Variant(
        "Livox Mid-360, IMU in g",
        robot(
            Cloud("/livox/lidar", "livox_frame", LIVOX_FIELDS, "absolute_ns"),
            imu=Imu("/livox/imu", "livox_frame", unit=9.80665),
        ),
        LIVOX + "; issue 60: linear_acceleration in g",
    ),
    Variant(
        "Unitree L1",
        robot(Cloud("/unilidar/cloud", "unilidar_lidar", (PAD, INTENSITY, RING, ("_", "u2"), ("time", "f4")), "s")),
        "github.com/unitreerobotics/unilidar_sdk, README: PointType",
    ),
    Variant(
        "SICK multiScan",
        robot(Cloud("/cloud_all_fields_fullframe", "world_lidar", (("i", "f4"), ("ring", "i1"), ("t", "u4")), "us")),
        "github.com/SICKAG/sick_scan_xd, README: multiScan, point cloud fields",
    ),
    Variant(
        "Autoware, PointXYZIRCAEDT",
        robot(
            Cloud(
                "/sensing/lidar/top/pointcloud_raw",
                "velodyne_top",
                (
                    *(("intensity", "u1"), ("return_type", "u1"), ("channel", "u2"), ("azimuth", "f4")),
                    *(("elevation", "f4"), ("distance", "f4"), ("time_stamp", "u4")),
                ),
                "ns",
            )
        ),
        "autowarefoundation.github.io: sensing data types, PointXYZIRCAEDT",
    ),
    Variant(
        "Gazebo, x y z alone in doubles",
        robot(Cloud("/scan/points", "lidar_link", xyz="f8")),
        "github.com/ros-simulation/gazebo_ros_pkgs, gazebo_ros_ray_sensor: PointCloud2 output",
    ),
    Variant(
        "big-endian",
        robot(replace(VELODYNE_CLOUD, big_endian=True)),
        "docs.ros.org: sensor_msgs/PointCloud2, is_bigendian",
    ),
    Variant(
        "deskewed and filtered clouds beside the raw one",
        robot(
            VELODYNE_CLOUD,
            others=(
                Cloud("/lio_sam/mapping/cloud_registered", "odom", (INTENSITY,)),
                Cloud("/lio_sam/deskew/cloud_deskewed", "velodyne", (INTENSITY,)),
                Cloud("/points_filtered", "velodyne", (INTENSITY,)),
            ),
        ),
        "github.com/TixiaoShan/LIO-SAM, README: topics",
        ".bag",
    ),
    Variant(
        "FAST-LIO's odometry",
        robot(
            Cloud("/livox/lidar", "livox_frame", msgtype="livox_ros_driver2/msg/CustomMsg"),
            motion=Motion("/Odometry", frame="camera_init", child="body", tf=True),
            base="body",
            others=(Cloud("/cloud_registered", "camera_init", (INTENSITY,)), Cloud("/cloud_registered_body", "body")),
        ),
        "github.com/hku-mars/FAST_LIO, README and src/laserMapping.cpp: topics",
    ),
    *(
        Variant(
            name,
            Robot(CAMERA, others=(Other(topic, msgtype),)),
            source,
            refused="no depth images and no LiDAR among its topics (/camera/camera_info, /camera/image_raw/compressed, "
            f"/detections, /odom, /tf_static); {topic} ({msgtype}) holds the raw packets of a LiDAR: replay them "
            "through its driver, and record the PointCloud2 that it publishes ({path}): record an aligned depth topic "
            "or a PointCloud2, or name one: --topic depth=/... or --topic lidar=/...",
        )
        for name, topic, msgtype, source in (
            ("Velodyne, packets alone", "/velodyne_packets", "velodyne_msgs/msg/VelodyneScan", VELODYNE),
            ("Ouster, packets alone", "/ouster/lidar_packets", "ouster_sensor_msgs/msg/PacketMsg", OUSTER),
            ("Hesai, packets alone", "/lidar_packets", "hesai_ros_driver/msg/UdpFrame", HESAI),
        )
    ),
)
