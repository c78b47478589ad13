"""Who is who."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from supermap_cli.evaluation.known_truth import known_truth
from supermap_cli.evaluation.matching import closeness, identify, match_one_to_one
from support import evaluated as e


def test_nothing_is_matched_to_nothing():
    assert match_one_to_one(np.zeros((0, 3), dtype=bool), np.zeros((0, 3))) == ()
    assert match_one_to_one(np.zeros((2, 3), dtype=bool), np.ones((2, 3))) == ()


@given(
    st.tuples(st.integers(1, 4), st.integers(1, 4)).flatmap(
        lambda shape: st.tuples(
            arrays(bool, shape), arrays(np.float64, shape, elements=st.integers(0, 8).map(lambda k: k / 8))
        )
    )
)
def test_the_assignment_is_the_best_of_all_as_far_as_trying_them_shows(case):
    allowed, preference = case
    if len(allowed) > len(allowed[0]):
        allowed, preference = allowed.T, preference.T
    pairs = match_one_to_one(allowed, preference)
    assert all(allowed[pair] for pair in pairs)
    assert len({r for r, _ in pairs}) == len({c for _, c in pairs}) == len(pairs)

    def worth(columns):
        chosen = [(r, c) for r, c in enumerate(columns) if allowed[r, c]]
        return len(chosen), sum(preference[pair] for pair in chosen)

    best = max(worth(columns) for columns in permutations(range(allowed.shape[1]), allowed.shape[0]))
    assert (len(pairs), sum(preference[pair] for pair in pairs)) == pytest.approx(best)


@pytest.mark.parametrize(
    ("offset_m", "iou", "near"), [(0, 1, True), (0.1, 0.6, True), (0.2, 1 / 3, True), (0.31, 0.09 / 0.71, False)]
)
def test_a_shifted_cube_is_as_close_as_worked_out_by_hand(offset_m, iou, near):
    state = e.stay((0, 0, 0))
    close = closeness([state], [e.stay((offset_m, 0, 0))])
    assert close.iou[0, 0] == pytest.approx(iou)
    assert close.distance_m[0, 0] == pytest.approx(offset_m)
    assert close.near[0, 0] == near


def test_a_state_is_what_stood_there_while_it_was_seen_not_what_it_was_believed_to_be_later():
    objects = (e.thing("chair-1", e.stay((0, 0, 0), until=5)), e.thing("stool-1", e.stay((0.05, 0, 0), since=5)))
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects)])
    estimate = e.perfect_map(truth)
    chair = estimate.objects[0]
    never_gone = replace(chair, states=(replace(chair.states[0], gone_ns=None),))
    known = known_truth(estimate, truth)
    for alter in (chair, never_gone):
        [[what]] = identify(e.with_objects(estimate, [alter]), known)
        assert (what.object_id, what.places) == ("chair-1", {0})


def test_a_state_that_nothing_true_is_near_is_nothing():
    truth = e.still_life()
    estimate = e.shifted_map(e.perfect_map(truth), (1, 0, 0))
    assert identify(estimate, known_truth(estimate, truth)) == ((None,),) * 4
