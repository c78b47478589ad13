"""Command lines as nobody means them: every one ends with an answer, a usage error, or one line, and in time.

Only commands that read, and harmless ones. `SUPERMAP_FUZZ_EXAMPLES` says how many are tried.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from supermap_cli.errors import SupermapError
from support import kitchen
from support.cli import supermap

EXAMPLES = int(os.environ.get("SUPERMAP_FUZZ_EXAMPLES", "60"))
LIMIT_S = 20.0
"""Seconds that no command may take on a small map."""
COMMANDS = (
    *(("show",), ("query",), ("history",), ("diff",), ("db", "info"), ("db", "check"), ("db", "sql"), ("inspect",)),
    *(
        ("db", "vacuum", "--dry-run"),
        ("config", "show"),
        ("plugins",),
        ("simulate", "--list"),
        ("export", "--out", "-"),
    ),
    *(("eval", "map"), ("eval", "change"), ("db", "merge", "--dry-run")),
)
OPTIONS = (
    *("--at", "--limit", "--label", "--format", "--traversal", "--keep", "--timeout", "--wait", "--start", "--end"),
    *("--topic", "--frame", "--camera", "--rate", "--option", "--align", "--json", "--all", "--present", "--again"),
    *("--detector", "--odometry", "--json-errors", "--debug"),
)
WORDS = st.one_of(
    st.sampled_from(
        [
            *("nan", "inf", "-inf", "1e999", "-1", "0", str(2**63), str(-(2**70)), "0x10", "1e-400", "9" * 400),
            *("", " ", "\n", "\x1b[2J", "\u202e", "\ud800", "a" * 300, "a/" * 3000, "/dev/zero", "/dev/full", "/", "."),
            *("chair-1", "cup", "chair near the table", "monday", "10:21", "12 s", "earlier", "crops=1d", "color=/a"),
            *("25:99", "99999-01-01", "9" * 30 + " s", "-5 s", "2026-02-30", "json", "csv", "base=x", "0 0 0 inf"),
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


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("place")
    kitchen.make_kitchen(folder / "map.db")
    os.mkfifo(folder / "pipe")
    (folder / "folder").mkdir()
    (folder / "text.mcap").write_text("no recording")
    (folder / "empty.bag").touch()
    return folder


def tried(arguments: list[str]) -> None:
    began = time.monotonic()
    result = supermap(*arguments)
    assert time.monotonic() - began < LIMIT_S, arguments
    error = result.exception
    if error is None or isinstance(error, SystemExit):
        return
    if not isinstance(error, SupermapError):
        raise AssertionError(f"{arguments}: {error!r}") from error  # noqa: TRY004 - a bug, whatever it is
    assert "\n" not in str(error)


@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    command=st.sampled_from(COMMANDS),
    words=st.lists(WORDS, max_size=3),
    options=st.lists(st.tuples(st.sampled_from(OPTIONS), st.one_of(st.none(), WORDS)), max_size=3),
    db=st.sampled_from(["map.db", "map.db", "map.db", "pipe", "folder", "text.mcap", "none.db", "x" * 300]),
)
@example(command=("query",), words=["(" * 3000 + "cup" + ")" * 3000], options=[], db="map.db")
@example(command=("show",), words=[], options=[("--limit", "nan")], db="map.db")
@example(command=("show",), words=[], options=[], db="x" * 300)
@example(command=("inspect",), words=["/dev/zero"], options=[("--start", "nan")], db="map.db")
def test_any_command_line(
    place: Path,
    command: tuple[str, ...],
    words: list[str],
    options: list[tuple[str, str | None]],
    db: str,
) -> None:
    given = [part for name, value in options for part in ((name,) if value is None else (name, value))]
    with_db = () if command[0] in {"config", "plugins", "simulate", "inspect", "eval"} else ("--db", str(place / db))
    tried([*command, *words, *given, *with_db])


@pytest.mark.parametrize(
    "what", ["pipe", "folder", "text.mcap", "empty.bag", "x" * 300, "/dev/zero", "/dev/full", "\0"]
)
@pytest.mark.parametrize("command", [("inspect",), ("build",), ("db", "merge"), ("eval", "all", "map.db")])
def test_what_is_no_file_is_refused_in_one_line(
    place: Path, command: tuple[str, ...], what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    tried([*command, what])
