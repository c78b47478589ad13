"""The detector's axes: each level does what it says, and the usual ones change nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache

import cv2
import numpy as np
import pytest

from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.language.lexicon import load_lexicon
from supermap_cli.simulation.detection.detector import DetectorErrors, SimulatedDetector
from supermap_cli.simulation.detection.fixed_errors import world_seed
from supermap_cli.simulation.detection.label_errors import other_names
from supermap_cli.simulation.detection.outline_errors import closed, convex_hull, moved, without_a_side
from supermap_cli.simulation.domains.axes import AXES, apply_levels
from supermap_cli.simulation.domains.detector_axes import DETECTOR_AXES
from supermap_cli.simulation.domains.domain import Domain
from supermap_cli.simulation.recording.messages import number_image
from supermap_cli.simulation.rigs import small_rgbd_rig
from supermap_cli.simulation.views import PlaceVisibility, RenderedView
from supermap_cli.simulation.world import Fixture, Material, Shape, SimulatedThing, World
from supermap_cli.simulation.worlds.shapes import LABELS
from supermap_cli.types.detections import Detections, RegionMask

START_NS = 1_700_000_000_000_000_000
TRIANGLE = Shape(np.eye(3), np.array([[0, 1, 2]]), np.zeros(1, np.int64), (Material((9, 9, 9)),))
QUIET = {"false_positives": 0, "phantoms_per_m2": 0, "lasting": 0, "constant": 0}
"""Errors of one image do not tell on the next: rates can be measured in few images."""
CHAIR = (120, 80, 220, 190)
HEIGHT, WIDTH = 300, 400
BEFORE = (124, 106.3503)
"""Detections and the sum of their scores in `test_knobs_that_are_off_draw_nothing`."""


def _world(labels: Sequence[str], fixtures: tuple[Fixture, ...] = ()) -> World:
    return World(fixtures, tuple(SimulatedThing(f"{label}-{k}", label, TRIANGLE) for k, label in enumerate(labels)), ())


def _view(rectangles: Sequence[tuple[int, int, int, int]], frame: int = 0) -> RenderedView:
    """The k-th thing covers columns u0..u1 and rows v0..v1 of the k-th (u0, v0, u1, v1), 2 m away."""
    thing = np.zeros((HEIGHT, WIDTH), np.int32)
    for k, (u0, v0, u1, v1) in enumerate(rectangles):
        thing[v0:v1, u0:u1] = k + 1
    ones, black = np.ones(thing.shape, np.float32), np.zeros((*thing.shape, 3), np.uint8)
    return RenderedView(START_NS + frame * 200_000_000, 2 * ones, thing, ones, black)


def _sights(view: RenderedView, distance_m: float = 2.0) -> PlaceVisibility:
    numbers, pixels = np.unique(view.thing[view.thing > 0], return_counts=True)
    ones = np.ones(len(numbers), np.float32)
    stays, present = np.zeros(len(numbers), np.int64), np.ones(len(numbers), bool)
    return PlaceVisibility(numbers.astype(np.int64) - 1, stays, present, ones, ones, pixels, distance_m * ones)


def _errors(axis: str, level: str, **knobs: float) -> DetectorErrors:
    errors = AXES[axis].levels[level].apply(Domain(small_rgbd_rig())).errors
    return DetectorErrors.model_validate(errors.model_dump() | QUIET | knobs)


def _detected(
    errors: DetectorErrors,
    frames: int,
    labels: Sequence[str] = ("chair",),
    rectangles: Sequence[tuple[int, int, int, int]] = (CHAIR,),
    distance_m: float = 2.0,
    seed: int = 3,
) -> list[Detections]:
    detector = SimulatedDetector(_world(labels), errors, seed)
    views = (_view(rectangles, frame) for frame in range(frames))
    return [detector.detect(view, _sights(view, distance_m), full_turn=False) for view in views]


def _counts(errors: DetectorErrors, frames: int, **seen: float) -> float:
    return float(np.mean([len(found) for found in _detected(errors, frames, **seen)]))  # type: ignore[arg-type]


def test_there_are_three_levels_or_more_and_the_usual_ones_change_nothing() -> None:
    assert [axis.name for axis in DETECTOR_AXES] == [
        "recall", "false-alarms", "labels", "masks", "touching", "detector-rate", "latency",
    ]  # fmt: skip
    assert all(len(axis.levels) >= 3 for axis in DETECTOR_AXES)
    domain = Domain(small_rgbd_rig())
    assert apply_levels(domain, {axis.name: axis.usual for axis in DETECTOR_AXES}) == domain


def test_knobs_that_are_off_draw_nothing() -> None:
    """What the detector gave for this seed before it had them."""
    rectangles = [(20, 20, 120, 140), (120, 60, 220, 200), (300, 200, 340, 260)]
    found = _detected(DetectorErrors(), 40, ("chair", "desk", "mug"), rectangles, seed=5)
    scores = sum(float(one.scores.sum()) for one in found)
    assert (sum(map(len, found)), round(scores, 4)) == BEFORE


@pytest.mark.parametrize("level", ["0.7", "0.5", "0.3"])
def test_recall_is_as_the_level_says(level: str) -> None:
    assert _counts(_errors("recall", level, splitting=0), 500) == pytest.approx(float(level), abs=0.06)


def test_each_class_has_a_recall_of_its_own() -> None:
    errors = _errors("recall", "by-class", splitting=0, min_area_px=1, half_area_px=0)
    rectangles = [(13 * (k % 30), 20 * (k // 30), 13 * (k % 30) + 10, 20 * (k // 30) + 15) for k in range(len(LABELS))]
    alone = {"merging": 0.0, "swallowing": 0.0, "confusion": 0.0}
    found = _detected(errors.model_copy(update=alone), 150, LABELS, rectangles)
    counted = Counter(label for one in found for label in one.labels)
    rates = np.array([counted[label] / 150 for label in LABELS])
    assert 0.2 < rates.min() < 0.42
    assert 0.8 < rates.max() <= 1
    assert np.std(rates) > 0.12
    assert world_seed(_world(LABELS)) != world_seed(_world(LABELS[1:]))


def test_recall_halves_at_three_metres() -> None:
    errors = _errors("recall", "by-distance", splitting=0)
    near, half, far = (_counts(errors, 300, distance_m=distance_m) for distance_m in (1.0, 3.0, 6.0))
    assert near > 0.88
    assert half == pytest.approx(0.95 / 2, abs=0.07)
    assert far < 0.12


def test_false_alarms_are_none_or_many() -> None:
    def counts(level: str) -> float:
        errors = AXES["false-alarms"].levels[level].apply(Domain(small_rgbd_rig())).errors
        return float(np.mean([len(found) for found in _detected(errors, 300, rectangles=())]))

    assert counts("rare") == 0
    assert counts("usual") == pytest.approx(0.1, abs=0.06)
    assert counts("many") == pytest.approx(1.5, abs=0.2)


def _room() -> World:
    """A wall 2 m before the camera, and floor as small as a cupboard's."""
    wall = np.array([[-2.0, 2.0, 0], [2, 2, 0], [2, 2, 2.5], [-2, 2, 2.5]])
    floor = np.array([[-2.0, -1, 0], [2, -1, 0], [2, 2.1, 0], [-2, 2.1, 0]])
    faces = {"wall": (wall, [[0, 1, 2], [0, 2, 3]]), "floor": (floor, [[0, 1, 2], [0, 2, 3]])}
    shapes = {
        label: Shape(corners, np.array(triangles), np.zeros(2, np.int64), (Material((9, 9, 9)),))
        for label, (corners, triangles) in faces.items()
    }
    return _world(LABELS, tuple(Fixture(label, shape) for label, shape in shapes.items()))


