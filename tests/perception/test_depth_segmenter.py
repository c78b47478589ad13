"""The segmenter `depth`, on scenes of which the truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask
from supermap_depth_segmenter import DepthSegmenterOptions
from supermap_depth_segmenter.segmenter import DepthSegmenter
from support.frames import CAMERA, frame

Box = tuple[float, float, float, float]
RAYS = CAMERA.rays().astype(np.float64)


def plane(normal: tuple[float, float, float], distance: float) -> FloatArray:
    """(h, w) depth of the plane {X: normal . X = distance} in the optical frame; infinity where it is not met."""
    along = RAYS @ np.array(normal)
    with np.errstate(divide="ignore"):
        depth = np.where(along > 1e-6, distance / along, np.inf)
    return np.where(depth > 0, depth, np.inf)


def block(u0: int, v0: int, u1: int, v1: int, depth_m: float) -> FloatArray:
    """(h, w) an upright face at a depth."""
    depth = np.full(RAYS.shape[:2], np.inf)
    depth[v0:v1, u0:u1] = depth_m
    return depth


def scene(*surfaces: FloatArray) -> NDArray[np.float32]:
    """What a camera with the noise of a Kinect sees: the nearest of the surfaces."""
    nearest = np.minimum.reduce(surfaces)
    noise = (
        np.random.default_rng(0).normal(size=nearest.shape) * 1.4e-3 * np.where(np.isfinite(nearest), nearest, 0) ** 2
    )
    return np.where(np.isfinite(nearest), nearest + noise, 0).astype(np.float32)


def boxes(*found: tuple[Box, str]) -> Detections:
    return Detections(
        1,
        np.array([box for box, _ in found], np.float32).reshape(-1, 4),
        np.full(len(found), 0.8, np.float32),
        tuple((Hypothesis(label, 0.8),) for _, label in found),
        (None,) * len(found),
    )


def segment(depth_m: NDArray[np.float32] | None, detections: Detections) -> list[BoolArray | None]:
    masks = DepthSegmenter(DepthSegmenterOptions()).segment(frame(depth_m=depth_m), detections)
    return [None if mask is None else mask.full(CAMERA.height, CAMERA.width) for mask in masks]


def iou(a: BoolArray | None, b: BoolArray) -> float:
    assert a is not None
    return float((a & b).sum() / (a | b).sum())


def where(u0: int, v0: int, u1: int, v1: int) -> BoolArray:
    return np.isfinite(block(u0, v0, u1, v1, 1.0))


TABLE = plane((0.0, 0.8, 0.6), 0.9)
"""A table top seen from above, 37 degrees to the line of sight."""
WALL = plane((0.0, 0.0, 1.0), 3.0)


def test_no_boxes_no_masks() -> None:
    assert segment(scene(WALL), boxes()) == []


def test_without_a_depth_image_nothing_can_be_told() -> None:
    assert segment(None, boxes(((10, 10, 40, 40), "cup"))) == [None]


def test_a_box_without_depth_has_no_mask() -> None:
    depth = scene(WALL)
    depth[20:60, 20:60] = 0
    assert segment(depth, boxes(((22, 22, 58, 58), "cup"))) == [None]


def test_a_box_outside_the_image_has_no_mask() -> None:
    assert segment(scene(WALL), boxes(((170, 10, 190, 40), "cup"))) == [None]


def test_a_mask_that_is_there_is_passed_through() -> None:
    mask = RegionMask(3, 4, np.ones((2, 2), bool))
    given = boxes(((0, 0, 20, 20), "cup")).with_masks((mask,))
    assert DepthSegmenter(DepthSegmenterOptions()).segment(frame(depth_m=scene(WALL)), given) == (mask,)


def test_a_cup_on_a_table_comes_without_the_table() -> None:
    stands_at = float(TABLE[80, 80])
    cup = block(66, 56, 94, 80, stands_at)
    (mask,) = segment(scene(TABLE, cup, WALL), boxes(((65, 55, 95, 82), "cup")))
    assert iou(mask, where(66, 56, 94, 80)) > 0.8
    assert mask is not None
    assert not mask[81:].any()


def test_a_chair_of_slats_comes_without_the_wall_behind() -> None:
    slats = [block(50, v, 100, v + 6, 1.5) for v in range(30, 80, 12)]
    posts = [block(u, 30, u + 6, 84, 1.5) for u in (50, 94)]
    chair = np.isfinite(np.minimum.reduce([*slats, *posts]))
    (mask,) = segment(scene(*slats, *posts, WALL), boxes(((50, 30, 100, 84), "chair")))
    assert iou(mask, chair) > 0.9


def test_a_chair_behind_a_table_comes_without_the_table() -> None:
    table = np.where(np.arange(120)[:, None] >= 70, TABLE, np.inf)
    chair = block(50, 40, 100, 90, 2.2)
    (mask,) = segment(scene(table, chair, WALL), boxes(((50, 40, 100, 80), "chair")))
    assert iou(mask, where(50, 40, 100, 70)) > 0.9


def test_a_table_top_comes_without_the_cup_that_has_a_box_of_its_own() -> None:
    rows, columns = np.mgrid[:120, :160]
    on_top = (rows >= 50) & (rows < 110) & (columns >= 20) & (columns < 140)
    table = np.where(on_top, TABLE, np.inf)
    cup = block(70, 66, 90, 84, float(TABLE[84, 80]))
    floor = plane((0.0, 0.8, 0.6), 1.6)
    found = boxes(((20, 50, 140, 110), "dining table"), ((69, 65, 91, 85), "cup"))
    table_mask, cup_mask = segment(scene(table, cup, floor), found)
    assert table_mask is not None
    assert cup_mask is not None
    assert not (table_mask & cup_mask).any()
    assert iou(table_mask, on_top & ~where(70, 66, 90, 84)) > 0.9


@pytest.mark.parametrize("surface", [TABLE, WALL], ids=["a book on a table", "a screen on a wall"])
def test_a_flat_thing_is_its_box_a_little_smaller(surface: FloatArray) -> None:
    (mask,) = segment(scene(surface), boxes(((50, 50, 110, 90), "book")))
    assert iou(mask, where(50, 50, 110, 90)) > 0.7
    assert mask is not None
    assert not (mask & ~where(50, 50, 110, 90)).any()


def test_large_boxes_are_sampled_and_still_covered() -> None:
    near = block(10, 10, 150, 110, 1.0)
    few = DepthSegmenter(DepthSegmenterOptions(samples=400))
    (mask,) = few.segment(frame(depth_m=scene(near, WALL)), boxes(((10, 10, 150, 110), "bed")))
    assert mask is not None
    assert iou(mask.full(120, 160), where(10, 10, 150, 110)) > 0.85
