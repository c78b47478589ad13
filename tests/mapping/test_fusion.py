"""How one keyframe's evidence enters an object."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from supermap_cli.mapping.belief import DEFAULT, Existence, Viewpoint
from supermap_cli.mapping.fusion import (
    area_share,
    fuse_detection,
    fuse_geometry,
    fuse_mask,
    fuse_miss,
    fuse_points,
    hanging_together,
)
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.recall import RecallModel, ScoreModel
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.mapping.voxel_map import LOG_ODDS_MAX, VoxelMap
from support import scenes as s

EYE = s.looking((0, 0, 1.2), (1.6, 0, 0.4))
AREA = 160 * 120


@pytest.fixture
def chair() -> MapObject:
    run = s.Run()
    run.walk((*s.ROOM, s.CHAIR), 5)
    return run.map[1]


def view_of(obj: MapObject, *things: s.Thing) -> ObjectView:
    run = s.Run()
    run.engine.objects.add(obj)
    return s.view_of(run.engine, s.render(things, EYE).keyframe).views[obj.number]


def upper_half(scene: s.Scene) -> s.Scene:
    """The scene as if nothing could be made out in the image's lower half."""
    owner = scene.owner.copy()
    owner[60:] = -1
    return replace(scene, owner=owner)


def test_rays_that_hit_and_rays_that_go_through_turn_a_voxels_occupancy(chair: MapObject) -> None:
    chair.voxels.log_odds[:] = 1.0
    fuse_geometry(chair, view_of(chair, *s.ROOM, s.CHAIR))
    assert (chair.voxels.log_odds > 1.0).mean() > 0.8
    chair.voxels.log_odds[:] = 1.0
    fuse_geometry(chair, view_of(chair, *s.ROOM))
    assert (chair.voxels.log_odds < 1.0).mean() > 0.8


def test_occupancy_is_clamped(chair: MapObject) -> None:
    view = view_of(chair, *s.ROOM, s.CHAIR)
    for _ in range(50):
        fuse_geometry(chair, view)
    assert chair.voxels.log_odds.max() == np.float32(LOG_ODDS_MAX)


def test_what_is_hidden_keeps_its_occupancy(chair: MapObject) -> None:
    before = chair.voxels.log_odds.copy()
    fuse_geometry(chair, view_of(chair, s.Thing("", (0.8, 0, 1), (0.1, 5, 5))))
    np.testing.assert_array_equal(chair.voxels.log_odds, before)


def test_voxels_within_the_mask_gain_support_and_those_beside_it_lose_it(chair: MapObject) -> None:
    upper = upper_half(s.render((*s.ROOM, s.CHAIR), EYE))
    chair.voxels.inside[:], chair.voxels.outside[:] = 1, 0
    fuse_mask(chair, view_of(chair, *s.ROOM, s.CHAIR), s.lifted(upper, 2))
    z = chair.voxels.centers()[:, 2]
    cut_m = z[chair.voxels.inside > 1].min()
    assert (chair.voxels.inside > 1).sum() > 50
    assert (chair.voxels.outside > 0).sum() > 50
    assert z[chair.voxels.outside > 0].max() <= cut_m + chair.voxels.voxel_m


def test_voxels_that_the_evidence_has_turned_against_are_dropped(chair: MapObject) -> None:
    low = chair.voxels.centers()[:, 2] < 0.2
    chair.voxels.log_odds[low] = -2.0
    fuse_points(chair, s.lifted(upper_half(s.render((*s.ROOM, s.CHAIR), EYE)), 2))
    assert low.any()
    assert chair.voxels.centers()[:, 2].min() > 0.2


def test_existence_rises_with_detections_and_falls_with_misses_within_bounds(chair: MapObject) -> None:
    one = s.lifted(s.render((*s.ROOM, s.CHAIR), EYE), 2, score=0.8)
    scores, recall = ScoreModel(), RecallModel()
    here, there = EYE[:3, 3], np.array([1.6, -2.5, 1.3])
    seconds = itertools.count(step=5)

    def at(place: NDArray[np.float64]) -> Viewpoint:
        return Viewpoint(s.ns(next(seconds)), place, chair.shape.centroid)

    chair.existence, chair.observations = Existence(0.0), 1
    fuse_detection(chair, one, scores, recall, at(here))
    once = chair.existence.log_odds
    assert once > 0.9
    fuse_detection(chair, one, scores, recall, at(here))
    twice = chair.existence.log_odds
    assert once < twice
    fuse_detection(chair, one, scores, recall, at(here))
    assert twice < chair.existence.log_odds < 2 * twice - once
    fuse_detection(chair, one, scores, recall, at(there))
    assert chair.existence.log_odds > 2 * once
    for _ in range(50):
        fuse_detection(chair, one, scores, recall, at(here))
    assert chair.existence.log_odds == DEFAULT.max_existence
    fuse_miss(chair, 0.9, at(there), RecallModel())
    assert DEFAULT.min_existence < chair.existence.log_odds < DEFAULT.max_existence
    for _ in range(3000):
        fuse_miss(chair, 0.9, at(there), RecallModel())
    assert chair.existence.log_odds == DEFAULT.min_existence


def test_the_visible_area_is_that_of_what_can_be_seen(chair: MapObject) -> None:
    whole = area_share(view_of(chair, *s.ROOM, s.CHAIR), AREA)
    screen = s.Thing("", (1.0, 0.5, 0.5), (0.05, 1.0, 3.0))
    half = area_share(view_of(chair, *s.ROOM, s.CHAIR, screen), AREA)
    assert whole == pytest.approx(s.render((*s.ROOM, s.CHAIR), EYE).mask(2).mean(), rel=0.35)
    assert half == pytest.approx(whole / 2, rel=0.25)
    assert area_share(view_of(chair, s.Thing("", (0.8, 0, 1), (0.1, 5, 5))), AREA) == 0.0


def test_an_object_never_loses_its_last_voxel(chair: MapObject) -> None:
    one = s.lifted(s.render((*s.ROOM, s.CHAIR), EYE), 2)
    fuse_points(chair, one)
    chair.voxels.outside[:] = 1000.0
    fuse_points(chair, one)
    assert len(chair.voxels)
    assert np.isfinite(chair.shape.centroid).all()


def test_a_few_voxels_far_from_all_others_are_dropped() -> None:
    cloud = np.stack(np.meshgrid(*[np.arange(0, 0.3, 0.02)] * 3), axis=-1).reshape(-1, 3)
    strays = np.array([[2.0, 0, 0], [2.02, 0, 0], [2.0, 0.02, 0]])
    voxels = VoxelMap(0.02)
    points = np.concatenate([cloud, strays])
    voxels.add_points(points, np.zeros(points.shape, np.uint8), 0.85)
    kept = voxels.centers()[hanging_together(voxels)]
    assert kept[:, 0].max() < 0.4
    assert len(kept) > 0.95 * len(voxels)


def test_two_large_parts_are_both_kept() -> None:
    cloud = np.stack(np.meshgrid(*[np.arange(0, 0.2, 0.02)] * 3), axis=-1).reshape(-1, 3)
    voxels = VoxelMap(0.02)
    points = np.concatenate([cloud, np.add(cloud[: len(cloud) // 4], (0, 0, 0.5))])
    voxels.add_points(points, np.zeros(points.shape, np.uint8), 0.85)
    assert hanging_together(voxels).all()
