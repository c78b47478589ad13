"""The probability of existence log-odds."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.types.existence import DEFAULT, ExistenceParameters, log_odds_of, probability_of

lines = st.builds(ExistenceParameters, intercept=st.floats(-3, 3), slope=st.floats(0.1, 2))


@given(st.floats(-6, 12), lines)
def test_it_is_the_logistic_function_of_a_line(log_odds: float, line: ExistenceParameters) -> None:
    expected = 1 / (1 + math.exp(-(line.intercept + line.slope * log_odds)))
    assert probability_of(log_odds, line) == pytest.approx(expected, rel=1e-12)


@given(st.floats(-6, 12))
def test_probabilities_become_the_log_odds_that_they_come_from(log_odds: float) -> None:
    assert log_odds_of(probability_of(log_odds)) == pytest.approx(log_odds, abs=1e-9)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_more_evidence_is_never_less_probable(first: float, second: float) -> None:
    low, high = sorted((first, second))
    assert 0 <= probability_of(low) <= probability_of(high) <= 1


@pytest.mark.parametrize("probability", [0.0, 1.0])
def test_certainty_has_finite_log_odds(probability: float) -> None:
    assert math.isfinite(log_odds_of(probability))


def test_as_much_for_it_as_against_it_is_two_in_five() -> None:
    assert probability_of(0.0) == pytest.approx(0.416, abs=1e-3)
    assert log_odds_of(0.5) == pytest.approx(-DEFAULT.intercept / DEFAULT.slope)
