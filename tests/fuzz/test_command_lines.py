"""Command lines as nobody means them: every one ends with an answer, a usage error, or one line, in time, and no map
is harmed. What commands and options there are is asked of the program itself.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from typer.main import get_command

from supermap_cli.commands import ablation, bench, bench_memory, benchmark, demo, domain_suite, perception, simulate
from supermap_cli.main import make_app
from supermap_cli.mcp_server import server as mcp_server
from support import bags, kitchen
from support.fuzzed_commands import run
from support.fuzzing import fuzzing, one_input

WORK = (
    (simulate, "simulate_scenario"),
    (demo.DemoRun, "simulate"),
    (bench, "measure"),
    (bench_memory, "kept_or_temporary"),
    (benchmark, "build_and_score"),
    (domain_suite, "run_suite"),
    (ablation, "compare"),
    (ablation, "_simulated_world"),
    (perception, "_compare"),
    (mcp_server, "serve_stdio"),
    (mcp_server, "serve_http"),
)
"""What takes minutes once a command line is accepted, and is not done here."""

WORDS = st.one_of(
    st.sampled_from(
        [
            *("nan", "inf", "-inf", "1e999", "-1", "0", str(2**63), str(-(2**70)), "0x10", "1e-400", "9" * 400),
            *("", " ", "\n", "\x1b[2J", "\u202e", "\ud800", "\0", "a" * 300, "a/" * 3000, "/", ".", "~"),
            *("/dev/zero", "/dev/full", "pipe", "folder", "text.mcap", "empty.bag", "map.db", "none", "link"),
            *("chair-1", "cup", "chair near the table", "monday", "10:21", "12 s", "earlier", "crops=1d", "color=/a"),
            *("25:99", "99999-01-01", "9" * 30 + " s", "-5 s", "2026-02-30", "json", "csv", "base=x", "0 0 0 inf"),
            *("x=nan", "x=inf", "x=1e308", "x=", "=x", "onnx.model=pipe", "recorded.labels=/dev/zero", "nan,nan"),
            *("onnx.model=/dev/zero", "onnx.model=folder", "recorded.labels=pipe", "camera=nan 0 0 0 0 0", "1,1e9"),
            "near " * 400 + "cup",
            "the cup " + "on the table " * 300,
            "(" * 3000 + "cup" + ")" * 3000,
            "SELECT " + "(" * 2000 + "1" + ")" * 2000,
            "SELECT 1e999, -1e999, x'00', NULL",
            "SELECT zeroblob(2000000000)",
        ]
    ),
    st.text(max_size=30),
    st.floats().map(str),
    st.integers().map(str),
)


def _commands(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    if not hasattr(command, "list_commands"):
        yield path, command
        return
    context = command.make_context("supermap", [], resilient_parsing=True)
    for name in command.list_commands(context):
        yield from _commands(command.get_command(context, name), (*path, name))


COMMANDS = dict(_commands(get_command(make_app())))
"""Every command by its words."""

SOUND = {
    "recording": "run.mcap",
    "recordings": "run.mcap",
    "text": "cup",
    "statement": "SELECT 1",
    "db": "map.db",
    "truth": "truth.json",
    "other": "map.db",
    "world": "tiny",
    "scenario": "tiny",
    "scenarios": "tiny",
    "text_id": "chair-1",
}
"""An argument that can be meant, by its name."""

NUMBERS = (
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1",
    "0",
    "1e-320",
    str(2**63),
    str(-(2**63) - 1),
    "9" * 5000,
    "1_000",
    "\u0664",
)
PATHS = ("pipe", "folder", "text.mcap", "empty.bag", "x" * 300, "/dev/zero", "/dev/full", "\0", "", "map.db", "none/a")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("place")
    kitchen.make_kitchen(folder / "map.db")
    bags.write_recording(folder / "run.mcap", frames=4)
    (folder / "folder").mkdir()
    (folder / "text.mcap").write_text("no recording")
    (folder / "empty.bag").touch()
    _WHOLE.update({name: (folder / name).read_bytes() for name in ("map.db", "run.mcap")})
    return folder


class AcceptedError(Exception):
    """A command line that would have set to work."""


@pytest.fixture
def place(sound: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of its own with a map, a recording and what is neither, in which no long work is done."""

    def accepted(*_: object, **__: object) -> None:
        raise AcceptedError

    shutil.copytree(sound, tmp_path, dirs_exist_ok=True)
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("map.db")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("supermap_cli.commands.build.build_all", accepted)
    for owner, name in WORK:
        monkeypatch.setattr(owner, name, accepted)
    return tmp_path


def tried(place: Path, arguments: list[str]) -> int:
    """The exit code of a command, after which the map and the recording are what they were."""
    try:
        code, _ = run(arguments)
    except AcceptedError:
        code = 0
    assert (place / "run.mcap").read_bytes() == _WHOLE["run.mcap"], arguments
    if (place / "map.db").read_bytes() != _WHOLE["map.db"]:
        assert run(["db", "check", "--db", str(place / "map.db")])[0] == 0, arguments
    return code


