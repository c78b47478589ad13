"""An object seen beside its place: how often, and how clearly, before it is believed."""

from __future__ import annotations

import numpy as np

from supermap_cli.mapping.displacement import DEFAULT, displaced_since_ns, is_displaced, level_grid, sure_gain
from supermap_cli.mapping.objects import MapObject
from support import scenes as s

EYE = (0.0, 0.3, 1.2)
CHAIR_WORLD = (*s.ROOM, s.CHAIR)
PUSHED = (*s.ROOM, s.CHAIR.at(1.6, 0.25))


def mapped() -> tuple[s.Run, MapObject]:
    run = s.Run()
    run.walk(CHAIR_WORLD)
    run.take()
    return run, run.map[1]


def test_one_image_is_not_enough() -> None:
    run, chair = mapped()
    run.see(PUSHED, EYE)
    assert (chair.displacement.views, chair.displacement.first_ns) == (1, s.ns(2))
    assert not is_displaced(chair)
    assert run.take().temporal_edges == ()


def test_several_cameras_at_one_moment_are_one_view() -> None:
    run, chair = mapped()
    for camera in ("left", "front", "right"):
        run.see(PUSHED, EYE, camera_id=camera, step_s=0.0)
    assert (chair.displacement.views, chair.displacement.keyframes) == (1, 3)
    assert not is_displaced(chair)
    assert run.take().temporal_edges == ()


def test_an_image_that_shows_it_in_its_place_voids_those_before() -> None:
    run, chair = mapped()
    run.see(PUSHED, EYE)
    run.see(CHAIR_WORLD, EYE)
    assert (chair.displacement.views, chair.displacement.gain) == (0, 0.0)


def test_what_was_found_in_its_place_in_this_visit_needs_more() -> None:
    _, chair = mapped()
    settled = sure_gain(chair)
    chair.visit.supported = 1
    assert settled == DEFAULT.settled_factor * sure_gain(chair)


def test_what_only_an_earlier_traversal_found_in_its_place_was_pushed_aside_in_between() -> None:
    _, chair = mapped()
    chair.visit.supported, chair.visit.first_support_ns, chair.visit.earlier_ns = 1, s.ns(9), s.ns(1)
    assert displaced_since_ns(chair, s.ns(10)) == (s.ns(1), s.ns(9))


def test_shifts_are_tried_level_and_all_around() -> None:
    grid = level_grid(0.1, 0.2)
    assert grid.shape == (25, 3)
    assert not grid[:, 2].any()
    np.testing.assert_allclose(grid.min(axis=0)[:2], -0.2)
