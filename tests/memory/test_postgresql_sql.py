"""SQL on a map in PostgreSQL reads everything and changes nothing."""

from __future__ import annotations

import select
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from supermap_cli.errors import QueryError
from supermap_cli.memory import open_store
from supermap_cli.memory.opening import read_sql
from supermap_schema import SCHEMA_VERSION
from supermap_schema.models import Base
from support import databases, kitchen
from support.cli import document

pytestmark = pytest.mark.postgresql_only
ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT {} FROM n"


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
        (
            "SELECT id FROM instance_label WHERE words @@ plainto_tsquery('supermap_label', 'tables')",
            [("dining-table-1",)],
        ),
        ("SELECT count(*) FROM state_box WHERE min_x < 0 AND max_x > 0", [(3,)]),
        ("SELECT count(*) FROM state_box WHERE ground && box(point(3, -1), point(4, 1))", [(1,)]),
        ("SELECT key FROM instance, json_each(label_belief::json) WHERE id = 'cup-1'", [("cup",), ("other",)]),
        ("SELECT version_num FROM alembic_version", [(f"{SCHEMA_VERSION:04}",)]),
        ("SELECT 1 WHERE false; -- nothing", []),
        ("SELECT '100 %s', 7 % 4", [("100 %s", 3)]),
        ("SHOW transaction_isolation", [("repeatable read",)]),
        (
            "SELECT true, 3::numeric, 0.5::numeric, 'NaN'::numeric::text, '\\x00ff'::bytea, NULL, ARRAY[1, 2], 1::int2",
            [(1, 3, 0.5, "NaN", b"\x00\xff", None, "{1,2}", 1)],
        ),
        (
            "SELECT '2026-01-05 09:00:00+00'::timestamptz AT TIME ZONE 'UTC', '{\"a\": 1}'::jsonb",
            [("2026-01-05 09:00:00", '{"a": 1}')],
        ),
    ],
)
def test_whatever_reads_is_answered(db: Path, statement: str, expected: list[tuple[object, ...]]) -> None:
    assert rows(db, statement) == expected


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE instance SET label = 'song' RETURNING id",
        "DELETE FROM observation",
        "WITH gone AS (DELETE FROM visit RETURNING 1) SELECT count(*) FROM gone",
        "CREATE TABLE song (title text)",
        "CREATE TEMP TABLE song (title text)",
        "SELECT nextval('state_id_seq')",
        "SELECT * FROM instance FOR UPDATE",
        "SET TRANSACTION READ WRITE",
        "COPY instance TO '/tmp/instance.csv'",
        "COPY instance TO STDOUT",
        "DO $$ BEGIN DELETE FROM visit; END $$",
        "EXPLAIN ANALYZE DELETE FROM visit",
        "COMMIT",
        "VACUUM",
        "DROP VIEW changes",
        "SELECT 1; DELETE FROM visit",
    ],
)
def test_whatever_writes_is_refused_and_leaves_no_trace(db: Path, statement: str) -> None:
    before = contents(db)
    with pytest.raises(QueryError, match="give one SELECT"):
        rows(db, statement)
    assert contents(db) == before


def contents(db: Path) -> list[object]:
    with closing(databases.connect(db)) as connection:
        found = [
            connection.execute(f"SELECT * FROM {table.name} ORDER BY 1, 2, 3".encode()).fetchall()
            for table in Base.metadata.sorted_tables
        ]
        counters = connection.execute(b"SELECT last_value, is_called FROM state_id_seq").fetchall()
        relations = b"SELECT relname FROM pg_class WHERE relnamespace = current_schema()::regnamespace ORDER BY 1"
        return [*found, counters, connection.execute(relations).fetchall()]


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("", "returns no rows: give one SELECT"),
        ("SELECT 1; SELECT 2", "one SQL statement at a time: give one SELECT"),
        ("SELECT id FORM instance", 'PostgreSQL says: .*"instance".*--help'),
        ("SELECT * FROM chairs", '"chairs" does not exist: there are changes, current_objects, .* visit$'),
        ("SELECT colour FROM instance", r'"colour" does not exist: `SELECT column_name .*` lists the columns'),
        ("SELECT paint(id) FROM instance", r"paint\(text\) does not exist: .*functions of plugins are for SQLite"),
        ("SELECT $1::text", "there is no parameter|parameter|bind"),
        ("SELECT 1 / (2 - i) FROM generate_series(1, 3) AS i", "division by zero: see `supermap db sql --help`"),
    ],
)
def test_what_is_wrong_is_said_with_its_cure(db: Path, statement: str, message: str) -> None:
    with pytest.raises(QueryError, match=message):
        rows(db, statement)


def test_columns_come_as_the_statement_names_them(db: Path) -> None:
    with read_sql(str(db), "SELECT id, id, x AS east FROM instance WHERE false") as found:
        assert found.columns == ("id", "id", "east")


def test_rows_are_read_while_they_are_taken(db: Path) -> None:
    with read_sql(str(db), ENDLESS.format("i")) as found:
        assert [next(found.rows) for _ in range(3)] == [(1,), (2,), (3,)]


def test_it_reads_while_a_build_writes(db: Path) -> None:
    with open_store(str(db)):
        assert rows(db, "SELECT count(*) FROM traversal") == [(2,)]


def test_json_is_by_the_schema(db: Path) -> None:
    statement = "SELECT 1, 0.5, NULL, 'Küche \"2\"', '\\x00ff'::bytea, '-Infinity'::float8, 1 AS a, 2 AS a"
    printed = document("db_sql", "db", "sql", statement, "--db", db)
    assert printed["rows"] == [[1, 0.5, None, 'Küche "2"', {"base64": "AP8="}, "-inf", 1, 2]]
    assert printed["columns"][-2:] == ["a", "a"]


def test_ctrl_c_ends_a_long_statement(db: Path) -> None:
    code = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a job may ignore it
    code += "from supermap_cli.main import main; print('ready', file=sys.stderr, flush=True); main()"
    arguments = ["db", "sql", ENDLESS.format("count(*)"), "--db", databases.place(db)]
    with subprocess.Popen([sys.executable, "-c", code, *arguments], stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            assert select.select([process.stderr], [], [], 60)[0], "it does not start"
            assert process.stderr.readline() == "ready\n"
            time.sleep(2.0)
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=30) == 130
        finally:
            process.kill()
