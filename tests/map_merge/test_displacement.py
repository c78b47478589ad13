"""Objects that were pushed aside between two maps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from supermap_cli.map_merge.displacement import displacement_hypothesis
from support import scenes as s
from support.map_objects import TABLE, compare, map_object


def test_a_thing_pushed_aside_is_told_from_one_that_was_seen_from_another_side() -> None:
    armchair = replace(s.CHAIR, label="armchair", center=(2.0, 0, 0.4), size=(0.7, 0.7, 0.8))
    known, pushed = map_object(1, armchair), map_object(-1, armchair.at(2.05, 0.25))
    aside = displacement_hypothesis(known, pushed)
    assert aside is not None
    np.testing.assert_allclose(aside.shift_m[:2], (0.05, 0.25), atol=0.08)  # of equal ones the least
    compare(known, (armchair.at(2.05, 0.25),), aside)
    assert aside.is_accepted
    assert aside.since_ns is not None

    whole, end = map_object(1, TABLE, low=0.5), map_object(-1, TABLE, high=0.7)
    askew = displacement_hypothesis(whole, end)
    assert askew is not None
    compare(whole, (TABLE,), askew)
    assert not askew.is_accepted
    assert displacement_hypothesis(known, map_object(-1, armchair)) is None
