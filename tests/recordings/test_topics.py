"""Which topic serves which role."""

import numpy as np
import pytest

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.containers import open_storage
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.roles import parse_named_topics
from supermap_cli.recordings.survey import survey_topics
from supermap_cli.recordings.topics import plan_topics
from support import bags

SIZE, K = (8, 6), (8.0, 8.0, 3.5, 2.5)
RGB, DEPTH = np.zeros((6, 8, 3), np.uint8), np.ones((6, 8), np.uint16)


def plan_of(path, named=None):
    storage = open_storage(path, Notes())
    return plan_topics(survey_topics(storage, Decoder("run")), parse_named_topics(named or {}), "run")


def chosen(plan):
    return {role: choice.topic.name for role, choice in plan.choices.items()}


def test_a_recording_of_nothing_useful_says_what_is_missing(tmp_path):
    with bags.BagWriter(tmp_path / "a.mcap") as bag:
        bag.imu("/imu", bags.START_NS, "imu", (0, 0, 0), (0, 0, 9.8))
    plan = plan_of(tmp_path / "a.mcap")
    assert chosen(plan) == {"imu": "/imu"}
    assert ["no camera images" in str(problem) for problem in plan.problems] == [True]
    assert "/imu" in str(plan.problems[0])
    assert "--topic color=" in str(plan.problems[0])


def test_a_whole_recording_is_told_apart_by_type_and_name(tmp_path):
    plan = plan_of(bags.write_recording(tmp_path / "a.mcap", frames=1, lidar=True))
    assert chosen(plan) == {
        "color": "/camera/color/image_raw",
        "depth": "/camera/depth/image_raw",
        "camera_info": "/camera/color/camera_info",
        "depth_camera_info": "/camera/depth/camera_info",
        "lidar": "/points",
        "odometry": "/odom",
        "detections": "/detections",
        "masks": "/masks",
    }
    assert plan.problems == ()


def write_realsense(path):
    """All the images a RealSense publishes."""
    with bags.BagWriter(path) as bag:
        at, color, depth = bags.START_NS, "camera_color_optical_frame", "camera_depth_optical_frame"
        bag.image("/camera/infra1/image_rect_raw", at, "camera_infra1_optical_frame", DEPTH.astype(np.uint8), "mono8")
        bag.image("/camera/color/image_raw", at, color, RGB, "rgb8")
        bag.image("/camera/depth/image_rect_raw", at, depth, DEPTH, "16UC1")
        bag.image("/camera/aligned_depth_to_color/image_raw", at, color, DEPTH, "16UC1")
        for name, frame in (("infra1", "camera_infra1_optical_frame"), ("color", color), ("depth", depth)):
            bag.camera_info(f"/camera/{name}/camera_info", at, frame, SIZE, K)
        bag.camera_info("/camera/aligned_depth_to_color/camera_info", at, color, SIZE, K)


def test_aligned_depth_and_colour_are_preferred(tmp_path):
    write_realsense(tmp_path / "a.mcap")
    plan = chosen(plan_of(tmp_path / "a.mcap"))
    assert plan["color"] == "/camera/color/image_raw"
    assert plan["depth"] == "/camera/aligned_depth_to_color/image_raw"
    assert plan["camera_info"] == "/camera/color/camera_info"
    assert plan["depth_camera_info"] == "/camera/aligned_depth_to_color/camera_info"


def test_the_user_may_name_any_topic(tmp_path):
    write_realsense(tmp_path / "a.mcap")
    plan = plan_of(tmp_path / "a.mcap", {"depth": "/camera/depth/image_rect_raw"})
    assert chosen(plan)["depth"] == "/camera/depth/image_rect_raw"
    assert chosen(plan)["depth_camera_info"] == "/camera/depth/camera_info"
    assert plan.choices["depth"].reason == "named by the user"


@pytest.mark.parametrize(
    ("named", "what"),
    [
        ({"depth": "/nowhere"}, "no messages on topic /nowhere, named for depth.*/camera/depth/image_rect_raw"),
        ({"depth": "/camera/color/camera_info"}, "cannot serve as depth"),
    ],
)
def test_a_name_that_is_not_there_is_an_error_that_lists_what_is(tmp_path, named, what):
    write_realsense(tmp_path / "a.mcap")
    with pytest.raises(RecordingError, match=what):
        plan_of(tmp_path / "a.mcap", named)


