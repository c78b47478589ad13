"""A recording understood as one robot: its evidence, its clocks, its frames, and the options that put them right."""

import numpy as np
import pytest

from supermap_cli.errors import ConfigError, OdometryError, RecordingError
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings.inspection import inspect_recording
from support import bags
from support.rigs import FRAME, mount, open_, problems_of

FAR = make_transform(np.eye(3), [465_432.0, 5_572_111.0, 320.0])


def positions(recording):
    return [pose.T_odom_base[:3, 3].tolist() for pose in recording.poses()]


# Evidence ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("late", [3, 40])
def test_the_first_calibrations_may_be_zero(tmp_path, late):
    size, K = (bags.WIDTH, bags.HEIGHT), (bags.FOCAL, bags.FOCAL, 31.5, 23.5)
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(50):
            at = bags.stamp(index)
            bag.camera_info("/cam/camera_info", at, FRAME, size, K if index >= late else (0.0, 0.0, 0.0, 0.0))
            bag.image("/cam/image_raw", at, FRAME, bags.color_image(index), "rgb8")
            bag.image("/cam/depth", at, FRAME, bags.depth_image(), "16UC1")
            bag.odometry("/odom", at, bags.pose_at(index))
    recording = open_(tmp_path / "run.mcap")
    assert next(recording.frames()).camera.fx == bags.FOCAL
    assert any("of no use (the camera is not calibrated" in line for line in recording.warnings)


def test_a_broken_first_image_is_left_out_and_the_rest_is_read(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        bag.image("/camera/color/image_raw", bags.stamp(0), FRAME, np.zeros((1, 1, 3), np.uint8), "rgb8")
        for index in range(1, 8):
            bags.write_images(bag, index)
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index))
    assert len(list(open_(tmp_path / "run.mcap").frames())) == 7


def test_transforms_are_found_wherever_they_begin(tmp_path):
    joints, begins = 30_000, 20
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(joints):
            bag.transform(bags.START_NS + index * 10**6, "base_link", "wheel", np.eye(4))
        for index in range(300):
            if index >= begins * 10:
                bag.transform(bags.stamp(index), "odom", "base_link", bags.pose_at(index))
            if index % 10 == 0:
                bags.write_images(bag, index)
    report = inspect_recording(tmp_path / "run.mcap", RecordingRequest())
    assert report.poses == "TF (odom -> base_link)"
    assert report.can_build


def test_results_added_a_day_later_do_not_lengthen_the_recording(tmp_path):
    day_ns = 86_400 * 10**9
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(10):
            bags.write_images(bag, index)
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index))
        for index in range(10):
            at = bags.stamp(index)
            bag.detections("/detections", at, FRAME, [([("box", 0.9)], (24, 16, 40, 32))], log_ns=at + day_ns)
    recording = open_(tmp_path / "run.mcap")
    assert recording.end_ns == bags.stamp(9)
    assert len(list(recording.detections())) == 10


# Robots and motion ---------------------------------------------------------------------------------------------------


def write_robot(bag, index, name, speed, *, camera):
    frame = f"{FRAME}"
    if index == 0:
        mount(bag, frame, namespace=f"/{name}")
    T = make_transform(np.eye(3), [speed * index / 10, 0, 0])
    bag.transform(bags.stamp(index), "odom", "base_link", T, namespace=f"/{name}")
    bag.odometry(f"/{name}/odom", bags.stamp(index), T)
    if camera:
        bags.write_images(bag, index, prefix=f"/{name}/camera", frame_id=frame)


