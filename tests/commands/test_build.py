"""`supermap build`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from supermap_cli import main as entry
from supermap_cli import plugin_manager
from supermap_cli.commands.build_options import override, pairs
from supermap_cli.config import BuildConfig, KeyframeConfig
from supermap_cli.errors import ConfigError, MemoryStoreError, PluginError, RecordingError, SupermapError
from supermap_cli.memory import open_store
from support import fakes as f
from support import scenes as s
from support.cli import supermap

KITCHEN = (*s.ROOM, s.TABLE, s.CUP)
DAY_S = 86_400.0


@pytest.fixture
def plugins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> f.FakePlugins:
    """In an empty folder, a plugin that opens `monday.fake` and `tuesday.fake`."""
    recordings = {
        "monday.fake": f.FakeRecording(f.film(KITCHEN), tmp_path / "monday.fake"),
        "tuesday.fake": f.FakeRecording(f.film(KITCHEN, start_s=DAY_S), tmp_path / "tuesday.fake"),
    }
    fake = f.FakePlugins(recordings)
    loaded = fake.load()
    monkeypatch.setattr(plugin_manager, "load_plugins", lambda: loaded)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SUPERMAP_DB", raising=False)
    return fake


def run_main(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """The exit code of the program as a shell runs it."""
    monkeypatch.setattr(sys, "argv", ["supermap", *arguments])
    with pytest.raises(SystemExit) as ended:
        entry.main()
    return int(ended.value.code or 0)


# -- what it does


@pytest.mark.sqlite_only("about a file")
def test_a_recording_is_built_into_the_database_here(plugins: f.FakePlugins, tmp_path: Path) -> None:
    result = supermap("build", "monday.fake")
    assert result.exit_code == 0, result.output
    assert "monday: 6 keyframes" in result.stdout
    assert "1 cup, 1 dining table" in result.stdout
    assert "supermap.db" in result.stdout
    for stage in ("place", "decode", "detect", "map", "write"):
        assert stage in result.stdout
    assert (tmp_path / "supermap.db").is_file()


def test_several_recordings_are_built_in_their_order(plugins: f.FakePlugins, tmp_path: Path) -> None:
    result = supermap("build", "monday.fake", "tuesday.fake", "--db", "office.db", "--json")
    assert result.exit_code == 0, result.output
    traversals = json.loads(result.stdout)["traversals"]
    assert [each["traversal"] for each in traversals] == ["monday", "tuesday"]
    assert [each["objects"] for each in traversals] == [2, 2]
    assert traversals[0]["labels"] == {"cup": 1, "dining table": 1}
    assert traversals[0]["backends"]["detector"] == "fake"
    with open_store(str(tmp_path / "office.db"), read_only=True) as store:
        assert [each.name for each in store.traversals()] == ["monday", "tuesday"]


def test_options_reach_the_plugins_and_the_recording(plugins: f.FakePlugins) -> None:
    result = supermap(
        *(
            "build",
            "monday.fake",
            "--option",
            "fake.score=0.4",
            "--rate",
            "6",
            "--ablate",
            "semantic-fusion",
            "--name",
            "first",
        ),
        *("--topic", "color=/cam/image", "--topic", "depth=/cam/depth", "--frame", "base=body"),
        *("--camera", "equirectangular", "--start", "1.5", "--end", "9"),
    )
    assert result.exit_code == 0, result.output
    (request,) = plugins.requests
    assert request.topics == {"color": "/cam/image", "depth": "/cam/depth"}
    assert request.frames == {"base": "body"}
    assert (request.camera, request.start_s, request.end_s) == ("equirectangular", 1.5, 9.0)
    with open_store("supermap.db", read_only=True) as store:
        (traversal,) = store.traversals()
    assert traversal.name == "first"
    assert traversal.keyframes == 12
    assert traversal.config["ablate"] == ["semantic-fusion"]
    used = BuildConfig.model_validate({k: v for k, v in traversal.config.items() if k in BuildConfig.model_fields})
    assert used.backends.options == {"fake": {"score": "0.4"}}


def test_the_files_configuration_holds_and_the_command_line_goes_before_it(
    plugins: f.FakePlugins, tmp_path: Path
) -> None:
    text = """
    db = "from-file.db"
    [build.keyframes]
    rate_hz = 2.0
    depth_step = 4
    [build.recording.topics]
    imu = "/imu"
    """
    (tmp_path / "supermap.toml").write_text(text)
    assert supermap("build", "monday.fake", "--rate", "6", "--topic", "color=/c").exit_code == 0
    assert plugins.requests[0].topics == {"imu": "/imu", "color": "/c"}
    with open_store(str(tmp_path / "from-file.db"), read_only=True) as store:
        keyframes = KeyframeConfig.model_validate(store.traversals()[0].config["keyframes"])
    assert (keyframes.rate_hz, keyframes.depth_step) == (6.0, 4)


def test_warnings_go_to_stderr(plugins: f.FakePlugins) -> None:
    plugins.recordings["monday.fake"].warnings = ["2 images were broken"]
    result = supermap("build", "monday.fake", "--json")
    assert "warning: 2 images were broken" in result.stderr
    assert json.loads(result.stdout)["traversals"][0]["warnings"] == ["2 images were broken"]


def test_a_broken_plugin_is_told_and_left_out(plugins: f.FakePlugins, monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = plugin_manager.load_plugins()
    loaded.broken = (plugin_manager.BrokenPlugin("dud", "supermap-dud", "0.1", "ImportError: no dud"),)
    result = supermap("build", "monday.fake")
    assert result.exit_code == 0
    assert "plugin dud is left out" in result.stderr


# -- what is not understood


@pytest.mark.parametrize(
    ("arguments", "error", "said"),
    [
        (["--topic", "color"], ConfigError, "--topic 'color' is not understood"),
        (["--topic", "=/cam"], ConfigError, "--topic '=/cam' is not understood"),
        (["--frame", "base="], ConfigError, "--frame 'base=' is not understood"),
        (["--option", "score=0.3"], ConfigError, "option 'score=0.3' is not understood"),
        (["--option", "fake.speed=3"], ConfigError, "fake has no option 'speed'"),
        (["--option", "fake.score=high"], ConfigError, "fake.score"),
        (["--option", "nobody.score=1"], ConfigError, "'nobody', which is no backend"),
        (["--ablate", "everything"], ConfigError, "ablate"),
        (["--rate", "0"], ConfigError, "--rate: it must be greater than 0"),
        (["--align", "somewhere"], SupermapError, "'somewhere'"),
        (["--detector", "nobody"], PluginError, "no detector is called 'nobody'"),
    ],
)
def test_what_is_not_understood_is_said_and_leaves_nothing(
    plugins: f.FakePlugins, tmp_path: Path, arguments: list[str], error: type[Exception], said: str
) -> None:
    result = supermap("build", "monday.fake", *arguments)
    assert isinstance(result.exception, error)
    assert said in str(result.exception)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", ["0", "1", "1.5", "-0.1", "nan"])
def test_a_confidence_that_is_no_probability_is_one_line(
    plugins: f.FakePlugins, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], value: str
) -> None:
    assert run_main(monkeypatch, "build", "monday.fake", f"--min-confidence={value}") == 1
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"--min-confidence {value} is not between 0 and 1" in line


@pytest.mark.sqlite_only("about a file")
def test_the_least_confidence_is_a_parameter_of_the_method_and_stored(plugins: f.FakePlugins, tmp_path: Path) -> None:
    result = supermap("build", "monday.fake", "--min-confidence", "0.6", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["traversals"][0]["objects"] == 2
    with open_store(str(tmp_path / "supermap.db"), read_only=True) as store, store.reader() as reader:
        (traversal,) = reader.traversals
        assert traversal.config["parameters"]["lifecycle"]["min_confidence"] == 0.6
        assert all(state.confidence >= 0.6 for each in reader.believed for state in each.states)


def test_who_asks_for_more_confidence_than_there_is_learns_it(plugins: f.FakePlugins) -> None:
    result = supermap("build", "monday.fake", "--min-confidence", "0.94")
    assert isinstance(result.exception, RecordingError)
    assert "no object confirmed" in str(result.exception)
    assert "lower --min-confidence" in str(result.exception)


def test_a_name_for_several_traversals_is_refused(plugins: f.FakePlugins) -> None:
    assert isinstance(supermap("build", "monday.fake", "tuesday.fake", "--name", "week").exception, ConfigError)


def test_the_same_recording_twice_is_refused(plugins: f.FakePlugins) -> None:
    assert supermap("build", "monday.fake").exit_code == 0
    assert isinstance(supermap("build", "monday.fake").exception, MemoryStoreError)


def test_when_the_second_of_two_fails_the_first_stays(plugins: f.FakePlugins, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no recording")
    result = supermap("build", "monday.fake", "notes.txt")
    assert isinstance(result.exception, RecordingError)
    assert "notes.txt" in str(result.exception)
    with open_store("supermap.db", read_only=True) as store:
        assert [each.name for each in store.traversals()] == ["monday"]


@pytest.mark.parametrize("path", ["missing.mcap", "empty.mcap", "folder", "text.bag"])
def test_what_is_no_recording_is_one_line_and_exit_code_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, path: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "text.bag").write_text("no recording")
    before = sorted(tmp_path.iterdir())
    assert run_main(monkeypatch, "build", path) == 1
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith("error: ")
    assert path in line
    assert sorted(tmp_path.iterdir()) == before


def test_an_observer_that_fails_costs_a_warning_and_not_the_map(plugins: f.FakePlugins) -> None:
    plugins.observer = f.ObserverLog(failing=True)
    result = supermap("build", "monday.fake")
    assert result.exit_code == 0
    assert "ZeroDivisionError" in result.stderr


def test_a_bug_is_not_hidden(plugins: f.FakePlugins, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("supermap_cli.drivers.bag.choose_frames", lambda *_: 1 / 0)
    monkeypatch.setattr(sys, "argv", ["supermap", "build", "monday.fake"])
    with pytest.raises(ZeroDivisionError):
        entry.main()


# -- the configuration it makes


def test_without_words_the_configuration_stays() -> None:
    assert override(BuildConfig()) == BuildConfig()


def test_words_are_laid_over_the_configuration() -> None:
    given = BuildConfig.model_validate(
        {"backends": {"detector": "onnx", "options": {"onnx": {"score": 0.3, "model": "a.onnx"}}}}
    )
    config = override(given, options=["onnx.model=b.onnx", "bytetrack.buffer=0.1"], tracker="bytetrack", rate=5.0)
    assert config.backends.options == {"onnx": {"score": 0.3, "model": "b.onnx"}, "bytetrack": {"buffer": "0.1"}}
    assert (config.backends.detector, config.backends.tracker) == ("onnx", "bytetrack")
    assert config.keyframes.rate_hz == 5.0
    assert given.backends.options["onnx"]["model"] == "a.onnx"


def test_pairs_keep_what_follows_the_first_equals_sign() -> None:
    assert pairs(None, "--topic", "") == {}
    assert pairs(["color= /a=b "], "--topic", "") == {"color": "/a=b"}