def test_posters_fool_again_and_again_at_the_same_spots() -> None:
    camera = PinholeCamera(WIDTH, HEIGHT, 200, 200, 199.5, 149.5)
    T_world_camera = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]])
    errors = _errors("false-alarms", "persistent", lasting=0.6)
    spots: list[Counter[tuple[str, int, int]]] = []
    for seed, frames in ((1, 150), (2, 40)):
        detector = SimulatedDetector(_room(), errors, seed)
        seen: Counter[tuple[str, int, int]] = Counter()
        for frame in range(frames):
            view = _view([], 10 * frame)
            found = detector.detect(view, _sights(view), full_turn=False, camera=camera, T_world_camera=T_world_camera)
            for label, box, score, mask in zip(found.labels, found.boxes_xyxy, found.scores, found.masks, strict=True):
                assert score > 0.5
                assert mask is not None
                assert mask.pixels.sum() > 800
                u, v = (box[:2] + box[2:]) / 20
                seen[label, round(float(u) / 2), round(float(v) / 2)] += 1
        spots.append(seen)
    for seen, frames in zip(spots, (150, 40), strict=True):
        by_label = Counter({label: 0 for label, _, _ in seen})
        for (label, _, _), count in seen.items():
            by_label[label] += count
        assert len(by_label) == 3
        assert all(0.45 < count / frames < 0.9 for count in by_label.values()), by_label
    assert {label for label, _, _ in spots[0]} == {label for label, _, _ in spots[1]}


