"""Recordings as the rest of the program sees them."""

from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.geometry.se3 import inverse, make_transform
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.protocols import Recording
from supermap_cli.recordings import open_bag_recording
from support import bags

FRAME = "camera_optical_frame"
SIZE, K = (bags.WIDTH, bags.HEIGHT), (bags.FOCAL, bags.FOCAL, (bags.WIDTH - 1) / 2, (bags.HEIGHT - 1) / 2)


def open_(path: Path, **request):
    return open_bag_recording(path, RecordingRequest(**request))


@pytest.mark.parametrize("name", ["run.mcap", "run.db3", "run.bag", "run"])
@pytest.mark.parametrize("depth_encoding", ["16UC1", "32FC1", "compressedDepth"])
def test_a_recording_in_any_format_gives_its_frames_and_poses(tmp_path, name, depth_encoding):
    recording = open_(bags.write_recording(tmp_path / name, frames=3, depth_encoding=depth_encoding))
    assert isinstance(recording, Recording)
    assert recording.streams == {"color", "depth", "poses", "detections", "masks"}
    assert recording.base_frame == "base_link"
    assert recording.frame_stamps_ns().tolist() == [bags.stamp(i) for i in range(3)]
    for index, frame in enumerate(recording.frames()):
        assert frame.stamp_ns == bags.stamp(index)
        assert np.array_equal(frame.rgb, bags.color_image(index))
        assert np.allclose(frame.depth_m, bags.depth_image() / 1000)
        assert np.allclose(frame.T_base_camera, bags.T_BASE_OPTICAL)
        assert frame.camera.focal_px() == bags.FOCAL
    assert [pose.stamp_ns for pose in recording.poses()] == [bags.stamp(i) for i in range(3)]
    assert np.allclose([pose.T_odom_base[0, 3] for pose in recording.poses()], [0, 0.1, 0.2])
    assert recording.warnings == ()


def test_only_selected_frames_are_decoded_and_streams_start_anew(tmp_path):
    recording = open_(bags.write_recording(tmp_path / "run.mcap", frames=6))
    wanted = {bags.stamp(1), bags.stamp(4)}
    for _ in range(2):
        assert [frame.stamp_ns for frame in recording.frames(wanted.__contains__)] == sorted(wanted)
    assert list(recording.frames(lambda stamp_ns: False)) == []


def test_the_window_is_half_open_and_poses_reach_beyond_it(tmp_path):
    path = bags.write_recording(tmp_path / "run.mcap", frames=60)
    first, second = open_(path, end_s=3.0), open_(path, start_s=3.0)
    assert first.frame_stamps_ns().tolist() == [bags.stamp(i) for i in range(30)]
    assert second.frame_stamps_ns().tolist() == [bags.stamp(i) for i in range(30, 60)]
    assert (first.start_ns, second.start_ns) == (bags.stamp(0), bags.stamp(30))
    assert len(list(first.frames())) == 30
    assert next(second.poses()).stamp_ns == bags.stamp(10)
    assert [found.stamp_ns for found in first.detections()] == [bags.stamp(i) for i in range(30)]
    assert len({open_(path).fingerprint(), first.fingerprint(), second.fingerprint()}) == 3
    assert first.fingerprint() == open_(path, end_s=3.0).fingerprint()


@pytest.mark.parametrize("window", [{"start_s": 100}, {"start_s": 2, "end_s": 1}, {"end_s": -1}])
def test_a_window_beside_the_recording_is_refused(tmp_path, window):
    with pytest.raises(RecordingError, match=r"lasts 0\.4 s"):
        open_(bags.write_recording(tmp_path / "run.mcap"), **window)


@pytest.mark.parametrize(
    ("without", "what"),
    [
        ({"color"}, "no camera images"),
        ({"depth"}, "no depth images and no LiDAR"),
        ({"camera_info"}, "no calibration"),
        ({"tf_static"}, "TF knows no frame 'camera_optical_frame'"),
        ({"tf_static", "tf"}, "TF knows no frame"),
    ],
)
def test_what_is_missing_is_said_in_one_line_with_a_cure(tmp_path, without, what):
    path = bags.write_recording(tmp_path / "run.mcap", without=without)
    with pytest.raises(RecordingError, match=what) as caught:
        open_(path)
    assert str(path) in str(caught.value)
    assert caught.value.cure
    assert "\n" not in str(caught.value)


def test_without_motion_a_recording_opens_and_its_poses_say_why(tmp_path):
    recording = open_(bags.write_recording(tmp_path / "run.mcap", without={"odom", "tf"}))
    assert "poses" not in recording.streams
    with pytest.raises(RecordingError, match=r"no poses.*--topic odometry="):
        recording.poses()


