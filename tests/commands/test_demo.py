"""`supermap demo`."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import typer

from supermap_cli.commands.demo import answer_summary, change_summary, demo, example_questions
from supermap_cli.errors import SimulationError
from supermap_cli.evaluation.changes import ChangeScores, FalseChange, MissedChange
from supermap_cli.evaluation.estimate import EstimatedAnswer
from supermap_cli.evaluation.shares import precision_recall
from supermap_cli.types.truth import GroundTruth, TrueChange, TrueQuestion
from support import cli, evaluated, kitchen, kitchen_truth

NOTHING_COMPARED = ChangeScores(None, None, None, None, None, None, 0, (), (), ())
DEMO_TRUTH = replace(kitchen_truth.kitchen_truth(), scenario="demo")


class Recorder:
    """Stands for the command line: notes what it is called with; `simulate` leaves a truth behind, `build` a map."""

    def __init__(self, folder: Path, failing: str = "") -> None:
        self.folder = folder
        self.failing = failing
        self.calls: list[list[str]] = []

    def main(self, args: list[str], **_: Any) -> int:
        self.calls.append(args)
        if args[0] == "simulate":
            self.folder.mkdir(exist_ok=True)
            kitchen_truth.write_kitchen_truth(self.folder / "truth.json", DEMO_TRUTH)
        if args[0] == "build":
            kitchen.make_kitchen(self.folder / "map.db")
        return int(args[0] == self.failing)


def run(recorder: Recorder) -> None:
    demo(SimpleNamespace(find_root=lambda: SimpleNamespace(command=recorder)), recorder.folder, seed=3)  # type: ignore[arg-type]


def truth_of(*questions: tuple[str, tuple[str, ...]], changed: Sequence[str] = "abcd") -> GroundTruth:
    changes = tuple(
        TrueChange("disappeared", object_id, 0, None, 5, 5, None, ("monday", "tuesday")) for object_id in changed
    )
    return GroundTruth("world", 0, (), (), (), changes, tuple(TrueQuestion(*question) for question in questions))


def test_it_shows_what_it_runs_and_runs_what_it_shows(tmp_path, capsys):
    recorder = Recorder(tmp_path / "my demo")
    run(recorder)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("$ supermap ")]
    assert [shlex.split(line)[2:] for line in lines] == recorder.calls


def test_it_simulates_builds_asks_compares_and_evaluates(tmp_path):
    recorder = Recorder(tmp_path / "demo")
    run(recorder)
    assert [call[0] for call in recorder.calls] == ["simulate", "build", "query", "diff", "eval"]
    simulate, build, query, *_ = recorder.calls
    assert simulate[simulate.index("--seed") + 1] == "3"
    assert build[1:3] == [str(tmp_path / "demo" / name) for name in ("monday.mcap", "tuesday.mcap")]
    assert query[1] == "vase on the table"


def test_an_earlier_demo_is_made_anew(tmp_path):
    recorder = Recorder(tmp_path)
    run(recorder)
    (tmp_path / "map.db-wal").write_text("old")
    run(recorder)
    assert len(recorder.calls) == 10
    assert not (tmp_path / "map.db-wal").exists()


@pytest.mark.parametrize("name", ["map.db", "monday.mcap", "tuesday.mcap", "evaluation.png"])
def test_what_no_demo_made_is_left_alone(name, tmp_path):
    (tmp_path / name).write_text("mine")
    recorder = Recorder(tmp_path)
    with pytest.raises(SimulationError, match=f"{name} would be overwritten.*name another --folder"):
        run(recorder)
    assert recorder.calls == []
    assert (tmp_path / name).read_text() == "mine"


@pytest.mark.parametrize("foreign", [kitchen_truth.kitchen_truth(), None])
def test_the_truth_of_another_world_is_left_alone(foreign, tmp_path, capsys):
    if foreign is None:
        (tmp_path / "truth.json").write_text("{}")
    else:
        kitchen_truth.write_kitchen_truth(tmp_path / "truth.json", foreign)
    recorder = Recorder(tmp_path)
    with pytest.raises(SimulationError, match="name another --folder"):
        run(recorder)
    assert recorder.calls == []
    assert capsys.readouterr().out == ""


def test_it_tells_what_really_changed_then_what_the_map_says_and_how_far_that_is_right(tmp_path, capsys):
    run(Recorder(tmp_path / "demo"))
    described = " ".join(capsys.readouterr().out.split())
    truly = described.index("the cup is gone, the chair was moved by 3.61 m and a new vase is there")
    assert truly < described.index("$ supermap diff") < described.index("the map found 3 of 3 true changes.")


def test_what_it_says_to_try_next_is_in_the_map(tmp_path, capsys):
    run(Recorder(tmp_path / "demo"))
    (instance_id,) = re.findall(r"supermap show (\S+-\d+)", capsys.readouterr().out)
    result = cli.supermap("show", instance_id, "--db", tmp_path / "demo" / "map.db")
    assert result.exit_code == 0, result.output


def test_what_was_missed_and_invented_is_said():
    missed = (MissedChange("moved", "armchair-1", "armchair", reported_as_two=True),)
    false = (FalseChange("disappeared", "book-1", "book", None), FalseChange("appeared", "mug-2", "mug", None))
    scores = replace(NOTHING_COMPARED, overall=precision_recall(3, 2, 1), missed=missed, false=false)
    described = change_summary(scores)
    assert "found 3 of 4 true changes" in described
    assert "It missed: armchair (moved, told as two)." in described
    assert "did not happen so: book (disappeared) and mug (appeared)." in described
    assert "nothing to compare" in change_summary(NOTHING_COMPARED)


def test_right_answers_are_counted():
    truth = evaluated.still_life()
    perfect = evaluated.perfect_map(truth)
    assert answer_summary(("the table", "a piano"), perfect, truth) == "It answered all 2 questions above right."
    assert "None of the questions" in answer_summary((), perfect, truth)


def test_wrong_answers_are_said_with_the_right_ones():
    truth = evaluated.still_life()
    answers = (EstimatedAnswer("the table", ()), EstimatedAnswer("a piano", ()))
    described = answer_summary(("the table", "a piano"), replace(evaluated.perfect_map(truth), answers=answers), truth)
    assert described == 'Of the 2 questions above it answered 1 wrong: "the table" (right: table-1).'


def test_it_ends_where_a_command_fails(tmp_path):
    recorder = Recorder(tmp_path, failing="build")
    with pytest.raises(typer.Exit):
        run(recorder)
    assert [call[0] for call in recorder.calls] == ["simulate", "build"]


@pytest.mark.parametrize(
    ("questions", "chosen"),
    [
        ([], ()),
        ([("piano", ()), ("how many pianos", ())], ()),
        (
            [("chair", ("a",)), ("cup on the table", ("b",)), ("how many mugs", ("c",)), ("plant earlier", ("d",))],
            ("how many mugs", "cup on the table", "plant earlier"),
        ),
        ([("how many mugs", ("c",)), ("how many chairs", ("a", "b"))], ("how many chairs",)),
        ([("cup on the table", ("a",)), ("cup near the tv", ("a",))], ("cup near the tv",)),
        ([("bin earlier", ("a",)), ("where was the bin", ("a",))], ("where was the bin",)),
    ],
)
def test_questions_are_a_count_a_relation_and_one_about_the_past(questions, chosen):
    assert example_questions(truth_of(*questions)) == chosen


def test_the_question_about_the_past_is_of_something_that_changed():
    questions = (("where was the plant", ("plant",)), ("bag earlier", ("bag",)))
    assert example_questions(truth_of(*questions, changed=("bag",))) == ("bag earlier",)
