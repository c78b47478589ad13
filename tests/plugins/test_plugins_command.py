"""`supermap plugins`."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from supermap_cli import hookimpl, plugin_manager
from supermap_cli.main import make_app
from support.broken_plugins import break_plugin


def run(*arguments: str) -> str:
    result = CliRunner().invoke(make_app(), ["plugins", *arguments])
    assert result.exit_code == 0, result.output
    return result.stdout


def test_plugins_backends_and_options_are_listed() -> None:
    text = run()
    for expected in ("bytetrack", "supermap-cli", "register_detectors", "onnx.score_floor=0.1", "depth.samples="):
        assert expected in text


def test_json_holds_everything() -> None:
    listed = json.loads(run("--json"))
    assert set(listed) == {"plugins", "broken", "conflicts"}
    assert listed["broken"] == listed["conflicts"] == []
    backends = {
        (backend["kind"], backend["name"]): backend for plugin in listed["plugins"] for backend in plugin["backends"]
    }
    onnx = {option["name"]: option for option in backends["detector", "onnx"]["options"]}
    assert onnx["score_floor"]["default"] == 0.1
    assert onnx["model"] == {
        "name": "model",
        "required": False,
        "default": None,
        "description": onnx["model"]["description"],
    }


def test_a_broken_plugin_is_listed_with_its_error(monkeypatch: pytest.MonkeyPatch) -> None:
    break_plugin(monkeypatch, "bytetrack", ImportError("No module named 'lap' [in a bracket]"))
    loaded = plugin_manager.load_plugins([SimpleNamespace(spatial_predicates=hookimpl(lambda: ()))])
    monkeypatch.setattr(plugin_manager, "load_plugins", lambda: loaded)
    assert "ImportError: No module named 'lap' [in a bracket]" in " ".join(run().split())
    (broken,) = json.loads(run("--json"))["broken"]
    assert broken["name"] == "bytetrack"
