"""`supermap simulate` as it is typed."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from supermap_cli.commands.simulate import detector_errors
from supermap_cli.errors import ConfigError, SimulationError
from supermap_cli.simulation import scenarios
from supermap_cli.simulation.rigs import RIGS
from supermap_cli.simulation.scenarios import SCENARIOS
from support import cli

EXAMPLE = Path(__file__).parents[2] / "examples" / "simulated_office" / "run.sh"


def test_the_list_names_every_scenario_and_every_error_of_the_detector() -> None:
    shown = cli.supermap("simulate", "--list").stdout
    assert all(name in shown for name in (*SCENARIOS, *RIGS, "recall", "false_positives"))
    listed = cli.document("simulate_list", "simulate", "--list")
    assert [scenario["name"] for scenario in listed["scenarios"]] == list(SCENARIOS)
    assert [rig["name"] for rig in listed["rigs"]] == list(RIGS)
    assert {"name": "recall", "default": 0.95}.items() <= listed["errors"][0].items()


def test_a_scenario_is_written_and_told(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    told = cli.document("simulate", "simulate", "tiny", "--out", folder, "--seed", "2", "--seconds", "2", "--perfect")
    assert (told["scenario"], told["seed"]) == ("tiny", 2)
    assert told["truth"] == str(folder / "truth.json")
    written = {path.name for path in folder.iterdir()}
    assert written == {"truth.json", *(Path(recording["path"]).name for recording in told["recordings"])}
    for recording in told["recordings"]:
        assert recording["bytes"] == Path(recording["path"]).stat().st_size
        assert recording["seconds"] == pytest.approx(2, abs=0.5)
        assert recording["detection_images"] >= 5


def test_people_are_told_what_to_do_next(tmp_path: Path) -> None:
    folder = tmp_path / "my rooms"
    arguments = ("simulate", "tiny", "--out", folder, "--seconds", "1", "--error", "recall=0.5")
    shown = cli.supermap(*arguments).stdout
    assert "truth.json" in shown
    assert f"supermap build '{folder}/" in shown
    assert f"supermap eval all '{folder / 'map.db'}' '{folder / 'truth.json'}'" in shown
    again = cli.supermap(*arguments)
    assert isinstance(again.exception, SimulationError)
    assert "--overwrite" in str(again.exception)
    assert cli.supermap(*arguments, "--overwrite").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ((), "no scenario given.*--list"),
        (("moon",), r"there is no scenario 'moon'.*tiny"),
        (("tiny", "--rig", "moon"), r"there is no rig 'moon'.*three-cameras"),
    ],
)
def test_a_scenario_that_there_is_none_of(arguments: tuple[str, ...], what: str) -> None:
    result = cli.supermap("simulate", *arguments)
    assert isinstance(result.exception, SimulationError)
    with pytest.raises(SimulationError, match=what):
        raise result.exception


@pytest.mark.parametrize(
    ("given", "what"),
    [
        (["recall"], "--error 'recall' is not understood"),
        (["recal=0.5"], "--error recal: .*the errors are recall,"),
        (["recall=2"], "--error recall: .*less than or equal to 1"),
        (["recall=often"], "--error recall: .*number"),
    ],
)
def test_an_error_that_is_none_is_told(given: list[str], what: str) -> None:
    with pytest.raises(ConfigError, match=what):
        detector_errors(given, perfect=False)


def test_single_errors_lie_over_a_perfect_detector() -> None:
    errors = detector_errors(["recall=0.5", "hypotheses=4"], perfect=True)
    assert (errors.recall, errors.hypotheses, errors.confusion) == (0.5, 4, 0)


def test_nothing_is_written_for_a_number_of_seconds_that_makes_no_sense(tmp_path: Path) -> None:
    assert cli.supermap("simulate", "tiny", "--out", tmp_path / "out", "--seconds", "0").exit_code == 2
    assert not (tmp_path / "out").exists()


def test_json_goes_to_stdout_alone(tmp_path: Path) -> None:
    result = cli.supermap("simulate", "tiny", "--out", tmp_path, "--seconds", "1", "--json")
    assert json.loads(result.stdout)["scenario"] == "tiny"


@pytest.mark.parametrize("command", [("simulate", "tiny"), ("demo",), ("eval", "ablation", "tiny")])
def test_a_negative_seed_is_wrong_usage_and_nothing_begins(
    command: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = cli.supermap(*command, "--seed", "-1")
    assert result.exit_code == 2
    assert result.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_while_the_world_is_made_says_that_nothing_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(scenarios, "make_scenario", interrupt)
    result = cli.supermap("simulate", "tiny", "--out", tmp_path / "out")
    assert "interrupted: nothing was written" in result.stderr
    assert result.exit_code != 0
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["truth.json", "monday.mcap", "office.db"])
def test_the_example_leaves_alone_what_it_has_not_made(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("mine", encoding="utf-8")
    ran = subprocess.run(["bash", str(EXAMPLE), str(tmp_path)], capture_output=True, text=True, check=False, timeout=60)
    assert ran.returncode == 1
    assert f"{name} would be overwritten" in ran.stderr
    assert (tmp_path / name).read_text(encoding="utf-8") == "mine"
