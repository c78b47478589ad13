"""Which detection is of which object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from supermap_cli.mapping.association import DEFAULT, Association, affinity, associate, bounds_of, near_enough
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.types.sensing import MAIN_CAMERA
from support import scenes as s

LEFT, RIGHT = s.CHAIR.at(1.6, 0.35), s.CHAIR.at(1.6, -0.35)


def mapped(*things: s.Thing, looks: int = 5) -> s.Run:
    run = s.Run()
    run.walk((*s.ROOM, *things), looks)
    return run


def assign(
    run: s.Run, scene: s.Scene, *indices: int, label: str | None = None
) -> tuple[Association, list[LiftedDetection]]:
    """Hold the detections of some things of the scene against the map."""
    found = [s.lifted(scene, index, label) for index in indices]
    look = s.view_of(run.engine, scene.keyframe)
    return associate(found, list(run.map.values()), look.views), found


def nearest(run: s.Run, thing: s.Thing) -> MapObject:
    return min(run.map.values(), key=lambda obj: s.distance_to(obj, thing))


def test_nothing_to_assign() -> None:
    assert associate([], [], {}) == Association((), ())
    scene = s.render((*s.ROOM, s.CHAIR), s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    assert associate([s.lifted(scene, 2)], [], {}) == Association((), (0,))


def test_a_thing_seen_again_is_itself() -> None:
    run = mapped(s.CHAIR)
    scene = s.render((*s.ROOM, s.CHAIR), s.looking((0.1, 0.2, 1.3), (1.6, 0, 0.4)))
    ((row, number, fit),) = assign(run, scene, 2)[0].pairs
    assert (row, number) == (0, 1)
    assert fit.covered > 0.8
    assert fit.explained > 0.8


@pytest.mark.parametrize("target", [(1.6, 1.25, 0.4), (1.6, -1.25, 0.4)])
def test_a_partial_view_matches_its_object(target: s.Point) -> None:
    """Half of the table is beyond the image's border."""
    run = mapped(s.TABLE)
    scene = s.render((*s.ROOM, s.TABLE), s.looking((0, 0, 1.2), target))
    one = s.lifted(scene, 2)
    assert one.truncated
    association, _ = assign(run, scene, 2)
    assert [number for _, number, _ in association.pairs] == [1]


def test_a_thing_half_behind_another_matches_its_object() -> None:
    run = mapped(s.CHAIR)
    screen = s.Thing("", (1.0, 0.2, 0.5), (0.05, 0.4, 1.0))
    scene = s.render((*s.ROOM, s.CHAIR, screen), s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    assert [number for _, number, _ in assign(run, scene, 2)[0].pairs] == [1]


def test_two_things_side_by_side_do_not_swap() -> None:
    run = mapped(LEFT, RIGHT)
    scene = s.render((*s.ROOM, LEFT, RIGHT), s.looking((0, -0.4, 1.2), (1.6, 0.2, 0.4)))
    wanted = {0: nearest(run, LEFT).number, 1: nearest(run, RIGHT).number}
    assert {row: number for row, number, _ in assign(run, scene, 2, 3)[0].pairs} == wanted
    reversed_rows = {row: number for row, number, _ in assign(run, scene, 3, 2)[0].pairs}
    assert reversed_rows == {0: wanted[1], 1: wanted[0]}


def test_with_one_of_two_hidden_the_other_is_not_taken_for_it() -> None:
    run = mapped(LEFT, RIGHT)
    scene = s.render((*s.ROOM, LEFT), s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    assert [number for _, number, _ in assign(run, scene, 2)[0].pairs] == [nearest(run, LEFT).number]


def test_a_detection_far_away_stays_free() -> None:
    run = mapped(s.CHAIR)
    scene = s.render((*s.ROOM, s.CHAIR.at(2.4, 1.2)), s.looking((0, 0, 1.2), (2.0, 0.6, 0.4)))
    association, _ = assign(run, scene, 2)
    assert association == Association((), (0,))
    far = s.render((*s.ROOM, s.CHAIR.at(2.8, 2.4)), s.looking((0, 0, 1.2), (2.0, 1.6, 0.4)))
    candidates = list(run.map.values())
    assert not near_enough(s.lifted(far, 2), candidates, bounds_of(candidates)).any()


def test_a_thing_on_another_is_not_the_other() -> None:
    run = mapped(s.TABLE)
    scene = s.render((*s.ROOM, s.TABLE, s.CUP), s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    association, _ = assign(run, scene, 2, 3)
    assert [(row, number) for row, number, _ in association.pairs] == [(0, 1)]
    assert association.free == (1,)


def test_another_label_in_the_same_place_fits_worse_but_may_still_fit() -> None:
    run = mapped(s.CHAIR)
    scene = s.render((*s.ROOM, s.CHAIR), s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    look, chair = s.view_of(run.engine, scene.keyframe), run.map[1]
    same, other = (affinity(s.lifted(scene, 2, label), chair, look.views[1]) for label in ("chair", "couch"))
    assert same.log_ratio > other.log_ratio > 0


def test_its_own_track_fits_better_and_another_worse() -> None:
    run = mapped(s.CHAIR)
    chair = run.map[1]
    scene = s.render((*s.ROOM, s.CHAIR), s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    view = s.view_of(run.engine, scene.keyframe).views[1]

    def fit(track_id: int) -> float:
        chair.track_ids = {MAIN_CAMERA: track_id}
        return affinity(replace(s.lifted(scene, 2), track_id=5), chair, view).log_ratio

    assert fit(5) > fit(-1) > fit(6)


def test_a_track_of_another_camera_says_nothing() -> None:
    run = mapped(s.CHAIR)
    chair = run.map[1]
    scene = s.render((*s.ROOM, s.CHAIR), s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    detection = replace(s.lifted(scene, 2), track_id=5)
    view = s.view_of(run.engine, scene.keyframe).views[1]
    untracked = affinity(detection, chair, view, camera_id="left")
    chair.track_ids = {"right": 6}
    assert affinity(detection, chair, view, camera_id="left") == untracked
    chair.track_ids["left"] = 5
    assert affinity(detection, chair, view, camera_id="left").log_ratio > untracked.log_ratio


def test_each_object_is_given_away_once() -> None:
    run = mapped(s.CHAIR)
    scene = s.render((*s.ROOM, s.CHAIR), s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    association, _ = assign(run, scene, 2, 2)
    assert len(association.pairs) == len(association.free) == 1


def test_the_gate_holds_back_what_fits_badly() -> None:
    run = mapped(s.CHAIR)
    scene = s.render((*s.ROOM, s.CHAIR), s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    views = s.view_of(run.engine, scene.keyframe).views
    closed = replace(DEFAULT, gate=np.inf)
    assert associate([s.lifted(scene, 2)], list(run.map.values()), views, parameters=closed).free == (0,)
