"""What `inspect`, `build` and `plugins` print with --json is valid by the published schemas, on real recordings."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from supermap_cli import hookimpl, plugin_manager
from supermap_cli.hookspecs import Options, Register
from support import bags
from support import synthetic_room as room
from support.cli import document


@pytest.fixture(autouse=True)
def in_an_empty_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SUPERMAP_DB", raising=False)


class Required(Options):
    model: Path


def register_namesakes(register: Register) -> None:
    for _ in range(2):
        register("twin", object, Required)


@pytest.mark.parametrize("options", [{}, {"lidar": True}, {"frames": 1}, {"without": {"odom"}}], ids=str)
def test_inspect_of_a_recording_that_can_be_built(tmp_path: Path, options: dict[str, object]) -> None:
    path = bags.write_recording(tmp_path / "run.mcap", **options)  # type: ignore[arg-type]
    report = document("inspect", "inspect", path)
    assert report["can_build"]
    assert report["problems"] == []
    assert report["topics"]


def test_inspect_of_a_recording_with_several_cameras(tmp_path: Path) -> None:
    report = document("inspect", "inspect", bags.write_rig(tmp_path / "run.mcap", ("/cam_front", "/cam_left")))
    assert [camera["camera_id"] for camera in report["cameras"]] == ["front", "left"]
    assert {role["camera"] for role in report["roles"]} == {"front", "left", None}


@pytest.mark.parametrize("missing", ["color", "depth", "camera_info", "tf_static"])
def test_inspect_of_a_recording_that_cannot_be_built(tmp_path: Path, missing: str) -> None:
    path = bags.write_recording(tmp_path / "run.mcap", without={missing})
    report = document("inspect", "inspect", path, exit_code=1)
    assert not report["can_build"]
    assert report["problems"]


def test_build_of_a_rendered_room(tmp_path: Path) -> None:
    room.write_room_recording(tmp_path / "room.mcap", seconds=3.0)
    (traversal,) = document("build", "build", tmp_path / "room.mcap")["traversals"]
    assert traversal["traversal"] == "room"
    assert traversal["objects"] == sum(traversal["labels"].values()) > 0
    assert traversal["backends"]["detector"] == "recorded"


def test_plugins_as_they_are_installed() -> None:
    listed = document("plugins", "plugins")
    assert {"onnx", "recorded"} <= {plugin["name"] for plugin in listed["plugins"]}


def test_plugins_that_are_broken_or_claim_one_name(monkeypatch: pytest.MonkeyPatch) -> None:
    twins = SimpleNamespace(register_detectors=hookimpl(register_namesakes))
    loaded = plugin_manager.load_plugins([twins, object()])
    monkeypatch.setattr(plugin_manager, "load_plugins", lambda: loaded)
    listed = document("plugins", "plugins")
    assert "implements no hook" in listed["broken"][0]["error"]
    assert "'twin' is claimed" in listed["conflicts"][0]
    (option, _) = (plugin["options"][0] for plugin in listed["plugins"][-1]["backends"])
    assert option == {"name": "model", "required": True, "default": None, "description": ""}
