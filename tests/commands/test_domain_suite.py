"""`supermap eval benchmark --suite domains`."""

from __future__ import annotations

from supermap_cli.commands import domain_suite
from supermap_cli.commands.domain_suite import WorldScores, figures_of, summarise
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
    assert 0 <= usual["figures"]["f1"] <= 1
    assert "masks" in broken["failed"]
    assert printed["overall"]["failed"] == 1


def test_what_the_suite_fixes_cannot_be_asked_for() -> None:
    assert isinstance(supermap("eval", "benchmark", "office", "--suite", "domains").exception, ConfigError)
    result = supermap("eval", "benchmark", "--suite", "domains", "--axis", "colour")
    assert isinstance(result.exception, EvaluationError)