def test_tf_gives_the_poses_where_there_is_no_odometry(tmp_path):
    recording = open_(bags.write_recording(tmp_path / "run.mcap", without={"odom"}))
    assert recording.base_frame == "base_link"
    assert np.allclose([pose.T_odom_base for pose in recording.poses()], [bags.pose_at(i) for i in range(5)])


def test_odom_to_base_may_be_a_chain(tmp_path):
    T_footprint_base = make_transform(np.eye(3), [0, 0, 0.3])
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        write_camera(bag, 4)
        bag.transform(bags.START_NS, "base_footprint", "base_link", T_footprint_base, static=True)
        bag.transform(bags.START_NS, "base_link", FRAME, bags.T_BASE_OPTICAL, static=True)
        for index in range(4):
            bag.transform(bags.stamp(index), "map", "odom", np.eye(4))
            bag.transform(bags.stamp(index), "odom", "base_footprint", bags.pose_at(index))
    recording = open_(tmp_path / "run.mcap")
    assert recording.base_frame == "base_link"
    poses = list(recording.poses())
    assert np.allclose(poses[3].T_odom_base, bags.pose_at(3) @ T_footprint_base)


def write_camera(bag, count, frame_id=FRAME, depth_frame=None):
    for index in range(count):
        bag.camera_info("/camera/color/camera_info", bags.stamp(index), frame_id, SIZE, K)
        bag.image("/camera/color/image_raw", bags.stamp(index), frame_id, bags.color_image(index), "rgb8")
        bag.image("/camera/depth/image_raw", bags.stamp(index), depth_frame or frame_id, bags.depth_image(), "16UC1")


@pytest.mark.parametrize("covariance", [False, True])
def test_poses_of_the_camera_itself_need_no_tf(tmp_path, covariance):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        write_camera(bag, 3)
        for index in range(3):
            bag.pose("/slam/pose", bags.stamp(index), "world", bags.pose_at(index), covariance=covariance)
    recording = open_(tmp_path / "run.mcap")
    assert recording.base_frame == FRAME
    assert np.array_equal(next(recording.frames()).T_base_camera, np.eye(4))
    assert len(list(recording.poses())) == 3
    assert any("does not say what it moves" in line for line in recording.warnings)


def test_odometry_of_another_frame_is_carried_over_to_the_base(tmp_path):
    T_base_imu = make_transform(np.eye(3), [0.5, 0, 0])
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        write_camera(bag, 3)
        bag.transform(bags.START_NS, "base_link", "imu", T_base_imu, static=True)
        bag.transform(bags.START_NS, "base_link", FRAME, bags.T_BASE_OPTICAL, static=True)
        for index in range(3):
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index), child_frame_id="imu")
    assert open_(tmp_path / "run.mcap").base_frame == "imu"
    recording = open_(tmp_path / "run.mcap", frames={"base": "base_link"})
    assert recording.base_frame == "base_link"
    assert np.allclose(next(recording.poses()).T_odom_base, inverse(T_base_imu))


def test_poses_that_are_not_finite_are_left_out_with_a_warning(tmp_path):
    recording = open_(bags.write_recording(tmp_path / "run.mcap", broken_poses={1, 2}))
    assert [pose.stamp_ns for pose in recording.poses()] == [bags.stamp(i) for i in (0, 3, 4)]
    assert any("/odom at 0.100 s" in line and "not finite, 2 pose(s)" in line for line in recording.warnings)


def test_only_poses_that_are_not_finite_are_an_error(tmp_path):
    recording = open_(bags.write_recording(tmp_path / "run.mcap", broken_poses=range(5)))
    with pytest.raises(RecordingError, match=r"no usable poses.*all 5 left out \(.*not finite\).*run.mcap, /odom"):
        list(recording.poses())


