"""Several cameras: found by themselves, named, and not mistaken for several."""

from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import CalibrationError, ConfigError, RecordingError
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from support import bags

RIG = ("/camera_front", "/camera_left", "/camera_right")
SIZE, K = (bags.WIDTH, bags.HEIGHT), (bags.FOCAL, bags.FOCAL, (bags.WIDTH - 1) / 2, (bags.HEIGHT - 1) / 2)


def open_(path: Path, **request):
    return open_bag_recording(path, RecordingRequest(**request))


def color(prefix):
    return f"{prefix}/color/image_raw"


def greens(recording, camera_id):
    return {int(frame.rgb[0, 0, 1]) for frame in recording.frames(camera_id=camera_id)}


@pytest.mark.parametrize(
    ("prefixes", "ids"),
    [
        (RIG, ("front", "left", "right")),
        (("/cam_left", "/cam_right"), ("left", "right")),
        (("/front/realsense", "/rear/realsense"), ("front", "rear")),
        (("/spot/camera/frontleft", "/spot/camera/frontright"), ("frontleft", "frontright")),
        (("/cam0", "/cam1", "/cam2"), ("cam0", "cam1", "cam2")),
        (("/kinect_1", "/kinect_2"), ("kinect_1", "kinect_2")),
        (("/camera", "/camera_rear"), ("camera", "rear")),
    ],
)
def test_rgbd_cameras_are_found_and_called_by_their_prefixes(tmp_path, prefixes, ids):
    recording = open_(bags.write_rig(tmp_path / "run.mcap", prefixes))
    assert recording.cameras == ids
    for camera_id, prefix in zip(ids, prefixes, strict=True):
        frames = list(recording.frames(camera_id=camera_id))
        assert [frame.camera_id for frame in frames] == [camera_id] * 5
        assert [frame.frame_id for frame in frames] == [bags.camera_frame(prefix)] * 5
        assert np.array_equal(frames[2].rgb, bags.rig_image(prefix, 2))
        assert np.allclose(frames[2].depth_m, bags.depth_image() / 1000)
        (found, *_) = recording.detections(camera_id)
        assert (found.camera_id, found.labels) == (camera_id, (prefix,))
        assert found.masks[0] is not None
    assert any(f"{len(ids)} cameras found: {ids[0]} ({color(prefixes[0])})" in line for line in recording.warnings)


def test_every_camera_has_its_own_mounting(tmp_path):
    recording = open_(bags.write_rig(tmp_path / "run.mcap", {"/cam_front": 0, "/cam_left": 90}))
    front, left = (next(recording.frames(camera_id=camera_id)) for camera_id in recording.cameras)
    assert np.allclose(front.T_base_camera[:3, 2], [1, 0, 0])
    assert np.allclose(left.T_base_camera[:3, 2], [0, 1, 0])


def test_without_an_id_streams_are_the_main_cameras(tmp_path):
    recording = open_(bags.write_rig(tmp_path / "run.mcap", RIG))
    assert {frame.camera_id for frame in recording.frames()} == {"front"}
    assert {found.camera_id for found in recording.detections()} == {"front"}
    assert recording.frame_stamps_ns().tolist() == recording.frame_stamps_ns("front").tolist()
    with pytest.raises(ValueError, match="no camera 'rear' among"):
        recording.frame_stamps_ns("rear")


def test_start_and_end_span_all_cameras(tmp_path):
    late = {"/camera_left": 30_000_000, "/camera_right": -40_000_000}
    recording = open_(bags.write_rig(tmp_path / "run.mcap", RIG, late_ns=late))
    assert recording.start_ns == bags.stamp(0) - 40_000_000
    assert recording.end_ns == bags.stamp(4) + 30_000_000
    assert recording.frame_stamps_ns("left").tolist() == [bags.stamp(i) + 30_000_000 for i in range(5)]


def test_messages_of_all_streams_come_in_the_order_of_their_stamps(tmp_path):
    late = {"/camera_left": 30_000_000}
    recording = open_(bags.write_rig(tmp_path / "run.mcap", RIG, late_ns=late))
    found = list(recording.messages())
    assert [message.stamp_ns for message in found] == sorted(message.stamp_ns for message in found)
    counts = dict.fromkeys(recording.cameras, 0)
    for message in found:
        if type(message).__name__ == "CameraFrame":
            counts[message.camera_id] += 1
    assert counts == {"front": 5, "left": 5, "right": 5}
    assert len(found) == 5 + 15 + 15


