"""`supermap eval benchmark --suite domains`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from supermap_cli.commands import domain_suite
from supermap_cli.commands.domain_suite import FIGURES, SCORES_NAME, WorldScores, figures_of, summarise
from supermap_cli.errors import ConfigError, EvaluationError
from supermap_cli.simulation.domains.suite import SuiteWorld
from support.cli import document, supermap


def scores(axis: str, level: str, f1: float | None, failed: str | None = None) -> WorldScores:
    return WorldScores(axis, level, 1, "report", {} if f1 is None else {"f1": f1}, failed)


def test_levels_are_means_and_a_failed_world_counts_as_nothing_found() -> None:
    suite = summarise(
        [scores("masks", "hull", 0.8), scores("masks", "hull", None, "crashed"), scores("odometry", "yaw", 1.0)]
    )
    hull, yaw = suite.levels
    assert (hull.worlds, hull.failed, hull.figures["f1"]) == (2, 1, 0.4)
    assert (yaw.worlds, yaw.failed, yaw.figures["f1"]) == (1, 0, 1.0)
    assert suite.overall.figures["f1"] == 0.6
    assert hull.figures["precision"] is None


def test_a_benchmark_of_one_world_gives_the_figures() -> None:
    figures = [{"name": "objects: F1", "values": [0.9], "mean": 0.9}, {"name": "another", "values": [1], "mean": 1}]
    found = figures_of({"tables": [{"figures": figures}]})
    assert found["f1"] == 0.9
    assert found["switches"] is None


def test_the_suite_is_built_in_processes_of_their_own(tmp_path, monkeypatch) -> None:
    worlds = (SuiteWorld("usual", "", 1, "development"), SuiteWorld("masks", "wool", 1, "report"))
    monkeypatch.setattr(domain_suite, "suite_worlds", lambda: worlds)
    monkeypatch.setattr(domain_suite, "SCENARIO", "tiny")
    printed = document("domain_suite", "eval", "benchmark", "--suite", "domains", "--keep", tmp_path)
    usual, broken = printed["worlds"]
    assert usual["failed"] is None
    assert printed["calibration"]["count"] == len(usual["rated"]) > 0
    kept = json.loads((tmp_path / "usual" / "tiny" / "1" / SCORES_NAME).read_text())
    assert kept == usual
    assert not list(tmp_path.rglob("masks*/**/suite_scores.*"))
    assert 0 <= usual["figures"]["f1"] <= 1
    assert "masks" in broken["failed"]
    assert printed["overall"]["failed"] == 1


class FakeWorlds:
    """Worlds that are scored at once; each says how often it was, and some fail."""

    def __init__(self) -> None:
        self.built: list[str] = []
        self.failing: set[str] = set()
        self.dying: set[str] = set()

    def score(self, world: SuiteWorld, place: Path) -> WorldScores:
        if world.axis in self.dying:
            raise KeyboardInterrupt
        self.built.append(world.axis)
        figures = dict.fromkeys(FIGURES, 1 / len(self.built))
        failed = "crashed" if world.axis in self.failing else None
        rated = ((0.75, True), (0.5, False))
        return WorldScores(world.axis, world.level, world.seed, world.half, {} if failed else figures, failed, rated)


@pytest.fixture
def fakes(monkeypatch: pytest.MonkeyPatch) -> FakeWorlds:
    fakes = FakeWorlds()
    worlds = [SuiteWorld("usual", "", 1, "development"), SuiteWorld("masks", "hull", 1, "report")]
    monkeypatch.setattr(domain_suite, "suite_worlds", lambda: worlds)
    monkeypatch.setattr(domain_suite, "_score", fakes.score)
    return fakes


SUITE = ("eval", "benchmark", "--suite", "domains", "--jobs", "1", "--keep")


def test_a_suite_that_was_killed_goes_on_if_asked_to(fakes: FakeWorlds, tmp_path: Path) -> None:
    fakes.dying = {"masks"}
    assert supermap(*SUITE, tmp_path).exit_code != 0
    fakes.dying = set()
    printed = document("domain_suite", *SUITE, tmp_path, "--resume")
    assert fakes.built == ["usual", "masks"]
    assert [world["figures"]["f1"] for world in printed["worlds"]] == [1.0, 0.5]
    assert printed["calibration"]["count"] == 4
    assert document("domain_suite", *SUITE, tmp_path, "--resume") == printed
    assert len(fakes.built) == 2


def test_without_resume_every_world_is_built_again(fakes: FakeWorlds, tmp_path: Path) -> None:
    for _ in range(2):
        supermap(*SUITE, tmp_path)
    assert fakes.built == ["usual", "masks"] * 2


def test_a_world_that_failed_has_no_scores_to_keep_not_even_old_ones(fakes: FakeWorlds, tmp_path: Path) -> None:
    supermap(*SUITE, tmp_path)
    fakes.failing = {"masks"}
    supermap(*SUITE, tmp_path)
    fakes.failing = set()
    printed = document("domain_suite", *SUITE, tmp_path, "--resume")
    assert fakes.built == ["usual", "masks", "usual", "masks", "masks"]
    assert printed["overall"]["failed"] == 0


@pytest.mark.parametrize("damage", ["", "{}", "[1]", '{"axis": "masks"}'])
def test_scores_that_are_none_are_told(fakes: FakeWorlds, tmp_path: Path, damage: str) -> None:
    supermap(*SUITE, tmp_path)
    path = tmp_path / "usual" / "room" / "1" / SCORES_NAME
    path.write_text(damage)
    result = supermap(*SUITE, tmp_path, "--resume")
    assert isinstance(result.exception, EvaluationError)
    assert str(path) in str(result.exception)


def test_the_scores_of_another_world_are_not_taken(fakes: FakeWorlds, tmp_path: Path) -> None:
    supermap(*SUITE, tmp_path)
    usual, masks = (tmp_path / name / "room" / "1" / SCORES_NAME for name in ("usual", "masks=hull"))
    masks.write_bytes(usual.read_bytes())
    assert isinstance(supermap(*SUITE, tmp_path, "--resume").exception, EvaluationError)


def test_all_worlds_together_are_one_reliability_table(fakes: FakeWorlds, tmp_path: Path) -> None:
    printed = supermap(*SUITE, tmp_path).stdout
    assert "expected calibration error 0.375" in printed
    assert "0.7 to 0.8" in printed
    assert "0.8 to 0.9" not in printed


@pytest.mark.parametrize("words", [("--suite", "domains", "--resume"), ("tiny", "--keep", "worlds", "--resume")])
def test_there_must_be_something_to_go_on_with(words: tuple[str, ...]) -> None:
    assert isinstance(supermap("eval", "benchmark", *words).exception, ConfigError)


def test_what_the_suite_fixes_cannot_be_asked_for() -> None:
    assert isinstance(supermap("eval", "benchmark", "office", "--suite", "domains").exception, ConfigError)
    result = supermap("eval", "benchmark", "--suite", "domains", "--axis", "colour")
    assert isinstance(result.exception, EvaluationError)
