"""`supermap config show`: what a build in this folder would use."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.errors import ConfigError
from support.cli import document, supermap

FILE = """
[build.keyframes]
rate_hz = 5

[build.parameters.drift]
min_matched = 0.5
search_radii_m = [0.3, 0.1]
"""


@pytest.fixture(autouse=True)
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_without_a_file_nothing_is_overridden() -> None:
    entries = document("config", "config", "show")["entries"]
    assert not any(entry["overridden"] for entry in entries)
    assert {"", "build", "build.keyframes", "build.parameters.drift", "build.parameters.predicates"} <= {
        entry["section"] for entry in entries
    }


def test_what_the_file_changes_is_marked(folder: Path) -> None:
    (folder / "supermap.toml").write_text(FILE, encoding="utf-8")
    entries = document("config", "config", "show")["entries"]
    changed = {(entry["section"], entry["name"]): entry for entry in entries if entry["overridden"]}
    assert changed.keys() == {
        ("build.keyframes", "rate_hz"),
        ("build.parameters.drift", "min_matched"),
        ("build.parameters.drift", "search_radii_m"),
    }
    rate = changed["build.keyframes", "rate_hz"]
    assert (rate["value"], rate["default"], rate["unit"]) == (5.0, 3.0, "Hz")
    assert changed["build.parameters.drift", "search_radii_m"]["value"] == [0.3, 0.1]


def test_people_get_tables_with_units_and_sources(folder: Path) -> None:
    (folder / "supermap.toml").write_text(FILE, encoding="utf-8")
    text = supermap("config", "show").stdout
    assert "[build.keyframes]" in text
    (line,) = (line for line in text.splitlines() if line.startswith("search_radii_m"))
    assert line.split()[1:5] == ["*", "[0.3,", "0.1]", "m"]
    assert line.rstrip().endswith("tuned on seeds 1-3")


@pytest.mark.parametrize("name", ["drift", "build.parameters.drift"])
def test_one_section_can_be_asked_for(name: str) -> None:
    entries = document("config", "config", "show", name)["entries"]
    assert {entry["section"] for entry in entries} == {"build.parameters.drift"}


def test_an_unknown_section_is_named_with_what_is_near() -> None:
    assert "is it drift" in str(supermap("config", "show", "drit").exception)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("min_match = 0.5", "there is no parameter min_match; is it min_matched"),
        ("min_matched = true", "not a number"),
        ("search_radii_m = 3.0", "not a list of numbers"),
    ],
)
def test_a_wrong_parameter_is_named(folder: Path, line: str, said: str) -> None:
    (folder / "supermap.toml").write_text(f"[build.parameters.drift]\n{line}\n", encoding="utf-8")
    error = supermap("config", "show").exception
    assert isinstance(error, ConfigError)
    assert said in str(error)
    assert "build.parameters.drift." in str(error)