def test_of_two_robots_the_one_with_the_camera_is_mapped_with_its_own_wheels(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        for index in range(20):
            write_robot(bag, index, "alpha", 1.0, camera=True)
            write_robot(bag, index, "beta", 3.0, camera=False)
    recording = open_(tmp_path / "run.mcap")
    assert positions(recording)[-1] == pytest.approx([1.9, 0, 0])
    assert any("2 robots" in line and "--robot" in line for line in recording.warnings)


def test_two_robots_with_cameras_are_refused_and_one_can_be_chosen(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        for index in range(20):
            write_robot(bag, index, "alpha", 1.0, camera=True)
            write_robot(bag, index, "beta", 3.0, camera=True)
    with pytest.raises(RecordingError, match=r"2 robots are in it \(alpha, beta\).*--robot alpha"):
        open_(tmp_path / "run.mcap")
    assert positions(open_(tmp_path / "run.mcap", robot="beta"))[-1] == pytest.approx([5.7, 0, 0])
    with pytest.raises(ConfigError, match="no such robot"):
        open_(tmp_path / "run.mcap", robot="gamma")


def test_robots_are_told_apart_by_the_prefixes_of_their_frames(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag, f"r1/{FRAME}", "r1/base_link")
        for index in range(20):
            for name, speed in (("r1", 1.0), ("r2", 3.0)):
                T = make_transform(np.eye(3), [speed * index / 10, 0, 0])
                bag.transform(bags.stamp(index), f"{name}/odom", f"{name}/base_link", T)
            bags.write_images(bag, index, frame_id=f"r1/{FRAME}")
    recording = open_(tmp_path / "run.mcap")
    assert recording.base_frame == "r1/base_link"
    assert positions(recording)[-1] == pytest.approx([1.9, 0, 0])


def write_prefixed(path, *, sign, cameras, odometry):
    """Two robots on one /tf, told apart by what stands before "/" or "_" in their frames and topics."""
    with bags.BagWriter(path) as bag:
        for name in cameras:
            mount(bag, f"{name}{sign}{FRAME}", f"{name}{sign}base_link")
        for index in range(20):
            for name, speed in (("r1", 1.0), ("r2", 3.0)):
                T = make_transform(np.eye(3), [speed * index / 10, 0, 0])
                if odometry:
                    bag.odometry(f"/{name}{sign}odom", bags.stamp(index), T, frame_id="odom", child_frame_id="base")
                bag.transform(bags.stamp(index), "map", f"{name}{sign}base_link", T)
            for name in cameras:
                bags.write_images(bag, index, prefix=f"/{name}{sign}camera", frame_id=f"{name}{sign}{FRAME}")
    return path


@pytest.mark.parametrize("odometry", [False, True])
@pytest.mark.parametrize("sign", ["/", "_"])
def test_robots_on_one_tf_are_told_apart_by_prefixes(tmp_path, sign, odometry):
    path = write_prefixed(tmp_path / "run.mcap", sign=sign, cameras=("r1", "r2"), odometry=odometry)
    with pytest.raises(RecordingError, match=r"2 robots are in it \(r1, r2\).*--robot r1"):
        open_(path)
    base = {} if not odometry else {"frames": {"base": f"r2{sign}base_link"}}
    chosen = open_(path, robot="r2", **base)
    assert positions(chosen)[-1] == pytest.approx([5.7, 0, 0])
    lone = write_prefixed(tmp_path / "lone.mcap", sign=sign, cameras=("r1",), odometry=False)
    assert positions(open_(lone))[-1] == pytest.approx([1.9, 0, 0])


def test_an_arm_is_no_robot_of_its_own(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag, FRAME, "mobile_base_link")
        bag.transform(bags.START_NS, "mobile_base_link", "ur5_base_link", np.eye(4), static=True)
        for index in range(20):
            bag.transform(bags.stamp(index), "odom", "mobile_base_link", bags.pose_at(index))
            bags.write_images(bag, index)
    assert positions(open_(tmp_path / "run.mcap"))[-1] == pytest.approx([1.9, 0, 0])


@pytest.mark.parametrize(
    ("topic", "frame", "count"),
    [
        ("/goal_pose", "map", 2),
        ("/move_base_simple/goal", "map", 40),
        ("/aruco_single/pose", FRAME, 40),
        ("/handle/pose", "base_link", 40),
        ("/mavros/setpoint_position/local", "map", 40),
    ],
)
def test_poses_of_something_else_are_not_the_robots_motion(tmp_path, topic, frame, count):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(40):
            bags.write_images(bag, index)
            if index % (40 // count) == 0:
                bag.pose(topic, bags.stamp(index), frame, bags.pose_at(index))
    report = inspect_recording(tmp_path / "run.mcap", RecordingRequest())
    assert report.poses is None
    assert any(topic in problem.what for problem in report.problems)
    named = inspect_recording(tmp_path / "run.mcap", RecordingRequest(topics={"odometry": topic}))
    assert topic in (named.poses or "")


def test_detections_of_a_camera_that_tf_does_not_place_are_not_anothers(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag, "a_optical")
        for index in range(10):
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index))
            bags.write_images(bag, index, prefix="/cam_a", frame_id="a_optical")
            bags.write_images(bag, index, prefix="/cam_b", frame_id="b_optical")
            bag.detections("/found", bags.stamp(index), "b_optical", [([("box", 0.9)], (24, 16, 40, 32))])
    found = open_(tmp_path / "run.mcap")
    assert "detections" not in found.streams
    assert any("TF does not place its frame 'b_optical'" in line for line in found.warnings)
    alone = open_(tmp_path / "run.mcap", topics={"color": "/cam_a/color/image_raw"})
    assert "detections" not in alone.streams
    assert any("/found holds detections" in line and "'b_optical'" in line for line in alone.warnings)


def test_coordinates_of_the_world_are_counted_from_an_origin(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(10):
            bags.write_images(bag, index)
            bag.odometry("/odom", bags.stamp(index), FAR @ bags.pose_at(index), frame_id="utm")
    recording = open_(tmp_path / "run.mcap")
    assert positions(recording)[0] == pytest.approx([32, 11, 320])
    assert any("(465400, 5572100, 0) m are taken off" in line for line in recording.warnings)


@pytest.mark.parametrize("tf", [False, True])
@pytest.mark.parametrize("without_fix", [0, 3])
def test_far_coordinates_keep_every_digit(tmp_path, tf, without_fix):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(12):
            bags.write_images(bag, index)
            T = np.eye(4) if index < without_fix else FAR @ bags.pose_at(index)
            if tf:
                bag.transform(bags.stamp(index), "utm", "base_link", T)
            else:
                bag.odometry("/odom", bags.stamp(index), T, frame_id="utm")
    recording = open_(tmp_path / "run.mcap")
    expected = [[32 + index / 10, 11, 320] for index in range(without_fix, 12)]
    np.testing.assert_allclose(positions(recording), expected, atol=1e-6)
    assert bool(without_fix) == any(
        "more than 10 km from where the others are, 3 pose(s)" in line for line in recording.warnings
    )


@pytest.mark.parametrize(
    ("scale", "said"),
    [(np.nan, "not finite"), (0.0, "a quaternion of length 0,"), (0.5, "length 0.5"), (1e100, "length 1e+100")],
)
def test_rotations_that_are_none_are_named_with_topic_and_time(tmp_path, scale, said):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(10):
            bags.write_images(bag, index)
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index), quaternion_scale=scale)
    with pytest.raises(OdometryError) as failure:
        list(open_(tmp_path / "run.mcap").poses())
    assert said in str(failure.value)
    assert "/odom (odom -> base_link) at 0.000 s" in str(failure.value)


