"""When one object turns out to be two, and when the detector only cut it in two."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.mapping.belief import Viewpoint
from supermap_cli.mapping.mask_overlap import overlap_share
from supermap_cli.mapping.splitting import SplitEvidence, nearer_to_second, side_by_side
from supermap_cli.types.detections import Detections
from support import scenes as s

LEFT, RIGHT = s.CHAIR.at(1.6, 0.23), s.CHAIR.at(1.6, -0.23)
CHAIRS = (*s.ROOM, LEFT, RIGHT)
TABLE = (*s.ROOM, s.TABLE)


def as_one(scene: s.Scene, at_s: float) -> Detections:
    """A detector that takes the two chairs for one."""
    return s.detections_of([scene.mask(2) | scene.mask(3)], [[("chair", 0.8)]], at_s)


def halved(scene: s.Scene, at_s: float, label: str = "dining table") -> Detections:
    """A detector that cuts the room's one thing in two, in the middle of what it shows."""
    left, right = scene.mask(2), scene.mask(2)
    middle = int(np.flatnonzero(left.any(axis=0)).mean())
    left[:, middle:], right[:, :middle] = False, False
    return s.detections_of([left, right], [[(label, 0.8)]] * 2, at_s)


def seen_as_one_from_afar() -> s.Run:
    run = s.Run(detector=as_one)
    for y in np.linspace(-0.3, 0.3, 6):
        run.see(CHAIRS, (-1.5, float(y), 1.2))
    run.detector = s.detect
    return run


def come_near(run: s.Run) -> None:
    for _ in range(2):
        run.walk(CHAIRS, 8)
        run.pause(2)


def test_two_chairs_seen_as_one_from_afar_are_two_from_near_by() -> None:
    run = seen_as_one_from_afar()
    assert [obj.number for obj in run.standing("chair")] == [1]
    come_near(run)
    assert len(run.standing("chair")) == 2
    for chair in (LEFT, RIGHT):
        one = min(run.standing("chair"), key=lambda obj: s.distance_to(obj, chair))
        assert s.distance_to(one, chair) < 0.15
        assert one.shape.box.size[:2].max() < 0.55


def test_it_is_said_that_they_were_one_and_not_that_one_appeared() -> None:
    run = seen_as_one_from_afar()
    run.take()
    come_near(run)
    delta = run.take()
    (split,) = delta.temporal_edges
    new = next(obj.number for obj in run.standing("chair") if obj.number != 1)
    assert (split.kind, split.from_number, split.from_state, split.to_number, split.to_state) == ("split", 1, 0, new, 0)
    state = next(state for state in delta.states if state.object_number == new)
    assert state.first_seen_ns == split.not_after_ns
    assert state.empty_before_ns is None
    first = next(observation for observation in delta.observations if observation.object_number == new)
    assert first.stamp_ns == state.first_seen_ns


def test_they_stay_two() -> None:
    run = seen_as_one_from_afar()
    for _ in range(2):
        come_near(run)
    numbers = [obj.number for obj in run.standing("chair")]
    run.take()
    come_near(run)
    assert [obj.number for obj in run.standing("chair")] == numbers
    assert run.take().temporal_edges == ()


def test_a_table_that_the_detector_cuts_in_two_now_and_then_stays_one() -> None:
    run = s.Run()
    for k in range(48):
        run.detector = halved if k % 6 == 5 else s.detect
        run.see(TABLE, (0.0, k % 8 / 7 - 0.5, 1.2))
    assert [obj.number for obj in run.standing()] == [1]
    assert run.take().temporal_edges == ()


def test_a_detector_that_errs_for_a_while_from_one_place_splits_nothing() -> None:
    run = s.Run()
    run.walk(TABLE, 4)
    run.detector = halved
    for _ in range(6):
        run.see(TABLE, (0, 0.5, 1.2))
    assert [obj.number for obj in run.standing()] == [1]


def test_images_that_cut_a_thing_now_so_and_now_so_do_not_agree() -> None:
    scene = s.render(TABLE, s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    pairs = [_parts(scene, column) for column in (50, 108)]
    evidence = SplitEvidence()
    for k in range(12):
        view = Viewpoint(s.ns(3 * k), np.array([0, 0.4 * k - 2, 1.2]), np.array([1.6, 0, 0.4]))
        assert not evidence.add_two_masks(1, *pairs[k % 2], view)


def _parts(scene: s.Scene, column: int) -> list[s.LiftedDetection]:
    left, right = scene.mask(2), scene.mask(2)
    left[:, column:], right[:, :column] = False, False
    found = s.detections_of([left, right], [[("dining table", 0.8)]] * 2)
    return s.lift(scene.keyframe, s.depth_view(scene.keyframe, 6.0), found, np.array([-1, -1]))


def test_two_masks_on_one_another_are_not_side_by_side() -> None:
    scene = s.render(CHAIRS, s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    left, right = s.lifted(scene, 2), s.lifted(scene, 3)
    run = seen_as_one_from_afar()
    assert side_by_side(run.map[1].shape, left, right)
    assert not side_by_side(run.map[1].shape, left, left)
    assert (overlap_share(left.mask, right.mask), overlap_share(left.mask, left.mask)) == (0, 1)


@pytest.mark.parametrize(("x", "second"), [(0.1, False), (0.9, True)])
def test_a_voxel_goes_to_the_nearer_group(x: float, second: bool) -> None:
    first, other = np.zeros((1, 3)), np.array([[1.0, 0, 0]])
    assert nearer_to_second(np.array([[x, 0, 0]]), first, other).tolist() == [second]
