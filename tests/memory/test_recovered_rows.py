"""`supermap db recover` and `db check --repair` of maps with values that nothing can read, and without rows."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing, suppress
from pathlib import Path

import pytest

from support import databases, kitchen
from support.cli import supermap

pytestmark = pytest.mark.sqlite_only("files of a map")


@pytest.fixture
def db(tmp_path: Path) -> Path:
    kitchen.make_kitchen(tmp_path / "map.db")
    return tmp_path / "map.db"


def damage(db: Path, statement: str) -> None:
    """Do what no rule of the database allows."""
    with closing(sqlite3.connect(db)) as connection:
        triggers = connection.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        connection.execute("PRAGMA ignore_check_constraints = 1")
        for name, _ in triggers:
            connection.execute(f"DROP TRIGGER {name}")
        connection.execute(statement)
        for _, sql in triggers:
            with suppress(sqlite3.OperationalError):  # of a table that was dropped
                connection.execute(sql)
        connection.commit()


def recovered(db: Path) -> Path:
    """The map that is recovered, which is sound and can be shown."""
    new = db.with_name("new.db")
    assert supermap("db", "recover", "--db", db, "--out", new).exit_code == 0
    assert supermap("db", "check", "--db", new).exit_code == 0
    assert supermap("show", "--db", new).exit_code == 0
    return new


def count(db: Path, table: str) -> int:
    return int(databases.query(db, f"SELECT count(*) FROM {table}")[0][0])


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE instance SET x = 9e999 WHERE number = 1",
        "UPDATE instance SET size_z = -1, label_belief = '[[[', presence = 'q', first_seen_ns = 0",
        "UPDATE instance SET label = 'zz' WHERE number = 2",
        "UPDATE instance SET engine_state = '{'",
        "UPDATE traversal SET config = '{', timings = '7', versions = ''",
        "UPDATE traversal SET T_map_odom = 'x', warnings = 'x', status = 'q'",
        "UPDATE traversal SET start_ns = 9223372036854775807",
        "UPDATE traversal SET start_ns = 0, end_ns = 0",
        "UPDATE observation SET hypotheses = CAST(x'ff20' AS TEXT), crop_jpeg = x'00' WHERE id < 3",
        "UPDATE observation SET label = CAST(x'ff20' AS TEXT) WHERE id = 1",
        "UPDATE keyframe SET camera = 'x' WHERE id = 2",
        "UPDATE keyframe SET T_map_camera = '[]' WHERE id = 2",
        "DELETE FROM observation WHERE id < 4",
        "DROP TABLE visit",
        "DROP TABLE keyframe",
        "DROP TABLE observation",
        "DROP TABLE spatial_edge",
        "DROP TABLE temporal_edge",
        "DROP TABLE checksum",
    ],
)
def test_bad_values_cost_only_themselves(db: Path, statement: str) -> None:
    things = count(db, "instance"), count(db, "state")
    damage(db, statement)
    new = recovered(db)
    assert (count(new, "instance"), count(new, "state")) == things


def test_a_lost_traversal_is_made_of_its_keyframes(db: Path) -> None:
    traversals = count(db, "traversal")
    damage(db, "DELETE FROM traversal WHERE id = (SELECT min(id) FROM traversal)")
    assert count(recovered(db), "traversal") == traversals


def test_a_repair_is_remembered(db: Path) -> None:
    databases.run_sql(db, "UPDATE visit SET in_view = in_view + 1;")
    assert supermap("db", "check", "--db", db).exit_code == 1
    assert supermap("db", "check", "--repair", "--db", db).exit_code == 0
    warnings = [json.loads(row[0]) for row in databases.query(db, "SELECT warnings FROM traversal")]
    assert any("visit rows are as they were built cannot be verified" in text for each in warnings for text in each)
    assert supermap("db", "check", "--db", db).exit_code == 0


@pytest.mark.parametrize(
    "statement", ["UPDATE observation SET hypotheses = CAST(x'ff20' AS TEXT) WHERE id = 1", "DROP TABLE visit"]
)
def test_a_repair_survives_what_it_cannot_mend(db: Path, statement: str) -> None:
    damage(db, statement)
    databases.run_sql(db, "DROP INDEX ix_observation_keyframe_id;")
    repaired = supermap("db", "check", "--repair", "--db", db)
    assert repaired.exit_code == 1
    assert "ix_observation_keyframe_id made anew" in repaired.output
    assert "supermap db recover" in repaired.output