# Mounting ------------------------------------------------------------------------------------------------------------


def write_unconnected(path, child="body", frame_id=FRAME, *, mounted=True):
    with bags.BagWriter(path) as bag:
        if mounted:
            mount(bag)
        for index in range(10):
            bags.write_images(bag, index, frame_id=frame_id)
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index), child_frame_id=child)
    return path


def test_a_body_that_tf_does_not_connect_is_refused_with_cures_that_work(tmp_path):
    path = write_unconnected(tmp_path / "run.mcap")
    (problem,) = problems_of(path)
    assert "--frame base=base_link" in problem
    assert '--mount body="base_link' in problem
    same = open_(path, frames={"base": "base_link"})
    assert positions(same)[-1] == pytest.approx([0.9, 0, 0])
    assert any("taken as one frame" in line for line in same.warnings)
    linked = open_(path, mounts={"body": "base_link 0 0 0.4 0 0 0"})
    assert next(linked.frames()).T_base_camera[2, 3] == pytest.approx(bags.T_BASE_OPTICAL[2, 3] - 0.4)


@pytest.mark.parametrize("frame_id", ["", "unknown_frame"])
def test_images_in_no_known_frame_are_refused_with_cures_that_work(tmp_path, frame_id):
    path = write_unconnected(tmp_path / "run.mcap", "base_link", frame_id)
    (problem,) = problems_of(path)
    assert f"--frame camera={FRAME}" in problem
    assert "--mount camera=" in problem
    named = open_(path, frames={"camera": FRAME})
    assert np.allclose(next(named.frames()).T_base_camera, bags.T_BASE_OPTICAL)
    mounted = open_(path, mounts={"camera": "0.1 0 0.5 0 0 0"})
    assert np.allclose(next(mounted.frames()).T_base_camera, bags.T_BASE_OPTICAL)


