"""What `supermap inspect` says after a build that failed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from supermap_cli.commands.failed_builds import MOST_KEPT, last_failure, remembered
from supermap_cli.errors import RecordingError
from support import bags
from support.cli import supermap


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def fail(path: Path, message: str) -> None:
    with pytest.raises(RecordingError), remembered(path):
        raise RecordingError(message, cure="mend it")


def test_the_error_of_a_build_is_said_again_until_one_ends_well(tmp_path: Path) -> None:
    recording = bags.write_recording(tmp_path / "run.mcap", frames=30)
    failed = supermap("build", recording, "--db", tmp_path / "map.db", "--start", "2.85")
    assert str(failed.exception) in " ".join(supermap("inspect", recording).stderr.split())
    with remembered(recording):
        pass
    assert "last build" not in supermap("inspect", recording).stderr


def test_another_recording_in_its_place_has_not_failed(tmp_path: Path) -> None:
    path = bags.write_recording(tmp_path / "run.mcap", frames=2)
    fail(path, "no motion")
    assert last_failure(path) == "no motion: mend it"
    os.utime(path, (1, 1))
    assert last_failure(path) is None


def test_the_oldest_are_forgotten(tmp_path: Path) -> None:
    for number in range(MOST_KEPT + 1):
        fail(tmp_path / f"{number}.mcap", "gone")
    assert last_failure(tmp_path / "0.mcap") is None
    assert last_failure(tmp_path / f"{MOST_KEPT}.mcap") == "gone: mend it"


@pytest.mark.parametrize("content", [b"", b"[1]", b"\xff", b"[" * 5000])
def test_a_damaged_state_is_none(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "state" / "supermap").mkdir(parents=True)
    (tmp_path / "state" / "supermap" / "failed_builds.json").write_bytes(content)
    assert last_failure(tmp_path / "run.mcap") is None
    fail(tmp_path / "run.mcap", "no motion")
    assert last_failure(tmp_path / "run.mcap") == "no motion: mend it"
