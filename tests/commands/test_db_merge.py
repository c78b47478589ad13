"""`supermap db merge`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from supermap_cli.drivers.traversal_build import TraversalBuild
from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import open_store
from support import fakes as f
from support import scenes as s
from support.cli import document, supermap

STOOL = s.Thing("stool", (2.2, -0.9, 0.25), (0.35, 0.35, 0.5), (40, 160, 60))


def build(path: Path, name: str, things: Sequence[s.Thing], start_s: float) -> Path:
    config = f.config(keyframes={"depth_step": 2})
    scenes = f.film((*s.ROOM, *things), 24, start_s=start_s, target=(1.8, 0, 0.3))
    with open_store(str(path), create=True) as store:
        recording = f.FakeRecording(scenes, Path(f"{name}.fake"))
        TraversalBuild(recording, f.FakePlugins().load(), config, store).run(align="none")
    return path


@pytest.fixture
def maps(tmp_path: Path) -> tuple[Path, Path]:
    return (
        build(tmp_path / "monday.db", "monday", (s.TABLE, s.CUP, STOOL), 0.0),
        build(tmp_path / "tuesday.db", "tuesday", (s.TABLE, STOOL.at(1.2, 0.9)), 86_400.0),
    )


def test_a_merge_is_told_by_the_published_schema(maps: tuple[Path, Path]) -> None:
    monday, tuesday = maps
    dry = document("db_merge", "db", "merge", tuesday, "--into", monday, "--dry-run")
    assert not dry["written"]
    told = document("db_merge", "db", "merge", tuesday, "--db", monday)
    assert told["written"]
    assert told["traversals"] == [{"other_name": "tuesday", "name": "tuesday"}]
    assert {obj["id"]: obj["how"] for obj in told["objects"]} == {"dining-table-1": "in place", "stool-1": "moved"}
    assert told["gone"] == ["cup-1"]
    assert document("db_check", "db", "check", "--db", monday)["sound"]
    found = document("diff", "diff", "--db", monday)
    assert {(item["kind"], item["id"]) for item in found["changes"]} >= {("disappeared", "cup-1"), ("moved", "stool-1")}


def test_a_merge_is_told_in_a_table(maps: tuple[Path, Path]) -> None:
    monday, tuesday = maps
    dry = supermap("db", "merge", tuesday, "--into", monday, "--dry-run", "--align", "none").stdout
    assert "nothing is written" in dry
    printed = supermap("db", "merge", tuesday, "--into", monday, "--align", "none").stdout
    assert "2 objects, 2 of them known here" in printed
    assert "seen to be gone: cup-1" in printed
    again = supermap("db", "merge", tuesday, "--into", monday, "--align", "none").exception
    assert isinstance(again, MemoryStoreError)
    assert "the same recording is in both maps" in str(again)


def test_what_is_wrong_says_so(maps: tuple[Path, Path], tmp_path: Path) -> None:
    monday, tuesday = maps
    assert supermap("db", "merge", tuesday, "--into", monday, "--db", monday).exit_code == 2
    assert isinstance(supermap("db", "merge", tmp_path / "none.db", "--into", monday).exception, MemoryStoreError)
    assert isinstance(supermap("db", "merge", tuesday, "--into", tmp_path / "none.db").exception, MemoryStoreError)
    assert isinstance(supermap("db", "merge", monday, "--into", monday).exception, MemoryStoreError)
