"""What the simulated robots carry, and under which names."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.errors import SimulationError
from supermap_cli.simulation.rigs import RIGS, make_rig, rgbd_rig, three_camera_rig
from supermap_cli.types.sensing import MAIN_CAMERA


def yaw_deg(T_base_camera: np.ndarray) -> float:
    """Where the optical axis points, from straight ahead to the left."""
    return float(np.degrees(np.arctan2(T_base_camera[1, 2], T_base_camera[0, 2])))


@pytest.mark.parametrize("name", RIGS)
def test_every_rig_can_be_made_and_has_a_name_and_distinct_topics(name: str) -> None:
    rig = make_rig(name)
    assert rig.name == name
    topics = [topic for camera in rig.cameras for topic in (camera.color_namespace, camera.detections_topic)]
    assert len(set(topics)) == len(topics)
    assert (rig.depth is None) == all(camera.depth_namespace is None for camera in rig.cameras)


def test_an_unknown_rig_is_an_error_that_names_the_known_ones() -> None:
    with pytest.raises(SimulationError, match=r"no rig 'submarine'.*three-cameras"):
        make_rig("submarine")


def test_three_cameras_look_ahead_and_to_both_sides_with_hardly_a_gap_between_their_views() -> None:
    front, left, right = three_camera_rig().cameras
    assert [camera.camera_id for camera in (front, left, right)] == ["front", "left", "right"]
    yaws_deg = [yaw_deg(camera.T_base_camera) for camera in (front, left, right)]
    np.testing.assert_allclose(yaws_deg, [0, 75, -75], atol=1e-9)
    width_deg = np.degrees(2 * np.arctan(front.model.width / 2 / front.model.focal_px()))
    assert 0 < 75 - width_deg < 7


def test_side_cameras_are_mounted_as_the_front_camera_is_but_for_their_yaw() -> None:
    (alone,) = rgbd_rig().cameras
    front, *sides = three_camera_rig().cameras
    np.testing.assert_array_equal(front.T_base_camera, alone.T_base_camera)
    for camera in sides:
        assert camera.model == alone.model
        np.testing.assert_allclose(camera.T_base_camera[2], front.T_base_camera[2], atol=1e-12)
        assert np.linalg.norm(camera.T_base_camera[:2, 3]) == pytest.approx(0.12)


def test_several_cameras_are_named_by_their_place_and_an_only_one_is_not() -> None:
    (alone,) = rgbd_rig().cameras
    assert (alone.camera_id, alone.frame_id) == (MAIN_CAMERA, "camera_color_optical_frame")
    left = three_camera_rig().camera("left")
    assert left.frame_id == "camera_left_color_optical_frame"
    assert left.color_namespace == "/camera_left/color"
    assert left.depth_namespace == "/camera_left/aligned_depth_to_color"
    assert left.detections_topic == "/camera_left/detections"


@pytest.mark.parametrize("camera_id", ["front", "left", "right"])
def test_one_of_the_three_cameras_alone_is_where_it_is_among_them(camera_id: str) -> None:
    (alone,) = make_rig(f"{camera_id}-camera").cameras
    among = three_camera_rig().camera(camera_id)
    assert (alone.camera_id, alone.frame_id) == (camera_id, among.frame_id)
    np.testing.assert_array_equal(alone.T_base_camera, among.T_base_camera)
