"""A new name is a change of the world only with evidence that another thing stands there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from supermap_cli.memory import open_store
from supermap_cli.query.appearance_change import chroma_log_ratio, mean_chroma, shape_log_ratio
from supermap_cli.query.detectors import detector_of, recall_of
from supermap_cli.query.diff import ObjectChange, diff
from supermap_cli.query.readings import Reading, words_log_ratio
from supermap_cli.types.memory import MapDelta, Observation
from support import memories as m
from support import random_instances

Words = dict[str, dict[str, float]]


def jpeg(*bgr: int) -> bytes:
    return cv2.imencode(".jpg", np.full((40, 40, 3), bgr, np.uint8))[1].tobytes()


RED, BLUE = jpeg(40, 40, 200), jpeg(200, 60, 40)


def ratio(old: Words, new: Words, detectors: tuple[str, str] = ("one", "one")) -> float:
    return words_log_ratio(Reading(detectors[0], old, ()), Reading(detectors[1], new, ()))


def test_the_same_name_speaks_for_the_same_thing() -> None:
    assert ratio({"front": {"tv": 4}}, {"front": {"tv": 4}}) < -3
    assert ratio({"front": {"tv": 4}}, {"front": {"tv": 4}}, ("one", "other")) < -2


def test_another_name_says_most_from_the_same_place_by_the_same_detector() -> None:
    tv, microwave = {"front": {"tv": 5.0}}, {"front": {"microwave": 5.0}}
    again = ratio(tv, microwave)
    elsewhere = ratio(tv, {"left": {"microwave": 5.0}})
    another = ratio(tv, microwave, ("one", "other"))
    assert again > elsewhere == pytest.approx(another)


def test_the_more_often_it_is_said_the_more_another_name_says() -> None:
    ratios = [ratio({"front": {"tv": n}}, {"front": {"microwave": n}}) for n in (0.5, 2.0, 8.0, 30.0)]
    assert ratios == sorted(ratios)


def test_a_detector_that_wavers_says_little() -> None:
    sure = ratio({"front": {"tv": 5}}, {"front": {"microwave": 5}})
    assert ratio({"front": {"tv": 3, "microwave": 2}}, {"front": {"microwave": 3, "tv": 2}}) < min(0, sure)


def test_colours_of_one_thing_differ_by_the_light_only() -> None:
    red, blue = mean_chroma(RED), mean_chroma(BLUE)
    assert chroma_log_ratio(red, red + 5) < 0 < chroma_log_ratio(red, blue)


def called(label: str, since: float, crop: bytes, through: int, looks: int = 12) -> MapDelta:
    """Looks at the chair, of which the first went through some of its 100 points."""
    stamps = [since + 1 + i / 2 for i in range(looks)]

    def look(i: int, at: float) -> Observation:
        against = through if i < 3 else 2
        observed = replace(m.observation(1, at, label), evidence_for=100 - against, evidence_against=against)
        return replace(observed, crop_jpeg=crop if i == 0 else None)

    return MapDelta(keyframes=m.keyframes(stamps), observations=tuple(look(i, at) for i, at in enumerate(stamps)))


def two_visits(path: Path, first: MapDelta, second: MapDelta, detectors: tuple[str, str] = ("", "")) -> ObjectChange:
    """The change of one chair between two visits, each by a detector."""
    chair = m.instance(1, "chair", seen=(1, 107), observations=24)
    with open_store(str(path), create=True) as store:
        for since, name, delta, detector in zip((0, 100), ("a", "b"), (first, second), detectors, strict=True):
            start = m.start(name, (since, since + 10))
            traversal_id = store.begin_traversal(replace(start, config={**start.config, "detector": detector}))
            store.commit(traversal_id, MapDelta(instances=(chair,), visits=(m.visit(1, 12, 12),)))
            store.commit(traversal_id, delta)
            store.commit(traversal_id, MapDelta(states=(m.state(1, 0, (1, 107)),) if name == "b" else ()))
            store.finish_traversal(traversal_id, learnt={"detector_recall": {"chair": [8.0, 10.0]}})
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        (change,) = diff(reader).changes
    return change


def test_another_detectors_name_is_another_reading(tmp_path: Path) -> None:
    visits = called("tv", 0, RED, 2), called("microwave", 100, RED, 2)
    change = two_visits(tmp_path / "map.db", *visits, detectors=("strong", "weak"))
    assert (change.kind, change.label_before, change.label_after) == ("unchanged", "tv", "microwave")
    assert "another reading by another detector (strong, then weak)" in change.reason
    assert "its shape and look did not change" in change.reason


def test_a_name_alone_is_another_reading_also_of_one_detector(tmp_path: Path) -> None:
    change = two_visits(tmp_path / "map.db", called("tv", 0, RED, 2), called("microwave", 100, RED, 2))
    assert change.kind == "unchanged"
    assert "another reading, no change" in change.reason


@pytest.mark.parametrize("detectors", [("one", "one"), ("one", "other")])
def test_another_name_with_another_shape_and_look_is_another_thing(tmp_path: Path, detectors: tuple[str, str]) -> None:
    visits = called("tv", 0, RED, 2), called("microwave", 100, BLUE, 70)
    change = two_visits(tmp_path / "map.db", *visits, detectors=detectors)
    assert change.kind == "relabelled"
    assert change.confidence > 0.9
    assert "its shape and look changed" in change.reason
    assert (change.not_before_ns, change.not_after_ns) == (m.ns(6.5), m.ns(101))


def test_without_pictures_and_points_only_words_speak(tmp_path: Path) -> None:
    assert shape_log_ratio((), ()) == 0.0
    deltas = [
        replace(delta, observations=tuple(replace(seen, crop_jpeg=None) for seen in delta.observations))
        for delta in (called("tv", 0, RED, 2), called("microwave", 100, BLUE, 2))
    ]
    assert "look" not in two_visits(tmp_path / "map.db", *deltas).reason


def test_traversals_of_older_versions_name_their_plugin() -> None:
    (traversal, *_) = random_instances.TRAVERSALS
    assert detector_of(traversal) == ""
    used = {"used": {"detector": "onnx"}, "backends": {"options": {"onnx": {"model": "a.onnx"}}}}
    assert detector_of(replace(traversal, config=used)) == 'onnx {"model": "a.onnx"}'
    assert detector_of(replace(traversal, config={**used, "detector": "a 12345678"})) == "a 12345678"
    learnt = replace(traversal, config={"detector_recall": {"chair": [8.0, 10.0], "cup": [1.0, 2.0]}})
    assert [recall_of(learnt, label) for label in ("chair", "cup", "tv")] == [0.8, None, None]
