"""From masks to points: what bleeds off an object does not come along."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy import ndimage

from supermap_cli.mapping.clusters import joined_clusters
from supermap_cli.mapping.depth import depth_view
from supermap_cli.mapping.lifting import DEFAULT, LiftedDetection, is_truncated, lift
from supermap_cli.mapping.mask_core import erode, erosion_px
from supermap_cli.types.detections import Detections, no_detections
from support import scenes as s

EYE = s.looking((0, 0, 1.2), (1.6, 0, 0.4))
SCENE = s.render((*s.ROOM, s.BOX), EYE)
BOX = 2
NARROW = s.Thing("bottle", (1.6, 0, 0.5), (0.05, 0.05, 1.0))


def lift_all(scene: s.Scene, detections: Detections) -> list[LiftedDetection]:
    return lift(scene.keyframe, depth_view(scene.keyframe, 6.0), detections, np.arange(len(detections)))


def lift_mask(scene: s.Scene, mask: NDArray[np.bool_], label: str = "box") -> LiftedDetection:
    (one,) = lift_all(scene, s.detections_of([mask], [[(label, 0.8)]]))
    return one


def outside_m(points: NDArray[np.float64], thing: s.Thing) -> NDArray[np.float64]:
    """(n,) how far points lie outside an unturned box."""
    beyond = np.abs(points - thing.center) - np.array(thing.size) / 2
    return np.linalg.norm(np.maximum(beyond, 0), axis=1)


def test_no_detections_give_no_points() -> None:
    assert lift_all(SCENE, no_detections(0)) == []


def test_a_detection_without_a_mask_or_depth_is_left_out() -> None:
    found = s.detect(SCENE)
    assert lift_all(SCENE, found.with_masks((None,))) == []
    without_depth = s.render((), EYE)
    assert lift_all(without_depth, found) == []


def test_points_lie_on_the_thing_and_have_its_colour() -> None:
    one = s.lifted(SCENE, BOX)
    assert len(one.points_map) > 200
    assert outside_m(one.points_map, s.BOX).max() < 1e-3
    assert (one.rgb == s.BOX.rgb).all()
    assert np.linalg.norm(one.centroid_map - s.BOX.center) < 0.3
    assert one.extent_m == pytest.approx(0.4, abs=0.1)


@pytest.mark.parametrize("bleeding_px", [2, 5, 8])
def test_a_mask_that_bleeds_onto_the_wall_behind_lifts_only_the_thing(bleeding_px: int) -> None:
    thing = s.BOX.at(1.6, 0, 1.2)
    scene = s.render((*s.ROOM, thing), s.looking((0, 0, 1.2), (1.6, 0, 1.2)))
    mask = ndimage.binary_dilation(scene.mask(BOX), iterations=bleeding_px)
    assert outside_m(lift_mask(scene, mask).points_map, thing).max() < 1e-3


def test_a_mask_that_lies_half_beside_a_thing_takes_the_body_it_is_mostly_made_of() -> None:
    thing = s.BOX.at(1.6, 0, 1.2)
    scene = s.render((*s.ROOM, thing), s.looking((0, 0, 1.2), (1.6, 0, 1.2)))
    mask = np.roll(scene.mask(BOX), 8, axis=1)
    assert outside_m(lift_mask(scene, mask).points_map, thing).max() < 1e-3


def test_both_parts_of_a_thing_cut_in_two_by_something_thin_are_lifted() -> None:
    thing = s.Thing("box", (1.5, 0, 0.3), (0.2, 0.24, 0.6))
    wire = s.Thing("", (1.37, 0, 0.5), (0.01, 0.02, 1.0))
    scene = s.render((*s.ROOM, thing, wire), EYE)
    y = lift_mask(scene, scene.mask(BOX)).points_map[:, 1]
    assert y.min() < -0.05
    assert y.max() > 0.05


def test_a_thin_thing_does_not_vanish() -> None:
    scene = s.render((*s.ROOM, NARROW), EYE)
    one = lift_mask(scene, scene.mask(2), "bottle")
    assert one.core.any()
    assert outside_m(one.points_map, NARROW).max() < 0.01


def test_large_masks_are_thinned_out_evenly() -> None:
    close = s.Thing("box", (0.6, 0, 1.2), (0.2, 0.6, 0.45))
    scene = s.render((close,), s.looking((0, 0, 1.2), (1, 0, 1.2)))
    assert scene.mask(0).sum() > DEFAULT.max_points
    one = lift_mask(scene, scene.mask(0))
    assert len(one.points_map) == DEFAULT.max_points
    assert np.ptp(one.points_map[:, 2]) > 0.35


def test_what_came_with_the_detection_stays_with_it() -> None:
    found = s.detections_of([SCENE.mask(BOX)], [[("box", 0.6), ("suitcase", 0.3)]])
    (one,) = lift(SCENE.keyframe, depth_view(SCENE.keyframe, 6.0), found, np.array([17]))
    assert (one.index, one.track_id, one.score) == (0, 17, pytest.approx(0.6))
    assert [each.label for each in one.hypotheses] == ["box", "suitcase"]
    assert not one.truncated


def test_a_thing_at_the_border_is_truncated() -> None:
    scene = s.render((*s.ROOM, s.BOX), s.looking((0, 0, 1.2), (1.6, 1.1, 0.4)))
    assert s.lifted(scene, BOX).truncated


@pytest.mark.parametrize(
    ("box", "truncated"),
    [
        ((10, 10, 100, 100), False),
        ((1, 10, 100, 100), True),
        ((10, 1, 100, 100), True),
        ((10, 10, 158, 100), True),
        ((10, 10, 100, 118), True),
    ],
)
def test_a_box_is_truncated_at_any_side(box: tuple[int, int, int, int], truncated: bool) -> None:
    assert is_truncated(np.array(box, np.float32), s.CAMERA) == truncated


@given(hnp.arrays(bool, (12, 14)), st.integers(1, 6))
def test_an_eroded_mask_never_loses_more_than_two_thirds(mask: NDArray[np.bool_], margin_px: int) -> None:
    core = erode(mask, margin_px)
    assert 3 * core.sum() >= mask.sum()
    assert not (core & ~mask).any()


def test_erosion_cuts_back_by_the_margin() -> None:
    mask = np.zeros((40, 40), bool)
    mask[5:35, 5:35] = True
    core = erode(mask, 3)
    assert core[8:32, 12:28].all()
    assert not core[:8, 12:28].any()
    assert not core[32:, 12:28].any()


def test_a_mask_that_fills_its_region_is_eroded_at_the_regions_border() -> None:
    core = erode(np.ones((30, 30), bool), 3)
    assert core[3:27, 12:18].all()
    assert not core[:3, 12:18].any()
    assert not core[12:18, 27:].any()


@pytest.mark.parametrize(
    ("side_px", "width_px", "margin_px"), [(5, 640, 2), (50, 640, 4), (400, 640, 6), (200, 320, 3)]
)
def test_the_margin_grows_with_the_mask_and_the_image(side_px: int, width_px: int, margin_px: int) -> None:
    assert erosion_px(side_px**2, width_px / 640) == margin_px


LAMP = s.Thing("lamp", (1.6, 0, 0.75), (0.02, 0.02, 1.5))


@pytest.mark.parametrize("bleeding_px", [0, 1])
def test_a_pole_that_is_nothing_but_rim_is_lifted_and_the_wall_behind_it_is_not(bleeding_px: int) -> None:
    scene = s.render((*s.ROOM, LAMP), s.looking((0, 0, 1.2), (1.6, 0, 0.8)))
    mask = ndimage.binary_dilation(scene.mask(BOX), iterations=bleeding_px) if bleeding_px else scene.mask(BOX)
    points = lift_mask(scene, mask, "lamp").points_map
    assert np.ptp(points[:, 2]) > 0.9
    assert outside_m(points, LAMP).max() < 0.03


def test_the_rim_on_the_floor_beside_a_thing_is_not_lifted() -> None:
    bled = ndimage.binary_dilation(SCENE.mask(BOX), iterations=3)
    assert lift_mask(SCENE, bled).points_map[:, 2].min() > -0.001
    assert outside_m(lift_mask(SCENE, bled).points_map, s.BOX).max() < 0.02


def test_the_far_half_of_a_long_thing_cut_in_two_is_lifted_too() -> None:
    board = s.Thing("table", (1.8, 0, 0.5), (0.1, 1.6, 0.5))
    post = s.Thing("", (1.5, 0.1, 0.5), (0.03, 0.03, 1.0))
    scene = s.render((*s.ROOM, board, post), EYE)
    y = lift_mask(scene, scene.mask(BOX), "table").points_map[:, 1]
    assert y.min() < -0.6
    assert y.max() > 0.6


def test_the_top_of_a_table_at_a_grazing_angle_is_no_depth_edge() -> None:
    table = s.Thing("table", (2.0, 0, 0.55), (2.4, 1.6, 0.1))
    scene = s.render((*s.ROOM, table), s.looking((0, 0, 0.85), (2.0, 0, 0.6)))
    points = s.lifted(scene, 2).points_map
    on_top = np.abs(points[:, 2] - 0.6) < 0.02
    assert points[on_top, 0].max() - points[on_top, 0].min() > 1.5


def test_narrow_parts_of_a_mask_keep_their_middle() -> None:
    mask = np.zeros((80, 80), bool)
    mask[5:45, 5:75] = True
    mask[45:78, 10:14] = True
    core = erode(mask, 6)
    assert core[50:70, 10:14].any(axis=1).all()
    assert not core[50:70, 10].any()
    assert not core[5:11, 15:65].any()


def test_a_thing_goes_on_on_the_other_side_of_what_stands_before_it() -> None:
    desk = s.Thing("desk", (2.2, 0, 0.5), (0.5, 2.0, 1.0))
    post = s.Thing("post", (1.2, 0, 0.7), (0.1, 0.4, 1.4))
    scene = s.render((*s.ROOM, desk, post), s.looking((0, 0, 1.0), (2.2, 0, 0.6)))
    points = s.lifted(scene, 2).points_map
    assert points[:, 1].min() < -0.7
    assert points[:, 1].max() > 0.7


def test_the_wall_beside_what_stands_before_a_thing_is_not_the_thing() -> None:
    """A mask holds a box and, beyond a post before both, a piece of the wall far behind."""
    box = s.Thing("box", (1.6, -0.5, 0.6), (0.4, 0.6, 0.6))
    post = s.Thing("post", (1.0, -0.05, 0.7), (0.1, 0.2, 1.4))
    scene = s.render((*s.ROOM, box, post), s.looking((0, 0, 1.0), (2.2, 0, 0.6)))
    rows, columns = np.nonzero(scene.owner == 3)
    patch = np.zeros_like(scene.owner, bool)
    patch[rows.min() + 20 : rows.min() + 40, columns.min() - 22 : columns.min()] = True
    mask = scene.mask(2) | (patch & (scene.owner == 1))
    assert (mask & (scene.owner == 1)).sum() > 100
    found = s.detections_of([mask], [[("box", 0.8)]])
    (one,) = lift(scene.keyframe, depth_view(scene.keyframe, 6.0), found, np.array([-1]))
    assert one.points_map[:, 0].max() < 2.0


def test_bodies_of_the_image_are_joined_where_they_meet_in_space() -> None:
    x = np.array([0.0, 0.02, 0.5, 0.52, 0.54, 1.5])
    points = np.column_stack([x, np.zeros_like(x), np.ones_like(x)])
    joined = joined_clusters(points, 0.03, np.array([1, 2, 2, 3, 4, 5]))
    np.testing.assert_array_equal(joined[:, None] == joined, np.equal.outer(*[np.array([0, 0, 0, 0, 0, 1])] * 2))
    assert not joined_clusters(points, 0.03, np.ones(6, np.int64)).any()