_WHOLE: dict[str, bytes] = {}
"""What the recording and the map held at first."""


def complete(path: tuple[str, ...], without: str = "") -> list[str]:
    """A command with the arguments that it needs, but for one."""
    needed = [parameter for parameter in COMMANDS[path].params if parameter.param_type_name == "argument"]
    words = [
        SOUND.get(parameter.name, "x") for parameter in needed if parameter.name not in {without, "before", "after"}
    ]
    out = ["--out", "-"] if path == ("export",) else ["--out", "new.db"] if path == ("db", "recover") else []
    return [*path, *words, *out]


ALL_OPTIONS = [
    (path, parameter)
    for path, command in COMMANDS.items()
    for parameter in command.params
    if parameter.param_type_name == "option" and not parameter.is_flag
]
ALL_ARGUMENTS = [
    (path, parameter.name)
    for path, command in COMMANDS.items()
    for parameter in command.params
    if parameter.param_type_name == "argument"
]


@fuzzing(100, share=3)
@given(st.sampled_from(ALL_OPTIONS), st.one_of(st.sampled_from([*NUMBERS, *PATHS]), WORDS))
def test_any_value_of_any_option(place: Path, option: tuple[tuple[str, ...], Any], value: str) -> None:
    path, parameter = option
    with one_input("command line"):
        tried(place, [*complete(path), f"{parameter.opts[0]}={value}"])


@fuzzing(60)
@given(st.sampled_from(ALL_ARGUMENTS), st.one_of(st.sampled_from(PATHS), WORDS))
def test_any_value_of_any_argument(place: Path, argument: tuple[tuple[str, ...], str], value: str) -> None:
    path, name = argument
    needed = [each.name for each in COMMANDS[path].params if each.param_type_name == "argument"]
    words = [value if each == name else SOUND.get(each, "x") for each in needed[: needed.index(name) + 1]]
    with one_input("command line"):
        tried(place, [*path, *complete(path)[len(path) + len(words) :], "--", *words])


@fuzzing(60)
@given(
    path=st.sampled_from(sorted(COMMANDS)),
    words=st.lists(WORDS, max_size=3),
    data=st.data(),
    db=st.sampled_from(["map.db", "map.db", "map.db", "pipe", "folder", "text.mcap", "none.db", "x" * 300]),
)
@example(path=("query",), words=["(" * 3000 + "cup" + ")" * 3000], data=None, db="map.db")
@example(path=("show",), words=[], data=None, db="x" * 300)
@example(path=("inspect",), words=["/dev/zero"], data=None, db="map.db")
def test_any_command_line(
    place: Path, path: tuple[str, ...], words: list[str], data: st.DataObject | None, db: str
) -> None:
    options = [parameter for parameter in COMMANDS[path].params if parameter.param_type_name == "option"]
    given: list[str] = []
    for parameter in data.draw(st.lists(st.sampled_from(options), max_size=3)) if data is not None else []:
        value = data.draw(st.one_of(st.none(), WORDS))  # type: ignore[union-attr]
        given += [parameter.opts[0]] if value is None else [parameter.opts[0], value]
    with_db = ["--db", db] if any("--db" in parameter.opts for parameter in options) else []
    with one_input("command line"):
        tried(place, [*path, *words, *given, *with_db])


FLOATS = [(path, parameter) for path, parameter in ALL_OPTIONS if "float" in str(vars(parameter)).lower()]


@pytest.mark.parametrize("number", ["nan", "inf", "-inf"])
@pytest.mark.parametrize(
    ("path", "parameter"), FLOATS, ids=lambda part: " ".join(part) if type(part) is tuple else part.name
)
def test_no_number_that_is_not_finite_is_taken(place: Path, path: tuple[str, ...], parameter: Any, number: str) -> None:
    assert tried(place, [*complete(path), f"{parameter.opts[0]}={number}"]) in {1, 2}


WHOLE = [(path, parameter) for path, parameter in ALL_OPTIONS if "<class 'int'>" in str(vars(parameter))]


@pytest.mark.parametrize(
    ("path", "parameter"), WHOLE, ids=lambda part: " ".join(part) if type(part) is tuple else part.name
)
def test_no_count_or_seed_is_negative(place: Path, path: tuple[str, ...], parameter: Any) -> None:
    for number in ("-1", "nan", "1.5", "9" * 5000):
        expected = {0, 1, 2} if number.isdigit() else {1, 2}
        assert tried(place, [*complete(path), f"{parameter.opts[0]}={number}"]) in expected, number


PATH_ARGUMENTS = [
    (path, name) for path, name in ALL_ARGUMENTS if SOUND.get(name, "").endswith((".mcap", ".db", ".json"))
]


@pytest.mark.parametrize("what", PATHS)
def test_what_is_no_file_is_refused_in_one_line(place: Path, what: str) -> None:
    for path, name in PATH_ARGUMENTS:
        with one_input("command line"):
            tried(place, [what if word == SOUND[name] else word for word in complete(path)])
