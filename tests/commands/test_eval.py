"""`supermap eval`."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import EvaluationError, MemoryStoreError, TruthError
from supermap_cli.memory import open_store
from supermap_cli.recordings.fingerprint import window_fingerprint
from supermap_cli.types.truth import GroundTruth, TrueQuestion
from support import kitchen, kitchen_truth
from support.cli import document, supermap

SECTIONS = ("map", "change", "identity", "instances", "semantics", "query")


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("map") / "kitchen.db")


def all_of_it() -> GroundTruth:
    """The truth of just the time that the kitchen's map has keyframes of: 1 to 90 s, and 1001 to 1090 s."""
    return kitchen_truth.kitchen_truth(seconds=(range(1, 91), range(1001, 1091)))


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen_truth.write_kitchen_truth(tmp_path_factory.mktemp("truth") / "truth.json", all_of_it())


@pytest.mark.parametrize("section", SECTIONS)
def test_a_section_is_printed_alone_by_the_schema(db, truth, section):
    printed = document("eval", "eval", section, db, truth)
    assert set(printed) & set(SECTIONS) == {section}
    assert (printed["scenario"], printed["seed"]) == ("kitchen", 7)
    assert printed["alignment_rmse_m"] == {"monday": pytest.approx(0), "tuesday": pytest.approx(0)}


def test_all_prints_every_section(db, truth):
    printed = document("eval", "eval", "all", db, truth)
    assert set(SECTIONS) <= set(printed)
    found = printed["map"]["labelled"]
    assert (found["found"], found["missed"], found["recall"]) == (3, 0, 1.0)
    assert {instance["id"] for instance in printed["map"]["false"]} >= {"tv-1", "lamp-1"}
    assert printed["map"]["calibration"]["count"] == len(printed["map"]["rated"]) == found["found"] + found["false"]
    assert printed["change"]["reported"]["overall"]["f1"] == 1.0
    assert printed["identity"]["relocated_kept"] == 1.0
    assert printed["query"]["exact"] == 1.0


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ("map", ("F1", "precision without label", "tv-1", "why", "expected calibration error", "share right")),
        ("change", ("change recall, per object", "F1 moved", "chair-a (moved here)", "before it came")),
        ("identity", ("instances per object", "relocated, same id", "images showed 2 places left empty")),
        ("instances", ("AP50", "not a mean over labels")),
        ("semantics", ("mIoU", "wall as one class")),
        ("query", ("answered right", "share of 2 questions")),
    ],
)
def test_a_table_says_what_every_figure_means(db, truth, section, said):
    result = supermap("eval", section, db, truth)
    assert result.exit_code == 0, result.output
    assert "kitchen, seed 7; the robot's way off its true way: monday 0.000 m, tuesday 0.000 m" in result.stdout
    assert [words for words in ("what it says", *said) if words not in result.stdout] == []


def questions(folder: Path) -> Path:
    """Three questions to the kitchen: one is answered, one refused as it should be, one expects what is not so."""
    asked = (
        ("where is the vase", "name", {"ids": {"label": "vase"}}),
        ("where is the quix", "refusal", {"refused": "unknown word"}),
        ("how many vases are there", "count", {"count": {"label": "piano"}}),
    )
    lines = (
        json.dumps({"text": text, "kind": kind, "language": "en", "expected": expected})
        for text, kind, expected in asked
    )
    path = folder / "questions.jsonl"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_questions_of_a_file_are_counted_by_kind_and_the_wrong_ones_named(db, truth, tmp_path):
    printed = document("questions", "eval", "query", db, truth, "--questions", questions(tmp_path))
    assert (printed["all"]["exact"], printed["all"]["wrong"]) == (2, 1)
    [wrong] = printed["not_exact"]
    assert (wrong["text"], wrong["expected"]) == ("how many vases are there", "0")
    result = supermap("eval", "query", db, truth, "--questions", questions(tmp_path))
    assert [words for words in ("WRONG", "how many vases", "exact 0.667") if words not in result.stdout] == []


def test_a_file_that_holds_no_questions_is_refused(db, truth, tmp_path):
    (tmp_path / "no.jsonl").write_text("mug\n", encoding="utf-8")
    result = supermap("eval", "query", db, truth, "--questions", tmp_path / "no.jsonl")
    assert isinstance(result.exception, EvaluationError)
    assert "no.jsonl:1" in str(result.exception)


@pytest.mark.parametrize("section", ["map", "change", "all"])
def test_a_picture_is_drawn(db, truth, tmp_path, section):
    picture = tmp_path / f"{section}.png"
    result = supermap("eval", section, db, truth, "--plot", picture)
    assert result.exit_code == 0, result.output
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert f"drawn: {picture}" in result.stderr


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("map.song", "name a .png"),
        ("map", "name a .png"),
        ("none/map.png", "no such folder"),
        ("folder.png", "cannot be written there"),
    ],
)
def test_a_picture_that_cannot_be_is_refused_before_anything_is_read(tmp_path, name, said):
    (tmp_path / "folder.png").mkdir()
    result = supermap("eval", "map", tmp_path / "no.db", tmp_path / "no.json", "--plot", tmp_path / name)
    assert isinstance(result.exception, EvaluationError)
    assert said in str(result.exception)
    assert result.stdout == ""


def test_a_picture_that_fails_comes_after_the_result(db, truth, tmp_path, monkeypatch):
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", full)
    result = supermap("eval", "map", db, truth, "--plot", tmp_path / "map.png")
    assert isinstance(result.exception, EvaluationError)
    assert "No space left on device" in str(result.exception)
    assert "F1 without label" in result.stdout


