from __future__ import annotations

import pytest

from supermap_cli import timing
from supermap_cli.timing import StageClock, StageTiming


@pytest.fixture
def ticks(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What the clock shows, reading after reading."""
    readings: list[float] = []
    monkeypatch.setattr(timing.time, "perf_counter", lambda: readings.pop(0))
    return readings


def test_nothing_ran() -> None:
    assert StageClock().timings() == ()


def test_stages_are_measured_in_the_order_in_which_they_first_ran(ticks: list[float]) -> None:
    ticks += [0.0, 0.25, 1.0, 1.5, 2.0, 2.75]
    clock = StageClock()
    for stage in ("decode", "map", "decode"):
        with clock.stage(stage):
            pass
    decode, mapped = clock.timings()
    assert decode == StageTiming("decode", 1.0, 2, 500.0, pytest.approx(725.0))
    assert mapped == StageTiming("map", 0.5, 1, 500.0, 500.0)


def test_a_stage_that_fails_is_measured_and_the_error_goes_on(ticks: list[float]) -> None:
    ticks += [0.0, 0.5]
    clock = StageClock()
    with pytest.raises(ZeroDivisionError), clock.stage("map"):
        raise ZeroDivisionError
    assert [timing.total_s for timing in clock.timings()] == [0.5]


def test_a_stage_within_a_stage_counts_for_both(ticks: list[float]) -> None:
    ticks += [0.0, 1.0, 2.0, 3.0]
    clock = StageClock()
    with clock.stage("outer"), clock.stage("inner"):
        pass
    assert {timing.stage: timing.total_s for timing in clock.timings()} == {"outer": 3.0, "inner": 1.0}