def _first_words(errors: DetectorErrors, frames: int = 400) -> dict[str, float]:
    counted = Counter(label for found in _detected(errors, frames) for label in found.labels)
    return {label: count / counted.total() for label, count in counted.items()}


def test_two_words_are_the_right_one_and_always_the_same_wrong_one() -> None:
    words = _first_words(_errors("labels", "two-words"))
    assert len(words) == 2
    assert words["chair"] == pytest.approx(0.6, abs=0.07)
    again = _detected(_errors("labels", "two-words"), 100, seed=99)
    assert {label for found in again for label in found.labels} == set(words)


def test_wrong_words_spread_over_twelve_and_the_right_one_leads() -> None:
    words = _first_words(_errors("labels", "twelve-words"), 600)
    assert len(words) == 13
    assert words.pop("chair") == pytest.approx(0.55, abs=0.06)
    assert max(words.values()) < 0.1


def test_synonyms_come_first_in_half_of_the_detections_and_the_usual_word_second() -> None:
    found = _detected(_errors("labels", "synonyms", confusion=0), 300, ("trash can",))
    ranked = [hypotheses for one in found for hypotheses in one.hypotheses]
    words = Counter(hypotheses[0].label for hypotheses in ranked)
    assert set(words) == {"trash can", *other_names()["trash can"]}
    assert words["trash can"] / words.total() == pytest.approx(0.5, abs=0.08)
    assert all("trash can" in {hypothesis.label for hypothesis in hypotheses[:2]} for hypotheses in ranked)


def test_other_names_are_found_by_the_label_to_the_lexicon() -> None:
    lexicon = load_lexicon("en")
    for label, names in other_names().items():
        assert label in {*LABELS, "person"}
        assert label not in names
        found = lexicon.synonyms(label) | lexicon.kinds(label) | lexicon.near_kinds(label)
        assert set(names) <= {label} | found, label


def test_flat_scores_tell_nothing() -> None:
    errors = _errors("labels", "flat-scores", confusion=0.5, false_positives=2.0)
    found = _detected(errors, 200)
    assert {len(hypotheses) for one in found for hypotheses in one.hypotheses} == {1}
    scores = {
        right: [score for one in found for label, score in zip(one.labels, one.scores, strict=True) if right == label]
        for right in ("chair", "stool", "armchair")
    }
    everything = np.concatenate([one.scores for one in found])
    assert everything.min() > 0.4
    assert everything.max() < 0.6
    assert all(np.mean(values) == pytest.approx(0.5, abs=0.01) for values in scores.values())


@cache
def _mask(level: str) -> np.ndarray:
    """The chair as a level draws it."""
    found = _detected(_errors("masks", level, recall=1, splitting=0), 5)
    mask = next(one for one in found if len(one)).masks[0]
    assert mask is not None
    return mask.full(HEIGHT, WIDTH)


@pytest.mark.parametrize(
    ("level", "grown_px"), [("exact", 0), ("eroded", -3), ("leaking", 4), ("filled", 0), ("hull", 0)]
)
def test_outlines_move_by_the_levels_pixels(level: str, grown_px: int) -> None:
    """6 px of 640 are 3.75 of 400."""
    rows, columns = (np.flatnonzero(_mask(level).any(axis=axis)) for axis in (1, 0))
    u0, v0, u1, v1 = CHAIR
    assert [columns[0], rows[0], columns[-1] + 1, rows[-1] + 1] == [
        u0 - grown_px, v0 - grown_px, u1 + grown_px, v1 + grown_px,
    ]  # fmt: skip


@pytest.mark.parametrize("size", [2, 8, 60])
def test_masks_leak_whatever_their_size_and_never_vanish(size: int) -> None:
    mask = RegionMask(100, 100, np.ones((size, size), bool))
    larger, smaller = moved(mask, 6, HEIGHT, WIDTH), moved(mask, -6, HEIGHT, WIDTH)
    assert larger.pixels.shape == (size + 12, size + 12)
    assert smaller.pixels.shape == (max(size - 12, 2), max(size - 12, 2))
    at_border = moved(RegionMask(0, 0, np.ones((HEIGHT, WIDTH), bool)), 6, HEIGHT, WIDTH)
    assert at_border.pixels.all()


