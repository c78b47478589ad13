"""What one depth image says of a point: the wall is 2 m before the camera unless told otherwise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.mapping.depth import DepthView, depth_sigma_m, depth_view
from supermap_cli.mapping.visibility import ObjectView, check_objects, check_visibility, tolerance_m
from support import scenes as s

VOXEL_M = 0.02
EYE = s.looking((0, 0, 1), (1, 0, 1))
WALL = s.Thing("", (2.05, 0, 1), (0.1, 8, 8))
PILLAR = s.Thing("", (1.05, 0, 1), (0.1, 0.4, 8))


def view_of(*things: s.Thing, max_depth_m: float = 6.0) -> DepthView:
    return depth_view(s.render(things, EYE).keyframe, max_depth_m)


def look(view: DepthView, *points: s.Point) -> ObjectView:
    return check_visibility(view, np.array(points, float).reshape(-1, 3), VOXEL_M)


def verdict(view: DepthView, point: s.Point) -> str:
    """What the image says of one point."""
    one = look(view, point)
    said = [name for name in ("supported", "contradicted", "occluded") if getattr(one, name)[0]]
    assert len(said) <= 1 or not one.contradicted[0]
    return " and ".join(said) or "nothing"


def test_of_no_points_it_says_nothing() -> None:
    nothing = look(view_of(WALL))
    assert nothing.observable_share == nothing.contradicted_share == 0.0
    assert not nothing.hidden
    assert nothing.box_xyxy is None


@pytest.mark.parametrize(
    ("x", "said"),
    [(2.0, "supported"), (1.0, "contradicted"), (1.8, "contradicted"), (2.5, "occluded"), (-1.0, "nothing")],
)
def test_a_point_on_before_or_behind_the_surface(x: float, said: str) -> None:
    assert verdict(view_of(WALL), (x, 0, 1)) == said


def test_behind_a_surface_is_not_observable() -> None:
    assert look(view_of(WALL), (2.5, 0, 1)).observable_share == 0.0


def test_a_point_beside_the_image_is_not_seen() -> None:
    one = look(view_of(WALL), (1, 3, 1))
    assert not one.on_image[0]
    assert not one.observable[0]


def test_where_nothing_returned_nothing_is_said() -> None:
    assert verdict(view_of(), (1, 0, 1)) == "nothing"


def test_a_return_beyond_the_range_says_only_that_its_ray_passed() -> None:
    view = view_of(WALL, max_depth_m=1.5)
    assert verdict(view, (1, 0, 1)) == "contradicted"
    assert verdict(view, (2.0, 0, 1)) == "nothing"


def test_beside_something_near_a_return_beyond_the_range_says_nothing() -> None:
    assert verdict(view_of(WALL, PILLAR, max_depth_m=1.5), (1.3, 0.27, 1)) == "nothing"


def test_points_beyond_the_range_are_not_judged() -> None:
    far_wall = s.Thing("", (5.05, 0, 1), (0.1, 20, 20))
    assert verdict(view_of(far_wall, max_depth_m=6.0), (5.0, 0, 1)) == "supported"
    assert verdict(view_of(far_wall, max_depth_m=4.0), (4.5, 0, 1)) == "nothing"


def test_next_to_a_depth_edge_a_miss_says_nothing() -> None:
    """The pillar's edge is at y = 0.2: a ray just beside it may as well have hit it."""
    view = view_of(WALL, PILLAR)
    assert verdict(view, (1.5, 0.305, 1)) == "nothing"
    assert verdict(view, (1.5, 0.4, 1)) == "contradicted"


@given(st.floats(0.5, 5.0), st.floats(0.01, 1.0))
def test_the_tolerance_grows_with_depth(depth_m: float, more_m: float) -> None:
    depths = np.array([depth_m, depth_m + more_m])
    near, far = tolerance_m(depths, VOXEL_M)
    assert near < far
    assert np.diff(depth_sigma_m(depths))[0] > 0


def test_the_tolerance_grows_with_the_voxel() -> None:
    assert tolerance_m(np.array([2.0]), 0.02) < tolerance_m(np.array([2.0]), 0.08)


def test_what_is_within_the_tolerance_near_by_is_not_so_close_to_the_camera() -> None:
    """12 cm before a wall: at 5 m that may be noise, at 1 m it is not."""
    near, far = s.Thing("", (1.05, 0, 1), (0.1, 20, 20)), s.Thing("", (5.05, 0, 1), (0.1, 20, 20))
    assert verdict(view_of(near), (0.88, 0, 1)) == "contradicted"
    assert verdict(view_of(far), (4.88, 0, 1)) == "supported"


def test_a_slanted_surface_supports_the_points_on_it() -> None:
    """The floor as seen from 1 m up: depth changes by centimetres from one pixel to the next."""
    points = [(x, y, 0.0) for x in (2.0, 2.5, 3.0) for y in (-0.3, 0.0, 0.3)]
    assert look(view_of(s.FLOOR), *points).supported.all()


def test_shares_are_of_all_points_and_of_those_that_can_be_told() -> None:
    view = look(view_of(WALL), (2.0, 0, 1), (1.0, 0, 1), (1.2, 0, 1), (2.6, 0, 1), (2.6, 0.1, 1), (1, 3, 1))
    assert view.observable_share == pytest.approx(3 / 6)
    assert view.contradicted_share == pytest.approx(2 / 3)


def test_hidden_means_that_most_of_what_is_on_the_image_lies_behind_something() -> None:
    behind = [(2.5, y, 1.0) for y in np.linspace(-0.3, 0.3, 9)]
    assert look(view_of(WALL), *behind).hidden
    assert not look(view_of(WALL), *behind[:2], (2.0, 0, 1), (2.0, 0.1, 1)).hidden
    assert not look(view_of(WALL), (1, 3, 1)).hidden


def test_the_image_box_spans_the_projected_points() -> None:
    view = look(view_of(WALL), *[(2.0, y, z) for y in (-0.5, 0.5) for z in (0.8, 1.2)])
    f, cx, cy = s.CAMERA.fx, s.CAMERA.cx, s.CAMERA.cy
    box = view.box_xyxy
    assert box is not None
    np.testing.assert_allclose(box, [cx - f / 4, cy - f / 10, cx + f / 4, cy + f / 10], atol=1)


def test_objects_are_looked_at_in_one_pass_and_those_off_the_image_left_out() -> None:
    run = s.Run()
    run.walk((*s.ROOM, s.CHAIR, s.CUP.at(1.6, 0.7)), 4)
    chair, cup = run.standing("chair")[0], run.standing("cup")[0]
    scene = s.render((*s.ROOM, s.CHAIR), s.looking((0, 0, 1.2), (1.6, -0.8, 0.6)))
    views = check_objects(depth_view(scene.keyframe, 6.0), [chair, cup])
    assert list(views) == [chair.number]
    assert len(views[chair.number].u) == len(chair.voxels)
    assert views[chair.number].contradicted_share < 0.1
    assert check_objects(depth_view(scene.keyframe, 6.0), []) == {}
