"""`supermap eval`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import kitchen
import kitchen_truth
from cli import document, supermap
from supermap_cli.errors import EvaluationError, MemoryStoreError, TruthError
from supermap_cli.types.truth import TrueQuestion

SECTIONS = ("map", "change", "identity", "instances", "semantics", "query")


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("map") / "kitchen.db")


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen_truth.write_kitchen_truth(tmp_path_factory.mktemp("truth") / "truth.json")


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
    assert {each["id"] for each in printed["map"]["false"]} >= {"tv-1", "lamp-1"}
    assert printed["change"]["reported"]["overall"]["f1"] == 1.0
    assert printed["identity"]["relocated_kept"] == 1.0
    assert printed["query"]["exact"] == 1.0


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ("map", ("F1", "precision without label", "tv-1", "why")),
        ("change", ("change recall, per object", "F1 moved", "chair-a (moved here)")),
        ("identity", ("instances per object", "relocated, same id")),
        ("instances", ("AP50", "best instance")),
        ("semantics", ("mIoU", "wall as one class")),
        ("query", ("answered right", "share of 2 questions")),
    ],
)
def test_a_table_says_what_every_figure_means(db, truth, section, said):
    result = supermap("eval", section, db, truth)
    assert result.exit_code == 0, result.output
    assert "kitchen, seed 7; the robot's way off its true way: monday 0.000 m, tuesday 0.000 m" in result.stdout
    assert [each for each in ("what it says", *said) if each not in result.stdout] == []


@pytest.mark.parametrize("section", ["map", "change", "all"])
def test_a_picture_is_drawn(db, truth, tmp_path, section):
    picture = tmp_path / f"{section}.png"
    result = supermap("eval", section, db, truth, "--plot", picture)
    assert result.exit_code == 0, result.output
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert f"drawn: {picture}" in result.stderr


def test_a_picture_of_an_unknown_kind_is_refused(db, truth, tmp_path):
    result = supermap("eval", "map", db, truth, "--plot", tmp_path / "map.song")
    assert isinstance(result.exception, EvaluationError)
    assert "name a .png" in str(result.exception)


def test_a_map_of_one_traversal_has_no_change_to_judge(tmp_path, truth):
    one = kitchen.m.make_memory(tmp_path / "map.db", ("monday", (0, 100), kitchen.monday))
    printed = document("eval", "eval", "all", one, truth)
    assert printed["change"]["reported"]["between"] is None
    assert supermap("eval", "all", one, truth).exit_code == 0


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
    assert "belongs to another recording" in str(result.exception)


def test_a_question_that_is_not_understood_is_answered_wrong(db, tmp_path):
    asked = replace(kitchen_truth.kitchen_truth(), questions=(TrueQuestion("why is there a song", ()),))
    path = kitchen_truth.write_kitchen_truth(tmp_path / "asked.json", asked)
    assert document("eval", "eval", "query", db, path)["query"]["exact"] == 0.0
    assert "(not understood)" in supermap("eval", "query", db, path).stdout
