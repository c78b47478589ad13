"""`supermap eval ablation`."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.commands import ablation
from supermap_cli.commands.ablation import Ablation, AblationRow
from supermap_cli.errors import EvaluationError, SimulationError
from support.cli import document, supermap

COMPONENTS = ["tracker", "semantic-fusion", "geometric-consistency"]


@pytest.fixture(autouse=True)
def in_an_empty_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_simulated_world_is_built_as_it_is_and_without_each_component(tiny_world, tmp_path):
    printed = document("ablation", "eval", "ablation", tiny_world, "--keep", tmp_path / "kept")
    assert (printed["scenario"], printed["seed"]) == ("tiny", 2)
    assert [row["switched_off"] for row in printed["rows"]] == [None, *COMPONENTS]
    assert all(row["f1"] is not None and row["change_recall"] is None for row in printed["rows"])
    kept = {path.name for path in (tmp_path / "kept").glob("*.db")}
    assert kept == {f"without-{component}.db" for component in ("nothing", *COMPONENTS)}


def test_an_earlier_comparison_is_not_overwritten(tiny_world, tmp_path):
    (tmp_path / "without-nothing.db").touch()
    result = supermap("eval", "ablation", tiny_world, "--keep", tmp_path)
    assert isinstance(result.exception, EvaluationError)
    assert "name another folder" in str(result.exception)


def test_a_seed_is_not_for_a_world_that_is_there(tiny_world):
    result = supermap("eval", "ablation", tiny_world, "--seed", "3")
    assert isinstance(result.exception, EvaluationError)
    assert "leave --seed out" in str(result.exception)


def test_an_unknown_scenario_names_those_there_are():
    result = supermap("eval", "ablation", "moon-base")
    assert isinstance(result.exception, SimulationError)
    assert "office-twice" in str(result.exception)


def test_the_table_names_what_was_switched_off(monkeypatch, tiny_world):
    rows = (
        AblationRow(None, 9, 2, 0, 0.9, 0.8, 1.0, 0.95, 1.0, 0.97, 60.4),
        AblationRow("tracker", 5, 5, 5, 0.5, 0.5, 0.5, None, 1.25, None, 59.6),
    )
    monkeypatch.setattr(ablation, "compare", lambda *_: Ablation("office", 4, rows))
    result = supermap("eval", "ablation", tiny_world)
    assert result.exit_code == 0, result.output
    assert "office, seed 4" in result.stdout
    assert "as it is" in result.stdout
    (line,) = [line.split() for line in result.stdout.splitlines() if line.startswith("without tracker")]
    assert line[2:] == ["5", "/", "5", "/", "5", "0.500", "0.500", "0.500", "-", "1.250", "-", "60"]
