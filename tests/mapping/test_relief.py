"""Whether what a mask shows stands out from what is around it, and what that says of a thing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from supermap_cli.mapping.belief import Existence, LabelBelief
from supermap_cli.mapping.depth import depth_view
from supermap_cli.mapping.foreground import foreground
from supermap_cli.mapping.mask_core import erode
from supermap_cli.mapping.objects import MapObject, OpenState
from supermap_cli.mapping.relief import DEFAULT, Relief, ReliefLooks, look_at
from supermap_cli.mapping.voxel_map import VoxelMap
from supermap_cli.types.detections import Hypothesis, cut_mask
from support import scenes as s

Mask = NDArray[np.bool_]
PICTURE = s.Thing("picture", (2.99, 0, 1.2), (0.02, 0.8, 0.6))

looks = st.floats(0, 30)


def relief(scene: s.Scene, mask: Mask) -> Relief | None:
    region = cut_mask(mask)
    assert region is not None
    core = erode(region.pixels, 1)
    return foreground(depth_view(scene.keyframe, 6.0), region, lambda: core, mask).relief


def patch(scene: s.Scene, owner: int) -> Mask:
    """The middle part of what is visible of something."""
    v, u = np.nonzero(scene.mask(owner))
    mask = np.zeros(scene.owner.shape, dtype=bool)
    low, high = np.percentile(v, (40, 60)).astype(int), np.percentile(u, (40, 60)).astype(int)
    mask[low[0] : low[1], high[0] : high[1]] = True
    return mask & scene.mask(owner)


@settings(max_examples=15, deadline=None)
@given(side_m=st.floats(-0.8, 0.8), height_m=st.floats(0.9, 1.6))
def test_a_thing_on_the_floor_rises_from_it_and_so_does_what_is_left_of_it(side_m: float, height_m: float) -> None:
    scene = s.render((*s.ROOM, s.BOX), s.looking((0, side_m, height_m), (1.6, 0, 0.3)))
    for px in (0, 2):
        found = relief(scene, erode(scene.mask(2), px) if px else scene.mask(2))
        assert found is not None
        assert found.height_m > 0.5 * s.BOX.size[2]


def test_a_patch_of_the_floor_and_a_picture_on_the_wall_do_not() -> None:
    scene = s.render((*s.ROOM, PICTURE), s.looking((0, 0, 1.0), (2.4, 0, 0.6)))
    for mask in (patch(scene, 0), scene.mask(2)):
        found = relief(scene, mask)
        assert found is not None
        assert found.height_m < 0.05


def test_nothing_is_said_where_no_plane_is_seen() -> None:
    scene = s.render((s.BOX,), s.looking((0, 0, 1.2), (1.6, 0, 0.3)))
    assert relief(scene, scene.mask(0)) is None


def test_a_flat_chair_looks_flat_a_flat_book_is_not_judged() -> None:
    flat = Relief(height_m=0.01, tolerance_m=0.02)
    assert look_at(flat, "chair", 0.5) == ReliefLooks(flat=0.5)
    assert look_at(Relief(0.4, 0.02), "chair", 1.0) == ReliefLooks(raised=1.0)
    assert look_at(flat, "book", 1.0) is None
    assert look_at(None, "chair", 1.0) is None


def test_depth_that_is_too_inexact_for_a_cup_says_nothing_of_one() -> None:
    assert look_at(Relief(0.01, tolerance_m=0.04), "cup", 1.0) is None
    assert look_at(Relief(0.01, tolerance_m=0.02), "cup", 1.0) == ReliefLooks(flat=1.0)


@given(looks, looks, st.floats(0, 5))
def test_each_flat_look_says_more_against_a_thing_and_each_raised_one_less(
    flat: float, raised: float, more: float
) -> None:
    said = ReliefLooks(flat, raised).log_ratio()
    assert np.log(DEFAULT.flat_odds) - 1e-9 <= said <= 1e-9
    assert ReliefLooks(flat + more, raised).log_ratio() <= said + 1e-9
    assert ReliefLooks(flat, raised + more).log_ratio() >= said - 1e-9


def called(label: str, log_odds: float) -> MapObject:
    voxels = VoxelMap(0.01)
    voxels.add_points(np.zeros((1, 3)), np.zeros((1, 3), np.uint8), 0.85)
    labels = LabelBelief()
    labels.update((Hypothesis(label, 1.0),), 3.0)
    return MapObject(1, voxels, labels, Existence(log_odds), OpenState(0, 0), 0, 0)


def test_however_often_a_detector_says_so_a_chair_as_flat_as_the_floor_is_more_likely_none() -> None:
    chair = called("chair", 12.0)
    believed = chair.confidence
    chair.add_relief("chair", ReliefLooks(flat=5.0))
    assert chair.confidence < 0.5 < believed


def test_that_it_is_flat_for_a_chair_says_nothing_of_a_whiteboard() -> None:
    board = called("whiteboard", 8.0)
    before = board.existence_log_odds
    board.add_relief("chair", ReliefLooks(flat=5.0))
    assert board.existence_log_odds == pytest.approx(before)
