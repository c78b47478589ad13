"""Colour and depth that do not fit together are found out."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.self_calibration import corrected_color_camera, fit_images

CAMERA = PinholeCamera(320, 240, 290.0, 290.0, 160.0, 120.0)
CENTRE = np.array([(CAMERA.width - 1) / 2, (CAMERA.height - 1) / 2])
REAL = Path(__file__).parents[3] / "shared/data/redkitchen.mcap"
MISSING = "the real recording ../shared/data/redkitchen.mcap is not here"
Images = list[tuple[NDArray[np.uint8], NDArray[np.float32]]]


def pictures(scale: float, shift_u: float, shift_v: float) -> Images:
    """Coloured blocks before a wall; the colour image is the depth image's, scaled about the centre and shifted."""
    rng = np.random.default_rng(0)
    centre = np.array([(CAMERA.width - 1) / 2, (CAMERA.height - 1) / 2])
    motion = np.column_stack([np.eye(2) * scale, centre * (1 - scale) + [shift_u, shift_v]])
    images: Images = []
    for _ in range(8):
        rgb = np.full((CAMERA.height, CAMERA.width, 3), 90, np.uint8)
        depth_m = np.full((CAMERA.height, CAMERA.width), 3.0, np.float32)
        for _ in range(9):
            u, v = rng.integers(10, 260), rng.integers(10, 180)
            width, height = rng.integers(20, 60, 2)
            rgb[v : v + height, u : u + width] = rng.integers(0, 255, 3)
            depth_m[v : v + height, u : u + width] = rng.uniform(0.8, 2.0)
        moved = cv2.warpAffine(rgb, motion, (CAMERA.width, CAMERA.height), borderMode=cv2.BORDER_REPLICATE)
        images.append((moved, depth_m))
    return images


def apart(focal_px: float, apart_m: float) -> Images:
    """Blocks before a wall, seen by a colour camera of another focal length that stands beside the depth camera."""
    rng = np.random.default_rng(1)
    images: Images = []
    for _ in range(12):
        rgb = np.full((CAMERA.height, CAMERA.width, 3), 90, np.uint8)
        depth_m = np.full((CAMERA.height, CAMERA.width), 3.0, np.float32)
        for z in sorted(rng.uniform(0.6, 2.2, 9), reverse=True):
            corner = rng.uniform([10, 10], [260, 180])
            far_corner = corner + rng.uniform(20, 60, 2)
            scale = focal_px / CAMERA.fx
            (u0, v0), (u1, v1) = (corner.astype(int), far_corner.astype(int))
            depth_m[v0:v1, u0:u1] = z
            shift = np.array([focal_px * apart_m / z, 0])
            (a0, b0), (a1, b1) = (
                ((pixel - CENTRE) * scale + CENTRE + shift).round().astype(int) for pixel in (corner, far_corner)
            )
            rgb[max(b0, 0) : max(b1, 0), max(a0, 0) : max(a1, 0)] = rng.integers(0, 255, 3)
        images.append((rgb, depth_m))
    return images


def test_no_images_say_nothing() -> None:
    assert fit_images([]) is None
    assert corrected_color_camera([], CAMERA) is None


def test_a_scene_without_jumps_says_nothing() -> None:
    flat = np.full((240, 320), 2.0, np.float32)
    assert fit_images([(np.zeros((240, 320, 3), np.uint8), flat)] * 4) is None


def test_images_that_fit_are_left_alone() -> None:
    fit = fit_images(pictures(1.0, 0.0, 0.0))
    assert fit is not None
    assert (fit.scale, fit.shift_u, fit.shift_v) == pytest.approx((1.0, 0.0, 0.0), abs=0.6)
    assert corrected_color_camera(pictures(1.0, 0.0, 0.0), CAMERA) is None


@pytest.mark.parametrize(("scale", "shift_u", "shift_v"), [(0.9, -8.0, -1.0), (1.1, 5.0, 3.0), (1.0, 12.0, 0.0)])
def test_the_colour_cameras_intrinsics_are_found(scale: float, shift_u: float, shift_v: float) -> None:
    answer = corrected_color_camera(pictures(scale, shift_u, shift_v), CAMERA)
    assert answer is not None
    camera, fit = answer.camera, answer.fit
    assert fit.scale == pytest.approx(scale, abs=0.01)
    assert (fit.shift_u, fit.shift_v) == pytest.approx((shift_u, shift_v), abs=1.5)
    assert camera.fx == pytest.approx(290 * scale, abs=3)
    assert fit.score > fit.score_before


def test_cameras_that_stand_apart_are_told_from_a_shifted_image() -> None:
    answer = corrected_color_camera(apart(focal_px=260.0, apart_m=-0.03), CAMERA)
    assert answer is not None
    assert answer.camera.fx == pytest.approx(260, abs=4)
    assert answer.T_color_depth[:3, 3] == pytest.approx([-0.03, 0, 0], abs=0.008)


def test_halves_of_the_images_that_do_not_say_the_same_say_nothing() -> None:
    assert fit_images(pictures(0.9, -8.0, 0.0) + pictures(1.1, 5.0, 3.0)) is None


def test_a_result_at_the_edge_of_the_search_says_nothing() -> None:
    assert fit_images(pictures(1.0, 26.0, 0.0)) is None


def test_a_recording_of_two_seconds_shows_too_little_to_be_put_right(tmp_path: Path) -> None:
    if not REAL.exists():
        pytest.skip(MISSING)
    with REAL.open("rb") as file:
        (tmp_path / "cut.mcap").write_bytes(file.read(3_000_000))
    recording = open_bag_recording(tmp_path / "cut.mcap", RecordingRequest())
    assert next(recording.frames()).camera.focal_px() == pytest.approx(585)


def test_a_recording_with_a_wrong_colour_calibration_is_put_right() -> None:
    if not REAL.exists():
        pytest.skip(MISSING)
    recording = open_bag_recording(REAL, RecordingRequest())
    first = int(recording.frame_stamps_ns()[0])
    frame = next(recording.frames(lambda stamp_ns: stamp_ns == first))
    assert frame.camera.focal_px() == pytest.approx(525, abs=5), "a Kinect's colour camera, not the 585 px written"
    assert np.linalg.norm(frame.T_base_camera[:3, 3]) == pytest.approx(0.027, abs=0.01)
    assert any("focal length" in warning for warning in recording.warnings)
    trusting = open_bag_recording(REAL, RecordingRequest(fit_color=False))
    assert next(trusting.frames(lambda stamp_ns: stamp_ns == first)).camera.focal_px() == pytest.approx(585)