def test_colour_and_depth_are_paired_by_stamp_within_the_tolerance(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        bag.transform(bags.START_NS, "base_link", FRAME, bags.T_BASE_OPTICAL, static=True)
        bag.camera_info("/camera/color/camera_info", bags.START_NS, FRAME, SIZE, K)
        for index, off_ms in enumerate((0, 15, -15, 30, 5)):
            at = bags.stamp(index + 1)
            bag.image("/camera/color/image_raw", at, FRAME, bags.color_image(index), "rgb8")
            depth = np.full((bags.HEIGHT, bags.WIDTH), 1000 + index, np.uint16)
            late = at + 200_000_000
            bag.image("/camera/depth/image_raw", at + off_ms * 10**6, FRAME, depth, "16UC1", log_ns=late)
            bag.odometry("/odom", at, np.eye(4))
    recording = open_(tmp_path / "run.mcap")
    frames = list(recording.frames())
    assert [frame.stamp_ns for frame in frames] == [bags.stamp(i) for i in (1, 2, 3, 5)]
    assert np.allclose([frame.depth_m[0, 0] for frame in frames], [1.0, 1.001, 1.002, 1.004])
    assert any("1 of 5 images have no depth" in line for line in recording.warnings)
    assert len(open_(tmp_path / "run.mcap", sync_tolerance_s=0.04).frame_stamps_ns()) == 5


def test_depth_that_never_fits_is_an_error(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        bag.transform(bags.START_NS, "base_link", FRAME, bags.T_BASE_OPTICAL, static=True)
        bag.camera_info("/camera/color/camera_info", bags.START_NS, FRAME, SIZE, K)
        for index in range(3):
            bag.image("/camera/color/image_raw", bags.stamp(index), FRAME, bags.color_image(index), "rgb8")
            bag.image("/camera/depth/image_raw", bags.stamp(index) + 50_000_000, FRAME, bags.depth_image(), "16UC1")
    with pytest.raises(RecordingError, match=r"nearest is 0\.050 s off.*sync_tolerance_s"):
        open_(tmp_path / "run.mcap").frame_stamps_ns()


def test_an_unknown_encoding_names_topic_and_cure(tmp_path):
    with pytest.raises(RecordingError, match=r"'rgb565' \(.*run.mcap, /camera/color/image_raw\): .*name another topic"):
        open_(bags.write_recording(tmp_path / "run.mcap", color_encoding="rgb565"))


def test_an_unknown_encoding_in_the_middle_names_the_time_too(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        write_camera(bag, 2)
        bag.odometry("/odom", bags.START_NS, np.eye(4), child_frame_id=FRAME)
        bag.image("/camera/color/image_raw", bags.stamp(2), FRAME, bags.color_image(2), "strange8")
        bag.image("/camera/depth/image_raw", bags.stamp(2), FRAME, bags.depth_image(), "16UC1")
    with pytest.raises(RecordingError, match=r"'strange8' \(.*run.mcap, /camera/color/image_raw at 0.200 s\)"):
        list(open_(tmp_path / "run.mcap").frames())


def test_broken_images_are_left_out_with_a_warning_unless_all_are_broken(tmp_path):
    def write(path, broken):
        with bags.BagWriter(path) as bag:
            bag.odometry("/odom", bags.START_NS, np.eye(4), child_frame_id=FRAME)
            bag.camera_info("/camera/color/camera_info", bags.START_NS, FRAME, SIZE, K)
            for index in range(3):
                png = b"\x89PNG broken" if index in broken else None
                data = png or bags.compressed_depth_png(bags.depth_image())
                form = "16UC1; compressedDepth png"
                bag.image("/camera/color/image_raw", bags.stamp(index), FRAME, bags.color_image(index), "rgb8")
                bag.compressed("/camera/depth/image_raw/compressedDepth", bags.stamp(index), FRAME, data, form)
        return open_(path)

    recording = write(tmp_path / "one.mcap", {1})
    assert [frame.stamp_ns for frame in recording.frames()] == [bags.stamp(0), bags.stamp(2)]
    assert any("at 0.100 s" in line and "1 camera frame(s) left out" in line for line in recording.warnings)
    chosen = {bags.stamp(1), bags.stamp(2)}
    with pytest.raises(RecordingError, match="none of 2 camera frames can be used"):
        list(write(tmp_path / "all.mcap", {1, 2}).frames(chosen.__contains__))
    rest_of_a_resumed_build = {bags.stamp(2)}
    assert list(write(tmp_path / "last.mcap", {1, 2}).frames(rest_of_a_resumed_build.__contains__)) == []


def test_an_upright_camera_frame_is_the_cameras_body_and_turned_unless_the_user_names_it(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        write_camera(bag, 1, frame_id="camera_link")
        bag.transform(bags.START_NS, "base_link", "camera_link", np.eye(4), static=True)
        bag.odometry("/odom", bags.START_NS, np.eye(4))
    recording = open_(tmp_path / "run.mcap")
    assert np.allclose(next(recording.frames()).T_base_camera[:3, 2], [1, 0, 0])
    assert any("'camera_link', which stands upright in TF" in line for line in recording.warnings)
    kept = open_(tmp_path / "run.mcap", frames={"camera": "camera_link"})
    assert np.array_equal(next(kept.frames()).T_base_camera, np.eye(4))
    mounted = open_(tmp_path / "run.mcap", mounts={"camera": "1 0 0.5 0 0 0"})
    assert np.allclose(next(mounted.frames()).T_base_camera[:3, 3], [1, 0, 0.5])
    assert np.allclose(next(mounted.frames()).T_base_camera[:3, 2], [1, 0, 0])


def test_a_camera_on_a_moving_head_moves(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        for index in range(5):
            lift = make_transform(np.eye(3), [0, 0, index / 10])
            bag.transform(bags.stamp(index), "base_link", "head", lift)
        bag.transform(bags.START_NS, "head", FRAME, bags.T_BASE_OPTICAL, static=True)
        write_camera(bag, 5)
        bag.odometry("/odom", bags.START_NS, np.eye(4))
    heights = [frame.T_base_camera[2, 3] for frame in open_(tmp_path / "run.mcap").frames()]
    assert np.allclose(heights, [0.5, 0.6, 0.7, 0.8, 0.9])


def test_a_forced_panorama_needs_no_calibration(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        bag.image("/camera/image", bags.START_NS, FRAME, bags.color_image(0)[:32], "rgb8")
        bag.image("/camera/depth", bags.START_NS, FRAME, bags.depth_image()[:32], "16UC1")
        bag.odometry("/odom", bags.START_NS, np.eye(4), child_frame_id=FRAME)
    frame = next(open_(tmp_path / "run.mcap", camera="equirectangular").frames())
    assert frame.camera == EquirectangularCamera(64, 32)


def test_an_image_that_is_not_twice_as_wide_as_high_is_no_panorama(tmp_path):
    path = bags.write_recording(tmp_path / "run.mcap")
    with pytest.raises(
        RecordingError, match=r"64 x 48 pixels is no full panorama.*color/image_raw.*leave out --camera"
    ):
        open_(path, camera="equirectangular")


def test_lidar_sweeps_are_placed_on_the_base(tmp_path):
    recording = open_(bags.write_recording(tmp_path / "run.mcap", without={"depth"}, lidar=True))
    assert recording.streams >= {"color", "lidar", "poses"}
    sweeps = list(recording.sweeps())
    assert [sweep.stamp_ns for sweep in sweeps] == [bags.stamp(i) for i in range(5)]
    assert np.allclose(sweeps[0].T_base_lidar[:3, 3], [0, 0, 0.6])
    assert np.ptp(sweeps[0].point_stamps_ns) == pytest.approx(1e8, rel=0.01)
    assert all(frame.depth_m is None for frame in recording.frames())


def test_imu_samples_are_turned_into_the_base(tmp_path):
    turned = make_transform([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [0, 0, 1])
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        write_camera(bag, 1, frame_id="base_link")
        bag.odometry("/odom", bags.START_NS, np.eye(4))
        bag.transform(bags.START_NS, "base_link", "imu_link", turned, static=True)
        bag.imu("/imu/data", bags.START_NS, "imu_link", (1, 0, 0), (0, 2, 9.8))
    recording = open_(tmp_path / "run.mcap")
    assert "imu" in recording.streams
    sample = next(recording.imu())
    assert np.allclose(sample.angular_rate_base, [0, 1, 0])
    assert np.allclose(sample.specific_force_base, [-2, 0, 9.8])


def test_an_imu_that_tf_does_not_place_is_left_out(tmp_path):
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        write_camera(bag, 1, frame_id="base_link")
        bag.odometry("/odom", bags.START_NS, np.eye(4))
        bag.imu("/imu/data", bags.START_NS, "somewhere", (0, 0, 0), (0, 0, 9.8))
    recording = open_(tmp_path / "run.mcap")
    assert "imu" not in recording.streams
    assert list(recording.imu()) == []
    assert any("'somewhere'" in line for line in recording.warnings)


def test_stamps_of_another_clock_than_the_recorders_count(tmp_path):
    day = 86_400_000_000_000
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        for index in range(30):
            at, log_ns = bags.stamp(index), bags.stamp(index) + day
            bag.camera_info("/camera/color/camera_info", at, FRAME, SIZE, K, log_ns=log_ns)
            bag.image("/camera/color/image_raw", at, FRAME, bags.color_image(index), "rgb8", log_ns=log_ns)
            bag.image("/camera/depth/image_raw", at, FRAME, bags.depth_image(), "16UC1", log_ns=log_ns)
            bag.odometry("/odom", at, bags.pose_at(index), child_frame_id=FRAME, log_ns=log_ns)
    recording = open_(tmp_path / "run.mcap", start_s=1.0, end_s=2.0)
    assert recording.frame_stamps_ns().tolist() == [bags.stamp(i) for i in range(10, 20)]
    assert len(list(recording.frames())) == 10
    assert any("off the time of recording" in line for line in recording.warnings)


def test_a_cut_recording_is_read_up_to_the_cut(tmp_path):
    whole = bags.write_recording(tmp_path / "whole.mcap", frames=40, chunk_size=60_000)
    recording = open_(bags.cut_file(whole, tmp_path / "cut.mcap", 0.5))
    count = len(recording.frame_stamps_ns())
    assert 10 < count < 40
    assert len(list(recording.frames())) == count
    assert any("cut off" in line for line in recording.warnings)


def test_definitions_may_be_missing_from_the_recording(tmp_path):
    recording = open_(bags.write_recording(tmp_path / "run.mcap", definitions=False))
    assert len(list(recording.frames())) == 5
    assert [found.labels for found in recording.detections()] == [("box",)] * 5
