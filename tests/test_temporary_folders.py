"""Folders of programs that were killed go with the next one, those of programs that run stay."""

from __future__ import annotations

import gzip
import subprocess
import sys
import time
from pathlib import Path

import pytest

from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings.inspection import inspect_recording
from supermap_cli.temporary_folders import make_temporary_folder, remove_left_behind, temporary_folder
from support import bags

MAKE_AND_WAIT = """
import sys, time
from pathlib import Path
from supermap_cli.temporary_folders import make_temporary_folder
print(make_temporary_folder("supermap-", Path(sys.argv[1])).path, flush=True)
time.sleep(60)
"""


def owner(folder: Path) -> tuple[subprocess.Popen[str], Path]:
    child = subprocess.Popen(
        [sys.executable, "-c", MAKE_AND_WAIT, str(folder)], stdout=subprocess.PIPE, text=True, cwd=Path.cwd()
    )
    assert child.stdout is not None
    return child, Path(child.stdout.readline().strip())


def test_a_folder_stays_while_its_owner_runs_and_goes_once_it_was_killed(tmp_path: Path) -> None:
    child, made = owner(tmp_path)
    try:
        (made / "run.mcap").write_bytes(b"unpacked")
        assert remove_left_behind("supermap-", tmp_path) == 0
        assert made.is_dir()
    finally:
        child.kill()
        child.wait(timeout=30)
    assert made.is_dir()
    with temporary_folder("supermap-", tmp_path) as mine:
        assert not made.exists()
        assert mine.is_dir()
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_such_folder_stays(tmp_path: Path) -> None:
    (tmp_path / "supermap-notes").mkdir()
    (tmp_path / "supermap-notes" / "a.txt").write_text("mine")
    (tmp_path / "supermap-file").write_text("mine")
    other = make_temporary_folder("elsewhere-", tmp_path)
    (tmp_path / "supermap-link").symlink_to(other.path)
    assert remove_left_behind("supermap-", tmp_path) == 0
    assert sorted(each.name for each in tmp_path.iterdir())[1:] == ["supermap-file", "supermap-link", "supermap-notes"]
    other.remove()


def test_opening_a_recording_removes_what_was_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bags.write_recording(tmp_path / "run.mcap")
    packed = tmp_path / "run.mcap.gz"
    packed.write_bytes(gzip.compress((tmp_path / "run.mcap").read_bytes()))
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    child, made = owner(temporary)
    child.kill()
    child.wait(timeout=30)
    assert made.is_dir()
    assert inspect_recording(packed, RecordingRequest()).can_build
    assert not made.exists()
    deadline = time.monotonic() + 10
    while list(temporary.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert list(temporary.iterdir()) == []
