"""What killed programs left behind is removed, and nothing else is."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from supermap_cli.leftovers import new_temporary_folder, process_runs


def ended_process() -> int:
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        process.wait(timeout=60)
    return process.pid


def test_folders_of_processes_that_have_ended_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    left = tmp_path / f"supermap-unpacked-{ended_process()}-abc"
    kept = [
        tmp_path / f"supermap-unpacked-{os.getppid()}-abc",
        tmp_path / f"supermap-unpacked-{os.getpid()}-abc",
        tmp_path / "supermap-unpacked-notes",
        tmp_path / f"supermap-other-{ended_process()}-abc",
    ]
    for folder in (left, *kept):
        folder.mkdir()
        (folder / "run.mcap").write_bytes(b"x")
    new = new_temporary_folder("unpacked")
    assert sorted(tmp_path.iterdir()) == sorted([*kept, new])


def test_a_link_with_such_a_name_is_not_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    precious = tmp_path / "precious"
    precious.mkdir()
    (tmp_path / f"supermap-unpacked-{ended_process()}-abc").symlink_to(precious)
    new_temporary_folder("unpacked")
    assert precious.is_dir()


def test_a_process_runs_until_it_has_ended() -> None:
    assert process_runs(os.getppid())
    assert not process_runs(ended_process())
