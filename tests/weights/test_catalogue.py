"""The catalogue holds what can be cited, and nothing that could run code or leave its folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.errors import ModelError
from supermap_cli.plugin_manager import load_plugins
from supermap_cli.weights.catalogue import load_catalogue, parse_catalogue, shipped_catalogue
from supermap_cli.weights.model_file import model_file

ENTRY = """
[[model]]
name = "mine"
task = "detector"
licence = "MIT"
[[model.file]]
path = "mine.onnx"
url = "https://models.example/mine.onnx"
"""


def test_every_shipped_entry_names_its_licence_source_and_citation() -> None:
    for model in shipped_catalogue().model:
        assert model.licence_url.startswith("https://")
        assert model.source.startswith("https://")
        assert model.citation
        assert model.unchecked is not None or all(file.sha256 and file.size for file in model.file)
        assert all(file.url.startswith("https://") for file in model.file)


def test_copyleft_has_to_be_accepted() -> None:
    copyleft = [model for model in shipped_catalogue().model if "GPL" in model.licence]
    assert copyleft
    assert all(model.accept for model in copyleft)


def test_the_detector_of_closed_sets_and_the_sentence_encoder_have_models() -> None:
    plugins = load_plugins()
    assert shipped_catalogue().of_backend("onnx")[0].name == "yolox-nano"
    assert shipped_catalogue().of_backend("sentence")
    assert {"onnx"} <= set(plugins.detectors.names())


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('"mine.onnx"', '"../mine.onnx"', "no plain file name"),
        ('"mine.onnx"', '".hidden"', "no plain file name"),
        ('"mine.onnx"', '"mine.pt"', "run code"),
        ('"https://models.example/mine.onnx"', '"file:///etc/passwd"', "no http or https address"),
        ('"mine"', '"../mine"', "model.0.name"),
        ('task = "detector"', "", "model.0.task: it is missing"),
        ('licence = "MIT"', 'licence = "MIT"\nsong = 1', "there is no such entry"),
        ('path = "mine.onnx"', 'path = "mine.onnx"\nsha256 = "abc"', "sha256"),
        ("[[model]]", "[[model", "not a TOML file"),
    ],
)
def test_a_wrong_entry_is_named(before: str, after: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        parse_catalogue(ENTRY.replace(before, after, 1), "catalogue.toml")


def test_own_models_join_the_catalogue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SUPERMAP_MODELS", str(tmp_path))
    (tmp_path / "catalogue.toml").write_text(ENTRY)
    assert load_catalogue().names() == (*shipped_catalogue().names(), "mine")
    (tmp_path / "catalogue.toml").write_text(ENTRY.replace('"mine"', '"yolox-nano"', 1))
    with pytest.raises(ModelError, match="has already: yolox-nano"):
        load_catalogue()


def test_a_missing_model_says_the_command_that_gets_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SUPERMAP_MODELS", str(tmp_path))
    with pytest.raises(ModelError, match="`supermap models pull grounding-dino` gets them"):
        model_file("grounding-dino")
    with pytest.raises(ModelError, match="`supermap models pull yolo11n-seg --accept-license` gets them"):
        model_file("yolo11n-seg")
    with pytest.raises(ModelError, match="no model is called 'song'"):
        model_file("song")
    with pytest.raises(ModelError, match="no file 'song'"):
        model_file("grounding-dino", "song")


def test_a_model_is_here_only_with_all_its_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SUPERMAP_MODELS", str(tmp_path))
    (tmp_path / "sam2").mkdir()
    (tmp_path / "sam2" / "encoder.onnx").touch()
    with pytest.raises(ModelError, match="a part of sam2 is missing"):
        model_file("sam2")
    (tmp_path / "sam2" / "decoder.onnx").touch()
    assert model_file("sam2") == tmp_path / "sam2" / "encoder.onnx"
    assert model_file("sam2", "decoder.onnx") == tmp_path / "sam2" / "decoder.onnx"
