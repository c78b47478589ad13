"""Results that come late, out of order or never."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.stages.fixed_lag import FixedLag

SECOND_NS = 1_000_000_000


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


def test_cameras_of_one_stamp_have_results_of_their_own() -> None:
    lag: FixedLag[str, str] = FixedLag(SECOND_NS)
    lag.expect(0, "front", awaited=True, camera_id="front")
    lag.expect(0, "left", awaited=True, camera_id="left")
    assert lag.arrive(0, "of left", "left")
    assert list(lag.settled(0)) == []
    assert lag.arrive(0, "of front", "front")
    assert list(lag.settled(0)) == [("front", "of front"), ("left", "of left")]