def test_of_several_clouds_the_raw_scan_is_the_lidar(tmp_path):
    records = np.ones(3, np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")]))
    with bags.BagWriter(tmp_path / "a.mcap") as bag:
        for topic, frame in (("/cloud_map", "map"), ("/ground_points", "lidar"), ("/velodyne_points", "lidar")):
            bag.points(topic, bags.START_NS, frame, records)
    assert chosen(plan_of(tmp_path / "a.mcap"))["lidar"] == "/velodyne_points"


def test_of_several_depths_and_detections_those_of_the_cameras_own_device_are_chosen(tmp_path):
    with bags.BagWriter(tmp_path / "a.mcap") as bag:
        for _ in range(2):
            for prefix in ("/front", "/rear"):
                bag.image(f"{prefix}/color/image_raw", bags.START_NS, f"{prefix}_color", RGB, "rgb8")
                bag.detections(f"{prefix}/detections", bags.START_NS, f"{prefix}_color", [])
        bag.image("/front/depth/image_raw", bags.START_NS, "front_depth", DEPTH, "16UC1")
        bag.image("/rear/aligned_depth_to_color/image_raw", bags.START_NS, "rear_color", DEPTH, "16UC1")
        bag.detections("/rear/detections", bags.START_NS, "rear_color", [])
    front = chosen(plan_of(tmp_path / "a.mcap", {"color": "/front/color/image_raw"}))
    assert (front["depth"], front["detections"]) == ("/front/depth/image_raw", "/front/detections")
    rear = chosen(plan_of(tmp_path / "a.mcap", {"color": "/rear/color/image_raw"}))
    assert (rear["depth"], rear["detections"]) == ("/rear/aligned_depth_to_color/image_raw", "/rear/detections")


def write_images(path, topics, depth="/cam/depth/image", frame="camera_optical"):
    """Colour topics with the shape and the encoding of their images, in one frame, and depth of 8 x 6 pixels."""
    with bags.BagWriter(path) as bag:
        for topic, (pixels, encoding) in topics.items():
            bag.image(topic, bags.START_NS, frame, pixels, encoding)
            info = f"{topic.rpartition('/')[0]}/camera_info"
            bag.camera_info(info, bags.START_NS, frame, (pixels.shape[1], pixels.shape[0]), K)
        bag.image(depth, bags.START_NS, frame, DEPTH, "16UC1")
    return path


LARGE, SMALL, MOSAIC = np.zeros((12, 16, 3), np.uint8), np.zeros((3, 4, 3), np.uint8), np.zeros((6, 8), np.uint8)


@pytest.mark.parametrize(
    ("topics", "best"),
    [
        ({"/cam/hd/image": (LARGE, "rgb8"), "/cam/qhd/image": (RGB, "rgb8")}, "/cam/qhd/image"),
        ({"/cam/preview/image": (SMALL, "rgb8"), "/cam/video/image": (LARGE, "rgb8")}, "/cam/video/image"),
        (
            {"/cam/rgb/image_raw": (MOSAIC, "bayer_grbg8"), "/cam/rgb/image_color": (RGB, "rgb8")},
            "/cam/rgb/image_color",
        ),
        (
            {"/cam/rgb/image_raw": (RGB, "rgb8"), "/cam/rgb/image_rect_color": (RGB, "rgb8")},
            "/cam/rgb/image_rect_color",
        ),
    ],
)
def test_of_a_cameras_streams_the_best_is_chosen_in_any_order(tmp_path, topics, best):
    for number, listed in enumerate((topics, dict(reversed(topics.items())))):
        assert chosen(plan_of(write_images(tmp_path / f"{number}.mcap", listed)))["color"] == best


def test_a_camera_with_depth_counts_before_one_without(tmp_path):
    with bags.BagWriter(tmp_path / "a.mcap") as bag:
        for device, colour in (("depth_camera_front", "rgb/image_raw"), ("web", "color/image_color")):
            bag.image(f"/{device}/{colour}", bags.START_NS, f"{device}_optical", RGB, "rgb8")
            folder = colour.rpartition("/")[0]
            bag.camera_info(f"/{device}/{folder}/camera_info", bags.START_NS, f"{device}_optical", SIZE, K)
        bag.image("/depth_camera_front/depth/image_raw", bags.START_NS, "depth_camera_front_optical", DEPTH, "16UC1")
    assert chosen(plan_of(tmp_path / "a.mcap"))["color"] == "/depth_camera_front/rgb/image_raw"


@pytest.mark.parametrize("frame", ["odom", "camera_init", "map"])
def test_odometry_in_the_frame_of_registered_clouds_is_motion_and_these_are_no_scan(tmp_path, frame):
    with bags.BagWriter(tmp_path / "a.mcap") as bag:
        for index in range(3):
            bag.odometry("/lio/odometry", bags.stamp(index), bags.pose_at(index), frame_id=frame)
            for topic, own in (("/lio/cloud", frame), ("/points_raw", "lidar")):
                bag.points(topic, bags.stamp(index), own, bags.wall_points(index))
    assert chosen(plan_of(tmp_path / "a.mcap")) == {"lidar": "/points_raw", "odometry": "/lio/odometry"}