def test_of_equal_stamps_the_order_is_that_of_the_cameras_whatever_was_recorded_first(tmp_path):
    reversed_order = {"/camera_right": 120.0, "/camera_left": 60.0, "/camera_front": 0.0}
    orders = []
    for name, cameras in (("a.mcap", RIG), ("b.mcap", reversed_order)):
        recording = open_(bags.write_rig(tmp_path / name, cameras, frames=2))
        orders.append([(type(message).__name__, getattr(message, "camera_id", "")) for message in recording.messages()])
    first = [("StampedPose", ""), *(("CameraFrame", camera) for camera in ("front", "left", "right"))]
    first += [("Detections", camera) for camera in ("front", "left", "right")]
    assert orders[0] == orders[1] == first * 2


def test_color_alone_restricts_to_that_camera_with_its_own_streams(tmp_path):
    path = bags.write_rig(tmp_path / "run.mcap", RIG)
    recording = open_(path, topics={"color": color("/camera_left")})
    assert recording.cameras == ("camera",)
    frame = next(recording.frames())
    assert (frame.camera_id, frame.frame_id) == ("camera", bags.camera_frame("/camera_left"))
    (found, *_) = recording.detections()
    assert (found.labels, found.camera_id) == (("/camera_left",), "camera")
    assert recording.warnings == ()


def test_cameras_may_be_named_and_their_further_topics_are_found(tmp_path):
    path = bags.write_rig(tmp_path / "run.mcap", RIG)
    named = {"color.starboard": color("/camera_right"), "color.port": color("/camera_left")}
    recording = open_(path, topics=named)
    assert recording.cameras == ("starboard", "port")
    assert greens(recording, "port") == {bags.rig_image("/camera_left", 0)[0, 0, 1]}
    assert [next(recording.detections(camera)).labels for camera in recording.cameras] == [
        ("/camera_right",),
        ("/camera_left",),
    ]


def test_a_topic_may_be_named_for_a_camera_that_is_found(tmp_path):
    path = bags.write_rig(tmp_path / "run.mcap", RIG)
    recording = open_(path, topics={"camera_info.left": "/camera_left/color/camera_info"})
    assert recording.cameras == ("front", "left", "right")
    with pytest.raises(ConfigError, match=r"depth\.rear: there is no camera 'rear', only front, left, right"):
        open_(path, topics={"depth.rear": "/camera_left/aligned_depth_to_color/image_raw"})
    with pytest.raises(RecordingError, match=r"no messages on topic /nowhere, named for depth\.left"):
        open_(path, topics={"depth.left": "/nowhere"})
    with pytest.raises(RecordingError, match=r"no messages on topic /nowhere, named for color\.left"):
        open_(path, topics={"color.left": "/nowhere"})


def test_a_camera_named_where_there_is_one_alone_is_an_error(tmp_path):
    path = bags.write_recording(tmp_path / "run.mcap")
    with pytest.raises(ConfigError, match=r"there is no camera 'front', only camera"):
        open_(path, topics={"depth.front": "/camera/depth/image_raw"})
    with pytest.raises(ConfigError, match=r"there is no camera 'front', only camera"):
        open_(path, topics={"depth.front": "/camera/depth/image_raw"}, camera="equirectangular")
    assert open_(path, topics={"depth.camera": "/camera/depth/image_raw"}).cameras == ("camera",)


@pytest.mark.parametrize(
    ("role", "topic"),
    [
        ("depth", "/camera_left/aligned_depth_to_color/image_raw"),
        ("camera_info", "/camera_left/color/camera_info"),
        ("detections", "/camera_left/detections"),
    ],
)
def test_topics_that_belong_to_another_camera_are_refused(tmp_path, role, topic):
    path = bags.write_rig(tmp_path / "run.mcap", ("/camera_front", "/camera_left"), without={"/camera_left/detections"})
    if role == "detections":
        path = bags.write_rig(tmp_path / "run.mcap", ("/camera_front", "/camera_left"))
    named = {"color.front": color("/camera_front"), "color.left": color("/camera_left"), f"{role}.front": topic}
    if role == "detections":
        named["detections.left"] = "/camera_front/detections"
    else:
        named[f"{role}.left"] = topic.replace("left", "front")
    with pytest.raises(RecordingError, match=rf"is that of the camera 'left', not of 'front'.*{role}\.front="):
        open_(path, topics=named)


