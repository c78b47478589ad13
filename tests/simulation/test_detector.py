"""The detector error model: exact when perfect, and wrong at the rates and in the ways asked for."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from pydantic import ValidationError

from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.simulation.detection.correlated_noise import CorrelatedNoise
from supermap_cli.simulation.detection.detector import DetectorErrors, SimulatedDetector
from supermap_cli.simulation.detection.label_errors import look_alikes
from supermap_cli.simulation.views import PlaceVisibility, RenderedView
from supermap_cli.simulation.world import Fixture, Material, Shape, SimulatedThing, World
from supermap_cli.simulation.worlds.shapes import LABELS

START_NS = 1_700_000_000_000_000_000
PERFECT = DetectorErrors.perfect()
CHAIRS = ("chair", "chair")
TRIANGLE = Shape(np.eye(3), np.array([[0, 1, 2]]), np.zeros(1, np.int64), (Material((9, 9, 9)),))
Rectangle = tuple[int, int, int, int]


def _world(labels: Sequence[str], fixtures: tuple[Fixture, ...] = ()) -> World:
    return World(fixtures, tuple(SimulatedThing(f"{label}-{k}", label, TRIANGLE) for k, label in enumerate(labels)), ())


def _view(rectangles: Sequence[Rectangle], frame: int = 0, size: tuple[int, int] = (240, 320)) -> RenderedView:
    """An image in which the k-th thing covers columns u0..u1 and rows v0..v1 of the k-th (u0, v0, u1, v1), 2 m away."""
    thing = np.zeros(size, np.int32)
    for k, (u0, v0, u1, v1) in enumerate(rectangles):
        thing[v0:v1, u0:u1] = k + 1
    stamp_ns = START_NS + frame * 200_000_000
    return RenderedView(
        stamp_ns, np.full(size, 2, np.float32), thing, np.ones(size, np.float32), np.zeros((*size, 3), np.uint8)
    )


def _sights(view: RenderedView, *, distance_m: float = 2.0, visible: float = 1.0) -> PlaceVisibility:
    numbers, pixels = np.unique(view.thing[view.thing > 0], return_counts=True)
    n = len(numbers)
    share = np.full(n, visible, np.float32)
    return PlaceVisibility(
        numbers.astype(np.int64) - 1,
        np.zeros(n, np.int64),
        np.ones(n, bool),
        np.ones(n, np.float32),
        share,
        pixels.astype(np.int64),
        np.full(n, distance_m, np.float32),
    )


def _with(**knobs: float) -> DetectorErrors:
    """A perfect detector but for some knobs, with errors that no thing is prone to."""
    return DetectorErrors.model_validate({**PERFECT.model_dump(), "constant": 0.0, **knobs})


def _counts(errors: DetectorErrors, rectangles: Sequence[Rectangle], frames: int, **seen: float) -> np.ndarray:
    """How many detections each of so many images gives."""
    detector = SimulatedDetector(_world(CHAIRS), errors, seed=3)
    views = (_view(rectangles, 20 * frame) for frame in range(frames))
    return np.array([len(detector.detect(view, _sights(view, **seen), full_turn=False)) for view in views])


def test_an_image_of_nothing_gives_nothing() -> None:
    view = _view([])
    assert len(SimulatedDetector(_world(CHAIRS), PERFECT, 0).detect(view, _sights(view), full_turn=False)) == 0


def test_a_perfect_detector_gives_the_views_masks_boxes_and_labels() -> None:
    view = _view([(0, 10, 60, 80), (100, 90, 101, 91), (200, 50, 320, 240)])
    found = SimulatedDetector(_world(("desk", "mug", "person")), PERFECT, 0).detect(
        view, _sights(view), full_turn=False
    )
    assert sorted(found.labels) == ["desk", "mug", "person"]
    assert found.scores == pytest.approx(0.99)
    for label, box, mask in zip(found.labels, found.boxes_xyxy, found.masks, strict=True):
        assert mask is not None
        number = 1 + ["desk", "mug", "person"].index(label)
        assert np.array_equal(mask.full(240, 320), view.thing == number)
        columns, rows = np.flatnonzero((view.thing == number).any(0)), np.flatnonzero((view.thing == number).any(1))
        assert box.tolist() == [columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]


def test_nothing_tells_the_true_ids() -> None:
    view = _view([(10, 10, 60, 80), (100, 90, 200, 200)])
    found = SimulatedDetector(_world(CHAIRS), DetectorErrors(), 0).detect(view, _sights(view), full_turn=False)
    told = {hypothesis.label for hypotheses in found.hypotheses for hypothesis in hypotheses}
    assert told <= set(LABELS) | {"person"}


def test_detections_are_sorted_by_score_and_scores_are_probabilities() -> None:
    detector = SimulatedDetector(_world(LABELS), DetectorErrors(false_positives=3), 1)
    for frame in range(20):
        view = _view(
            [(30 * (k % 10), 50 * (k // 10), 30 * (k % 10) + 20, 50 * (k // 10) + 40) for k in range(35)], frame
        )
        found = detector.detect(view, _sights(view), full_turn=False)
        assert (np.diff(found.scores) <= 0).all()
        for hypotheses in found.hypotheses:
            scores = [hypothesis.score for hypothesis in hypotheses]
            assert scores == sorted(scores, reverse=True)
            assert 0 < sum(scores) <= 1
            assert len({hypothesis.label for hypothesis in hypotheses}) == len(hypotheses) == 3


@pytest.mark.parametrize("what", ["distance_m", "visible", "pixels"])
def test_recall_falls(what: str) -> None:
    errors = DetectorErrors(false_positives=0, splitting=0, merging=0, swallowing=0)
    near: dict[str, dict[str, float]] = {"distance_m": {"distance_m": 1.5}, "visible": {"visible": 1.0}}
    far: dict[str, dict[str, float]] = {"distance_m": {"distance_m": 8.0}, "visible": {"visible": 0.2}}
    small: Rectangle = (50, 50, 59, 59)
    many = _counts(errors, [(50, 50, 150, 150)], 250, **near.get(what, {})).mean()
    few = _counts(errors, [small if what == "pixels" else (50, 50, 150, 150)], 250, **far.get(what, {})).mean()
    assert many > 0.85
    assert few < many - 0.3


def test_regions_below_the_least_area_are_never_found() -> None:
    assert _counts(_with(min_area_px=60), [(50, 50, 57, 58)], 20).sum() == 0
    assert _counts(_with(min_area_px=60), [(50, 50, 60, 56)], 20).sum() == 20


def test_misses_come_in_runs() -> None:
    detector = SimulatedDetector(_world(CHAIRS), _with(recall=0.5, lasting=0.8, lasting_s=2.0), 0)
    views = [_view([(50, 50, 150, 150)], frame) for frame in range(700)]
    found = np.array([len(detector.detect(view, _sights(view), full_turn=False)) for view in views])
    assert found.mean() == pytest.approx(0.5, abs=0.15)
    assert (found[1:] == found[:-1]).mean() > 0.7


def test_a_wrong_label_is_a_look_alikes_and_stays_the_same_for_a_while() -> None:
    detector = SimulatedDetector(_world(CHAIRS), _with(confusion=0.5, hypotheses=3, lasting=0.9, lasting_s=0.8), 2)
    labels = []
    for frame in range(1200):
        view = _view([(50, 50, 150, 150)], frame)
        found = detector.detect(view, _sights(view), full_turn=False)
        labels.append(found.labels[0])
        assert "chair" in {hypothesis.label for hypothesis in found.hypotheses[0][:2]}
    wrong = np.array([label != "chair" for label in labels])
    assert wrong.mean() == pytest.approx(0.5 * 0.6, abs=0.1)
    assert {label for label in labels if label != "chair"} <= set(look_alikes()["chair"])
    mistaken_twice = [(a, b) for a, b in pairwise(labels) if "chair" not in {a, b}]
    assert len(mistaken_twice) > 100
    assert np.mean([a == b for a, b in mistaken_twice]) > 0.9


@pytest.mark.parametrize("rate", [0.1, 0.4])
def test_large_things_are_split_at_about_the_rate(rate: float) -> None:
    counts = _counts(_with(splitting=rate), [(50, 50, 150, 150)], 500)
    assert set(counts.tolist()) == {1, 2}
    assert (counts == 2).mean() == pytest.approx(rate, abs=0.06)
    assert (_counts(_with(splitting=rate), [(50, 50, 80, 80)], 20) == 1).all()


@pytest.mark.parametrize("rate", [0.1, 0.4])
def test_touching_things_of_one_label_are_merged_at_about_the_rate(rate: float) -> None:
    counts = _counts(_with(merging=rate), [(50, 50, 100, 100), (100, 50, 150, 100)], 500)
    assert (counts == 1).mean() == pytest.approx(rate, abs=0.06)
    assert (_counts(_with(merging=1.0), [(50, 50, 100, 100), (120, 50, 170, 100)], 20) == 2).all()


def test_a_merged_mask_covers_both_and_a_split_one_is_shared_out() -> None:
    view = _view([(50, 50, 100, 100), (100, 50, 160, 100)])
    merged = SimulatedDetector(_world(CHAIRS), _with(merging=1.0), 0).detect(view, _sights(view), full_turn=False)
    assert [mask.full(240, 320).sum() for mask in merged.masks if mask] == [50 * 110]
    alone = _view([(50, 50, 150, 100)])
    split = SimulatedDetector(_world(CHAIRS), _with(splitting=1.0), 0).detect(alone, _sights(alone), full_turn=False)
    parts = [mask.full(240, 320) for mask in split.masks if mask]
    assert len(parts) == 2
    assert not (parts[0] & parts[1]).any()
    assert np.array_equal(parts[0] | parts[1], alone.thing == 1)


@pytest.mark.parametrize(("full_turn", "count"), [(True, 2), (False, 1)])
def test_a_thing_across_the_seam_of_a_panorama_is_found_twice(full_turn: bool, count: int) -> None:
    view = _view([(0, 50, 30, 100)])
    view.thing[50:100, 290:] = 1
    found = SimulatedDetector(_world(CHAIRS), PERFECT, 0).detect(view, _sights(view), full_turn=full_turn)
    assert len(found) == count
    covered = np.any([mask.full(240, 320) for mask in found.masks if mask], axis=0)
    assert np.array_equal(covered, view.thing == 1)
    if full_turn:
        assert sorted(found.boxes_xyxy[:, 0].tolist()) == [0, 290]


def test_masks_bleed_or_are_cut_by_no_more_than_they_may() -> None:
    view = _view([(100, 80, 200, 160)])
    exact = view.thing == 1
    detector = SimulatedDetector(_world(CHAIRS), _with(bleeding=0.5, bleeding_px=4, erosion_px=2), 0)
    grown = []
    for frame in range(60):
        found = detector.detect(_view([(100, 80, 200, 160)], 30 * frame), _sights(view), full_turn=False)
        mask = found.masks[0]
        assert mask is not None
        full = mask.full(240, 320)
        columns = np.flatnonzero(full.any(axis=0))
        assert columns.min() >= 96
        assert columns.max() < 204
        assert full[82:158, 102:198].all()
        grown.append(int(full.sum()) - int(exact.sum()))
    assert min(grown) < 0 < max(grown)


def test_masks_and_boxes_stay_within_the_image_and_belong_together() -> None:
    detector = SimulatedDetector(_world(CHAIRS), DetectorErrors(patches=1.0, false_positives=2), 0)
    for frame in range(30):
        view = _view([(0, 0, 60, 60), (250, 200, 320, 240)], 20 * frame)
        found = detector.detect(view, _sights(view), full_turn=False)
        assert (found.boxes_xyxy >= 0).all()
        assert (found.boxes_xyxy <= [320, 240, 320, 240]).all()
        for box, mask in zip(found.boxes_xyxy, found.masks, strict=True):
            assert mask is not None
            h, w = mask.pixels.shape
            assert mask.pixels.any(axis=0).all()
            assert np.abs(box - [mask.u0, mask.v0, mask.u0 + w, mask.v0 + h]).max() <= 0.08 * max(h, w) + 1e-3


def test_false_detections_come_at_the_rate_with_low_scores() -> None:
    counts = _counts(_with(false_positives=0.3, worst_score=0.3), [], 600)
    assert counts.mean() == pytest.approx(0.3, abs=0.08)
    view = _view([])
    imagined = SimulatedDetector(_world(CHAIRS), DetectorErrors(false_positives=20), 0).detect(
        view, _sights(view), full_turn=False
    )
    assert imagined.scores.max() < 0.75


def test_some_false_detections_come_back_at_the_same_spot_of_a_wall() -> None:
    corners = np.array([[-2.0, -1.5, 2], [2, -1.5, 2], [2, 1.5, 2], [-2, 1.5, 2]])
    wall = Shape(corners, np.array([[0, 2, 1], [0, 3, 2]]), np.zeros(2, np.int64), (Material((9, 9, 9)),))
    world, camera = _world(CHAIRS, (Fixture("wall", wall),)), PinholeCamera(320, 240, 230, 230, 160, 120)
    detector = SimulatedDetector(world, _with(phantoms_per_m2=0.8, phantom_recall=0.5), 1)
    centers = []
    for frame in range(80):
        view = _view([], frame)
        found = detector.detect(view, _sights(view), full_turn=False, camera=camera, T_world_camera=np.eye(4))
        middles = np.round((found.boxes_xyxy[:, :2] + found.boxes_xyxy[:, 2:]) / 2).tolist()
        centers += [(label, *middle) for label, middle in zip(found.labels, middles, strict=True)]
    assert len(centers) > 60
    assert len(set(centers)) < 12
    moved = np.eye(4)
    moved[2, 3] = -20.0
    assert (
        len(detector.detect(_view([], 81), _sights(_view([])), full_turn=False, camera=camera, T_world_camera=moved))
        == 0
    )


def test_latency_keeps_its_bounds() -> None:
    detector = SimulatedDetector(_world(CHAIRS), DetectorErrors(latency_min_s=0.1, latency_max_s=0.5), 0)
    delays = [detector.latency_s() for _ in range(200)]
    assert 0.1 <= min(delays) < 0.15
    assert 0.45 < max(delays) <= 0.5
    assert SimulatedDetector(_world(CHAIRS), PERFECT, 0).latency_s() == 0


def test_the_same_seed_gives_the_same_detections() -> None:
    first, second, third = (SimulatedDetector(_world(CHAIRS), DetectorErrors(), seed) for seed in (7, 7, 8))
    views = [_view([(50, 50, 150, 150), (150, 50, 200, 100)], frame) for frame in range(10)]
    a, b, c = (
        [detector.detect(view, _sights(view), full_turn=False).scores.tolist() for view in views]
        for detector in (first, second, third)
    )
    assert a == b
    assert a != c


def test_knobs_are_checked() -> None:
    with pytest.raises(ValidationError, match="latency_min_s"):
        DetectorErrors(latency_min_s=1.0, latency_max_s=0.5)
    with pytest.raises(ValidationError, match="recall"):
        DetectorErrors(recall=1.5)
    with pytest.raises(ValidationError, match="sum"):
        DetectorErrors(lasting=0.8, constant=0.3)
    assert all(field.description for field in DetectorErrors.model_fields.values())


def test_every_label_has_look_alikes_that_a_detector_knows() -> None:
    known = {*LABELS, "person"}
    assert known <= set(look_alikes())
    for label, others in look_alikes().items():
        assert label not in others
        assert set(others) <= known


def test_correlated_noise_lasts_and_keeps_its_distribution() -> None:
    noise = CorrelatedNoise(np.random.default_rng(0), lasting_s=1.0, lasting=0.8, constant=0.0)
    drawn = np.array([noise.normal("a", k * 100_000_000) for k in range(20_000)])
    assert drawn.mean() == pytest.approx(0, abs=0.1)
    assert drawn.std() == pytest.approx(1, abs=0.05)
    assert np.corrcoef(drawn[:-1], drawn[1:])[0, 1] == pytest.approx(0.8 * np.exp(-0.1), abs=0.05)
    constant = CorrelatedNoise(np.random.default_rng(0), lasting_s=1.0, lasting=0.0, constant=1.0)
    assert constant.uniform("b", 0) == constant.uniform("b", 10**12)


def test_an_image_of_fifteen_things_is_answered_fast() -> None:
    rectangles = [(5 + 125 * (k % 5), 5 + 155 * (k // 5), 115 + 125 * (k % 5), 145 + 155 * (k // 5)) for k in range(15)]
    detector = SimulatedDetector(_world(LABELS[:15]), DetectorErrors(), 0)
    spent_s = []
    for frame in range(8):
        view = _view(rectangles, frame, (480, 640))
        visibility = _sights(view)
        start_s = time.process_time()
        detector.detect(view, visibility, full_turn=False)
        spent_s.append(time.process_time() - start_s)
    assert min(spent_s) < 0.06
