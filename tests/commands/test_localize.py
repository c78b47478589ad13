"""`supermap localize`: the placement of a build, and nothing written."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import SupermapError
from supermap_cli.memory import open_store
from support import synthetic_room as room
from support.cli import document, supermap


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A map of one recording, and a further recording of the same room."""
    folder = tmp_path_factory.mktemp("localize")
    for name in ("first", "second"):
        room.write_room_recording(folder / f"{name}.mcap", seconds=3.0)
    db = folder / "room.db"
    result = supermap("build", folder / "first.mcap", "--db", db)
    assert result.exit_code == 0, result.output
    return db, folder / "second.mcap"


def test_it_tells_what_a_build_would_use_and_writes_nothing(recordings: tuple[Path, Path]) -> None:
    db, recording = recordings
    before = hashlib.sha256(db.read_bytes()).hexdigest()
    told = document("localize", "localize", recording, "--db", db)
    assert hashlib.sha256(db.read_bytes()).hexdigest() == before
    built = supermap("build", recording, "--db", db, "--again")
    assert built.exit_code == 0, built.output
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        used = reader.traversals[-1].T_map_odom
        last = reader.last_pose()
    assert np.allclose(told["T_map_odom"], used, atol=1e-5)
    assert last is not None
    assert np.allclose(
        told["last_pose"]["position"], last[:3, 3], atol=0.7
    )  # the last keyframe is a third of a second earlier


def test_an_empty_or_missing_map_is_refused(recordings: tuple[Path, Path], tmp_path: Path) -> None:
    result = supermap("localize", recordings[1], "--db", tmp_path / "none.db")
    assert isinstance(result.exception, SupermapError)
    assert "supermap build" in str(result.exception)


def test_a_wrong_placement_is_refused(recordings: tuple[Path, Path]) -> None:
    result = supermap("localize", recordings[1], "--db", recordings[0], "--align", "here")
    assert isinstance(result.exception, SupermapError)
