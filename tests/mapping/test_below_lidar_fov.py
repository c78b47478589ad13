"""What stands beneath a LiDAR's lowest ray is placed by its foot on the floor, or hangs down from what is measured."""

import numpy as np
import pytest

from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.mapping.below_lidar_fov import (
    covered_below,
    extend_down,
    lowest_returns,
    mask_rays,
    place_on_floor,
)
from supermap_cli.types.detections import RegionMask

CAMERA = EquirectangularCamera(1440, 720)
EYE_M, WALL_M, RADIUS_M, TOP_M = 0.95, 4.0, 0.15, 0.4
T_MAP_CAMERA = make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0.0, 0.0, EYE_M])
"""Level, looking along x."""


def wall_above(lowest_deg: float) -> np.ndarray:
    """A round wall, 4 m off, that is measured down to so many degrees beneath the horizon."""
    depth_m = np.zeros((720, 1440), np.float32)
    row = round(360 + lowest_deg * 4)
    latitude = ((np.arange(720) + 0.5) / 720 - 0.5) * np.pi
    depth_m[200:row] = (WALL_M / np.cos(latitude[200:row]))[:, None]
    return depth_m


def seen_bin(distance_m: float) -> RegionMask:
    """The mask of an upright cylinder on the floor, straight ahead."""
    azimuth = np.linspace(0, 2 * np.pi, 400)
    rings = [
        np.column_stack([distance_m + RADIUS_M * np.cos(azimuth), RADIUS_M * np.sin(azimuth), np.full(len(azimuth), z)])
        for z in np.linspace(0, TOP_M, 80)
    ]
    points = np.concatenate(rings) - T_MAP_CAMERA[:3, 3]
    pixels, _ = CAMERA.project(points @ T_MAP_CAMERA[:3, :3])
    u, v = np.rint(pixels).astype(int).T
    u0, v0 = u.min(), v.min()
    mask = np.zeros((v.max() - v0 + 1, u.max() - u0 + 1), bool)
    mask[v - v0, u - u0] = True
    for column in mask.T:
        set_rows = np.flatnonzero(column)
        column[set_rows[0] : set_rows[-1] + 1] = True
    return RegionMask(int(u0), int(v0), mask)


def rays_of(mask: RegionMask):
    v, u = np.nonzero(mask.pixels)
    return mask_rays(CAMERA, T_MAP_CAMERA, u + mask.u0, v + mask.v0)


@pytest.mark.parametrize("distance_m", [1.2, 2.0, 2.8])
def test_a_thing_beneath_all_returns_stands_where_its_mask_meets_the_floor(distance_m: float) -> None:
    rays = rays_of(seen_bin(distance_m))
    lowest = lowest_returns(wall_above(6), CAMERA, T_MAP_CAMERA)
    points = place_on_floor(rays, lowest, CAMERA.focal_px(), 0.0, np.zeros(len(rays.u), bool))
    assert points is not None
    low, high = np.percentile(points, (2, 98), axis=0)
    assert (low + high)[:2] / 2 == pytest.approx([distance_m, 0], abs=0.06)
    assert (high - low)[:2] == pytest.approx([2 * RADIUS_M] * 2, abs=0.1)
    assert low[2] == pytest.approx(0, abs=0.06)
    assert high[2] == pytest.approx(TOP_M, abs=0.08)


def test_what_the_lidar_reaches_is_not_placed_by_its_foot() -> None:
    rays = rays_of(seen_bin(2.0))
    lowest = lowest_returns(wall_above(40), CAMERA, T_MAP_CAMERA)
    assert place_on_floor(rays, lowest, CAMERA.focal_px(), 0.0, np.zeros(len(rays.u), bool)) is None


def test_a_foot_behind_another_thing_tells_nothing() -> None:
    mask = seen_bin(2.0)
    rays = rays_of(mask)
    lowest = lowest_returns(wall_above(6), CAMERA, T_MAP_CAMERA)
    h, w = mask.pixels.shape
    before = RegionMask(mask.u0, mask.v0 + h // 2, np.ones((h, w), bool))
    covered = covered_below(mask, [mask, before], rays.u, rays.v, 4)
    assert place_on_floor(rays, lowest, CAMERA.focal_px(), 0.0, covered) is None


def test_a_foot_beyond_the_wall_is_none() -> None:
    rays = rays_of(seen_bin(2.8))
    near_wall = wall_above(6) * np.float32(0.5)
    lowest = lowest_returns(near_wall, CAMERA, T_MAP_CAMERA)
    assert place_on_floor(rays, lowest, CAMERA.focal_px(), 0.0, np.zeros(len(rays.u), bool)) is None


def test_beneath_the_returns_a_surface_goes_on_upright_down_to_the_floor() -> None:
    rays = rays_of(seen_bin(2.0))
    front = np.column_stack([np.full(20, 1.85), np.linspace(-0.1, 0.1, 20), np.full(20, 0.38)])
    pixels, _ = CAMERA.project((front - T_MAP_CAMERA[:3, 3]) @ T_MAP_CAMERA[:3, :3])
    points, kept = extend_down(rays, front, np.rint(pixels[:, 0]).astype(np.int64), 0.0)
    assert len(points) == len(kept)
    assert np.hypot(points[:, 0], points[:, 1]) == pytest.approx(1.85, abs=0.02)
    assert points[:, 2].min() == pytest.approx(0, abs=0.02)
