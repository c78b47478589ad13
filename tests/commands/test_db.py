"""`supermap db`."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import open_store
from supermap_cli.memory.databases import database_of
from supermap_schema import SCHEMA_VERSION
from support import kitchen
from support import memories as m
from support.cli import document, supermap


@pytest.fixture
def db(tmp_path: Path) -> Path:
    return kitchen.make_kitchen(tmp_path / "map.db")


def test_info_tells_counts_versions_and_timings(db: Path) -> None:
    found = document("db_info", "db", "info", "--db", db)
    assert found["counts"]["instances"] == 9
    assert found["traversals"][0]["timings_s"] == {"detect": 1.5}
    assert found["versions"]["monday"] == {"supermap-cli": "0.1.0"}
    assert found["path"] == database_of(str(db)).where
    assert found["size_bytes"] == db.stat().st_size if db.exists() else found["size_bytes"] > 100_000
    printed = supermap("db", "info", "--db", db).stdout
    assert "detect" in printed
    assert "66.7 x real time" in printed


def test_info_tells_what_a_build_warned_of(tmp_path: Path) -> None:
    db = tmp_path / "map.db"
    with open_store(str(db), create=True) as store:
        store.finish_traversal(store.begin_traversal(m.start("monday", (0, 10))), {}, ["no IMU in the recording"])
    assert document("db_info", "db", "info", "--db", db)["traversals"][0]["warnings"] == ["no IMU in the recording"]
    for command in (("db", "info"), ("show",)):
        assert "monday: warning: no IMU in the recording" in supermap(*command, "--db", db).stdout


def test_a_sound_map_passes_the_check(db: Path) -> None:
    assert document("db_check", "db", "check", "--db", db)["problems"] == []
    assert "sound" in supermap("db", "check", "--db", db).stdout


def test_a_broken_map_fails_the_check(db: Path) -> None:
    m.run_sql(db, "UPDATE state SET gone_ns = last_seen_ns + 1 WHERE gone_ns IS NULL")
    problems = document("db_check", "db", "check", "--db", db, exit_code=1)["problems"]
    assert {problem["table"] for problem in problems} == {"instance"}
    result = supermap("db", "check", "--db", db)
    assert result.exit_code == 1
    assert "counts as present although" in result.stdout


@pytest.mark.sqlite_only("no map of the first version lies in PostgreSQL")
def test_an_older_map_is_upgraded(db: Path) -> None:
    m.run_sql(db, "PRAGMA user_version = 0")
    assert isinstance(supermap("db", "info", "--db", db).exception, MemoryStoreError)
    assert document("db_upgrade", "db", "upgrade", "--db", db) == {
        "path": database_of(str(db)).where,
        "before": 0,
        "after": SCHEMA_VERSION,
        "ended_relations": 0,
    }
    assert supermap("db", "info", "--db", db).exit_code == 0
    assert f"has version {SCHEMA_VERSION} already" in supermap("db", "upgrade", "--db", db).stderr


@pytest.mark.parametrize("command", ["info", "check", "upgrade"])
def test_a_missing_map_is_an_error_and_is_not_made(tmp_path: Path, command: str) -> None:
    assert isinstance(supermap("db", command, "--db", tmp_path / "no.db").exception, MemoryStoreError)
    assert list(tmp_path.iterdir()) == []