def test_depth_that_looks_away_from_its_colour_is_refused(tmp_path):
    path = bags.write_rig(tmp_path / "run.mcap", {"/cam_front": 0, "/cam_rear": 180}, depth="depth")
    named = {"color.front": color("/cam_front"), "depth.front": "/cam_rear/depth/image_raw"}
    with pytest.raises(CalibrationError, match=r"looks away from what the camera 'front' sees"):
        open_(path, topics=named)


def test_a_named_camera_that_fails_is_an_error(tmp_path):
    path = bags.write_rig(tmp_path / "run.mcap", RIG, without={"/camera_left/color/camera_info"})
    named = {"color.front": color("/camera_front"), "color.left": color("/camera_left")}
    with pytest.raises(CalibrationError, match=r"no calibration.*/camera_left.*--topic camera_info\.left="):
        open_(path, topics=named)
    path = bags.write_rig(tmp_path / "two.mcap", RIG, without={"/camera_left/aligned_depth_to_color/image_raw"})
    with pytest.raises(RecordingError, match=r"no depth images of the camera 'left'.*--topic depth\.left="):
        open_(path, topics=named)


def test_a_found_camera_that_fails_is_left_out_with_a_warning(tmp_path):
    path = bags.write_rig(tmp_path / "run.mcap", RIG, without={"/camera_left/color/camera_info"})
    recording = open_(path)
    assert recording.cameras == ("front", "right")
    assert any("the camera 'left' is left out: no calibration" in line for line in recording.warnings)
    path = bags.write_rig(tmp_path / "off.mcap", RIG)
    with bags.BagWriter(tmp_path / "none.mcap") as bag:
        bag.odometry("/odom", bags.START_NS, np.eye(4))
        for prefix in RIG:
            bag.image(color(prefix), bags.START_NS, bags.camera_frame(prefix), bags.color_image(0), "rgb8")
            bag.image(
                f"{prefix}/depth/image_raw", bags.START_NS, bags.camera_frame(prefix), bags.depth_image(), "16UC1"
            )
            bag.transform(bags.START_NS, "base_link", bags.camera_frame(prefix), turned(40 * len(prefix)), static=True)
    with pytest.raises(CalibrationError, match="no calibration"):
        open_(tmp_path / "none.mcap")


def turned(yaw_deg):
    c, s = np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg))
    return make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [0, 0, 0]) @ bags.T_BASE_OPTICAL


def test_a_found_camera_whose_depth_never_fits_is_left_out_too(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        for index in range(5):
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index))
            for yaw, prefix in ((0, "/cam_front"), (90, "/cam_left")):
                at, frame = bags.stamp(index), bags.camera_frame(prefix)
                bag.transform(bags.START_NS, "base_link", frame, turned(yaw), static=True)
                bag.camera_info(f"{prefix}/color/camera_info", at, frame, SIZE, K)
                bag.image(color(prefix), at, frame, bags.color_image(index), "rgb8")
                late = 50_000_000 if prefix == "/cam_left" else 0
                bag.image(f"{prefix}/depth/image_raw", at + late, frame, bags.depth_image(), "16UC1")
    recording = open_(tmp_path / "run.mcap")
    assert recording.cameras == ("front",)
    assert len(list(recording.messages())) == 10
    assert any("the camera 'left' is left out: no depth image within" in line for line in recording.warnings)


def test_a_camera_that_tf_does_not_place_does_not_count(tmp_path):
    without = {bags.camera_frame("/camera_left"), bags.camera_frame("/camera_right")}
    recording = open_(bags.write_rig(tmp_path / "run.mcap", RIG, without=without))
    assert recording.cameras == ("camera",)
    assert next(recording.frames()).frame_id == bags.camera_frame("/camera_front")
    assert sum("TF does not place its frame" in line for line in recording.warnings) == 2
    without = {bags.camera_frame("/camera_front"), bags.camera_frame("/camera_right")}
    recording = open_(bags.write_rig(tmp_path / "other.mcap", RIG, without=without))
    assert recording.cameras == ("camera",)
    assert next(recording.frames()).frame_id == bags.camera_frame("/camera_left")
    assert next(recording.detections()).labels == ("/camera_left",)


