"""`supermap inspect`."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from supermap_cli.errors import RecordingError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.main import make_app
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.inspection import inspect_recording
from support import bags


def inspect(path, **request):
    return inspect_recording(path, RecordingRequest(**request))


def test_a_whole_recording_can_be_built(tmp_path):
    report = inspect(bags.write_recording(tmp_path / "run.mcap", frames=10, lidar=True))
    assert report.can_build
    assert report.usable_frames == 10
    assert report.base_frame == "base_link"
    assert report.poses == "/odom (odom -> base_link)"
    assert report.camera == "pinhole 64 x 48, 60 px a radian, depth aligned"
    assert {(edge.parent, edge.child, edge.static) for edge in report.transforms} == {
        ("odom", "base_link", False),
        ("base_link", "camera_optical_frame", True),
        ("base_link", "lidar", True),
    }
    color = next(topic for topic in report.topics if topic.role == "color")
    assert (color.count, color.rate_hz, color.frame_id) == (10, 10.0, "camera_optical_frame")
    assert not color.has_gap


@pytest.mark.parametrize(
    ("without", "what", "cure"),
    [
        ({"color"}, "no camera images", "--topic color="),
        ({"depth"}, "no depth images and no LiDAR", "--topic depth="),
        ({"odom", "tf"}, "no poses", "--topic odometry="),
        ({"camera_info"}, "no calibration", "--topic camera_info="),
        ({"tf_static"}, "TF knows no frame", "/tf_static"),
    ],
)
def test_what_keeps_a_build_from_working_is_said_with_its_cure(tmp_path, without, what, cure):
    report = inspect(bags.write_recording(tmp_path / "run.mcap", without=without))
    assert not report.can_build
    assert what in report.problems[0].what
    assert cure in (report.problems[0].cure or "")


@pytest.mark.parametrize("topics", [{}, {"depth": "/camera/depth/image_raw"}])
def test_depth_of_an_unsupported_encoding_is_named_with_what_is_supported(tmp_path, topics):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        bag.image("/camera/color/image_raw", bags.START_NS, "camera", bags.color_image(0), "rgb8")
        triples = np.zeros((bags.HEIGHT, bags.WIDTH, 3), np.int16)
        bag.image("/camera/depth/image_raw", bags.START_NS, "camera", triples, "16SC3")
    problem = inspect(tmp_path / "run.mcap", topics=topics).problems[0]
    assert "'16SC3'" in problem.what
    assert (problem.where or "").endswith("run.mcap, /camera/depth/image_raw")
    assert "16UC1, 32FC1" in (problem.cure or "")
    with pytest.raises(RecordingError, match="'16SC3', which is not supported"):
        open_bag_recording(tmp_path / "run.mcap", RecordingRequest(topics=topics))


def test_lidar_stands_in_for_depth_and_for_motion(tmp_path):
    report = inspect(bags.write_recording(tmp_path / "run.mcap", without={"depth", "odom", "tf"}, lidar=True))
    assert report.can_build
    assert report.poses == "LiDAR odometry"


def test_poses_that_are_never_finite_are_a_problem(tmp_path):
    report = inspect(bags.write_recording(tmp_path / "run.mcap", broken_poses=range(5)))
    assert ["no usable poses" in problem.what for problem in report.problems] == [True]


@pytest.mark.parametrize("name", ["run.mcap", "run.db3", "run.bag"])
def test_gaps_are_found_in_every_format(tmp_path, name):
    with bags.BagWriter(tmp_path / name) as bag:
        for index in [*range(10), *range(30, 40)]:
            bag.imu("/imu", bags.stamp(index), "imu", (0, 0, 0), (0, 0, 9.8))
    (topic,) = inspect(tmp_path / name).topics
    assert topic.has_gap
    assert topic.longest_gap_s == pytest.approx(2.1)
    assert topic.gap_at_s == pytest.approx(0.9)
    assert topic.rate_hz == pytest.approx(10)


def test_several_cameras_are_listed_each_with_its_topics_and_frames(tmp_path):
    report = inspect(bags.write_rig(tmp_path / "run.mcap", ("/cam_front", "/cam_left")))
    assert report.can_build
    assert [(camera.camera_id, camera.topic, camera.usable_frames) for camera in report.cameras] == [
        ("front", "/cam_front/color/image_raw", 5),
        ("left", "/cam_left/color/image_raw", 5),
    ]
    assert report.usable_frames == 10
    assert report.cameras[1].model == report.camera == "pinhole 64 x 48, 60 px a radian, depth aligned"
    depths = {(role.camera, role.topic) for role in report.roles if role.role == "depth"}
    assert depths == {(name, f"/cam_{name}/aligned_depth_to_color/image_raw") for name in ("front", "left")}
    roles = {topic.topic: topic.role for topic in report.topics}
    assert roles["/cam_left/detections"] == "detections.left"
    assert roles["/odom"] == "odometry"


def test_a_lone_camera_is_listed_too_and_its_roles_name_no_camera(tmp_path):
    report = inspect(bags.write_recording(tmp_path / "run.mcap"))
    assert [(camera.camera_id, camera.frame_id) for camera in report.cameras] == [("camera", "camera_optical_frame")]
    assert {role.camera for role in report.roles} == {None}


def test_each_camera_that_cannot_be_read_is_a_problem(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        bag.odometry("/odom", bags.START_NS, np.eye(4), child_frame_id="eye")
        for prefix in ("/a", "/b"):
            K = (60.0, 60.0, 31.5, 23.5)
            bag.camera_info(f"{prefix}/color/camera_info", bags.START_NS, "eye", (64, 48), K)
            bag.image(f"{prefix}/color/image_raw", bags.START_NS, "eye", bags.color_image(0), "rgb8")
            bag.image(f"{prefix}/depth/image_raw", bags.START_NS + 10**9, "eye", bags.depth_image(), "16UC1")
    report = inspect(tmp_path / "run.mcap", topics={f"color.{name}": f"/{name}/color/image_raw" for name in "ab"})
    assert [problem.what for problem in report.problems] == [
        "no depth image within 0.02 s of a colour image, the nearest is 1.000 s off"
    ] * 2
    assert [problem.where for problem in report.problems] == [
        f"{tmp_path / 'run.mcap'}, /{name}/depth/image_raw" for name in "ab"
    ]
    assert [(camera.camera_id, camera.usable_frames) for camera in report.cameras] == [("a", 0), ("b", 0)]


def test_the_window_counts(tmp_path):
    path = bags.write_recording(tmp_path / "run.mcap", frames=30)
    report = inspect(path, start_s=1.0, end_s=2.0)
    assert report.usable_frames == 10
    assert {topic.count for topic in report.topics if topic.role in {"color", "depth"}} == {10}


def test_a_frame_with_two_parents_is_warned_of(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        bag.transform(bags.START_NS, "a", "c", np.eye(4), static=True)
        bag.transform(bags.START_NS, "b", "c", np.eye(4), static=True)
    assert any("'c' has two parents, 'a' and 'b'" in line for line in inspect(tmp_path / "run.mcap").warnings)


def test_the_command_prints_tables_and_exits_0(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = bags.write_recording(tmp_path / "run.mcap")
    result = CliRunner().invoke(make_app(), ["inspect", str(path)])
    assert result.exit_code == 0, result.output
    assert "A build can work." in result.output
    assert "camera_optical_frame" in result.output


def test_the_command_lists_several_cameras(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = bags.write_rig(tmp_path / "run.mcap", ("/cam_front", "/cam_left"))
    result = CliRunner().invoke(make_app(), ["inspect", str(path)], env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output
    assert "Cameras" in result.output
    assert "color.left" in result.output
    named = ["--topic", "color.front=/cam_front/color/image_raw", "--topic", "depth.frnt=/x"]
    result = CliRunner().invoke(make_app(), ["inspect", str(path), *named])
    assert "no color topic is named for the camera 'frnt'" in str(result.exception)


def test_without_recorded_detections_the_command_says_that_a_model_is_needed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = bags.write_recording(tmp_path / "run.mcap", without={"detections", "masks"})
    result = CliRunner().invoke(make_app(), ["inspect", str(path)])
    assert result.exit_code == 0, result.output
    assert "A build can work if a detector model is given" in result.output
    assert "--option onnx.model=PATH" in result.output


def test_the_command_exits_1_where_a_build_could_not_work_and_speaks_json(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = bags.write_recording(tmp_path / "run.mcap", without={"depth"})
    result = CliRunner().invoke(make_app(), ["inspect", str(path), "--json"])
    assert result.exit_code == 1
    document = json.loads(result.stdout)
    assert document["can_build"] is False
    assert "LiDAR" in document["problems"][0]["what"]
    assert document["topics"][0].keys() >= {"topic", "type", "count", "rate_hz", "longest_gap_s", "role"}
