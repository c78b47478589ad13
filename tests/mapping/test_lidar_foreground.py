"""Which LiDAR returns on a mask are the thing's: a camera at the origin looks along z at a wall 4 m off."""

import numpy as np

from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.mapping.depth import DepthView, depth_view
from supermap_cli.mapping.lidar_depth import draw_returns
from supermap_cli.mapping.lidar_foreground import own_returns
from supermap_cli.types.detections import RegionMask
from supermap_cli.types.keyframe import Keyframe

CAMERA = EquirectangularCamera(960, 480)


def patch(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], count: int) -> np.ndarray:
    """Returns (n, 3) spread over a box, which is flat where two of its bounds are one; y points down."""
    low, high = np.array([x, y, z]).T
    return np.random.default_rng(5).uniform(low, high, (count, 3))


def table(count: int = 25) -> np.ndarray:
    """Four legs, and nothing of a top that all rays graze."""
    return np.concatenate([patch((x, x + 0.04), (0, 0.5), (z, z + 0.04), count) for x in (-0.6, 0.6) for z in (2, 2.7)])


WALL = patch((-2.5, 2.5), (-1, 1), (4.0, 4.0), 6000)


def view_of(*parts: np.ndarray) -> tuple[DepthView, np.ndarray]:
    points = np.concatenate(parts)
    rgb = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    keyframe = Keyframe(0, rgb, draw_returns(CAMERA, points), CAMERA, np.eye(4), np.eye(4), points)
    return depth_view(keyframe, 12.0), points


def mask_about(points: np.ndarray, margin_px: int) -> RegionMask:
    """The image box of points, with a margin."""
    pixels, _ = CAMERA.project(points)
    (u0, v0), (u1, v1) = np.floor(pixels.min(axis=0)) - margin_px, np.ceil(pixels.max(axis=0)) + margin_px
    return RegionMask(int(u0), int(v0), np.ones((int(v1 - v0) + 1, int(u1 - u0) + 1), bool))


def own_points(view: DepthView, points: np.ndarray, mask: RegionMask, *others: RegionMask) -> np.ndarray:
    masked = np.zeros((CAMERA.height, CAMERA.width), bool)
    for one in (mask, *others):
        masked[one.window] |= one.pixels
    core = np.zeros_like(mask.pixels)
    core[2:-2, 2:-2] = True
    return points[own_returns(view, mask, core, masked).which]


def test_of_a_table_its_legs_are_taken_and_not_the_wall_between_them() -> None:
    view, points = view_of(WALL, table())
    own = own_points(view, points, mask_about(table(), 3))
    assert own[:, 2].max() < 3
    assert len(own) > 0.9 * len(table())


def test_a_corner_behind_a_thing_is_none_of_it() -> None:
    """Of a pillar's corner each face lies behind the plane of the other."""
    along = np.linspace(0, 1.5, 2500)
    heights = np.random.default_rng(1).uniform(-1, 1, len(along))
    corner = np.concatenate([np.column_stack([side * along, heights, 3 + along]) for side in (-1, 1)])
    post = patch((-0.05, 0.05), (0, 0.5), (2.2, 2.3), 60)
    view, points = view_of(corner, post)
    own = own_points(view, points, mask_about(post, 8))
    assert len(own)
    assert own[:, 2].max() < 2.5


def test_a_picture_on_a_wall_is_taken_as_its_mask_shows_it() -> None:
    view, points = view_of(WALL)
    own = own_points(view, points, mask_about(patch((-0.5, 0.5), (-0.4, 0.4), (4, 4), 100), 0))
    assert len(own) > 50
    assert np.abs(own[:, 0]).max() < 0.55


def test_what_goes_on_in_the_mask_of_another_is_not_taken() -> None:
    """A mask of a bin that lies over a part of the desk behind it."""
    desk = patch((-0.2, 1.2), (0, 0.4), (2.9, 2.95), 500)
    bin_ = patch((-0.15, 0.1), (0.1, 0.5), (2.2, 2.3), 80)
    view, points = view_of(WALL, desk, bin_)
    own = own_points(view, points, mask_about(bin_, 4), mask_about(desk, 0))
    assert len(own) > 0.8 * len(bin_)
    assert own[:, 2].max() < 2.5


def test_nothing_is_taken_where_no_ray_came() -> None:
    view, points = view_of(WALL)
    below = RegionMask(470, 400, np.ones((20, 20), bool))
    assert not len(own_points(view, points, below))
