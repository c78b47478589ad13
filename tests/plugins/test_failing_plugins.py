"""Plugins that print, hang or raise: named, in one line."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
import typer

from supermap_cli import plugin_manager
from supermap_cli.commands.from_plugins import CommandGroup
from supermap_cli.errors import PluginError, SupermapError
from supermap_cli.hookspecs import hookimpl
from supermap_cli.memory.opening import read_sql
from support import kitchen
from support.cli import supermap


def install(monkeypatch: pytest.MonkeyPatch, load) -> None:
    """One installed plugin of a third party, and no other."""
    entry = SimpleNamespace(
        name="theirs", value="their_package:plugin", dist=SimpleNamespace(name="their-dist", version="1"), load=load
    )
    monkeypatch.setattr(plugin_manager, "entry_points", lambda **_: [entry])
    plugin_manager._load_installed.cache_clear()
    monkeypatch.setattr(plugin_manager, "LOADING_LIMIT_S", 0.5)


@pytest.fixture(autouse=True)
def forget_plugins() -> Iterator[None]:
    yield
    plugin_manager._load_installed.cache_clear()


def test_what_a_plugin_prints_is_no_answer(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    install(monkeypatch, lambda: print("hello") or ModuleType("their_package"))  # noqa: T201
    plugin_manager.load_plugins()
    assert capsys.readouterr().out == ""


def test_a_plugin_that_hangs_is_left_out_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, lambda: time.sleep(60))
    began = time.monotonic()
    (broken,) = plugin_manager.load_plugins().broken
    assert time.monotonic() - began < 10
    assert (broken.name, broken.error) == ("theirs", "TimeoutError: it takes longer than 0.5 s to load")


def test_what_a_plugin_raises_is_one_line_with_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, lambda: ModuleType("their_package"))
    their_code: dict[str, object] = {"__name__": "their_package.detector"}
    exec("def detect(): return [][3]", their_code)  # noqa: S102 - code of another package
    app = typer.Typer(cls=CommandGroup)

    @app.callback()
    def root() -> None: ...

    @app.command()
    def run() -> None:
        their_code["detect"]()  # type: ignore[operator]

    with pytest.raises(PluginError, match=r"the plugin theirs of their-dist failed: IndexError: .*--debug"):
        typer.main.get_command(app).main(["run"], standalone_mode=False)


@pytest.mark.sqlite_only("pragmas")
def test_a_plugin_cannot_lift_that_nothing_is_written(tmp_path: Path) -> None:
    kitchen.make_kitchen(tmp_path / "map.db")
    before = (tmp_path / "map.db").read_bytes()

    def lift(connection) -> None:
        for statement in ("PRAGMA query_only = OFF", "PRAGMA writable_schema = ON", "DELETE FROM visit"):
            with pytest.raises(Exception, match=r"not authorized|readonly"):
                connection.execute(statement)

    with read_sql(str(tmp_path / "map.db"), "SELECT count(*) FROM visit", lift) as found:
        assert next(found.rows)[0] > 0
    assert supermap("db", "check", "--db", tmp_path / "map.db").exit_code == 0
    assert (tmp_path / "map.db").read_bytes() == before
    assert "their_package" not in sys.modules


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (lambda: "x", "their_package.*answers with str, not with Detections"),
        (lambda: next(iter(())), "plugin theirs of their-dist failed"),
    ],
    ids=["no detections", "StopIteration"],
)
def test_a_detector_that_answers_with_anything_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer, said: str
) -> None:
    from importlib import metadata

    from support import bags

    module = ModuleType("their_package")
    module.__dict__["answer"] = answer
    code = "def detect(self, frame): return answer()\ndef image_stamps_ns(self, camera_id): return None"
    exec(code, module.__dict__)  # noqa: S102 - code of another package
    body = {"detect": module.detect, "image_stamps_ns": module.image_stamps_ns, "__module__": "their_package"}
    detector = type("Detector", (), body)

    @hookimpl
    def register_detectors(register) -> None:
        register("theirs", lambda options, recording: detector())

    module.__dict__["register_detectors"] = register_detectors
    built_in = metadata.entry_points(group="supermap")
    install(monkeypatch, lambda: module)
    (theirs,) = plugin_manager.entry_points()
    monkeypatch.setattr(plugin_manager, "entry_points", lambda **_: [*built_in, theirs])
    recording = bags.write_recording(tmp_path / "run.mcap", frames=6)
    failed = supermap("build", recording, "--db", tmp_path / "map.db", "--detector", "theirs")
    assert isinstance(failed.exception, SupermapError), failed.exception
    assert re.search(said, str(failed.exception))