def test_without_any_tf_the_mounting_can_be_given(tmp_path):
    path = write_unconnected(tmp_path / "run.mcap", "base_link", mounted=False)
    assert any("--mount camera=" in problem for problem in problems_of(path))
    mounted = open_(path, mounts={"camera": "0.1 0 0.5 0 0 0"})
    assert np.allclose(next(mounted.frames()).T_base_camera, bags.T_BASE_OPTICAL)


@pytest.mark.parametrize(
    ("mounts", "what"),
    [
        ({"camera": "1 2 3"}, "is not understood"),
        ({"camera": "base 1 2 3 a b c"}, "is not understood"),
        ({"camera": "0 0 1 0 90 0"}, "write the angles in radians"),
        ({"camera": "0 0 nan 0 0 0"}, "is not understood"),
    ],
)
def test_mountings_of_no_sense_are_one_clear_error(tmp_path, mounts, what):
    path = write_unconnected(tmp_path / "run.mcap")
    with pytest.raises(ConfigError, match=what):
        open_(path, mounts=mounts)
    with pytest.raises(ConfigError, match="unknown role 'cam' in --frame"):
        open_(path, frames={"cam": "x"})


def test_a_static_mounting_counts_before_a_moving_one(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag, "camera_link")
        bag.transform(bags.START_NS, "camera_link", FRAME, np.eye(4), static=True)
        for index in range(10):
            bags.write_images(bag, index)
            bag.transform(bags.stamp(index), "odom", "base_link", bags.pose_at(index))
            bag.transform(bags.stamp(index), "odom", "camera_link", bags.pose_at(2 * index))
    recording = open_(tmp_path / "run.mcap")
    assert all(np.allclose(frame.T_base_camera, bags.T_BASE_OPTICAL) for frame in recording.frames())
    assert any("'camera_link' has two parents" in line and "static mounting" in line for line in recording.warnings)


def test_a_placeholder_under_odom_does_not_hold_the_robot_still(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        bag.transform(bags.START_NS, "odom", "base_link", np.eye(4), static=True)
        for index in range(10):
            bags.write_images(bag, index)
            bag.transform(bags.stamp(index), "odom", "base_link", bags.pose_at(index))
    recording = open_(tmp_path / "run.mcap")
    assert positions(recording)[-1] == pytest.approx([0.9, 0, 0])
    assert any("the moving one counts" in line for line in recording.warnings)


def test_two_publishers_of_one_link_are_reported(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(20):
            bags.write_images(bag, index)
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index))
            far = make_transform(np.eye(3), [5.0 * (index % 2), 0, 0])
            bag.transform(bags.stamp(index), "odom", "base_link", far)
    assert any("jumps to and fro" in line for line in open_(tmp_path / "run.mcap").warnings)


# Values --------------------------------------------------------------------------------------------------------------


