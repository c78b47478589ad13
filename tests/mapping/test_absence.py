"""Looks at parts of a place that has been found empty, as counts of voxels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from supermap_cli.mapping.absence import AbsenceEvidence, EmptyRun

CODES = np.arange(1000)


def voxels(first: int, last: int) -> NDArray[np.bool_]:
    return (first <= CODES) & (last > CODES)


NONE = voxels(0, 0)


def run_of(*looks: tuple[NDArray[np.bool_], NDArray[np.bool_]]) -> EmptyRun:
    """A run of looks, one a second, each by what it supports and what it goes through."""
    run = EmptyRun()
    for at_s, (supported, through) in enumerate(looks):
        run.add(CODES, supported | through, through, at_s * 1_000_000_000)
    return run


def test_no_look_shows_nothing() -> None:
    assert not EmptyRun().shows_absence(1000)


def test_parts_add_up() -> None:
    parts = [(NONE, voxels(70 * k, 70 * k + 70)) for k in range(3)]
    assert not run_of(*parts[:2]).shows_absence(1000)
    assert run_of(*parts).shows_absence(1000)


def test_one_part_seen_empty_again_and_again_is_one_part() -> None:
    assert not run_of(*[(NONE, voxels(0, 70))] * 50).shows_absence(1000)


def test_two_looks_are_not_enough_however_much_they_see() -> None:
    assert not run_of((NONE, voxels(0, 500)), (NONE, voxels(500, 1000))).shows_absence(1000)


def test_a_few_rays_do_not_speak_for_a_small_thing() -> None:
    run = EmptyRun()
    codes = np.arange(40)
    for at_s in range(5):
        run.add(codes, codes < 25, codes < 25, at_s)
    assert not run.shows_absence(40)


def test_it_begins_with_the_first_look_that_saw_through_it() -> None:
    run = run_of((voxels(0, 70), NONE), (NONE, voxels(70, 140)), (NONE, voxels(140, 210)))
    assert (run.views, run.began_ns) == (2, 1_000_000_000)


def test_what_is_seen_in_its_place_ends_it() -> None:
    run = run_of((NONE, voxels(0, 100)), (NONE, voxels(100, 200)), (voxels(200, 400), NONE))
    assert run.views == 0


def test_the_last_word_on_a_voxel_counts() -> None:
    run = run_of((NONE, voxels(0, 300)), (voxels(0, 50), voxels(300, 400)), (NONE, voxels(400, 450)))
    assert np.count_nonzero(run.through) == 400


def test_other_voxels_begin_anew() -> None:
    run = run_of(*[(NONE, voxels(0, 500))] * 3)
    run.add(np.arange(900), np.arange(900) < 400, np.arange(900) < 400, 9)
    assert (run.views, run.began_ns) == (1, 9)


def test_strays_say_nothing() -> None:
    run = run_of((NONE, voxels(0, 5)), (NONE, voxels(0, 100)))
    assert run.began_ns == 1_000_000_000


def test_parts_seen_by_several_cameras_at_one_moment_are_one_view() -> None:
    run = EmptyRun()
    for stamp_ns, first in ((1, 0), (1, 70), (1, 140), (2, 210)):
        run.add(CODES, voxels(first, first + 70), voxels(first, first + 70), stamp_ns)
    assert run.views == 2
    assert not run.shows_absence(1000)
    run.add(CODES, voxels(0, 70), voxels(0, 70), 3)
    assert run.shows_absence(1000)


def test_empty_views_in_a_row_are_counted_by_moment() -> None:
    evidence = AbsenceEvidence()
    for stamp_ns in (5, 5, 6):
        evidence.add_empty(stamp_ns)
    assert (evidence.views, evidence.first_ns) == (2, 5)
    evidence.add_occupied()
    evidence.add_empty(6)
    assert (evidence.views, evidence.first_ns) == (1, 6)
