"""Sources of the robot's motion that contradict one another."""

import numpy as np

from supermap_cli.geometry.se3 import make_transform
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from support import bags

FRAME = "camera_optical_frame"
FRAMES = 60


def turned(index):
    yaw = 0.05 * index
    R = [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]
    return make_transform(R, [0, 0, 0]) @ bags.pose_at(index)


def open_with(path, odometries, tf=None, **request):
    with bags.BagWriter(path) as bag:
        bag.transform(bags.START_NS, "base_link", FRAME, bags.T_BASE_OPTICAL, static=True)
        for index in range(FRAMES):
            at = bags.stamp(index)
            if index % 5 == 0:
                bags.write_images(bag, index)
            if tf is not None:
                bag.transform(at, "odom", "base_link", tf(index))
            for topic, pose in odometries.items():
                bag.odometry(topic, at, pose(index))
    return open_bag_recording(path, RecordingRequest(**request))


def way_m(recording):
    places = [pose.T_odom_base[:3, 3] for pose in recording.poses()]
    return float(np.linalg.norm(places[-1] - places[0]))


def still(_):
    return np.eye(4)


def told(recording):
    return [line for line in recording.warnings if "another motion" in line or "stands still" in line]


def test_odometry_that_stands_still_loses_to_tf_that_moves(tmp_path):
    recording = open_with(tmp_path / "a.mcap", {"/odom": still}, tf=bags.pose_at)
    assert way_m(recording) > 5
    assert "/odom (odom -> base_link): it stands still while TF" in told(recording)[0]


def test_odometry_that_stands_still_loses_to_another_that_moves(tmp_path):
    assert way_m(open_with(tmp_path / "a.mcap", {"/odom": still, "/visual/odometry": bags.pose_at})) > 5


def test_what_the_user_named_is_used_though_it_stands_still(tmp_path):
    named = {"odometry": "/odom"}
    assert way_m(open_with(tmp_path / "a.mcap", {"/odom": still}, tf=bags.pose_at, topics=named)) == 0


def test_two_odometries_that_disagree_are_named_with_the_option_that_takes_the_other(tmp_path):
    given = {"/odom": bags.pose_at, "/odometry/filtered": turned}
    (line,) = told(open_with(tmp_path / "a.mcap", given))
    used, other = (("/odom", "/odometry/filtered"), ("/odometry/filtered", "/odom"))[line.index("filtered") < 100]
    assert used in line
    assert f"--topic odometry={other} " in line


def test_sources_that_drift_apart_a_little_are_not_named(tmp_path):
    def slipping(index):
        return make_transform(np.eye(3), [index / 9.5, 0.2, 0])

    recording = open_with(tmp_path / "a.mcap", {"/odom": slipping, "/visual/odometry": bags.pose_at}, tf=bags.pose_at)
    assert told(recording) == []


def test_a_robot_that_stands_has_no_odometry_in_doubt(tmp_path):
    assert told(open_with(tmp_path / "a.mcap", {"/odom": still}, tf=still)) == []