def test_floating_depth_in_millimetres_becomes_metres(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(5):
            bags.write_images(bag, index)
            at = bags.stamp(index)
            bag.image("/camera/depth_registered/image", at, FRAME, bags.depth_image().astype(np.float32), "32FC1")
            bag.odometry("/odom", at, bags.pose_at(index))
    recording = open_(tmp_path / "run.mcap", topics={"depth": "/camera/depth_registered/image"})
    assert np.isclose(np.median(next(recording.frames()).depth_m), bags.WALL_M)
    assert any("millimetres" in line for line in recording.warnings)


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_depth_of_eight_bits_is_refused(tmp_path, suffix):
    import cv2

    data = cv2.imencode(suffix, np.full((bags.HEIGHT, bags.WIDTH), 200, np.uint8))[1].tobytes()
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(5):
            at = bags.stamp(index)
            bag.camera_info("/camera/color/camera_info", at, FRAME, (bags.WIDTH, bags.HEIGHT), (60.0, 60.0, 31.5, 23.5))
            bag.image("/camera/color/image_raw", at, FRAME, bags.color_image(index), "rgb8")
            bag.compressed("/camera/depth/image_raw/compressed", at, FRAME, data, "16UC1; jpeg compressed ")
            bag.odometry("/odom", at, bags.pose_at(index))
    assert any("lossy depth images of 8 bits" in problem for problem in problems_of(tmp_path / "run.mcap"))


@pytest.mark.parametrize("to_and_fro", [True, False], ids=["two publishers", "one that is fast"])
def test_two_publishers_of_one_motion_are_told_from_one_that_is_fast(tmp_path, to_and_fro):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        mount(bag)
        for index in range(20):
            bags.write_images(bag, index)
            x = 5.0 * (index % 2 if to_and_fro else index)
            bag.transform(bags.stamp(index), "odom", "base_link", make_transform(np.eye(3), [x, 0, 0]))
    warned = any("jumps to and fro" in line for line in open_(tmp_path / "run.mcap").warnings)
    assert warned == to_and_fro


# Loops of TF ---------------------------------------------------------------------------------------------------------


def write_loop(path, links):
    with bags.BagWriter(path) as bag:
        for parent, child in links:
            T = bags.T_BASE_OPTICAL if child == FRAME else np.eye(4)
            bag.transform(bags.START_NS, parent, child, T, static=True)
        for index in range(10):
            bags.write_images(bag, index)
            bag.transform(bags.stamp(index), "odom", "base_link", bags.pose_at(index))
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index))
    return path


@pytest.mark.parametrize("top", ["base_link", "odom"])
def test_a_base_below_its_own_camera_is_turned_round(tmp_path, top):
    links = [("base_link", "camera_link"), ("camera_link", FRAME), (FRAME, top)]
    recording = open_(write_loop(tmp_path / "run.mcap", links))
    assert positions(recording)[3] == pytest.approx([0.3, 0, 0])
    assert any("is a loop" in line and f"'{FRAME}' -> '{top}' is left out" in line for line in recording.warnings)


def test_a_loop_of_sensors_is_mended_by_the_mounting_that_the_error_names(tmp_path):
    links = [("camera_link", FRAME), (FRAME, "camera_body"), ("camera_body", "camera_link")]
    path = write_loop(tmp_path / "run.mcap", links)
    problem = problems_of(path)[0]
    assert "the TF tree has a loop" in problem
    assert all(frame in problem for frame in ("camera_link", FRAME, "camera_body"))
    for frame in ("camera_link", "camera_body"):
        assert problems_of(path, mounts={frame: "base_link 0.1 0 0.5 0 0 0"}) == []
    (named,) = [word for word in problem.replace("=", " ").split() if word in {"camera_link", FRAME, "camera_body"}][
        -1:
    ]
    assert problems_of(path, mounts={named: "base_link 0.1 0 0.5 0 0 0"}) == []


# Errors --------------------------------------------------------------------------------------------------------------


def test_what_was_warned_of_is_told_with_the_error(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        for index in range(10):
            bag.image("/cam/image_raw", bags.stamp(index), FRAME, bags.color_image(index), "rgb8")
            bag.pose("/goal_pose", bags.stamp(index), "map", bags.pose_at(index))
            bag.image("/cam/depth/image_raw", bags.stamp(index), FRAME, bags.depth_image(), "16UC1")
    with pytest.raises(RecordingError) as failure:
        open_(tmp_path / "run.mcap")
    assert any("/goal_pose is not taken as the robot's motion" in line for line in failure.value.warnings)
