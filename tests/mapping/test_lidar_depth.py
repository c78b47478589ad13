"""A depth image drawn of a LiDAR's returns, each moved to where it was at its own time."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.geometry.se3 import inverse, make_transform, transform_points
from supermap_cli.mapping.lidar_depth import close_gaps, deskew_to_odom, draw_returns
from supermap_cli.types.sensing import Sweep

COLOR = PinholeCamera(64, 48, 60.0, 60.0, 31.5, 23.5)


def driving(stamp_ns: int) -> np.ndarray:
    """1 m/s along x, and turning at 0.5 rad/s."""
    seconds = stamp_ns / 1e9
    c, s = np.cos(seconds / 2), np.sin(seconds / 2)
    return make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [seconds, 0, 0])


def everywhere(stamps_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.array([driving(int(stamp)) for stamp in stamps_ns]), np.ones(len(stamps_ns), bool)


def nowhere(stamps_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.tile(np.eye(4), (len(stamps_ns), 1, 1)), np.zeros(len(stamps_ns), bool)


def test_deskewing_puts_every_point_where_it_was() -> None:
    world = np.random.default_rng(0).uniform(-10, 10, (500, 3))
    stamps_ns = np.linspace(0, 1e8, 500).astype(np.int64)
    T_base_lidar = make_transform(np.eye(3), [0.2, 0, 0.5])
    points = [
        transform_points(inverse(driving(int(stamp)) @ T_base_lidar), point[None])[0]
        for point, stamp in zip(world, stamps_ns, strict=True)
    ]
    found = deskew_to_odom(Sweep(0, "lidar", np.array(points), stamps_ns, T_base_lidar), everywhere)
    assert found is not None
    assert np.abs(found - world).max() < 2e-4


def test_without_a_trajectory_there_is_no_deskewed_sweep() -> None:
    assert deskew_to_odom(Sweep(0, "lidar", np.ones((3, 3)), np.zeros(3, np.int64), np.eye(4)), nowhere) is None


def test_rings_of_one_surface_are_closed_but_not_over_an_edge() -> None:
    depth = np.zeros((40, 3), np.float32)
    depth[[0, 10, 20], :] = [[2.0], [2.08], [5.0]]
    closed = close_gaps(depth, 12)
    assert closed[5, 0] == pytest.approx(2.04, abs=2e-3)
    assert not closed[11:20].any()
    assert not closed[21:].any()
    assert not close_gaps(depth, 5)[1:10].any()


def test_no_sweeps_draw_nothing() -> None:
    assert not draw_returns(COLOR, np.zeros((0, 3))).any()
