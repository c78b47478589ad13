"""The configuration: defaults, files, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from supermap_cli.config import BuildConfig, UserConfig, load_user_config
from supermap_cli.errors import ConfigError


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
