"""Camera models: round trips as laws, OpenCV as the independent source."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.errors import CalibrationError
from supermap_cli.geometry.cameras import (
    EquirectangularCamera,
    FisheyeCamera,
    PinholeCamera,
    camera_from_json,
    camera_to_json,
)

PLUMB_BOB = PinholeCamera(640, 480, 520.0, 515.0, 322.0, 238.0, (-0.28, 0.09, 0.0011, -0.0007, -0.012))
RATIONAL = PinholeCamera(640, 480, 560.0, 560.0, 318.0, 242.0, (0.9, -0.6, 0.0004, -0.0003, 0.02, 1.2, -0.4, -0.05))
FISHEYE = FisheyeCamera(640, 480, 190.0, 191.0, 321.0, 239.0, (0.012, -0.006, 0.002, -0.0004))
PLAIN = PinholeCamera(640, 480, 585.0, 585.0, 320.0, 240.0)
CAMERAS = [
    PLAIN,
    PLUMB_BOB,
    RATIONAL,
    FISHEYE,
    FisheyeCamera(320, 240, 100, 100, 160, 120),
    EquirectangularCamera(720, 360),
]
IDS = ["plain", "plumb_bob", "rational", "fisheye", "equidistant", "equirectangular"]


@pytest.mark.parametrize("camera", CAMERAS, ids=IDS)
def test_nothing_projects_to_nothing(camera):
    pixels, seen = camera.project(np.zeros((0, 3)))
    assert pixels.shape == (0, 2)
    assert seen.shape == (0,)
    assert camera.back_project(np.zeros((0, 2)), np.zeros(0)).shape == (0, 3)


@pytest.mark.parametrize("camera", CAMERAS, ids=IDS)
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_pixels_survive_the_way_out_and_back(camera, data):
    u = data.draw(st.floats(-0.49, camera.width - 0.51))
    v = data.draw(st.floats(-0.49, camera.height - 0.51))
    depth = data.draw(st.floats(0.2, 50))
    point = camera.back_project(np.array([[u, v]]), np.array([depth]))
    if not np.isfinite(point).all():
        assert isinstance(camera, FisheyeCamera)  # beyond its circle
        return
    pixel, seen = camera.project(point)
    assert seen.all()
    assert np.allclose(pixel, [[u, v]], atol=1e-4)
    assert np.allclose(camera.depth_of(point), depth)


@pytest.mark.parametrize("camera", CAMERAS, ids=IDS)
def test_rays_are_the_back_projection_of_all_pixels(camera):
    rays = camera.rays()
    assert rays.shape == (camera.height, camera.width, 3)
    assert rays is camera.rays()
    v, u = camera.height // 3, camera.width // 4
    assert np.allclose(rays[v, u] * 2.5, camera.back_project(np.array([[u, v]], float), np.array([2.5]))[0], atol=1e-5)


@pytest.mark.parametrize("camera", [PLUMB_BOB, RATIONAL], ids=["plumb_bob", "rational"])
def test_pinhole_projects_as_opencv_does(camera):
    points = np.random.default_rng(0).uniform([-1, -0.8, 2], [1, 0.8, 5], (200, 3))
    K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(camera.distortion))
    pixels, seen = camera.project(points)
    assert seen.any()
    assert np.allclose(pixels[seen], expected.reshape(-1, 2)[seen], atol=1e-6)


def test_fisheye_projects_as_opencv_does():
    points = np.random.default_rng(1).uniform([-3, -3, 0.5], [3, 3, 4], (200, 3))
    K = np.array([[FISHEYE.fx, 0, FISHEYE.cx], [0, FISHEYE.fy, FISHEYE.cy], [0, 0, 1]])
    expected, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), K, np.array(FISHEYE.distortion))
    pixels, seen = FISHEYE.project(points)
    assert seen.sum() > 50
    assert np.allclose(pixels[seen], expected.reshape(-1, 2)[seen], atol=1e-6)


def test_points_beyond_the_fold_of_the_polynomial_are_not_seen():
    folding = PinholeCamera(640, 480, 300.0, 300.0, 320.0, 240.0, (-0.4, 0.0, 0.0, 0.0))
    radius = np.sqrt(1 / (3 * 0.4))
    points = np.array([[radius * 0.95, 0, 1], [radius * 1.05, 0, 1], [4.0, 0, 1]])
    pixels, seen = folding.project(points)
    assert seen.tolist() == [True, False, False]
    assert np.isfinite(pixels).all()


def test_points_behind_a_perspective_camera_are_not_seen():
    for camera in (PLAIN, PLUMB_BOB, FISHEYE):
        assert not camera.project(np.array([[0, 0, -1.0], [0, 0, 0.0]]))[1].any()


def test_a_fisheye_sees_only_its_circle():
    mask = FisheyeCamera(640, 480, 120, 120, 320, 240).valid_mask()
    assert mask[240, 320]
    assert not mask[0, 0]


def test_a_panorama_looks_all_around():
    panorama = EquirectangularCamera(720, 360)
    points = np.array([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [1e-9, 0, -1], [0, 1, 0], [0, -1, 0]], float)
    pixels, seen = panorama.project(points)
    assert seen.all()
    assert np.allclose(pixels[:3], [[359.5, 179.5], [539.5, 179.5], [179.5, 179.5]])
    assert pixels[4, 1] > 359
    assert -0.51 < pixels[5, 1] < 0
    assert np.allclose(panorama.depth_of(points * 3), 3)


@pytest.mark.parametrize("camera", CAMERAS, ids=IDS)
def test_json_gives_the_same_camera_back(camera):
    assert camera_from_json(camera_to_json(camera)) == camera


@pytest.mark.parametrize(
    "text", ["", "{}", "[]", '{"model": "pinhole"}', '{"model": "magic"}', '{"model": "fisheye", "x": 1}']
)
def test_text_that_is_no_camera_is_refused(text):
    with pytest.raises(CalibrationError):
        camera_from_json(text)


@pytest.mark.parametrize("values", [(0, 480, 1, 1, 0, 0), (640, 480, 0, 1, 0, 0), (640, 480, 1, float("nan"), 0, 0)])
def test_senseless_intrinsics_are_refused(values):
    with pytest.raises(CalibrationError):
        PinholeCamera(*values)
