"""Which space was seen empty, and when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from supermap_cli.errors import MemoryStoreError
from supermap_cli.mapping.free_space import FreeSpaceMemory, decode_small_depth, small_view
from support import scenes as s

EYE = s.looking((0, 0, 1.2), (2, 0, 1.0))
PLACE = np.stack(np.meshgrid(*[np.linspace(-0.1, 0.1, 5)] * 3), axis=-1).reshape(-1, 3)


def around(x: float, y: float, z: float) -> np.ndarray:
    """Points of a thing 20 cm wide."""
    points: np.ndarray = PLACE + np.array([x, y, z])
    return points


def memory_of(*views: tuple[float, np.ndarray, tuple[s.Thing, ...]]) -> FreeSpaceMemory:
    """A memory of views: at a time, from a pose, at things."""
    memory = FreeSpaceMemory()
    for at_s, T_map_camera, things in views:
        memory.add_record(1, s.small_record(s.render(things, T_map_camera, at_s).keyframe))
    return memory


def test_where_nobody_has_looked_nothing_was_seen_empty() -> None:
    assert FreeSpaceMemory().last_seen_empty(around(1.5, 0, 1), 0.02, s.ns(10)) is None


ELSEWHERE = s.looking((0, 1.4, 1.2), (2, 0, 1.0))


def test_the_air_before_a_wall_was_seen_empty() -> None:
    memory = memory_of((2, ELSEWHERE, s.ROOM), (3, EYE, s.ROOM))
    assert memory.last_seen_empty(around(1.5, 0, 1), 0.02, s.ns(10)) == s.ns(3)


def test_one_view_alone_is_no_proof() -> None:
    assert memory_of((3, EYE, s.ROOM)).last_seen_empty(around(1.5, 0, 1), 0.02, s.ns(10)) is None


def test_one_view_of_an_earlier_traversal_is_enough() -> None:
    memory = memory_of((3, EYE, s.ROOM))
    memory.add_record(2, s.small_record(s.render(s.ROOM, s.looking((0, 0, 1.2), (-2, 0, 1.0)), 50).keyframe))
    assert memory.last_seen_empty(around(1.5, 0, 1), 0.02, s.ns(60)) == s.ns(3)


@pytest.mark.parametrize(
    ("place", "why"),
    [((3.5, 0, 1), "behind the wall"), ((-1.5, 0, 1), "behind the camera"), ((2.95, 0, 1), "at the wall")],
)
def test_other_places_were_not(place: s.Point, why: str) -> None:
    assert memory_of((3, EYE, s.ROOM)).last_seen_empty(around(*place), 0.02, s.ns(10)) is None, why


def test_the_place_of_a_thing_that_stood_there_was_not_empty() -> None:
    memory = memory_of((3, EYE, (*s.ROOM, s.BOX.at(1.5, 0, 1))))
    assert memory.last_seen_empty(around(1.5, 0, 1), 0.02, s.ns(10)) is None


def test_it_is_the_latest_view_before_that_time() -> None:
    from_the_right = s.looking((0, -1.4, 1.2), (2, 0, 1.0))
    memory = memory_of((2, from_the_right, s.ROOM), (3, EYE, s.ROOM), (5, ELSEWHERE, s.ROOM))
    assert memory.last_seen_empty(around(1.5, 0, 1), 0.02, s.ns(10)) == s.ns(5)
    assert memory.last_seen_empty(around(1.5, 0, 1), 0.02, s.ns(5)) == s.ns(3)
    assert memory.last_seen_empty(around(1.5, 0, 1), 0.02, s.ns(3)) is None


def test_without_a_return_a_ray_tells_nothing() -> None:
    assert memory_of((3, EYE, ())).last_seen_empty(around(1.5, 0, 1), 0.02, s.ns(10)) is None


def test_a_view_takes_the_place_of_the_newest_one_from_there_in_its_traversal() -> None:
    memory = FreeSpaceMemory()
    for traversal, at_s in ((1, 1.0), (1, 2.0), (1, 2.5), (2, 3.0), (2, 4.0), (2, 5.0)):
        memory.add_record(traversal, s.small_record(s.render(s.ROOM, EYE, at_s).keyframe))
    kept = [[view.stamp_ns for view in views] for views in memory.views.values()]
    assert kept == [[s.ns(1), s.ns(2.5)], [s.ns(3), s.ns(5)]]


def test_a_robot_that_stands_still_remembers_that_a_place_was_empty() -> None:
    memory = FreeSpaceMemory()
    stamps = [0.5 * k for k in range(200)]
    for at_s in stamps:
        memory.add_record(1, s.small_record(s.render(s.ROOM, EYE, at_s).keyframe))
    ((*older, newest),) = memory.views.values()
    assert newest.stamp_ns == s.ns(stamps[-1])
    assert len(older) == 2
    assert all(1e9 <= s.ns(stamps[-1]) - view.stamp_ns <= 21e9 for view in older)


def test_stored_depth_is_right_to_a_millimetre() -> None:
    scene = s.render((*s.ROOM, s.CHAIR), EYE)
    small = decode_small_depth(s.small_record(scene.keyframe, step_px=8))
    assert small.shape == (15, 20)
    np.testing.assert_allclose(small, scene.keyframe.depth_m[::8, ::8], atol=0.0006)


def test_stored_depth_that_is_no_png_is_a_damaged_memory() -> None:
    record = replace(s.small_record(s.render(s.ROOM, EYE).keyframe), depth_png=b"no png")
    with pytest.raises(MemoryStoreError, match="db check"):
        decode_small_depth(record)


def test_a_thing_that_is_narrower_than_the_rays_are_apart_may_stand_between_them() -> None:
    memory = FreeSpaceMemory()
    for at_s, eye in ((2, ELSEWHERE), (3, EYE)):
        memory.add_record(1, s.small_record(s.render(s.ROOM, eye, at_s).keyframe, step_px=16))  # 20 cm at 1.5 m
    assert memory.last_seen_empty(around(1.5, 0, 1) * 2 - (1.5, 0, 1), 0.02, s.ns(10)) == s.ns(3)
    assert memory.last_seen_empty(around(1.5, 0, 1) * 0.5 + (0.75, 0, 0.5), 0.02, s.ns(10)) is None


def test_a_ray_without_a_return_may_have_ended_as_near_as_those_around_it() -> None:
    depth_m = np.full((30, 40), 4.0, np.float32)
    depth_m[16:] = 1.0  # a table's top; its far edge gives no return
    depth_m[15] = 0.0
    view = small_view(0, np.eye(4), s.CAMERA, depth_m, 4)
    assert view.nearest_m[14, 20] == 1.0
    assert view.nearest_m[10, 20] == 4.0