def test_gaps_are_filled_up_to_their_width_and_holes_of_any() -> None:
    pixels = np.zeros((100, 160), bool)
    pixels[10:90, 10:15] = pixels[10:90, 21:26] = pixels[10:90, 60:65] = True
    pixels[40:80, 80:150] = True
    pixels[50:70, 90:140] = False
    filled = closed(RegionMask(50, 50, pixels), 9, HEIGHT, WIDTH).full(HEIGHT, WIDTH)[50:150, 50:210]
    assert filled[14:86, 15:21].all()
    assert not filled[10:90, 35:50].any()
    assert filled[50:70, 90:140].all()
    assert (filled | ~pixels).all()


def test_a_hull_is_convex() -> None:
    pixels = np.zeros((60, 80), bool)
    pixels[5:55, 5:10] = pixels[50:55, 5:70] = True
    hull = convex_hull(RegionMask(0, 0, pixels)).pixels
    assert (hull | ~pixels).all()
    contours, _ = cv2.findContours(hull.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    assert len(contours) == 1
    around = cv2.contourArea(cv2.convexHull(contours[0]))
    assert cv2.contourArea(contours[0]) == pytest.approx(around, rel=0.03)
    assert hull.sum() > 2.5 * pixels.sum()


def test_boxes_come_without_masks() -> None:
    found = _detected(_errors("masks", "boxes", recall=1, splitting=0, box_jitter=0), 30)
    assert sum(map(len, found)) > 20
    for one in found:
        assert all(mask is None for mask in one.masks)
        assert not number_image(one, HEIGHT, WIDTH).any()
        assert np.allclose(one.boxes_xyxy, CHAIR)


def test_a_third_is_cut_off_at_another_side_each_time() -> None:
    whole = RegionMask(10, 20, np.ones((40, 60), bool))
    rng = np.random.default_rng(0)
    shifts = []
    for _ in range(30):
        cut = without_a_side(whole, rng).full(HEIGHT, WIDTH)
        assert cut.sum() == pytest.approx(40 * 60 * 2 / 3, abs=1)
        shifts.append(np.argwhere(cut).mean(axis=0) - [39.5, 39.5])
    angles = np.arctan2(*np.transpose(shifts))
    assert np.histogram(angles, 4, (-np.pi, np.pi))[0].min() >= 3


@pytest.mark.parametrize(
    ("level", "labels", "touching", "rate"),
    [
        ("never", ("chair", "chair"), True, 0.0),
        ("often", ("chair", "chair"), True, 0.35),
        ("often", ("chair", "desk"), True, 0.15),
        ("split", ("chair", "desk"), False, 0.2),
    ],
)
def test_neighbours_are_one_or_things_are_two(level: str, labels: Sequence[str], touching: bool, rate: float) -> None:
    apart = 0 if touching else 20
    rectangles = [(50, 50, 90, 90), (90 + apart, 50, 130 + apart, 90)]
    knobs: dict[str, float] = {"recall": 1, "half_visible": 0, "half_area_px": 0, "half_distance_m": 100}
    if touching:
        knobs["splitting"] = 0
    found = _detected(_errors("touching", level, **knobs), 300, labels, rectangles)
    changed = np.mean([len(one) - 2 for one in found]) / (-1 if touching else 2)
    assert changed == pytest.approx(rate, abs=0.06)


@pytest.mark.parametrize(("level", "low_s", "high_s"), [("instant", 0, 0), ("usual", 0.1, 0.5), ("late", 1, 3)])
def test_answers_come_when_the_level_says(level: str, low_s: float, high_s: float) -> None:
    detector = SimulatedDetector(_world(("chair",)), _errors("latency", level), 1)
    delays_s = [detector.latency_s() for _ in range(100)]
    assert min(delays_s) == pytest.approx(low_s, abs=0.1)
    assert max(delays_s) == pytest.approx(high_s, abs=0.1)


@pytest.mark.parametrize(("level", "every"), [("usual", 1), ("half", 2), ("fifth", 5)])
def test_the_detector_gets_some_of_the_images(level: str, every: int) -> None:
    rig = small_rgbd_rig()
    assert apply_levels(Domain(rig), {"detector-rate": level}).rig.detection_every == every * rig.detection_every
