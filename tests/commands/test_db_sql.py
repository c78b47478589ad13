"""`supermap db sql`."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from supermap_cli import hookimpl, plugin_manager
from supermap_cli.errors import QueryError
from support import kitchen
from support.cli import document, supermap

COUNT_TO = "WITH RECURSIVE n(i) AS (SELECT 1 UNION SELECT i + 1 FROM n WHERE i < {}) SELECT i FROM n"


@pytest.fixture
def db(tmp_path: Path) -> Path:
    return kitchen.make_kitchen(tmp_path / "map.db")


@pytest.fixture
def with_plugins(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Adds plugins that prepare connections by these functions."""

    def add(*prepares: Callable[[sqlite3.Connection], None]) -> None:
        loaded = plugin_manager.load_plugins(
            [SimpleNamespace(prepare_connection=hookimpl(prepare)) for prepare in prepares]
        )
        monkeypatch.setattr(plugin_manager, "load_plugins", lambda: loaded)

    return add


def test_rows_are_a_table(db: Path) -> None:
    result = supermap("db", "sql", "SELECT id, x, NULL AS colour, voxels FROM instance WHERE id = 'cup-1'", "--db", db)
    assert result.exit_code == 0, result.output
    for expected in ("id", "colour", "cup-1", "0.5", "-", "bytes>"):
        assert expected in result.stdout
    assert result.stderr == ""


def test_nothing_found_is_an_answer(db: Path) -> None:
    assert supermap("db", "sql", "SELECT id FROM instance WHERE 1 = 0", "--db", db).stdout == "no rows\n"
    assert document("db_sql", "db", "sql", "SELECT id FROM instance WHERE 1 = 0", "--db", db) == {
        "columns": ["id"],
        "rows": [],
        "complete": True,
    }


@pytest.mark.parametrize(
    ("found", "options", "shown"),
    [(100, [], 100), (101, [], 100), (101, ["--limit", "0"], 101), (3, ["--limit", "2"], 2), (2, ["--limit", "2"], 2)],
)
def test_a_table_is_cut_at_the_limit_and_says_so(db: Path, found: int, options: list[str], shown: int) -> None:
    result = supermap("db", "sql", COUNT_TO.format(found), "--db", db, *options)
    lines = [line.strip() for line in result.stdout.splitlines() if line.strip()]
    assert lines[2:] == [str(i + 1) for i in range(shown)]
    assert result.stderr == ("" if shown == found else f"only the first {shown} rows are shown: --limit 0 shows all\n")


@pytest.mark.parametrize(("options", "rows", "complete"), [([], 101, True), (["--limit", "2"], 2, False)])
def test_json_holds_all_rows_unless_it_is_limited(db: Path, options: list[str], rows: int, *, complete: bool) -> None:
    printed = document("db_sql", "db", "sql", COUNT_TO.format(101), "--db", db, *options)
    assert printed["rows"] == [[i + 1] for i in range(rows)]
    assert printed["complete"] is complete


@pytest.mark.sqlite_only("writes bytes as SQLite does; PostgreSQL's stand in test_postgresql_sql")
def test_json_keeps_values_as_they_are(db: Path) -> None:
    statement = "SELECT 1, 0.5, NULL, 'Küche \"2\"', x'00ff', -9e999, 1 AS a, 2 AS a"
    printed = document("db_sql", "db", "sql", statement, "--db", db)
    assert printed["rows"] == [[1, 0.5, None, 'Küche "2"', {"base64": "AP8="}, "-inf", 1, 2]]
    assert printed["columns"][-2:] == ["a", "a"]


def test_a_wrong_statement_prints_nothing(db: Path) -> None:
    for options in ([], ["--json"]):
        result = supermap("db", "sql", "DELETE FROM instance", "--db", db, *options)
        assert isinstance(result.exception, QueryError)
        assert result.stdout == ""


@pytest.mark.sqlite_only("functions of plugins are for SQLite")
def test_a_plugin_adds_functions(db: Path, with_plugins: Callable[..., None]) -> None:
    with_plugins(lambda connection: connection.create_function("shout", 1, str.upper))
    assert document("db_sql", "db", "sql", "SELECT shout('cup')", "--db", db)["rows"] == [["CUP"]]


@pytest.mark.sqlite_only("functions of plugins are for SQLite")
def test_a_plugin_that_fails_is_told_and_leaves_the_rest_working(db: Path, with_plugins: Callable[..., None]) -> None:
    def fail(connection: sqlite3.Connection) -> None:
        raise RuntimeError("no\nlicence")

    with_plugins(fail, lambda connection: connection.create_function("shout", 1, str.upper))
    result = supermap("db", "sql", "SELECT shout('cup')", "--db", db)
    assert "CUP" in result.stdout
    (warning,) = result.stderr.splitlines()
    assert warning.startswith("warning: plugin SimpleNamespace")
    assert warning.endswith("not all its SQL functions are there: RuntimeError: no licence")
