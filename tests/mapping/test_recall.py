"""What a detection and a miss weigh."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.mapping.recall import (
    DEFAULT,
    FoundBy,
    RecallModel,
    ScoreModel,
    miss_log_ratio,
    return_log_ratio,
)

LARGE, SMALL = 0.2, 0.001


def trained(label: str, hits: int, misses: int, area_share: float = LARGE) -> RecallModel:
    model = RecallModel()
    for detected in [True] * hits + [False] * misses:
        model.record(label, area_share, truncated=False, detected=detected, weight=1.0)
    return model


def test_before_any_trial_every_other_thing_is_expected_to_be_found() -> None:
    assert RecallModel().expected("chair", LARGE, truncated=False) == pytest.approx(0.5)


def test_it_learns_a_class_that_is_always_found_and_one_that_seldom_is() -> None:
    assert trained("chair", 40, 0).expected("chair", LARGE, truncated=False) > 0.9
    assert trained("cup", 2, 38).expected("cup", LARGE, truncated=False) < 0.1


def test_what_it_learnt_of_one_class_says_nothing_of_another() -> None:
    assert trained("chair", 40, 0).expected("cup", LARGE, truncated=False) == pytest.approx(0.5)


def test_a_class_is_known_in_sizes_not_met_yet_but_less_than_where_it_was_met() -> None:
    model = trained("cup", 20, 0, LARGE)
    for _ in range(20):
        model.record("cup", SMALL, truncated=False, detected=False, weight=1.0)
    large, small = (model.expected("cup", area, truncated=False) for area in (LARGE, SMALL))
    assert small < 0.2
    assert large > 0.8
    assert small < model.expected("cup", LARGE, truncated=True) < large


@given(st.integers(0, 300), st.integers(0, 300))
def test_the_rate_is_never_certain(hits: int, misses: int) -> None:
    rate = trained("chair", hits, misses).expected("chair", LARGE, truncated=False)
    assert 0.02 <= rate <= 0.95


@given(st.floats(0.03, 0.95))
def test_a_miss_speaks_against_a_thing_by_how_well_it_would_have_been_found(recall: float) -> None:
    assert miss_log_ratio(recall) <= 0.0
    assert miss_log_ratio(min(recall + 0.04, 0.99)) < miss_log_ratio(recall)


def test_a_miss_where_the_detector_is_blind_says_nothing() -> None:
    assert miss_log_ratio(0.0) == pytest.approx(0.0)
    assert miss_log_ratio(0.95) == pytest.approx(np.log(0.05 / (1 - 0.95 * DEFAULT.clutter_recall)))


@given(st.floats(0.0, 0.95), st.integers(0, 50))
def test_a_firmer_detection_says_more(score: float, before: int) -> None:
    model = ScoreModel()
    assert model.detection_log_ratio(score + 0.05, 1.0, before) >= model.detection_log_ratio(score, 1.0, before)


@given(st.floats(0.02, 0.95), st.floats(0.02, 0.95))
def test_to_be_found_again_later_says_more_than_at_once(own: float, rate: float) -> None:
    """What fools a detector mostly does so for a moment; what is there is found again for ever."""
    at_once, later = (return_log_ratio(own, rate, soon=soon) for soon in (True, False))
    assert 0 <= at_once <= later
    if own >= rate:
        assert at_once > 0.5


def test_what_was_mostly_missed_is_expected_to_be_missed_again() -> None:
    rates = [RecallModel().own_rate(0.5, {"": FoundBy(1, missed)}) for missed in range(40)]
    assert rates == sorted(rates, reverse=True)
    costs = [miss_log_ratio(rate, 0.5) for rate in rates]
    assert costs == sorted(costs)
    assert costs[-1] == pytest.approx(0, abs=0.05)


@given(st.integers(0, 30), st.integers(0, 30), st.floats(0.02, 0.95))
def test_the_rate_of_one_thing_lies_between_its_classs_and_its_own(found: int, missed: int, rate: float) -> None:
    own = RecallModel().own_rate(rate, {"": FoundBy(found, missed)})
    share = found / (found + missed) if found + missed else rate
    assert min(rate, share, 0.95) - 1e-9 <= own <= max(rate, share) + 1e-9


def test_a_hesitant_detection_says_more_than_silence() -> None:
    assert ScoreModel().detection_log_ratio(0.01, 0.0, 3) > miss_log_ratio(0.5)


def test_no_detection_is_proof() -> None:
    assert ScoreModel().detection_log_ratio(1.0) <= 3.0


def test_a_small_networks_low_scores_come_to_count() -> None:
    model = ScoreModel()
    before = model.detection_log_ratio(0.35)
    for _ in range(300):
        model.record_real(0.35)
    after = model.detection_log_ratio(0.35)
    assert after > before
    model.record_clutter([0.35] * 600)
    assert model.detection_log_ratio(0.35) < after


def test_a_detector_may_be_blind_to_what_another_one_found() -> None:
    model = RecallModel(detector="weak")
    rates = [model.own_rate(0.8, {"strong": FoundBy(5, 1), "weak": FoundBy(0, n)}) for n in (0, 2, 20)]
    assert rates[0] == pytest.approx(0.8)
    assert rates == sorted(rates, reverse=True)
    assert rates[-1] < 0.1


def test_rates_are_told_by_class() -> None:
    assert trained("chair", 3, 1).by_class() == {"chair": [3.0, 4.0]}
