"""Percentiles are numpy's, in float64 to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.geometry.percentiles import percentiles

WANTED = (1.0, 1.5, 50.0, 98.5, 99.0)


@pytest.mark.parametrize("n", [1, 2, 3, 10, 99, 1000])
def test_they_are_those_of_numpy(n):
    drawn = np.random.default_rng(n)
    columns, whole = drawn.normal(size=(n, 3)), drawn.integers(0, 640, n)
    np.testing.assert_array_equal(percentiles(columns, WANTED), np.percentile(columns, WANTED, axis=0))
    np.testing.assert_array_equal(percentiles(np.asfortranarray(columns), WANTED), percentiles(columns, WANTED))
    np.testing.assert_array_equal(percentiles(whole, WANTED), np.percentile(whole, WANTED))
    single = whole.astype(np.float32)
    np.testing.assert_allclose(percentiles(single, (90,))[0], np.percentile(single, 90), rtol=1e-6)
