"""Reliability of confidences and the expected calibration error."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.evaluation.calibration import BINS, Rated, reliability

samples = st.lists(st.tuples(st.floats(0, 1), st.booleans()), max_size=60)


def calibration_error(rated: list[Rated]) -> float:
    """The definition of Guo et al. 2017, (3) to (5), number by number."""
    total = 0.0
    for m in range(1, 11):
        low, high = (m - 1) / 10, m / 10 if m < 10 else math.inf
        inside = [pair for pair in rated if low <= pair[0] < high]
        if inside:
            accuracy = math.fsum(right for _, right in inside) / len(inside)
            confidence = math.fsum(sure for sure, _ in inside) / len(inside)
            total += len(inside) / len(rated) * abs(accuracy - confidence)
    return total


@given(samples.filter(bool))
def test_the_error_is_that_of_the_definition(rated: list[Rated]) -> None:
    assert reliability(rated).expected_calibration_error == pytest.approx(calibration_error(rated), abs=1e-9)


@given(samples)
def test_bins_hold_every_instance_once_and_all_figures_are_shares(rated: list[Rated]) -> None:
    scores = reliability(rated)
    assert len(scores.bins) == BINS
    assert sum(one.count for one in scores.bins) == scores.count == len(rated)
    for one in scores.bins:
        assert (one.count == 0) == (one.mean_confidence is None) == (one.share_right is None)
        assert one.mean_confidence is None or one.low - 1e-9 <= one.mean_confidence <= one.high + 1e-9
    figures = (scores.expected_calibration_error, scores.mean_confidence, scores.share_right)
    assert all(figure is None or 0 <= figure <= 1 for figure in figures)
    assert (scores.expected_calibration_error is None) == (not rated)


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.floats(0.2, 5))
def test_a_calibrated_sample_has_a_small_error_and_one_that_is_too_sure_a_large_one(seed: int, shape: float) -> None:
    random = np.random.default_rng(seed)
    sure = random.beta(shape, 1.0, 20_000)
    right = random.random(20_000) < sure
    assert (reliability(zip(sure.tolist(), right.tolist(), strict=True)).expected_calibration_error or 0) < 0.02
    wrong = reliability((1.0, one) for one in right.tolist())
    assert wrong.expected_calibration_error == pytest.approx(1 - right.mean())


def test_borders_belong_to_the_bin_above_and_one_to_the_last() -> None:
    scores = reliability((k / 10, True) for k in range(11))
    assert [one.count for one in scores.bins] == [1] * 9 + [2]


@pytest.mark.parametrize("outside", [-0.1, 1.1, math.nan])
def test_what_is_no_probability_is_refused(outside: float) -> None:
    with pytest.raises(ValueError, match=r"\[0, 1\]"):
        reliability([(outside, True)])
