"""Atomic exports: a failed, stopped or killed export leaves the target as it was."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

from supermap_cli.errors import ExportError
from supermap_cli.exporting.destination import atomic_file, atomic_folder
from supermap_cli.exporting.selection import ExportSource
from support import kitchen, stopping

FULL = OSError(errno.ENOSPC, "No space left on device")


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def fill_the_disk(writing: AbstractContextManager[Path]) -> None:
    with writing as partial:
        (partial / "x" if partial.is_dir() else partial).write_text("half")
        raise FULL


def test_a_failed_export_leaves_nothing(tmp_path: Path) -> None:
    for writing in (
        atomic_file(tmp_path / "a", "csv", force=False),
        atomic_folder(tmp_path / "b", ("x",), "csv", force=False),
    ):
        with pytest.raises(ExportError, match="No space left"):
            fill_the_disk(writing)
    assert list(tmp_path.iterdir()) == []


def write_folder(out: Path, text: str) -> None:
    with atomic_folder(out, ("x",), "csv", force=True) as partial:
        (partial / "x").write_text(text)


@pytest.mark.parametrize("failing", [1, 2])
@pytest.mark.parametrize("error", [FULL, KeyboardInterrupt()], ids=["full disk", "Ctrl-C"])
def test_a_failed_replacement_keeps_the_old_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: int, error: BaseException
) -> None:
    write_folder(tmp_path / "tables", "old")
    rename, calls = Path.rename, 0

    def fail(self: Path, target: Path) -> Path:
        nonlocal calls
        calls += 1
        if calls == failing:
            raise error
        return rename(self, target)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "rename", fail)
        with pytest.raises((ExportError, KeyboardInterrupt)):
            write_folder(tmp_path / "tables", "new")
    assert names(tmp_path) == {"tables"}
    assert (tmp_path / "tables" / "x").read_text() == "old"
    write_folder(tmp_path / "tables", "new")
    assert names(tmp_path) == {"tables"}
    assert (tmp_path / "tables" / "x").read_text() == "new"


WRITING = """
import sys, time
from pathlib import Path
from supermap_cli.exporting.destination import atomic_file
with atomic_file(Path(sys.argv[1]), "csv", force=True) as partial:
    partial.write_text("half")
    print("half", flush=True)
    time.sleep(60)
"""
KILLED_BETWEEN_RENAMES = """
import os, sys
from pathlib import Path
from supermap_cli.exporting.destination import atomic_folder
rename = Path.rename
def die(self, target):
    rename(self, target)
    os.kill(os.getpid(), 9)
Path.rename = die
with atomic_folder(Path(sys.argv[1]), ("x",), "csv", force=True) as partial:
    (partial / "x").write_text("new")
"""


def killed(out: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", WRITING, out], stdout=subprocess.PIPE, env=os.environ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"half\n"
        process.send_signal(signal.SIGKILL)


def test_a_killed_export_leaves_the_file_as_it_was_and_the_next_one_clears_up(tmp_path: Path) -> None:
    out = tmp_path / "plan.geojson"
    out.write_text("whole")
    killed(out)
    assert out.read_text() == "whole"
    assert len(names(tmp_path)) == 2
    with atomic_file(out, "csv", force=True) as partial:
        partial.write_text("new")
    assert names(tmp_path) == {"plan.geojson"}
    assert out.read_text() == "new"


def test_leftovers_of_other_or_running_exports_are_kept(tmp_path: Path) -> None:
    killed(tmp_path / "other.json")
    of_others = {*names(tmp_path), f".a.json.{os.getppid()}.partial", ".a.json.notes.partial", ".axjson.999999.partial"}
    for name in of_others:
        (tmp_path / name).write_text("not mine")
    with atomic_file(tmp_path / "a.json", "csv", force=False) as partial:
        partial.write_text("new")
    assert names(tmp_path) == {*of_others, "a.json"}


def test_a_folder_is_restored_after_a_kill_between_two_renames(tmp_path: Path) -> None:
    out = tmp_path / "tables"
    write_folder(out, "old")
    ended = subprocess.run([sys.executable, "-c", KILLED_BETWEEN_RENAMES, out], env=os.environ, check=False, timeout=60)
    assert ended.returncode == -signal.SIGKILL
    assert not out.exists()
    with pytest.raises(ExportError, match="is there already"), atomic_folder(out, ("x",), "csv", force=False):
        pass
    assert (out / "x").read_text() == "old"
    assert names(tmp_path) == {"tables"}


def stop_while_it_writes(stop: int) -> None:
    """A `prepare`: the export's process receives a signal after writing a part."""
    whole = ExportSource.instances

    def stopped(self: ExportSource, **options: bool) -> Iterator[Any]:
        for instance in whole(self, **options):
            (partial,) = Path().glob(".out.*.partial")
            assert partial.exists()
            os.kill(os.getpid(), stop)
            yield instance

    ExportSource.instances = stopped  # type: ignore[method-assign]


@pytest.mark.parametrize("stop", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize(
    "options", [("--format", "json"), ("--format", "ply"), ("--format", "csv")], ids=lambda options: options[1]
)
def test_a_stopped_export_leaves_nothing(tmp_path: Path, stop: int, options: Sequence[str]) -> None:
    kitchen.make_kitchen(tmp_path / "map.db")
    before = {*names(tmp_path), "stderr.txt"}
    arguments = ("export", "--db", "map.db", "--out", "out", *options)
    code, said = stopping.run(tmp_path, *arguments, prepare=stop_while_it_writes, given=stop)
    assert code == 130, said
    assert "Traceback" not in said
    assert names(tmp_path) == before
    code, said = stopping.run(tmp_path, *arguments)
    assert code == 0, said


def test_a_forced_export_that_is_stopped_leaves_what_was_there(tmp_path: Path) -> None:
    kitchen.make_kitchen(tmp_path / "map.db")
    (tmp_path / "out").write_text(json.dumps({"format": "supermap-export"}))
    arguments = ("export", "--db", "map.db", "--out", "out", "--format", "json", "--force")
    code, _ = stopping.run(tmp_path, *arguments, prepare=stop_while_it_writes, given=signal.SIGTERM)
    assert code == 130
    assert json.loads((tmp_path / "out").read_text()) == {"format": "supermap-export"}
