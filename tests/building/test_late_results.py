"""Results that come late, out of order or never."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.building.late_results import FixedLag, Lateness, LateResults
from supermap_cli.config import PerceptionConfig
from supermap_cli.types.detections import Detections, no_detections
from supermap_cli.types.keyframe import Keyframe
from support import scenes as s

SECOND_NS = 1_000_000_000
Perceived = tuple[Keyframe, Detections | None]


def perceived(count: int, *, every: int = 1) -> list[Perceived]:
    """Keyframes at 2 Hz, every so many of them with (empty) detections of its own."""
    keyframe = s.render(s.ROOM, s.looking((0, 0, 1.5), (2, 0, 0.5)), 0).keyframe
    stamps_ns = [keyframe.stamp_ns + i * SECOND_NS // 2 for i in range(count)]
    return [
        (replace(keyframe, stamp_ns=stamp_ns), no_detections(stamp_ns) if i % every == 0 else None)
        for i, stamp_ns in enumerate(stamps_ns)
    ]


def stamps(of: list[Perceived]) -> list[tuple[int, int | None]]:
    return [(keyframe.stamp_ns, None if found is None else found.stamp_ns) for keyframe, found in of]


# -- the buffer


def test_a_keyframe_with_nothing_to_wait_for_goes_on_at_once() -> None:
    lag: FixedLag[str, str] = FixedLag(SECOND_NS)
    lag.expect(0, "a", awaited=False)
    assert list(lag.settled(0)) == [("a", None)]
    assert list(lag.settled(None)) == []


def test_one_that_waits_holds_back_those_after_it() -> None:
    lag: FixedLag[str, str] = FixedLag(9)
    lag.expect(0, "a", awaited=True)
    lag.expect(1, "b", awaited=True)
    lag.expect(2, "c", awaited=False)
    assert lag.arrive(1, "of b")
    assert list(lag.settled(2)) == []
    assert lag.arrive(0, "of a")
    assert list(lag.settled(2)) == [("a", "of a"), ("b", "of b"), ("c", None)]


def test_after_the_wait_it_goes_without_and_its_result_is_too_late() -> None:
    lag: FixedLag[str, str] = FixedLag(10)
    lag.expect(0, "a", awaited=True)
    assert list(lag.settled(10)) == []
    assert list(lag.settled(11)) == [("a", None)]
    assert not lag.arrive(0, "of a")


def test_a_result_counts_once() -> None:
    lag: FixedLag[str, str] = FixedLag(10)
    lag.expect(0, "a", awaited=True)
    assert lag.arrive(0, "first")
    assert not lag.arrive(0, "second")
    assert list(lag.settled(0)) == [("a", "first")]


def test_at_the_end_nothing_is_held_any_more() -> None:
    lag: FixedLag[str, str] = FixedLag(10)
    lag.expect(0, "a", awaited=True)
    assert list(lag.settled(None)) == [("a", None)]


@given(st.lists(st.tuples(st.integers(0, 40), st.booleans()), max_size=25))
def test_in_whatever_order_results_come_the_keyframes_keep_theirs(plan: list[tuple[int, bool]]) -> None:
    """Keyframes at 0, 10, 20 ...; each result comes so long after its image, or was never asked for."""
    lag: FixedLag[int, int] = FixedLag(40)
    results = sorted((10 * i + delay, 10 * i) for i, (delay, awaited) in enumerate(plan) if awaited)
    settled = []
    for i, (_, awaited) in enumerate(plan):
        lag.expect(10 * i, i, awaited=awaited)
        while results and results[0][0] <= 10 * i:
            assert lag.arrive(results.pop(0)[1], 10 * i)
        settled += lag.settled(10 * i)
        assert i + 1 - len(settled) <= 5
    assert all(lag.arrive(stamp, -1) for _, stamp in results)
    settled += lag.settled(None)
    assert [keyframe for keyframe, _ in settled] == list(range(len(plan)))
    assert [result is not None for _, result in settled] == [awaited for _, awaited in plan]


# -- a detector that takes its time


def test_nothing_stays_nothing() -> None:
    assert list(LateResults(PerceptionConfig(delay_s=1)).settled([])) == []


@pytest.mark.parametrize("delay_s", [0.0, 0.2, 2.0])
@pytest.mark.parametrize("every", [1, 3])
def test_late_results_are_given_to_the_images_they_are_of(delay_s: float, every: int) -> None:
    given_ = perceived(20, every=every)
    assert stamps(list(LateResults(PerceptionConfig(delay_s=delay_s)).settled(given_))) == stamps(given_)


def test_without_delay_no_keyframe_is_held() -> None:
    held = 0

    def counted() -> list[Perceived]:
        nonlocal held
        for each in perceived(5):
            held += 1
            yield each  # type: ignore[misc]

    for _ in LateResults(PerceptionConfig()).settled(counted()):
        held -= 1
        assert held == 0


def test_no_more_keyframes_are_held_than_come_in_the_wait() -> None:
    held = most = 0

    def counted() -> list[Perceived]:
        nonlocal held, most
        for each in perceived(60):
            held += 1
            most = max(most, held)
            yield each  # type: ignore[misc]

    for _ in LateResults(PerceptionConfig(delay_s=2, dropped=0.5, wait_s=3)).settled(counted()):
        held -= 1
    assert (held, most) == (0, 8)


def test_dropped_results_leave_the_depth() -> None:
    late = LateResults(PerceptionConfig(dropped=0.25))
    found = [detections for _, detections in late.settled(perceived(200))]
    assert len(found) == 200
    assert late.lost == found.count(None) == pytest.approx(50, abs=15)


def test_those_later_than_the_wait_are_left_out_and_counted() -> None:
    late = LateResults(PerceptionConfig(delay_s=4, wait_s=1))
    found = [detections for _, detections in late.settled(perceived(100))]
    assert 0 < late.too_late == found.count(None) < 100


def test_how_late_a_result_comes_is_the_same_each_time() -> None:
    lateness = Lateness(2.0, 0.2)
    arrivals = [lateness.arrival_ns(stamp_ns) for stamp_ns in range(0, 100 * SECOND_NS, SECOND_NS)]
    assert arrivals == [lateness.arrival_ns(stamp_ns) for stamp_ns in range(0, 100 * SECOND_NS, SECOND_NS)]
    late_ns = [arrival - i * SECOND_NS for i, arrival in enumerate(arrivals) if arrival is not None]
    assert 0 <= min(late_ns) < 0.2 * SECOND_NS < 1.8 * SECOND_NS < max(late_ns) <= 2 * SECOND_NS