def test_a_map_of_one_traversal_has_no_change_to_judge(tmp_path, truth):
    one = kitchen.m.make_memory(tmp_path / "map.db", ("monday", (0, 100), kitchen.monday))
    printed = document("eval", "eval", "all", one, truth)
    assert printed["change"]["reported"]["between"] is None
    assert (printed["not_mapped"], printed["partly_mapped"]) == (["tuesday"], [])
    assert (printed["query"]["exact"], printed["instances"]["ap"]) == (None, None)
    result = supermap("eval", "all", one, truth)
    assert result.exit_code == 0, result.output
    assert "; judged without tuesday: it is not in the map\n" in result.stdout
    assert result.stdout.count("not judged: the map lacks tuesday") == 4


def test_a_map_of_a_part_of_the_time_says_so(db):
    longer = kitchen_truth.write_kitchen_truth(db.with_name("longer.json"))
    assert document("eval", "eval", "query", db, longer)["partly_mapped"] == ["monday", "tuesday"]
    said = supermap("eval", "query", db, longer).stdout
    assert "judged with a part of monday, tuesday: the rest is not in the map" in said
    assert "not judged: the map lacks a part of monday and a part of tuesday" in said


# -- whose truth it is

CONTENT = {"monday": "c0ffee", "tuesday": "7ea"}
SPANS = {"monday": (0.0, 100.0), "tuesday": (1000.0, 1100.0)}


def known_by_fingerprint(**content: str | None) -> GroundTruth:
    whole = all_of_it()
    return replace(
        whole,
        traversals=tuple(replace(traversal, fingerprint=content.get(traversal.name)) for traversal in whole.traversals),
    )


@pytest.fixture
def fingerprinted(tmp_path: Path) -> Path:
    """The kitchen, built of recordings whose fingerprints are known."""
    path = tmp_path / "fingerprinted.db"
    with open_store(str(path), create=True) as store:
        for name, delta in (("monday", kitchen.monday), ("tuesday", kitchen.tuesday)):
            start = kitchen.m.start(name, SPANS[name])
            whole = window_fingerprint(CONTENT[name], start.start_ns, start.end_ns)
            number = store.begin_traversal(replace(start, name=f"built {name}", fingerprint=whole))
            store.commit(number, delta)
            store.finish_traversal(number, {})
    return path


def test_traversals_are_known_by_fingerprint_whatever_their_names(fingerprinted, tmp_path):
    path = kitchen_truth.write_kitchen_truth(tmp_path / "truth.json", known_by_fingerprint(**CONTENT))
    assert document("eval", "eval", "map", fingerprinted, path)["map"]["labelled"]["recall"] == 1.0


def test_the_truth_of_other_recordings_of_the_same_time_is_refused(fingerprinted, tmp_path):
    path = kitchen_truth.write_kitchen_truth(
        tmp_path / "truth.json", known_by_fingerprint(monday="0dd", tuesday="0dder")
    )
    result = supermap("eval", "map", fingerprinted, path)
    assert isinstance(result.exception, EvaluationError)
    assert "this truth belongs to other recordings" in str(result.exception)
    assert "beside the recordings" in result.exception.cure


def test_a_map_that_holds_more_than_the_truth_knows_is_refused(fingerprinted, tmp_path):
    path = kitchen_truth.write_kitchen_truth(
        tmp_path / "truth.json", known_by_fingerprint(monday="c0ffee", tuesday="0dd")
    )
    result = supermap("eval", "map", fingerprinted, path)
    assert isinstance(result.exception, EvaluationError)
    assert "the truth does not know built tuesday" in str(result.exception)


def test_a_traversal_without_a_fingerprint_is_known_by_its_time(fingerprinted, tmp_path):
    path = kitchen_truth.write_kitchen_truth(tmp_path / "truth.json", known_by_fingerprint(monday="c0ffee"))
    assert document("eval", "eval", "map", fingerprinted, path)["not_mapped"] == []


def test_a_way_far_off_the_true_one_is_warned_of(db, tmp_path):
    drives = kitchen_truth.kitchen_truth()
    drives.traversals[1].T_world_base[:, 0, 3] += np.linspace(0, 10, len(drives.traversals[1].T_world_base))
    far = kitchen_truth.write_kitchen_truth(tmp_path / "far.json", drives)
    result = supermap("eval", "map", db, far)
    assert result.exit_code == 0
    assert "warning: the robot's way in tuesday is" in result.stderr
    assert "the truth of other recordings?" in result.stderr


@pytest.mark.parametrize(
    ("break_it", "error"),
    [
        (lambda db, truth: (db.with_name("none.db"), truth), MemoryStoreError),
        (lambda db, truth: (db, truth.with_name("none.json")), TruthError),
        (lambda db, truth: (truth, db), TruthError),
    ],
    ids=["no map", "no truth", "in the wrong order"],
)
def test_what_cannot_be_read_says_so(db, truth, break_it, error):
    result = supermap("eval", "map", *break_it(db, truth))
    assert isinstance(result.exception, error)
    assert result.exception.cure


def test_the_truth_of_another_time_is_refused(db, tmp_path):
    later = kitchen_truth.write_kitchen_truth(
        tmp_path / "later.json", kitchen_truth.kitchen_truth(seconds=((5000.0, 5001.0), (6000.0, 6001.0)))
    )
    result = supermap("eval", "map", db, later)
    assert isinstance(result.exception, EvaluationError)
    assert "belongs to other recordings" in str(result.exception)


def test_a_question_that_is_not_understood_is_answered_wrong(db, tmp_path):
    asked = replace(all_of_it(), questions=(TrueQuestion("why is there a song", ()),))
    path = kitchen_truth.write_kitchen_truth(tmp_path / "asked.json", asked)
    assert document("eval", "eval", "query", db, path)["query"]["exact"] == 0.0
    assert "(not understood)" in supermap("eval", "query", db, path).stdout
