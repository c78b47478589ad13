"""Depth taken at another moment than colour."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from supermap_cli.geometry.cameras import FisheyeCamera, PinholeCamera
from supermap_cli.stages.motion_compensation import LEAST_SHIFT_PX, move_depth, shift_px

CAMERA = PinholeCamera(160, 120, 150.0, 150.0, 79.5, 59.5)
FISHEYE = FisheyeCamera(160, 120, 90.0, 90.0, 79.5, 59.5)


def turned(
    yaw_deg: float, pitch_deg: float = 0.0, moved_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> NDArray[np.float64]:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("yx", (yaw_deg, pitch_deg), degrees=True).as_matrix()
    T[:3, 3] = moved_m
    return T


def box_room(camera: PinholeCamera | FisheyeCamera, T_room_camera: NDArray[np.float64]) -> NDArray[np.float32]:
    """Exact depth (h, w) of a room of 6 x 3 x 6 m with the camera inside."""
    u, v = np.meshgrid(np.arange(camera.width, dtype=float), np.arange(camera.height, dtype=float))
    rays = camera.back_project(np.column_stack([u.ravel(), v.ravel()]), np.ones(u.size))
    seen = np.isfinite(rays[:, 2])
    directions = np.where(seen[:, None], rays, 1.0) @ T_room_camera[:3, :3].T
    half = np.array([3.0, 1.5, 3.0])
    along = (np.sign(directions) * half - T_room_camera[:3, 3]) / np.where(directions == 0, 1e-9, directions)
    return np.where(seen, along.min(axis=1), 0).reshape(camera.height, camera.width).astype(np.float32)


@pytest.mark.parametrize("camera", [CAMERA, FISHEYE], ids=["pinhole", "fisheye"])
@settings(max_examples=25, deadline=None)
@given(yaw_deg=st.floats(-3, 3), pitch_deg=st.floats(-2, 2), ahead_m=st.floats(-0.05, 0.05))
def test_moved_depth_is_what_the_camera_would_have_measured(camera, yaw_deg, pitch_deg, ahead_m):
    T_color_depth = turned(yaw_deg, pitch_deg, (0.01, 0.0, ahead_m))
    taken = box_room(camera, T_color_depth)
    moved, expected = move_depth(camera, taken, T_color_depth), box_room(camera, np.eye(4))
    both = (moved > 0) & (expected > 0)
    if shift_px(camera, T_color_depth) >= LEAST_SHIFT_PX:
        assert both.mean() > 0.75 * (expected > 0).mean()
        assert np.percentile(np.abs(moved - expected)[both], 95) < 0.06
    assert np.median(np.abs(moved - expected)[both]) < 0.02


def test_where_the_camera_stood_still_the_depth_is_left_as_it_is():
    depth_m = box_room(CAMERA, np.eye(4))
    assert move_depth(CAMERA, depth_m, np.eye(4)) is depth_m


def test_what_had_no_return_gets_none():
    depth_m = box_room(CAMERA, np.eye(4))
    depth_m[40:80, 60:100] = 0
    moved = move_depth(CAMERA, depth_m, turned(1.0))
    assert (moved[45:75, 68:92] == 0).all()
    assert np.count_nonzero(moved) > 0.85 * np.count_nonzero(depth_m)
