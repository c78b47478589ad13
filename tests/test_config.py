"""The configuration: defaults, files, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from supermap_cli.config import BuildConfig, UserConfig, load_user_config
from supermap_cli.errors import ConfigError
from supermap_cli.parameters import MethodParameters
from supermap_cli.wrong_entries import wrong_entry


def write(folder: Path, text: str) -> Path:
    (folder / "supermap.toml").write_text(text, encoding="utf-8")
    return folder


def test_without_a_file_the_defaults_hold(tmp_path: Path) -> None:
    assert load_user_config(tmp_path) == UserConfig()
    assert UserConfig().build.keyframes.rate_hz == 3.0
    assert UserConfig().build.ablate == ()


def test_an_empty_file_changes_nothing(tmp_path: Path) -> None:
    assert load_user_config(write(tmp_path, "")) == UserConfig()


def test_a_file_changes_what_it_names(tmp_path: Path) -> None:
    text = """
    db = "office.db"
    [build]
    ablate = ["tracker"]
    [build.recording.topics]
    color = "/cam/image"
    [build.backends]
    detector = "onnx"
    [build.backends.options.onnx]
    score = 0.3
    [build.keyframes]
    rate_hz = 5
    [build.parameters.drift]
    min_points = 100
    search_radii_m = [0.3, 1]
    """
    config = load_user_config(write(tmp_path, text))
    assert config.db == "office.db"
    assert config.build.ablate == ("tracker",)
    assert config.build.recording.topics == {"color": "/cam/image"}
    assert config.build.backends.detector == "onnx"
    assert config.build.backends.options == {"onnx": {"score": 0.3}}
    assert config.build.keyframes.rate_hz == 5.0
    assert config.build.parameters == {"drift": {"min_points": 100, "search_radii_m": [0.3, 1]}}
    assert config.build.mapping == BuildConfig().mapping


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("db = ", "not a TOML file"),
        ("bd = 'a.db'", "bd"),
        ("[build.keyframes]\nrate_hz = 0", "build.keyframes.rate_hz"),
        ("[build.keyframes]\nrate = 3", "build.keyframes.rate"),
        ("[build]\nablate = ['everything']", "build.ablate"),
        ("[build.parameters.drift]\nmin_points = 'many'", "build.parameters.drift.min_points"),
        ("[build.mapping]\nmax_depth_m = 'far'", "build.mapping.max_depth_m"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said) as raised:
        load_user_config(write(tmp_path, text))
    assert str(tmp_path / "supermap.toml") in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "supermap.toml").write_bytes(b"\xff\xfe\x00db")
    with pytest.raises(ConfigError, match="no UTF-8 text"):
        load_user_config(tmp_path)


def test_what_was_used_can_be_stored_and_read_again() -> None:
    config = BuildConfig.model_validate(
        {
            "backends": {"options": {"onnx": {"model": "a.onnx"}}},
            "parameters": {"drift": {"min_points": 100, "min_matched": 0.5, "search_radii_m": [0.3, 1]}},
            "ablate": ["tracker", "semantic-fusion"],
        }
    )
    assert BuildConfig.model_validate_json(config.model_dump_json()) == config


def test_a_configuration_cannot_be_changed_behind_its_back() -> None:
    with pytest.raises(ValidationError):
        BuildConfig().keyframes.rate_hz = 9.0


def _numbers(schema: dict[str, Any], part: dict[str, Any], entry: tuple[str, ...]) -> Iterator[tuple[Any, ...]]:
    """(entry, least, most) of every number that a JSON Schema allows, by its own words; `None`: no bound."""
    part = schema["$defs"][part["$ref"].rpartition("/")[2]] if "$ref" in part else part
    if part.get("type") in {"number", "integer"}:
        least, most = (part.get(name, part.get(f"exclusive{name.capitalize()}")) for name in ("minimum", "maximum"))
        yield entry, least, most
    for name, inner in part.get("properties", {}).items():
        if (entry, name) != (("build",), "parameters"):  # `MethodParameters` has the bounds of these
            yield from _numbers(schema, inner, (*entry, name))
    for inner in part.get("anyOf", []):
        yield from _numbers(schema, inner, entry)
    if isinstance(inner := part.get("additionalProperties"), dict):
        yield from _numbers(schema, inner, (*entry, "x"))


_SCHEMA = UserConfig.model_json_schema()
NUMBERS = list(_numbers(_SCHEMA, _SCHEMA, ()))


def _refusal(entry: tuple[str, ...], value: float) -> str:
    values: Any = value
    for name in reversed(entry):
        values = {name: values}
    with pytest.raises(ValidationError) as refused:
        UserConfig.model_validate(values)
    where, what = wrong_entry(refused.value)
    assert where == entry
    return what


@pytest.mark.parametrize(("entry", "least", "most"), NUMBERS, ids=[".".join(each[0]) for each in NUMBERS])
def test_every_number_has_bounds_and_is_refused_beyond_them(entry: tuple[str, ...], least: float, most: float) -> None:
    assert least is not None
    assert most is not None
    for value, bound in ((least - 1, least), (int(most * 1.001) + 1, most), (10**30, most), (-(10**30), least)):
        assert f"{bound:.12g}" in _refusal(entry, value)
    for value in (float("nan"), float("inf"), float("-inf")):
        assert "number" in _refusal(entry, value)


PARAMETERS = [row for row in MethodParameters().describe() if not isinstance(row.default, bool)]


@given(st.sampled_from(PARAMETERS), st.sampled_from([-1e12, 1e12, -(10**400), 10**400, float("nan"), float("inf")]))
def test_every_parameter_of_the_method_is_refused_beyond_its_bounds(row: Any, value: float) -> None:
    whole = isinstance(row.default, int)
    given_value = [value] * len(row.default) if isinstance(row.default, tuple) else value
    with pytest.raises(ConfigError) as refused:
        MethodParameters.from_overrides({row.file: {row.name: given_value}})
    said = str(refused.value)
    assert f"build.parameters.{row.file}.{row.name}" in said
    assert "number" in said or "give one from" in said
    assert len(said) < 400
    assert not whole or "whole" in said or "give one from" in said


def test_the_defaults_lie_within_the_bounds() -> None:
    given_values: dict[str, dict[str, object]] = {}
    for row in MethodParameters().describe():
        given_values.setdefault(row.file, {})[row.name] = (
            list(row.default) if isinstance(row.default, tuple) else row.default
        )
    assert MethodParameters.from_overrides(given_values) == MethodParameters()
    assert UserConfig.model_validate(UserConfig().model_dump()) == UserConfig()
