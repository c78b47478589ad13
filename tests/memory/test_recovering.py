"""`supermap db check --repair` and `supermap db recover`."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError
from support import databases, kitchen
from support.cli import supermap

pytestmark = pytest.mark.sqlite_only("files of a map")


@pytest.fixture
def db(tmp_path: Path) -> Path:
    kitchen.make_kitchen(tmp_path / "map.db")
    return tmp_path / "map.db"


@pytest.mark.parametrize(
    "damage",
    [
        "DELETE FROM state_box;",
        "DROP VIEW current_objects;",
        "DROP VIEW changes; CREATE VIEW changes AS SELECT 1 AS one;",
        "DROP TRIGGER observation_is_kept;",
        "DROP INDEX ix_observation_keyframe_id;",
        "UPDATE traversal SET keyframes = 1000, observations = 7;",
        "DELETE FROM instance_label;",
    ],
)
def test_what_is_derived_is_repaired(db: Path, damage: str) -> None:
    before = databases.contents(db)
    databases.run_sql(db, damage)
    assert supermap("db", "check", "--db", db).exit_code == 1
    assert supermap("db", "check", "--repair", "--db", db).exit_code == 0
    assert supermap("db", "check", "--db", db).exit_code == 0
    assert databases.contents(db) == before


def test_a_sound_map_is_recovered_as_it_is(db: Path, tmp_path: Path) -> None:
    assert supermap("db", "recover", "--db", db, "--out", tmp_path / "new.db").exit_code == 0
    assert databases.contents(tmp_path / "new.db") == databases.contents(db)


def pages_of(db: Path, table: str) -> tuple[int, int]:
    """The size of a page and the number of a table's first page."""
    with closing(sqlite3.connect(db)) as connection:
        size = connection.execute("PRAGMA page_size").fetchone()[0]
        return size, connection.execute("SELECT rootpage FROM sqlite_master WHERE name = ?", (table,)).fetchone()[0]


@pytest.mark.parametrize("table", ["spatial_edge", "temporal_edge", "visit", "checkpoint"])
def test_a_lost_page_costs_only_its_table(db: Path, tmp_path: Path, table: str) -> None:
    before = databases.contents(db)
    size, page = pages_of(db, table)
    content = bytearray(db.read_bytes())
    content[(page - 1) * size : page * size] = b"\xff" * size
    db.write_bytes(content)
    assert supermap("db", "check", "--db", db).exit_code == 1
    supermap("db", "recover", "--db", db, "--out", tmp_path / "new.db")
    after = databases.contents(tmp_path / "new.db")
    for name in ("instance", "state", "keyframe", "observation"):
        assert after[name] == before[name]
    assert supermap("show", "--db", tmp_path / "new.db").exit_code == 0


def test_a_lost_shape_costs_only_the_shape(db: Path, tmp_path: Path) -> None:
    databases.run_sql(db, "UPDATE instance SET voxels = x'00' WHERE number = 1;")
    assert supermap("db", "recover", "--db", db, "--out", tmp_path / "new.db").exit_code == 0
    assert databases.query(tmp_path / "new.db", "SELECT count(*) FROM instance") == databases.query(
        db, "SELECT count(*) FROM instance"
    )


def test_nothing_is_written_over(db: Path, tmp_path: Path) -> None:
    (tmp_path / "there.db").write_text("mine")
    for there in (tmp_path / "there.db", db):
        refused = supermap("db", "recover", "--db", db, "--out", there)
        assert isinstance(refused.exception, MemoryStoreError)
        assert "is there already" in str(refused.exception)
    assert (tmp_path / "there.db").read_text() == "mine"


def test_what_is_no_map_says_so(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no map" * 1000)
    refused = supermap("db", "recover", "--db", tmp_path / "notes.txt", "--out", tmp_path / "new.db")
    assert isinstance(refused.exception, MemoryStoreError)
    assert not (tmp_path / "new.db").exists()


def test_a_damaged_map_is_not_merged(db: Path, tmp_path: Path) -> None:
    kitchen.make_kitchen(tmp_path / "other.db")
    databases.run_sql(tmp_path / "other.db", "UPDATE instance SET label_belief = '{\"cup\": 7}' WHERE number = 2;")
    before = databases.contents(db)
    refused = supermap("db", "merge", tmp_path / "other.db", "--db", db, "--again", "--align", "none")
    assert isinstance(refused.exception, MemoryStoreError)
    assert "the map is damaged: instance" in str(refused.exception)
    assert databases.contents(db) == before
