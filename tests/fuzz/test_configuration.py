"""Configuration files and options as nobody means them: settings come out, or one line that names the entry."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.commands.build_options import override
from supermap_cli.config import BuildConfig, load_user_config
from supermap_cli.errors import ConfigError
from supermap_cli.parameters import MethodParameters, stored_config
from supermap_cli.plugin_manager import load_plugins
from supermap_cli.recordings.mounting import parse_mounts
from support.fuzzed_commands import run
from support.fuzzing import MUTATIONS, Edit, fuzzing, mutated, one_input, one_line

SOUND = """
db = "map.db"
[build]
ablate = ["tracker"]
[build.recording]
topics = { color = "/cam/image", depth = "/cam/depth" }
frames = { base = "base_link" }
mounts = { camera = "0.1 0 1.2 0 0.2 0" }
clocks = { "/lidar" = -37.0 }
robot = "r1"
sync_tolerance_s = 0.02
detection_tolerance_s = 0.001
fit_color = true
[build.recording.limits]
image_pixels = 1000
[build.backends]
detector = "onnx"
[build.backends.options.onnx]
model = "yolox.onnx"
score_floor = 0.2
[build.keyframes]
rate_hz = 3.0
batch = 10
[build.perception]
delay_s = 0.5
[build.mapping]
max_depth_m = 6.0
[build.parameters.lifecycle]
min_confidence = 0.5
"""

NUMBERS = ("nan", "inf", "-inf", "1e308", "-1", "0", str(2**63), str(-(2**70)), "1e-400", "9" * 5000, "0x7f", "1_0")
VALUES = st.one_of(
    st.sampled_from(
        [*NUMBERS, "true", '""', '"\\u0000"', '"nan"', "[]", "{}", "[nan]", "[[1]]", "1979-05-27", '"1e999"']
    ),
    st.text(max_size=20).map(json.dumps),
    st.floats().map(str),
    st.integers().map(str),
)


def _entries(model: Any, prefix: tuple[str, ...]) -> list[tuple[str, ...]]:
    found: list[tuple[str, ...]] = []
    for name, entry in model.model_fields.items():
        found.append((*prefix, name))
        if hasattr(entry.annotation, "model_fields"):
            found += _entries(entry.annotation, (*prefix, name))
    return found


ENTRIES = [
    *_entries(BuildConfig, ("build",)),
    *(("build", "parameters", row.file, row.name) for row in MethodParameters().describe()),
    *((*("build", "recording"), name, "x") for name in ("topics", "frames", "mounts", "clocks", "limits")),
    *(("build", "backends", "options", name, "x") for name in ("onnx", "recorded", "kiss-icp", "bytetrack", "none")),
]
"""Every entry that a supermap.toml may have."""


def settle(folder: Path) -> None:
    """All that becomes of a configuration before a recording is opened."""
    config = load_user_config(folder).build
    load_plugins().check_options(config.backends.options)
    parse_mounts(config.recording.mounts)
    json.dumps(stored_config(config), allow_nan=False)


@fuzzing(60, share=2)
@given(MUTATIONS)
def test_changed_files(tmp_path: Path, changes: list[Edit]) -> None:
    (tmp_path / "supermap.toml").write_bytes(mutated(SOUND.encode(), changes))
    with one_input("configuration file"):
        one_line(lambda: settle(tmp_path))


@fuzzing(150, share=2)
@given(st.lists(st.tuples(st.sampled_from(ENTRIES), VALUES), min_size=1, max_size=3))
def test_any_value_of_any_entry(tmp_path: Path, given: list[tuple[tuple[str, ...], str]]) -> None:
    lines = (".".join(json.dumps(part) for part in entry) + f" = {value}" for entry, value in given)
    (tmp_path / "supermap.toml").write_text("\n".join(lines), encoding="utf-8")
    with one_input("configuration entry"):
        one_line(lambda: settle(tmp_path))


@pytest.mark.parametrize("number", ["nan", "inf", "-inf"])
@pytest.mark.parametrize("entry", [entry for entry in ENTRIES if entry[-1] != "x"], ids=".".join)
def test_no_entry_takes_a_number_that_is_not_finite(tmp_path: Path, entry: tuple[str, ...], number: str) -> None:
    line = ".".join(json.dumps(part) for part in entry) + f" = {number}"
    (tmp_path / "supermap.toml").write_text(line, encoding="utf-8")
    with pytest.raises(ConfigError, match=entry[-1]):
        settle(tmp_path)


@fuzzing(60)
@given(
    st.dictionaries(
        st.sampled_from(["topics", "frames", "mounts", "clocks", "limits", "options", "ablate"]),
        st.lists(st.one_of(st.text(max_size=12), VALUES.map("x={}".format), VALUES.map("onnx.score-floor={}".format))),
        max_size=3,
    ),
    st.dictionaries(
        st.sampled_from(["detection_tolerance", "rate", "perception_rate", "min_confidence"]), st.floats(), max_size=2
    ),
)
def test_any_option_of_a_build(texts: dict[str, list[str]], numbers: dict[str, float]) -> None:
    with one_input("options of a build"):
        config = one_line(lambda: override(BuildConfig(), **texts, **numbers))
        if config is not None:
            assert all(math.isfinite(number) for number in numbers.values())
            one_line(lambda: json.dumps(stored_config(config), allow_nan=False))


@fuzzing(20, share=0.3)
@given(st.lists(st.tuples(st.sampled_from(ENTRIES), VALUES), min_size=1, max_size=3), st.booleans())
def test_commands_in_a_folder_of_any_configuration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: list[tuple[tuple[str, ...], str]], as_json: bool
) -> None:
    lines = (".".join(json.dumps(part) for part in entry) + f" = {value}" for entry, value in given)
    (tmp_path / "supermap.toml").write_text("\n".join(lines), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with one_input("configuration entry"):
        for command in (["config", "show"], ["inspect", "none.mcap"], ["show"]):
            code, printed = run([*command, *["--json"] * (as_json and command[0] != "inspect")])
            assert not as_json or code or json.loads(printed)


@pytest.mark.parametrize("what", ["folder", "pipe", "binary", "huge", "deep"])
def test_what_is_no_configuration_file(tmp_path: Path, what: str) -> None:
    import os

    path = tmp_path / "supermap.toml"
    if what == "folder":
        path.mkdir()
    elif what == "pipe":
        os.mkfifo(path)
    else:
        path.write_bytes({"binary": bytes(range(256)), "huge": b"#" * 200_000_000, "deep": b"a=" + b"[" * 5000}[what])
    with one_input("configuration file"):
        one_line(lambda: settle(tmp_path))
