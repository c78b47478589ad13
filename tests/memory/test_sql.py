"""SQL on the map reads everything and changes nothing."""

from __future__ import annotations

import hashlib
import select
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError, QueryError
from supermap_cli.memory import open_store
from supermap_cli.memory.opening import read_sql
from supermap_schema import SCHEMA_VERSION
from support import kitchen

pytestmark = pytest.mark.sqlite_only("speaks SQLite's SQL; PostgreSQL's stands in test_postgresql_sql")


@pytest.fixture
def db(tmp_path: Path) -> Path:
    return kitchen.make_kitchen(tmp_path / "map.db")


def rows(db: Path, statement: str) -> list[tuple[object, ...]]:
    with read_sql(str(db), statement) as found:
        return list(found.rows)


@pytest.mark.parametrize(
    ("statement", "expected"),
    [
        ("SELECT id FROM current_objects WHERE label = 'chair' ORDER BY id", [("chair-1",), ("chair-2",)]),
        ("SELECT state_index FROM object_history WHERE id = 'chair-1'", [(0,), (1,)]),
        ("SELECT from_id FROM changes WHERE kind = 'moved'", [("chair-1",)]),
        ("SELECT count(*) FROM trajectory", [(6,)]),
        ("SELECT id FROM instance_label WHERE instance_label MATCH 'tables'", [("dining-table-1",)]),
        ("SELECT count(*) FROM state_box WHERE min_x < 0 AND max_x > 0", [(3,)]),
        ("SELECT key FROM instance AS i, json_each(label_belief) WHERE i.id = 'cup-1'", [("cup",), ("other",)]),
        ("WITH RECURSIVE n(i) AS (SELECT 1 UNION SELECT i + 1 FROM n WHERE i < 3) SELECT i FROM n", [(1,), (2,), (3,)]),
        ("SELECT name FROM pragma_table_info('current_objects') LIMIT 1", [("id",)]),
        ("pragma user_version", [(SCHEMA_VERSION,)]),
        ("SELECT 1 WHERE 0; -- nothing", []),
    ],
)
def test_whatever_reads_is_answered(db: Path, statement: str, expected: list[tuple[object, ...]]) -> None:
    assert rows(db, statement) == expected


def test_columns_come_as_the_statement_names_them(db: Path) -> None:
    with read_sql(str(db), "SELECT id, id, x AS east FROM instance WHERE 0") as found:
        assert found.columns == ("id", "id", "east")


@pytest.mark.parametrize(
    "statement",
    [
        "INSERT INTO before_image VALUES (1, 'a', 1, '{}')",
        "UPDATE instance SET label = 'song'",
        "DELETE FROM observation RETURNING id",
        "CREATE TABLE song (title TEXT)",
        "CREATE TEMP TABLE song (title TEXT)",
        "DROP VIEW changes",
        "ATTACH 'other.db' AS other",
        "VACUUM",
        "VACUUM INTO 'other.db'",
        "PRAGMA journal_mode = DELETE",
        "PRAGMA user_version = 9",
        "PRAGMA query_only = OFF",
        "PRAGMA wal_checkpoint",
        "SELECT * FROM pragma_journal_mode('delete')",
        "REINDEX",
        "ANALYZE",
    ],
)
def test_whatever_writes_is_refused_and_leaves_no_trace(
    db: Path, monkeypatch: pytest.MonkeyPatch, statement: str
) -> None:
    monkeypatch.chdir(db.parent)
    before = hashlib.sha256(db.read_bytes()).digest()
    with pytest.raises(QueryError, match="SQLite says"):
        rows(db, statement)
    assert hashlib.sha256(db.read_bytes()).digest() == before
    assert list(db.parent.iterdir()) == [db]


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("", "returns no rows: give one SELECT"),
        ("BEGIN", "returns no rows: give one SELECT"),
        ("SELECT 1; SELECT 2", "one statement at a time.*give one SELECT"),
        ("SELECT id FORM instance", 'near "instance": syntax error.*--help'),
        ("SELECT * FROM chairs", "no such table: chairs: there are changes, current_objects, object_history.* visit$"),
        ("SELECT colour FROM instance", r"no such column: colour: `PRAGMA table_info\(NAME\)`"),
        ("SELECT paint(id) FROM instance", "no such function: paint: plugins may add"),
        ("DELETE FROM instance", "readonly database: this command only reads"),
        ("SELECT :id", "binding"),
        ("SELECT json('{')", "malformed JSON: see `supermap db sql --help`"),
    ],
)
def test_what_is_wrong_is_said_with_its_cure(db: Path, statement: str, message: str) -> None:
    with pytest.raises(QueryError, match=message):
        rows(db, statement)


def test_what_goes_wrong_while_rows_are_taken_is_said_too(db: Path) -> None:
    with read_sql(str(db), 'SELECT json(value) FROM json_each(\'["1", "2", "{"]\')') as found:
        assert next(found.rows) == ("1",)
        with pytest.raises(QueryError, match="SQLite says: malformed JSON"):
            list(found.rows)


def test_what_cannot_be_opened_is_said_as_everywhere(tmp_path: Path) -> None:
    with pytest.raises(MemoryStoreError, match="there is no map database"):
        rows(tmp_path / "missing.db", "SELECT 1")
    (tmp_path / "notes.txt").write_text("no database")
    with pytest.raises(MemoryStoreError, match="no map database"):
        rows(tmp_path / "notes.txt", "SELECT 1")


def test_functions_can_be_added(db: Path) -> None:
    def prepare(connection: sqlite3.Connection) -> None:
        connection.create_function("shout", 1, str.upper)

    with read_sql(str(db), "SELECT shout(id) FROM instance WHERE id = 'cup-1'", prepare) as found:
        assert list(found.rows) == [("CUP-1",)]


def test_rows_are_read_while_they_are_taken(db: Path) -> None:
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n"
    with read_sql(str(db), endless) as found:
        assert [next(found.rows) for _ in range(3)] == [(1,), (2,), (3,)]


def test_it_reads_while_a_build_writes(db: Path) -> None:
    with open_store(str(db)):
        assert rows(db, "SELECT count(*) FROM traversal") == [(2,)]


def test_ctrl_c_ends_a_long_statement(db: Path) -> None:
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT count(*) FROM n"
    code = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a job may ignore it
    code += "from supermap_cli.main import main; print('ready', file=sys.stderr, flush=True); main()"
    with subprocess.Popen(
        [sys.executable, "-c", code, "db", "sql", endless, "--db", str(db)], stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stderr is not None
            assert select.select([process.stderr], [], [], 60)[0], "it does not start"
            assert process.stderr.readline() == "ready\n"
            time.sleep(2.0)
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=30) == 130
        finally:
            process.kill()