def test_a_colour_camera_without_depth_is_no_further_camera(tmp_path):
    path = bags.write_rig(tmp_path / "run.mcap", RIG[:2], without={"/camera_left/aligned_depth_to_color/image_raw"})
    recording = open_(path)
    assert recording.cameras == ("camera",)
    assert recording.warnings == ()


def test_several_streams_of_one_device_are_one_camera(tmp_path):
    front = "camera_color_optical_frame"
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        bag.transform(bags.START_NS, "base_link", front, bags.T_BASE_OPTICAL, static=True)
        bag.transform(bags.START_NS, "base_link", "camera_infra1_optical_frame", bags.T_BASE_OPTICAL, static=True)
        bag.transform(bags.START_NS, "base_link", "camera_infra2_optical_frame", bags.T_BASE_OPTICAL, static=True)
        for index in range(3):
            at, rgb = bags.stamp(index), bags.color_image(index)
            bag.odometry("/odom", at, bags.pose_at(index))
            for topic in (
                "color/image_raw",
                "color/image_rect_color",
                "color_small/image_raw",
                "color/image_throttled",
            ):
                bag.image(f"/camera/{topic}", at, front, rgb, "rgb8")
            bag.compressed("/camera/color/image_raw/compressed", at, front, b"", "jpeg")
            bag.image("/republished/preview/image", at, front, rgb, "rgb8")
            for number in (1, 2):
                frame = f"camera_infra{number}_optical_frame"
                bag.image(f"/camera/infra{number}/image_rect_raw", at, frame, rgb[..., 0], "mono8")
                bag.camera_info(f"/camera/infra{number}/camera_info", at, frame, SIZE, K)
            for name in ("color", "depth", "aligned_depth_to_color", "color_small"):
                bag.camera_info(f"/camera/{name}/camera_info", at, front, SIZE, K)
            bag.image("/camera/depth/image_rect_raw", at, front, bags.depth_image(), "16UC1")
            bag.image("/camera/aligned_depth_to_color/image_raw", at, front, bags.depth_image(), "16UC1")
    recording = open_(tmp_path / "run.mcap")
    assert recording.cameras == ("camera",)
    assert recording.warnings == ()


@pytest.mark.parametrize("lidar", [True, False])
def test_a_stereo_pair_is_one_camera(tmp_path, lidar):
    pair = {"/stereo/left": 0.0, "/stereo/right": 0.0}
    without = {f"{prefix}/depth/image_raw" for prefix in pair} if lidar else set()
    path = bags.write_rig(
        tmp_path / "run.mcap", pair, without=without, lidar=lidar, depth="depth", baseline_m=0.54 if lidar else 0.12
    )
    recording = open_(path)
    assert recording.cameras == ("camera",)
    assert recording.warnings == ()


def test_lidar_stands_in_for_the_depth_of_all_cameras(tmp_path):
    without = {f"{prefix}/aligned_depth_to_color/image_raw" for prefix in RIG}
    path = bags.write_rig(tmp_path / "run.mcap", RIG, without=without, lidar=True)
    recording = open_(path)
    assert recording.cameras == ("front", "left", "right")
    assert "depth" not in recording.streams
    assert "lidar" in recording.streams
    assert next(recording.frames(camera_id="left")).depth_m is None


def test_cameras_that_record_one_after_the_other_are_not_one_rig(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        for index in range(0, 400, 5):
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index))
            yaw, prefix = (0, "/cam_front") if index < 300 else (90, "/cam_left")
            at, frame = bags.stamp(index), bags.camera_frame(prefix)
            bag.transform(bags.START_NS, "base_link", frame, turned(yaw), static=True)
            bag.camera_info(f"{prefix}/color/camera_info", at, frame, SIZE, K)
            bag.image(color(prefix), at, frame, bags.color_image(index), "rgb8")
            bag.image(f"{prefix}/depth/image_raw", at, frame, bags.depth_image(), "16UC1")
    recording = open_(tmp_path / "run.mcap")
    assert recording.cameras == ("camera",)
    assert any("does not record over the same time as /cam_front" in line for line in recording.warnings)


