"""`supermap eval benchmark`."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from supermap_cli.commands.benchmark import parse_seeds, tabulate
from supermap_cli.errors import EvaluationError
from supermap_cli.evaluation.report import Report
from support.cli import document, supermap


@pytest.fixture(scope="module")
def worlds(tiny_world: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where one small world lies already."""
    folder = tmp_path_factory.mktemp("worlds")
    shutil.copytree(tiny_world, folder / "tiny" / "2")
    return folder


def test_kept_worlds_are_used_again_and_built_anew(worlds):
    recording = worlds / "tiny" / "2" / "tiny.mcap"
    written = recording.stat().st_mtime_ns
    for _ in range(2):
        printed = document("benchmark", "eval", "benchmark", "tiny", "--seeds", "2", "--keep", worlds)
    (table,) = printed["tables"]
    figures = {figure["name"]: figure for figure in table["figures"]}
    assert (table["scenario"], table["seeds"]) == ("tiny", [2])
    assert figures["objects: F1"]["values"] == [figures["objects: F1"]["mean"]]
    assert figures["change: F1 of the diff"]["values"] == [None]
    ((*rated,),) = table["rated"]
    precision = figures["objects: precision"]["values"][0]
    assert sum(right for _, right in rated) / len(rated) == pytest.approx(precision, abs=1e-4)
    assert recording.stat().st_mtime_ns == written


def test_another_world_in_the_place_is_not_scored(worlds, tmp_path):
    (tmp_path / "tiny").mkdir()
    (tmp_path / "tiny" / "1").symlink_to(worlds / "tiny" / "2")
    result = supermap("eval", "benchmark", "tiny", "--seeds", "1", "--keep", tmp_path)
    assert isinstance(result.exception, EvaluationError)
    assert "this is tiny, seed 2, not tiny, seed 1" in str(result.exception)


@pytest.mark.parametrize(("text", "seeds"), [("1", (1,)), ("11, 12,13", (11, 12, 13)), ("3,3", (3,))])
def test_seeds_are_numbers_with_commas(text, seeds):
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "1,", "one", "-1", "1-3"])
def test_anything_else_is_an_error_with_a_cure(text):
    with pytest.raises(EvaluationError, match="write --seeds 1,2,3"):
        parse_seeds(text)


def test_the_mean_is_over_the_worlds_that_gave_occasion():
    reports = [Report("tiny", seed, {"tiny": off_m}) for seed, off_m in ((1, 0.1), (2, 0.3))]
    (off,) = tabulate([*reports, Report("tiny", 3, {})])
    assert (off.values, off.mean) == ((0.1, 0.3, None), 0.2)
