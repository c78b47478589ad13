"""`supermap eval perception`."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from supermap_cli.commands import perception
from supermap_cli.commands.perception import PerceptionFigure, perception_configs
from support.cli import document, supermap


def test_a_world_is_built_once_for_each_way_of_perceiving(tiny_world: Path, tmp_path: Path) -> None:
    shutil.copytree(tiny_world, tmp_path / "tiny" / "2")
    printed = document("perception", "eval", "perception", "tiny", "--seeds", "2", "--keep", tmp_path)
    assert printed["ways"] == list(perception_configs())
    (table,) = printed["tables"]
    assert (table["scenario"], table["seeds"]) == ("tiny", [2])
    figures = {figure["name"]: figure["means"] for figure in table["figures"]}
    at_once, late, *_ = figures["objects: F1"]
    assert at_once == late
    assert "change: F1 of the diff" not in figures
    assert all(len(means) == len(printed["ways"]) for means in figures.values())


def test_the_table_names_the_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    figures = (PerceptionFigure("objects: F1", (0.9, 0.9, 0.875, None)),)
    monkeypatch.setattr(perception, "_compare", lambda *_: figures)
    result = supermap("eval", "perception", "office", "--seeds", "1,2")
    assert result.exit_code == 0, result.output
    assert "office, mean of seeds 1, 2" in result.stdout
    assert all(perception_config in result.stdout for perception_config in perception_configs())
    (line,) = [line.split() for line in result.stdout.splitlines() if line.startswith("objects: F1")]
    assert line[2:] == ["0.900", "0.900", "0.875", "-"]
