from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.mapping.class_sizes import size_log_likelihood


@pytest.mark.parametrize(("label", "side_m"), [("chair", 0.9), ("chair", 0.1), ("cup", 0.1), ("flying carpet", 50.0)])
def test_a_plausible_or_smaller_size_and_an_unlisted_class_are_not_judged(label: str, side_m: float) -> None:
    assert size_log_likelihood(label, side_m) == 0.0


@given(st.floats(0.7, 5.0), st.floats(0.01, 1.0))
def test_the_larger_the_less_likely(side_m: float, more_m: float) -> None:
    assert size_log_likelihood("microwave", side_m + more_m) <= size_log_likelihood("microwave", side_m) < 0


def test_one_sigma_more_is_half_a_nat() -> None:
    assert size_log_likelihood("microwave", 0.6 * 1.1275) == pytest.approx(-0.5, abs=0.05)


def test_a_measure_may_be_wrong_altogether() -> None:
    """A stool whose mask fills the gaps between its legs is measured twice as wide: its name is worth more."""
    assert size_log_likelihood("microwave", 3.0) == pytest.approx(size_log_likelihood("microwave", 30.0), abs=1e-6)
    assert size_log_likelihood("microwave", 30.0) == pytest.approx(-3.0, abs=0.01)
