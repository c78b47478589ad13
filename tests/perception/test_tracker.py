"""The tracker `bytetrack`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_bytetrack import ByteTrackOptions
from supermap_bytetrack.kalman import initiate, predict, update
from supermap_bytetrack.tracker import ByteTracker
from supermap_cli.types.detections import Detections, Hypothesis, TrackPrior, no_detections

IMAGE = (640, 480)
FRAME_NS = 333_000_000
Box = tuple[float, float, float, float]


def seen(index: int, *found: tuple[Box, str, float]) -> Detections:
    """The detections of the index-th image."""
    return Detections(
        index * FRAME_NS,
        np.array([box for box, _, _ in found], np.float32).reshape(-1, 4),
        np.array([score for _, _, score in found], np.float32),
        tuple((Hypothesis(label, score),) for _, label, score in found),
        (None,) * len(found),
    )


def cup(u: float, score: float = 0.8, label: str = "cup") -> tuple[Box, str, float]:
    return (u, 200.0, u + 40, 240.0), label, score


def prior(track_id: int, u: float, hidden: bool = False, label: str = "cup") -> TrackPrior:
    return TrackPrior(track_id, np.array(cup(u)[0], np.float32), label, hidden)


def run(tracker: ByteTracker, images: Sequence[Detections], priors: Sequence[TrackPrior] = ()) -> list[list[int]]:
    return [tracker.update(image, priors, IMAGE).track_ids.tolist() for image in images]


@pytest.fixture
def tracker() -> ByteTracker:
    return ByteTracker(ByteTrackOptions(lost_frames=2))


def test_an_empty_image_has_no_tracks(tracker: ByteTracker) -> None:
    assert run(tracker, [no_detections(0), no_detections(FRAME_NS)]) == [[], []]


def test_a_thing_keeps_its_track(tracker: ByteTracker) -> None:
    assert run(tracker, [seen(0, cup(100)), seen(1, cup(110)), seen(2, cup(120))]) == [[1], [1], [1]]


def test_a_small_fast_box_is_followed_though_its_boxes_do_not_touch(tracker: ByteTracker) -> None:
    images = [seen(i, cup(100 + 60 * i)) for i in range(5)]
    assert run(tracker, images) == [[1]] * 5


def test_two_like_things_keep_apart(tracker: ByteTracker) -> None:
    images = [seen(i, cup(100 + 50 * i), cup(250 + 50 * i)) for i in range(5)]
    assert run(tracker, images) == [[1, 2]] * 5 or run(tracker, images) == [[2, 1]] * 5


def test_low_scores_start_no_track_but_keep_one(tracker: ByteTracker) -> None:
    images = [seen(0, cup(100, 0.2)), seen(1, cup(100)), seen(2, cup(100, 0.2)), seen(3, cup(100))]
    assert run(tracker, images) == [[-1], [1], [1], [1]]


def test_a_low_score_does_not_take_the_track_of_a_high_one(tracker: ByteTracker) -> None:
    run(tracker, [seen(0, cup(100))])
    assert run(tracker, [seen(1, cup(100, 0.15), cup(104, 0.8))]) == [[-1, 1]]


def test_another_label_costs_but_does_not_forbid(tracker: ByteTracker) -> None:
    run(tracker, [seen(0, cup(100))])
    assert run(tracker, [seen(1, cup(102, label="bowl"), cup(112))]) == [[2, 1]]
    assert run(tracker, [seen(2, cup(112, label="vase"))])[0][0] in {1, 2}


@pytest.mark.parametrize(("gap", "expected"), [(2, 1), (3, 2)])
def test_a_lost_track_is_forgotten_after_some_images(tracker: ByteTracker, gap: int, expected: int) -> None:
    images = [seen(0, cup(100)), *(no_detections(i * FRAME_NS) for i in range(1, gap + 1))]
    run(tracker, images)
    assert run(tracker, [seen(gap + 1, cup(100))]) == [[expected]]


def test_the_prior_replaces_the_motion(tracker: ByteTracker) -> None:
    run(tracker, [seen(0, cup(100))])
    assert run(tracker, [seen(1, cup(500))], [prior(1, 500)]) == [[1]]


def test_a_hidden_object_keeps_its_track_for_as_long_as_the_map_says(tracker: ByteTracker) -> None:
    run(tracker, [seen(0, cup(100))])
    run(tracker, [no_detections(i * FRAME_NS) for i in range(1, 20)], [prior(1, 100, hidden=True)])
    assert run(tracker, [seen(20, cup(104))], [prior(1, 100)]) == [[1]]


def test_what_stands_before_a_hidden_object_does_not_take_its_track(tracker: ByteTracker) -> None:
    run(tracker, [seen(0, cup(100), cup(300))])
    both = [prior(1, 100, hidden=True), prior(2, 110)]
    assert run(tracker, [seen(1, cup(104))], both) == [[2]]


def test_a_track_that_only_the_map_remembers_is_taken_up(tracker: ByteTracker) -> None:
    assert run(tracker, [seen(0, cup(100), cup(400))], [prior(7, 102)]) == [[7, 8]]


def test_tracks_of_the_map_carry_the_others_with_the_camera(tracker: ByteTracker) -> None:
    run(tracker, [seen(0, cup(100), cup(200), cup(300, label="vase"))])
    moved = seen(1, cup(400), cup(500), cup(600, label="vase"))
    assert run(tracker, [moved], [prior(1, 400), prior(2, 500)]) == [[1, 2, 3]]


found = st.tuples(st.integers(0, 600), st.sampled_from(["cup", "chair"]), st.sampled_from([0.15, 0.35, 0.7, 0.9]))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.lists(found, max_size=6, unique_by=lambda detection: detection[0]), min_size=1, max_size=5))
def test_ids_are_unique_and_follow_their_detections(images: list[list[tuple[int, str, float]]]) -> None:
    straight, shuffled = ByteTracker(ByteTrackOptions()), ByteTracker(ByteTrackOptions())
    for index, image in enumerate(images):
        order = np.random.default_rng(len(image) + index).permutation(len(image)).astype(np.int64)
        detections = seen(index, *(cup(u, score, label) for u, label, score in image))
        ids = straight.update(detections, (), IMAGE).track_ids
        assert shuffled.update(detections.take(order), (), IMAGE).track_ids.tolist() == ids[order].tolist()
        given_ids = ids[ids >= 0]
        assert len(set(given_ids.tolist())) == len(given_ids)
        assert (ids[detections.scores >= 0.3] >= 0).all()


def test_the_filter_learns_a_constant_velocity() -> None:
    states = initiate(np.array([[0, 0, 40, 40]], np.float32), IMAGE[0])
    for i in range(1, 15):
        states = update(predict(states, 0.3, IMAGE[0]), np.array([[30 * i, 0, 30 * i + 40, 40]], np.float32))
    np.testing.assert_allclose(states.mean[0], [20 + 30 * 14, 20, 40, 40, 100, 0], atol=2)


def test_uncertainty_grows_without_and_shrinks_with_a_measurement() -> None:
    box = np.array([[0, 0, 40, 40]], np.float32)
    first = initiate(box, IMAGE[0])
    later = predict(first, 0.3, IMAGE[0])
    assert (later.centre_deviation > first.centre_deviation).all()
    assert (update(later, box).centre_deviation < later.centre_deviation).all()
    assert np.linalg.eigvalsh(update(later, box).covariance[0]).min() > 0
