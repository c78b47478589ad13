"""`supermap demo`."""

from __future__ import annotations

import shlex
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import typer

import kitchen_truth
from supermap_cli.commands.demo import demo, three_questions
from supermap_cli.types.truth import GroundTruth, TrueQuestion


class Recorder:
    """Stands for the command line: notes what it is called with; `simulate` leaves a truth behind."""

    def __init__(self, folder: Path, failing: str = "") -> None:
        self.folder = folder
        self.failing = failing
        self.calls: list[list[str]] = []

    def main(self, args: list[str], **_: Any) -> int:
        self.calls.append(args)
        if args[0] == "simulate":
            self.folder.mkdir(exist_ok=True)
            kitchen_truth.write_kitchen_truth(self.folder / "truth.json")
        return int(args[0] == self.failing)


def run(recorder: Recorder) -> None:
    demo(SimpleNamespace(find_root=lambda: SimpleNamespace(command=recorder)), recorder.folder, seed=3)  # type: ignore[arg-type]


def questions(*asked: tuple[str, tuple[str, ...]]) -> GroundTruth:
    return GroundTruth("world", 0, (), (), (), (), tuple(TrueQuestion(*each) for each in asked))


def test_it_shows_what_it_runs_and_runs_what_it_shows(tmp_path, capsys):
    recorder = Recorder(tmp_path / "my demo")
    run(recorder)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("$ supermap ")]
    assert [shlex.split(line)[2:] for line in lines] == recorder.calls


def test_it_simulates_builds_asks_compares_and_evaluates(tmp_path):
    recorder = Recorder(tmp_path / "demo")
    run(recorder)
    assert [each[0] for each in recorder.calls] == ["simulate", "build", "query", "diff", "eval"]
    simulate, build, query, *_ = recorder.calls
    assert simulate[simulate.index("--seed") + 1] == "3"
    assert build[1:3] == [str(tmp_path / "demo" / name) for name in ("monday.mcap", "tuesday.mcap")]
    assert query[1] == "vase on the table"


def test_an_earlier_map_is_made_anew(tmp_path):
    recorder = Recorder(tmp_path)
    (tmp_path / "map.db").write_text("old")
    run(recorder)
    assert not (tmp_path / "map.db").exists()


def test_it_ends_where_a_command_fails(tmp_path):
    recorder = Recorder(tmp_path, failing="build")
    with pytest.raises(typer.Exit):
        run(recorder)
    assert [each[0] for each in recorder.calls] == ["simulate", "build"]


@pytest.mark.parametrize(
    ("asked", "chosen"),
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
def test_questions_are_a_count_a_relation_and_one_about_the_past(asked, chosen):
    assert three_questions(questions(*asked)) == chosen
