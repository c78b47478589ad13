"""Label beliefs and viewpoints: all hypotheses count, order does not, and a stare is no certainty."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.mapping.belief import LabelBelief, Viewpoint, ViewpointHistory, label_agreement
from supermap_cli.types.detections import Hypothesis

LABELS = ("chair", "couch", "bench", "stool")

hypotheses = st.lists(
    st.tuples(st.sampled_from(LABELS), st.floats(0.05, 1.0)), min_size=1, max_size=3, unique_by=lambda t: t[0]
).map(lambda pairs: tuple(Hypothesis(*pair) for pair in sorted(pairs, key=lambda t: -t[1])))


def believing(*detections: tuple[Hypothesis, ...], size_m: float = 0.0, weight: float = 1.0) -> LabelBelief:
    belief = LabelBelief(longest_side_m=size_m)
    for detection in detections:
        belief.update(detection, weight)
    return belief


def said(**scores: float) -> tuple[Hypothesis, ...]:
    return tuple(Hypothesis(label, score) for label, score in scores.items())


def test_nothing_seen_is_no_belief() -> None:
    assert LabelBelief().probabilities() == {}


@given(st.lists(hypotheses, min_size=1, max_size=6))
def test_a_belief_sums_to_one_best_first(detections: list[tuple[Hypothesis, ...]]) -> None:
    belief = believing(*detections)
    p = list(belief.probabilities().values())
    assert sum(p) == pytest.approx(1)
    assert p == sorted(p, reverse=True)
    assert belief.best == next(iter(belief.probabilities()))


@given(st.lists(hypotheses, min_size=1, max_size=6), st.randoms(use_true_random=False))
def test_the_order_of_detections_does_not_matter(detections: list[tuple[Hypothesis, ...]], random: object) -> None:
    shuffled = sorted(detections, key=lambda _: random.random())  # type: ignore[attr-defined]
    one, other = believing(*detections).probabilities(), believing(*shuffled).probabilities()
    assert one == pytest.approx(other)


def test_a_label_that_comes_late_has_been_unlikely_before() -> None:
    early = believing(said(couch=0.8), said(chair=0.8), said(chair=0.8))
    late = believing(said(chair=0.8), said(chair=0.8), said(couch=0.8))
    assert early.probabilities() == pytest.approx(late.probabilities())
    assert late.best == "chair"


def test_all_hypotheses_count() -> None:
    """`couch` is never the best label, but the only one that all three looks consider."""
    belief = believing(said(chair=0.5, couch=0.4), said(bench=0.5, couch=0.4), said(stool=0.5, couch=0.4))
    assert belief.best == "couch"


def test_a_firm_word_weighs_more_than_a_hesitant_one() -> None:
    assert believing(said(chair=0.9), said(couch=0.3)).best == "chair"
    assert believing(said(chair=0.3), said(couch=0.9)).best == "couch"


def test_scores_that_sum_to_more_than_one_are_shares() -> None:
    assert believing(said(chair=0.9, couch=0.9)).probabilities() == pytest.approx({"chair": 0.5, "couch": 0.5})


def test_a_long_stare_does_not_become_certainty() -> None:
    """One network errs in one way: a thousand looks say little more than a few."""
    few = believing(*[said(chair=0.6, couch=0.4)] * 3).probabilities()["couch"]
    many = believing(*[said(chair=0.6, couch=0.4)] * 1000).probabilities()["couch"]
    assert many == pytest.approx(few, abs=0.05)
    assert many > 0.2


def wrong_words(count: int) -> list[tuple[Hypothesis, ...]]:
    """Thirty detections of a tv, every second one called something else, by so many different words."""
    return [said(tv=0.5) if k % 2 else (Hypothesis(f"thing {k // 2 % count}", 0.5),) for k in range(30)]


def test_it_does_not_matter_how_many_different_wrong_words_were_said() -> None:
    few, many = (believing(*wrong_words(count)).probabilities()["tv"] for count in (2, 12))
    assert few > 0.5
    assert many >= few - 0.05


def test_the_same_wrong_word_every_time_wins() -> None:
    assert believing(*[said(laptop=0.5)] * 20, *[said(tv=0.5)] * 3).best == "laptop"


def test_a_look_of_small_weight_changes_little() -> None:
    belief = believing(said(chair=0.8))
    belief.update(said(couch=0.8), 0.01)
    assert belief.probabilities()["chair"] > 0.9


def test_a_microwave_a_metre_wide_is_a_tv() -> None:
    looks = [said(microwave=0.5, tv=0.3)] * 5
    assert believing(*looks, size_m=0.5).best == "microwave"
    assert believing(*looks, size_m=1.0).best == "tv"


def test_size_alone_does_not_invent_labels() -> None:
    assert believing(said(microwave=0.9), size_m=1.0).best == "microwave"


def test_two_detectors_that_agree_are_surer_than_one_that_repeats_itself() -> None:
    one, two = LabelBelief(), LabelBelief()
    for k in range(8):
        one.update((Hypothesis("tv", 0.6), Hypothesis("microwave", 0.4)), 1.0)
        two.detector = "first" if k < 4 else "second"
        two.update((Hypothesis("tv", 0.6), Hypothesis("microwave", 0.4)), 1.0)
    assert two.counts == one.counts
    assert two.probabilities()["tv"] > one.probabilities()["tv"]


def test_a_detector_is_expected_to_call_a_thing_as_it_did_before_whatever_it_is() -> None:
    belief = LabelBelief(detector="first")
    belief.update((Hypothesis("microwave", 1.0),), 3.0)
    assert belief.expected_words() == belief.probabilities()
    belief.detector = "second"
    assert belief.expected_words() == belief.probabilities()
    belief.update((Hypothesis("tv", 1.0),), 20.0)
    assert belief.best == "tv"
    assert belief.expected_words()["tv"] > 0.9
    belief.detector = "first"
    assert belief.expected_words()["microwave"] > 0.5


@given(st.lists(hypotheses, min_size=1, max_size=4), st.lists(hypotheses, min_size=1, max_size=4))
def test_joining_two_beliefs_is_having_seen_it_all_with_one(
    first: list[tuple[Hypothesis, ...]], second: list[tuple[Hypothesis, ...]]
) -> None:
    joined = believing(*first)
    joined.absorb(believing(*second))
    assert joined.probabilities() == pytest.approx(believing(*first, *second).probabilities())


def test_agreement_is_the_probability_of_one_label() -> None:
    assert label_agreement(said(chair=0.5, couch=0.5), {"chair": 0.8, "bench": 0.2}) == pytest.approx(0.4)
    assert label_agreement(said(stool=0.9), {"chair": 1.0}) == 0.0
    assert label_agreement(said(chair=0.2), {"chair": 1.0}) == pytest.approx(1.0)
    assert label_agreement((Hypothesis("chair", 0.0),), {"chair": 1.0}) == 0.0


ORIGIN = np.zeros(3)
PLACE = (2.0, 0.1, 1.0)


def seen_from(place: tuple[float, float, float], at_s: float = 0.0) -> Viewpoint:
    return Viewpoint(round(at_s * 1e9), np.array(place), ORIGIN)


def test_looks_from_one_place_add_up_like_the_square_root() -> None:
    views = ViewpointHistory()
    looks = [views.add_detection(seen_from(PLACE, 5.0 * k), 1.0) for k in range(100)]
    assert looks[0] == (1.0, 1.0)
    assert sum(weight for weight, _ in looks) == pytest.approx(10.0)
    assert sum(gain for _, gain in looks) == pytest.approx(10.0)


@pytest.mark.parametrize("elsewhere", [(0.1, 2.0, 1.0), (2.0, 0.1, 3.0), (6.0, 0.1, 3.0), (-2.0, 0.1, 1.0)])
def test_a_look_from_elsewhere_counts_in_full(elsewhere: tuple[float, float, float]) -> None:
    views = ViewpointHistory()
    views.add_detection(seen_from(PLACE), 1.0)
    assert views.add_detection(seen_from(elsewhere, 5.0), 2.0) == (1.0, 2.0)


@given(st.lists(st.floats(-2, 3), min_size=1, max_size=8), st.randoms(use_true_random=False))
def test_hits_and_misses_from_one_place_count_in_whatever_order(words: list[float], random: object) -> None:
    def told(order: list[float]) -> float:
        views = ViewpointHistory()
        looks = ((seen_from(PLACE, 5.0 * k), word) for k, word in enumerate(order))
        return sum(views.add_detection(at, word)[1] if word > 0 else views.add_miss(at, word) for at, word in looks)

    shuffled = sorted(words, key=lambda _: random.random())  # type: ignore[attr-defined]
    assert told(words) == pytest.approx(told(shuffled), abs=1e-9)


@given(st.floats(0.5, 3), st.integers(1, 30))
def test_a_look_that_says_next_to_nothing_takes_nothing_from_the_others(word: float, more: int) -> None:
    views = ViewpointHistory()
    views.add_detection(seen_from(PLACE), word)
    lost = sum(views.add_miss(seen_from(PLACE, 5.0 * k), -1e-6) for k in range(1, more))
    assert lost == pytest.approx(0, abs=1e-3)


@given(st.floats(0.1, 3), st.floats(0.1, 3))
def test_a_second_hit_never_speaks_against(first: float, second: float) -> None:
    views = ViewpointHistory()
    views.add_detection(seen_from(PLACE), first)
    assert views.add_detection(seen_from(PLACE, 5.0), second)[1] > 0


def test_looks_in_quick_succession_share_their_errors_wherever_they_are_from() -> None:
    around = [(2 * np.cos(0.5 * k), 2 * np.sin(0.5 * k), 1.0) for k in range(8)]
    quick, slow = ViewpointHistory(), ViewpointHistory()
    at_once = sum(quick.add_miss(seen_from(place, 0.2 * k), -1.0) for k, place in enumerate(around))
    assert sum(slow.add_miss(seen_from(place, 5.0 * k), -1.0) for k, place in enumerate(around)) == pytest.approx(-8.0)
    assert at_once == pytest.approx(-sum(1 / np.sqrt(k) for k in range(1, 9)))


def test_a_hit_ends_a_spell_of_misses() -> None:
    views = ViewpointHistory()
    views.add_miss(seen_from(PLACE, 0.0), -1.0)
    assert views.add_detection(seen_from((0.1, 2.0, 1.0), 0.3), 1.0)[1] == 1.0
    assert views.add_miss(seen_from((-2.0, 0.1, 1.0), 0.6), -1.0) == -1.0


def test_two_detectors_in_one_place_err_on_their_own() -> None:
    one, other = (Viewpoint(round(at_s * 1e9), np.ones(3), ORIGIN, name) for at_s, name in ((0, "one"), (10, "other")))
    history = ViewpointHistory()
    for _ in range(5):
        history.add_detection(one, 2.0)
    assert history.add_detection(other, 2.0) == (1.0, pytest.approx(2.0))
    assert history.last_weight(other) == pytest.approx(1.0)


def test_a_camera_on_the_object_itself_is_no_error() -> None:
    assert ViewpointHistory().add_detection(Viewpoint(0, ORIGIN, ORIGIN), 1.0) == (1.0, 1.0)


def test_joined_viewpoints_are_counted_together() -> None:
    one, other = ViewpointHistory(), ViewpointHistory()
    for k, views in enumerate((one, other, other)):
        views.add_detection(seen_from(PLACE, 5.0 * k), 1.0)
    one.absorb(other)
    weight, gain = one.add_detection(seen_from(PLACE, 20.0), 1.0)
    assert weight == pytest.approx(np.sqrt(4) - np.sqrt(3))
    assert gain == pytest.approx(np.sqrt(4) - np.sqrt(3))
