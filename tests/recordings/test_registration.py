"""Depth from another camera on the colour camera's pixels."""

import numpy as np
import pytest

from supermap_cli.geometry.cameras import EquirectangularCamera, PinholeCamera
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.registration import SameCentre, ZBuffer, splat_nearest
from support import bags

COLOR = PinholeCamera(64, 48, 60.0, 60.0, 31.5, 23.5)
HALF = PinholeCamera(32, 24, 30.0, 30.0, 15.5, 11.5)
WIDE = PinholeCamera(80, 60, 50.0, 50.0, 39.5, 29.5)


def test_no_depth_registers_to_no_depth():
    empty = np.zeros((24, 32), np.float32)
    assert not ZBuffer(COLOR, HALF).register(empty, np.eye(4)).any()
    assert not SameCentre(COLOR, HALF).register(empty, np.eye(4)).any()
    assert splat_nearest(COLOR, np.zeros((0, 3)), np.zeros(0, np.int64)).shape == (48, 64)


@pytest.mark.parametrize("depth_camera", [HALF, WIDE], ids=["half the size", "another focal length"])
def test_from_the_same_centre_depth_is_looked_up(depth_camera):
    depth = np.full((depth_camera.height, depth_camera.width), 2.0, np.float32)
    depth[:, : depth_camera.width // 2] = 1.0
    registered = SameCentre(COLOR, depth_camera).register(depth, np.eye(4))
    assert (registered[24, :31] == 1).all()
    assert (registered[24, 33:] == 2).all()


def test_a_panorama_gets_ranges_from_a_depth_camera():
    depth = np.full((60, 80), 2.0, np.float32)
    registered = SameCentre(EquirectangularCamera(360, 180), WIDE).register(depth, np.eye(4))
    assert registered[89, 179] == pytest.approx(2.0, abs=1e-3)
    assert registered[89, 200] == pytest.approx(2.0 / np.cos(np.radians(20.5)), abs=0.02)
    assert registered[89, 10] == 0


def test_a_camera_beside_sees_the_near_thing_shifted_by_its_parallax_and_before_the_wall():
    depth = np.full((60, 80), 4.0, np.float32)
    depth[25:35, 35:45] = 1.0
    T_color_depth = make_transform(np.eye(3), [0.1, 0, 0])
    registered = ZBuffer(COLOR, WIDE).register(depth, T_color_depth)
    near = np.argwhere(np.abs(registered - 1) < 1e-3)
    expected = 31.5 + 60 * 0.1
    assert near[:, 1].mean() == pytest.approx(expected, abs=0.7)
    assert (registered > 0)[4:-4, 10:-4].mean() > 0.97


def test_depth_in_its_own_frame_is_registered_when_read(tmp_path):
    frame, depth_frame = "color_optical_frame", "depth_optical_frame"
    with bags.BagWriter(tmp_path / "run.mcap") as bag:
        bag.transform(bags.START_NS, "base_link", frame, bags.T_BASE_OPTICAL, static=True)
        bag.transform(bags.START_NS, frame, depth_frame, make_transform(np.eye(3), [0.1, 0, 0]), static=True)
        bag.camera_info("/color/camera_info", bags.START_NS, frame, (64, 48), (60, 60, 31.5, 23.5))
        bag.camera_info("/depth/camera_info", bags.START_NS, depth_frame, (80, 60), (50, 50, 39.5, 29.5))
        bag.image("/color/image", bags.START_NS, frame, bags.color_image(0), "rgb8")
        bag.image("/depth/image", bags.START_NS, depth_frame, np.full((60, 80), 2000, np.uint16), "16UC1")
        bag.odometry("/odom", bags.START_NS, np.eye(4))
    frame_ = next(open_bag_recording(tmp_path / "run.mcap", RecordingRequest()).frames())
    assert np.allclose(frame_.depth_m[frame_.depth_m > 0], 2.0, atol=1e-4)
    assert (frame_.depth_m > 0).mean() > 0.9
