"""A keyframe's depth, prepared: the nearest and farthest return around every pixel."""

from __future__ import annotations

import numpy as np

from supermap_cli.mapping.depth import depth_view
from support import scenes as s

FACING = s.looking((0, 0, 1), (1, 0, 1))
WALL = s.Thing("", (2.05, 0, 1), (0.1, 8, 8))
POST = s.Thing("", (1.05, 0, 1), (0.1, 0.2, 8))


def test_without_a_return_nearest_is_infinite_and_farthest_zero() -> None:
    view = depth_view(s.render((), FACING).keyframe, 6.0)
    assert np.isinf(view.nearest_m).all()
    assert (view.farthest_m == 0).all()


def test_on_a_facing_wall_both_are_its_depth() -> None:
    view = depth_view(s.render((WALL,), FACING).keyframe, 6.0)
    np.testing.assert_allclose(view.nearest_m, 2.0, atol=1e-5)
    np.testing.assert_allclose(view.farthest_m, 2.0, atol=1e-5)


def test_at_an_edge_they_span_both_surfaces() -> None:
    view = depth_view(s.render((WALL, POST), FACING).keyframe, 6.0)
    edge = int(np.flatnonzero(np.diff(view.depth_m[60]) != 0)[0])
    assert np.isclose(view.nearest_m[60, edge], 1.0, atol=1e-3)
    assert np.isclose(view.farthest_m[60, edge], 2.0, atol=1e-3)
    assert np.isclose(view.farthest_m[60, edge - 3], 2.0, atol=1e-3)
    assert np.isclose(view.nearest_m[60, edge - 3], view.farthest_m[60, edge - 3])


def test_a_hole_in_the_depth_is_bridged_by_what_surrounds_it() -> None:
    keyframe = s.render((WALL,), FACING).keyframe
    keyframe.depth_m[60, 80] = 0
    view = depth_view(keyframe, 6.0)
    assert view.depth_m[60, 80] == 0
    assert np.isclose(view.nearest_m[60, 80], 2.0, atol=1e-5)


def test_what_is_beyond_the_range_is_dropped() -> None:
    assert (depth_view(s.render((WALL,), FACING).keyframe, 1.9).depth_m == 0).all()


def test_points_go_to_the_pixels_that_saw_them() -> None:
    keyframe = s.render((WALL,), FACING).keyframe
    view = depth_view(keyframe, 6.0)
    points = np.array([[2.0, 0.0, 1.0], [2.0, -0.5, 1.21], [-2.0, 0.0, 1.0], [2.0, 5.0, 1.0]])
    u, v, depth, on_image = view.project(points)
    assert on_image.tolist() == [True, True, False, False]
    np.testing.assert_allclose(depth[:2], 2.0)
    assert (u[1], v[1]) == (round(s.CAMERA.cx + 0.25 * s.CAMERA.fx), round(s.CAMERA.cy - 0.105 * s.CAMERA.fx))
