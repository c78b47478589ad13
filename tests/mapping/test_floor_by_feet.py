"""Where the floor is, by the feet of what stands on it: the floor is at z = -0.3, the camera 1 m above."""

from collections.abc import Iterable

import numpy as np
import pytest

from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.mapping.below_lidar_fov import mask_rays
from supermap_cli.mapping.depth import depth_view
from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.floor_by_feet import FloorByFeet, foot_below
from supermap_cli.mapping.lidar_depth import draw_returns
from supermap_cli.mapping.snapshot import engine_snapshot, restore_engine
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask
from supermap_cli.types.keyframe import Keyframe

CAMERA = EquirectangularCamera(960, 480)
FLOOR_M, EYE_M = -0.3, 0.7
LEVEL = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], float)
THINGS = [(2.0, 0.0), (1.5, 1.2), (2.2, -1.0)]


def pixels_of(keyframe_T: np.ndarray, points: np.ndarray) -> np.ndarray:
    return CAMERA.project((points - keyframe_T[:3, 3]) @ keyframe_T[:3, :3])[0]


def post_mask(T: np.ndarray, x: float, y: float) -> RegionMask:
    """The mask of a thin post, 0.3 m high, on the floor."""
    heights = np.linspace(FLOOR_M, FLOOR_M + 0.3, 100)
    u, v = np.rint(pixels_of(T, np.column_stack([np.full(100, x), np.full(100, y), heights]))).astype(int).T
    pixels = np.zeros((v.max() - v.min() + 1, 5), bool)
    pixels[:] = True
    return RegionMask(int(u.min()) - 2, int(v.min()), pixels)


def look(feet: FloorByFeet, x: float, things: Iterable[tuple[float, float]]) -> None:
    """An image from (x, 0) by a LiDAR that sees only what is above it."""
    T = make_transform(LEVEL, [x, 0.0, EYE_M])
    masks = tuple(post_mask(T, *thing) for thing in things)
    azimuth, height = np.meshgrid(np.linspace(-3, 3, 300), np.linspace(-0.8, 0.0, 30))
    returns = np.column_stack([4 * np.sin(azimuth.ravel()), height.ravel(), 4 * np.cos(azimuth.ravel())])
    rgb = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    keyframe = Keyframe(int(x * 1e9), rgb, draw_returns(CAMERA, returns), CAMERA, T, T, returns)
    boxes = np.array([[m.u0, m.v0, m.u0 + 5, m.v0 + len(m.pixels)] for m in masks], np.float32)
    scores = np.ones(len(masks), np.float32)
    detections = Detections(keyframe.stamp_ns, boxes, scores, ((Hypothesis("post", 1.0),),) * len(masks), masks)
    feet.add(keyframe, depth_view(keyframe, 12.0), detections, np.arange(len(masks)), [])


def test_feet_seen_from_several_places_tell_where_the_floor_is() -> None:
    feet = FloorByFeet()
    for x in np.linspace(-1, 1, 9):
        look(feet, float(x), THINGS)
    assert feet.floor_z == pytest.approx(FLOOR_M, abs=0.05)


def test_one_view_or_one_thing_is_not_enough() -> None:
    once, one = FloorByFeet(), FloorByFeet()
    look(once, 0.0, THINGS)
    for x in np.linspace(-1, 1, 9):
        look(one, float(x), THINGS[:1])
    assert once.floor_z is None
    assert one.floor_z is None


def test_what_walks_along_has_no_foot_in_one_place() -> None:
    feet = FloorByFeet()
    for x in np.linspace(-1, 1, 9):
        look(feet, float(x), [(a + x, b) for a, b in THINGS])
    assert feet.floor_z is None


def test_the_returns_above_a_foot_tell_how_far_off_it_is() -> None:
    T = make_transform(LEVEL, [0.0, 0.0, EYE_M])
    mask = post_mask(T, 2.0, 0.0)
    v, u = np.nonzero(mask.pixels[-2:])
    rays = mask_rays(CAMERA, T, u + mask.u0, v + mask.v0 + len(mask.pixels) - 2)
    foot = foot_below(rays, np.array([[2.0, 0.0, 0.4], [2.0, 0.01, 0.5], [3.9, 1.5, 0.4]]), 0.02)
    assert foot is not None
    assert foot == pytest.approx([2.0, 0.0, FLOOR_M], abs=0.05)


def test_a_robot_that_stands_still_meets_no_feet() -> None:
    feet = FloorByFeet()
    for k in range(9):
        look(feet, 1e-4 * k, THINGS)
    assert feet.floor_z is None


def test_what_was_seen_of_feet_survives_a_snapshot() -> None:
    engine, whole = MappingEngine(), FloorByFeet()
    for x in np.linspace(-1, 1, 9):
        if x == 0:
            engine = restore_engine(engine_snapshot(engine))
        look(engine.feet, float(x), THINGS)
        look(whole, float(x), THINGS)
    assert engine.feet.floor_z == whole.floor_z
    assert whole.floor_z is not None
