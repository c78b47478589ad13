"""Which images are mapped, and which of them are perceived."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.drivers.keyframe_choice import choose_keyframes, fill_gaps
from support import scenes as s


def stamps(rate_hz: float, seconds: float = 10.0, jitter_ns: int = 0) -> np.ndarray:
    rng = np.random.default_rng(1)
    exact = np.arange(0, seconds, 1 / rate_hz) * 1e9
    return (s.EPOCH_NS + exact + rng.integers(-jitter_ns, jitter_ns + 1, len(exact))).astype(np.int64)


def test_no_images_give_no_keyframes() -> None:
    chosen = choose_keyframes(np.zeros(0, np.int64), None, 3.0, None)
    assert chosen.mapped == chosen.perceived == frozenset()


@pytest.mark.parametrize(("recorded_hz", "wanted_hz"), [(30, 3), (15, 3), (30, 30), (10, 3), (15, 4)])
@pytest.mark.parametrize("jitter_ns", [0, 2_000_000])
def test_images_are_chosen_at_the_wanted_rate(recorded_hz: float, wanted_hz: float, jitter_ns: int) -> None:
    chosen = choose_keyframes(stamps(recorded_hz, jitter_ns=jitter_ns), None, wanted_hz, None)
    assert chosen.mapped == chosen.perceived
    assert len(chosen.mapped) == pytest.approx(10 * wanted_hz, abs=1 + 0.02 * 10 * wanted_hz)
    assert np.diff(sorted(chosen.mapped)).max() <= 1e9 / wanted_hz + 1e9 / recorded_hz + 2 * jitter_ns + 1


def test_all_images_are_taken_of_a_recording_slower_than_wanted() -> None:
    assert len(choose_keyframes(stamps(1.0), None, 3.0, None).mapped) == 10


def test_after_a_gap_it_goes_on_at_the_wanted_rate() -> None:
    both = np.concatenate([stamps(30, 2.0), stamps(30, 2.0) + 60 * 10**9])
    assert len(choose_keyframes(both, None, 3.0, None).mapped) == 12


def test_only_images_the_detector_can_speak_of_are_perceived() -> None:
    frames = stamps(30)
    chosen = choose_keyframes(frames, frames[5::40], 3.0, None)
    assert chosen.perceived == frozenset(frames[5::40].tolist())
    assert choose_keyframes(frames, frames + 1, 3.0, None).mapped == frozenset()


def test_where_the_detector_is_silent_images_are_mapped_by_their_depth() -> None:
    frames = stamps(30)
    chosen = choose_keyframes(frames, frames[60:180:40], 3.0, None)
    assert chosen.perceived < chosen.mapped
    steps_ns = np.diff(sorted({*chosen.mapped, frames[0], frames[-1]}))
    assert steps_ns.max() <= 1.5e9 / 3 + 1
    assert len(chosen.mapped) == pytest.approx(30, abs=2)


def test_detections_about_as_frequent_as_keyframes_bring_no_others_in() -> None:
    frames = stamps(10)
    chosen = choose_keyframes(frames, frames[::2], 3.0, None)
    assert chosen.mapped == chosen.perceived


@pytest.mark.parametrize("jitter_ns", [0, 2_000_000])
def test_images_can_be_perceived_less_often_than_mapped(jitter_ns: int) -> None:
    chosen = choose_keyframes(stamps(30, jitter_ns=jitter_ns), None, 3.0, 1.0)
    assert (len(chosen.mapped), len(chosen.perceived)) == (30, 10)
    assert chosen.perceived < chosen.mapped


def test_images_cannot_be_perceived_more_often_than_mapped() -> None:
    chosen = choose_keyframes(stamps(30), None, 3.0, 10.0)
    assert chosen.mapped == chosen.perceived
    assert len(chosen.mapped) == 30


def test_a_gap_is_filled_evenly_from_what_there_is() -> None:
    at = np.arange(0, 110, 10)
    assert fill_gaps(at, np.array([0, 100]), 33) == {30, 70}
    assert fill_gaps(at[[0, 1, 10]], np.array([0, 100]), 33) == frozenset()
    assert fill_gaps(at, np.array([40]), 20) == {0, 20, 60, 80, 100}
    assert fill_gaps(np.array([5]), np.array([5]), 20) == frozenset()


def filled_step_by_step(stamps_ns: np.ndarray, chosen_ns: np.ndarray, period_ns: float) -> set[int]:
    """What `fill_gaps` says, by looking at every step of every gap."""
    wanted = []
    at = chosen_ns[0] - period_ns
    while at >= stamps_ns[0] - 1e6:
        wanted.append(at)
        at -= period_ns
    at = chosen_ns[-1] + period_ns
    while at <= stamps_ns[-1] + 1e6:
        wanted.append(at)
        at += period_ns
    for start, end in itertools.pairwise(chosen_ns.tolist()):
        steps = round((end - start) / period_ns)
        wanted += [start + (end - start) * step / steps for step in range(1, steps)]
    nearest = [(float(stamps_ns[np.abs(stamps_ns - at).argmin()]), at) for at in wanted]
    return {int(stamp) for stamp, at in nearest if abs(stamp - at) < period_ns / 2}


@given(
    st.lists(st.integers(0, 400), min_size=1, max_size=60, unique=True),
    st.lists(st.integers(0, 59), min_size=1, max_size=12),
    st.integers(5, 60),
)
def test_gaps_are_filled_as_by_looking_at_every_step(at: list[int], which: list[int], period: int) -> None:
    stamps_ns = np.array(sorted(at), np.int64) * 10_000_000
    chosen_ns = stamps_ns[sorted({each % len(at) for each in which})]
    period_ns = period * 10_000_000.0
    assert fill_gaps(stamps_ns, chosen_ns, period_ns) == filled_step_by_step(stamps_ns, chosen_ns, period_ns)


def test_a_gap_of_decades_costs_nothing() -> None:
    stamps_ns = np.concatenate([np.arange(60), 10**10 + np.arange(60)]) * 10**8
    assert len(fill_gaps(stamps_ns, stamps_ns[[0, 30, 90, 119]], 3e8)) < len(stamps_ns)
    assert len(fill_gaps(stamps_ns, stamps_ns[[0]], 3e8)) < len(stamps_ns)
