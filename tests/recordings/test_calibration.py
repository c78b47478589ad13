"""CameraInfo to camera."""

from dataclasses import replace

import numpy as np
import pytest

from supermap_cli.errors import CalibrationError
from supermap_cli.geometry.cameras import EquirectangularCamera, FisheyeCamera, PinholeCamera
from supermap_cli.recordings.calibration import camera_from_calibration
from supermap_cli.recordings.messages import CalibrationMessage

K = np.array([[500.0, 0, 320], [0, 510, 240], [0, 0, 1]])
P = np.array([[450.0, 0, 310, 0], [0, 450, 230, 0], [0, 0, 1, 0]])
INFO = CalibrationMessage(0, "camera", 640, 480, "plumb_bob", (), K, P, (1, 1), (0, 0, 0, 0))


def test_without_distortion_it_is_a_plain_pinhole():
    assert camera_from_calibration(INFO, (640, 480)) == PinholeCamera(640, 480, 500, 510, 320, 240)
    assert camera_from_calibration(replace(INFO, D=(0.0,) * 5), (640, 480)).distortion == ()


@pytest.mark.parametrize(
    ("model", "D", "kind", "length"),
    [
        ("plumb_bob", (0.1, 0.2, 0.01, 0.02, 0.3), PinholeCamera, 5),
        ("plumb_bob", (0.1, 0.2, 0.01, 0.02), PinholeCamera, 5),
        ("rational_polynomial", (0.1, 0.2, 0.0, 0.0, 0.3, 0.4, 0.5, 0.6), PinholeCamera, 8),
        ("rational_polynomial", (0.1, 0.2, 0.0, 0.0, 0.3, 0.4, 0.5, 0.6, 0, 0, 0, 0), PinholeCamera, 8),
        ("equidistant", (0.1, 0.01, 0.0, 0.0), FisheyeCamera, 4),
    ],
)
def test_models_by_their_ros_names(model, D, kind, length):
    camera = camera_from_calibration(replace(INFO, model=model, D=D), (640, 480))
    assert isinstance(camera, kind)
    assert len(camera.distortion) == length
    assert camera.distortion[: len(D)] == D[:length]


def test_an_equirectangular_panorama_needs_no_intrinsics():
    info = replace(INFO, model="equirectangular", K=np.zeros((3, 3)))
    assert camera_from_calibration(info, (1000, 500)) == EquirectangularCamera(1000, 500)
    with pytest.raises(CalibrationError, match="no full panorama"):
        camera_from_calibration(info, (640, 480))


def test_the_region_of_interest_moves_the_principal_point_and_binning_divides():
    info = replace(INFO, roi=(100, 60, 400, 300), binning=(2, 2))
    assert camera_from_calibration(info, (200, 150)) == PinholeCamera(200, 150, 250, 255, 110, 90)


def test_a_scaled_stream_scales_the_calibration():
    camera = camera_from_calibration(INFO, (320, 240))
    assert (camera.fx, camera.fy) == (250, 255)
    assert (camera.cx, camera.cy) == ((320.5) / 2 - 0.5, (240.5) / 2 - 0.5)


def test_rectified_images_follow_the_projection_matrix():
    camera = camera_from_calibration(replace(INFO, D=(0.1, 0, 0, 0, 0)), (640, 480), rectified=True)
    assert camera == PinholeCamera(640, 480, 450, 450, 310, 230)


@pytest.mark.parametrize(
    ("change", "size", "what"),
    [
        ({"K": np.zeros((3, 3)), "P": np.zeros((3, 4))}, (640, 480), "not calibrated"),
        ({"model": "omni", "D": (0.1,)}, (640, 480), "unknown distortion model 'omni'"),
        ({}, (640, 200), "640 x 480 pixels, the image has 640 x 200"),
        ({"model": "rational_polynomial", "D": (0.1,) * 12}, (640, 480), "12 values"),
    ],
)
def test_what_makes_no_sense_is_refused_with_a_cure(change, size, what):
    with pytest.raises(CalibrationError, match=what) as caught:
        camera_from_calibration(replace(INFO, **change), size)
    assert caught.value.cure


@pytest.mark.parametrize("K", [np.zeros((3, 3)), np.full((3, 3), np.nan)])
def test_where_only_p_is_filled_in_it_gives_the_intrinsics(K):
    P = np.array([[500.0, 0, 320, 0], [0, 501, 240, 0], [0, 0, 1, 0]])
    assert camera_from_calibration(replace(INFO, K=K, P=P), (640, 480)) == PinholeCamera(640, 480, 500, 501, 320, 240)


def test_a_model_that_is_not_known_needs_none_without_distortion():
    named = replace(INFO, model="Brown Conrady", D=(0.0,) * 5)
    assert camera_from_calibration(named, (640, 480)) == PinholeCamera(640, 480, 500, 510, 320, 240)
    with pytest.raises(CalibrationError, match="unknown distortion model 'Brown Conrady'"):
        camera_from_calibration(replace(named, D=(0.1,) * 5), (640, 480))