def test_a_camera_by_another_clock_is_left_out(tmp_path):
    path = bags.write_rig(tmp_path / "run.mcap", RIG)
    with bags.BagWriter(path) as bag:
        for index in range(5):
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index))
            for yaw, prefix in ((0, "/cam_front"), (90, "/cam_left")):
                at = bags.stamp(index) - (7_000_000_000 if prefix == "/cam_left" else 0)
                frame, log_ns = bags.camera_frame(prefix), bags.stamp(index)
                bag.transform(bags.START_NS, "base_link", frame, turned(yaw), static=True)
                bag.camera_info(f"{prefix}/color/camera_info", at, frame, SIZE, K, log_ns=log_ns)
                bag.image(color(prefix), at, frame, bags.color_image(index), "rgb8", log_ns=log_ns)
                bag.image(f"{prefix}/depth/image_raw", at, frame, bags.depth_image(), "16UC1", log_ns=log_ns)
    recording = open_(path)
    assert recording.cameras == ("camera",)
    assert any("its clock is 7.0 s off that of /cam_front" in line for line in recording.warnings)
    with pytest.raises(RecordingError, match=r"its clock is 7\.0 s off that of /cam_front.*/cam_left"):
        open_(path, topics={f"color.{name}": color(f"/cam_{name}") for name in ("front", "left")})


def test_of_more_than_six_cameras_the_first_six_are_taken(tmp_path):
    prefixes = {f"/cam{number}": 45.0 * number for number in range(8)}
    recording = open_(bags.write_rig(tmp_path / "run.mcap", prefixes, frames=2))
    assert recording.cameras == tuple(f"cam{number}" for number in range(6))
    assert any("8 cameras, of which cam6, cam7 are left out" in line for line in recording.warnings)


FRONT_AND_LEFT = {"/cam_front": 0, "/cam_left": 90}


def write_moment(bag, index, yaws):
    """The odometry and the images of one moment: a camera at each prefix, turned by so many degrees."""
    at = bags.stamp(index)
    bag.odometry("/odom", at, bags.pose_at(index))
    for prefix, yaw in yaws.items():
        frame = bags.camera_frame(prefix)
        bag.transform(bags.START_NS, "base_link", frame, turned(yaw), static=True)
        bag.camera_info(f"{prefix}/color/camera_info", at, frame, SIZE, K)
        bag.image(color(prefix), at, frame, bags.color_image(index), "rgb8")
        bag.image(f"{prefix}/depth/image_raw", at, frame, bags.depth_image(), "16UC1")
    return at


def test_detections_of_several_cameras_may_stand_in_one_topic_told_apart_by_their_frames(tmp_path):
    without = {f"{prefix}/{stream}" for prefix in RIG[:2] for stream in ("detections", "masks")}
    path = bags.write_rig(tmp_path / "rig.mcap", RIG[:2], without=without)
    with bags.BagWriter(path) as bag:
        for index in range(3):
            at = write_moment(bag, index, FRONT_AND_LEFT)
            for prefix in FRONT_AND_LEFT:
                bag.detections("/found", at, bags.camera_frame(prefix), [([(prefix, 0.9)], (24, 16, 40, 32))])
    named = {f"color.{name}": color(f"/cam_{name}") for name in ("front", "left")}
    recording = open_(path, topics={**named, "detections.front": "/found", "detections.left": "/found"})
    for camera_id in ("front", "left"):
        assert [found.labels for found in recording.detections(camera_id)] == [(f"/cam_{camera_id}",)] * 3
        assert recording.detection_stamps_ns(camera_id).tolist() == [bags.stamp(i) for i in range(3)]


def test_detections_are_paired_by_frame_and_by_the_cameras_name(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        for index in range(3):
            at = write_moment(bag, index, FRONT_AND_LEFT)
            bag.detections("/yolo/a", at, bags.camera_frame("/cam_left"), [([("left", 0.9)], (24, 16, 40, 32))])
            bag.detections("/yolo/front", at, "", [([("front", 0.9)], (24, 16, 40, 32))])
    recording = open_(tmp_path / "run.mcap")
    assert recording.cameras == ("front", "left")
    assert [next(recording.detections(camera_id)).labels for camera_id in recording.cameras] == [("front",), ("left",)]
