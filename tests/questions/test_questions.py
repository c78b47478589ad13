"""The questions of this folder, as people type them, asked of the memory that a small office's truth makes."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import pytest

from supermap_cli.errors import EvaluationError
from supermap_cli.evaluation.question_files import read_questions
from supermap_cli.evaluation.question_matrix import QuestionMatrix, judge_questions
from supermap_cli.evaluation.true_selection import TrueSelections
from supermap_cli.memory import open_store
from supermap_cli.simulation.recording.observed_truth import Undetermined
from supermap_cli.types.truth import GroundTruth, TrueChange
from support import kitchen_truth as kt
from support import memories as m
from support import perfect_map

FILES = sorted(Path(__file__).parent.glob("*.jsonl"))
QUESTIONS = tuple(question for path in FILES for question in read_questions(path))
DAYS = (tuple(float(second) for second in range(10)), tuple(float(second) for second in range(1000, 1010)))

LEAST_ASKED, LEAST_EXACT = 350, 0.95
"""Questions that this office determines, and the share of them that is to be answered exactly (issue 15)."""


def office() -> GroundTruth:
    """A desk with a laptop and one with a monitor, a corner with a couch; three things move, come and go overnight."""
    box, small, seat = (0.5, 0.4, 0.5), (0.08, 0.08, 0.1), (0.5, 0.5, 0.9)
    objects = (
        kt.thing("desk-1", "desk", (1.4, 0.7, 0.74), ((0, 0, 0.37), None, None)),
        kt.thing("desk-2", "desk", (1.4, 0.7, 0.74), ((8, 0, 0.37), None, None)),
        kt.thing("laptop-1", "laptop", (0.35, 0.25, 0.03), ((0, 0, 0.755), None, None)),
        kt.thing("mug-1", "mug", small, ((0.5, 0, 0.79), None, None)),
        kt.thing("mug-2", "mug", small, ((8.5, 0, 0.79), None, None)),
        kt.thing("monitor-1", "monitor", (0.5, 0.15, 0.4), ((8, 0.1, 0.94), None, None)),
        kt.thing("keyboard-1", "keyboard", (0.4, 0.15, 0.03), ((8, -0.2, 0.755), None, None)),
        kt.thing("chair-1", "chair", seat, ((0, -0.8, 0.45), None, None)),
        kt.thing("chair-2", "chair", seat, ((8, -0.8, 0.45), None, None)),
        kt.thing("chair-3", "chair", seat, ((4, -5, 0.45), None, None)),
        kt.thing("armchair-1", "armchair", (0.9, 0.9, 1.0), ((-6, 6, 0.5), None, None)),
        kt.thing("couch-1", "couch", (2.0, 0.9, 0.8), ((0, 8, 0.4), None, None)),
        kt.thing("tv-1", "tv", (1.2, 0.1, 0.7), ((0, 12, 1.5), None, None)),
        kt.thing("refrigerator-1", "refrigerator", (0.6, 0.6, 1.8), ((12, 8, 0.9), None, None)),
        kt.thing("cabinet-1", "cabinet", (0.8, 0.5, 0.9), ((10.5, 8, 0.45), None, None)),
        kt.thing("microwave-1", "microwave", (0.5, 0.4, 0.3), ((10.5, 8, 1.05), None, None)),
        kt.thing("bookshelf-1", "bookshelf", (1.0, 0.4, 2.0), ((-8, -6, 1.0), None, None)),
        kt.thing("potted-plant-1", "potted plant", (0.4, 0.4, 1.0), ((5, 10, 0.5), None, None)),
        kt.thing("stool-1", "stool", (0.4, 0.4, 0.45), ((-5, 0, 0.225), None, 500), ((-9, 4, 0.225), 500, None)),
        kt.thing("suitcase-1", "suitcase", box, ((-3, -6, 0.25), None, 500), ((6, 5, 0.25), 500, None)),
        kt.thing("trash-can-1", "trash can", box, ((14, -4, 0.25), None, 500)),
        kt.thing("bucket-1", "bucket", box, ((14, 3, 0.25), 500, None)),
    )
    night = (m.ns(500), m.ns(500))
    names = ("monday", "tuesday")
    changes = (
        TrueChange("moved", "stool-1", 0, 1, *night, 5.66, names),
        TrueChange("moved", "suitcase-1", 0, 1, *night, 14.2, names),
        TrueChange("disappeared", "trash-can-1", 0, None, *night, None, names),
        TrueChange("appeared", "bucket-1", None, 0, *night, None, names),
    )
    traversals = tuple(kt.traversal(name, day, objects) for name, day in zip(names, DAYS, strict=True))
    return GroundTruth("office", 1, traversals, objects, (), changes, ())


@pytest.fixture(scope="module")
def matrix(tmp_path_factory: pytest.TempPathFactory) -> QuestionMatrix:
    path, truth = tmp_path_factory.mktemp("office") / "office.db", office()
    true_ids = perfect_map.write_perfect_map(path, truth)
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        return judge_questions(reader, truth, QUESTIONS, true_ids)


def test_nothing_is_answered_wrong(matrix: QuestionMatrix) -> None:
    assert [answer for answer in matrix.not_exact if answer.verdict == "wrong"] == []


def test_most_questions_are_answered_exactly(matrix: QuestionMatrix) -> None:
    assert matrix.all.asked >= LEAST_ASKED
    assert matrix.exact_share is not None
    assert matrix.exact_share >= LEAST_EXACT, matrix.not_exact


def test_every_kind_and_language_is_asked_often_enough() -> None:
    kinds = Counter(question.kind for question in QUESTIONS if question.kind != "refusal: empty")
    languages = Counter(question.language for question in QUESTIONS)
    assert min(kinds.values()) >= 8, kinds
    assert min(languages.values()) >= 20, languages
    assert sum(question.sort == "refused" for question in QUESTIONS) >= 60


def test_a_selection_follows_the_truth() -> None:
    truth = TrueSelections(office())
    assert truth.ids({"label": "mug", "on": {"label": "desk", "having": {"on": {"label": "laptop"}}}}) == {"mug-1"}
    assert truth.ids({"label": "desk", "not": {"having": {"on": {"label": "laptop"}}}}) == {"desk-2"}
    assert truth.ids({"label": "trash can", "when": "first"}) == {"trash-can-1"}
    assert truth.ids({"label": "chair", "first": ["farthest", 1, {"label": "bookshelf"}]}) == {"chair-2"}
    assert truth.changed("moved")[0] == {"stool-1", "suitcase-1"}


def test_what_is_within_a_margin_of_a_limit_is_not_asked() -> None:
    with pytest.raises(Undetermined):
        TrueSelections(office()).ids({"label": "cabinet", "within_m": [0.8, {"label": "refrigerator"}]})


@pytest.mark.parametrize(
    ("expected", "why"),
    [
        ({"ids": {"label": "mug", "upon": {"label": "desk"}}}, "'upon' is none of"),
        ({"ids": {"label": "mug"}, "count": {"label": "mug"}}, "no question"),
        ({"refused": "too hard"}, "'too hard' is none of"),
        ({"changes": "vanished"}, "'vanished' is none of"),
        ({"more": [{"label": "mug"}]}, "no question"),
        ("mug", "no question"),
    ],
)
def test_a_line_that_expects_nothing_known_is_named(tmp_path: Path, expected: object, why: str) -> None:
    path = tmp_path / "questions.jsonl"
    line = {"text": "where is the mug", "kind": "name", "language": "en", "expected": expected}
    path.write_text("\n" + json.dumps(line), encoding="utf-8")
    with pytest.raises(EvaluationError, match=why) as error:
        read_questions(path)
    assert "questions.jsonl:2" in str(error.value)
