"""Maps that others made or that were damaged: every command that reads gives an answer or one line, and in time.

`SUPERMAP_FUZZ_EXAMPLES` says how many damaged maps of each kind are tried; a found one becomes a test of its own.
"""

from __future__ import annotations

import math
import os
import sqlite3
import time
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from supermap_cli.errors import SupermapError
from supermap_schema.models import Base
from support import kitchen
from support.cli import supermap

pytestmark = pytest.mark.sqlite_only("files of a map")

EXAMPLES = int(os.environ.get("SUPERMAP_FUZZ_EXAMPLES", "15"))
READING = (
    ("show",),
    ("show", "chair-1"),
    ("query", "chair near the table"),
    ("query", "what was on the table on monday"),
    ("query", "how many chairs", "--json"),
    ("history", "chair-1"),
    ("diff",),
    ("diff", "--json"),
    ("export", "--format", "json", "--out", "-"),
    ("export", "--format", "geojson", "--out", "-"),
    ("db", "info"),
    ("db", "check"),
    ("db", "sql", "SELECT * FROM object_history", "--timeout", "5"),
    ("db", "vacuum", "--dry-run", "--keep", "crops=1d"),
)
LIMIT_S = 20.0
"""Seconds that no command may take on a small map."""

TABLES = [table for table in Base.metadata.sorted_tables if table.name not in {"before_image", "checkpoint"}]
HOSTILE = st.one_of(
    st.sampled_from(
        [
            None,
            0,
            -1,
            2**63 - 1,
            -(2**63),
            math.inf,
            -math.inf,
            1e308,
            1e-320,
            "",
            "\0",
            "\x1b[2J",
            "\u202e",
            "[]",
            "{}",
        ]
    ),
    st.sampled_from(["null", "[[1,2],[3]]", "NaN", "[" * 2000, '{"a": 1e999}', "x" * 5000, b"", b"SMV1", b"\x89PNG"]),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False),
    st.text(st.characters(exclude_categories=["Cs"]), max_size=20),
    st.binary(max_size=30),
)
FUZZED = settings(
    max_examples=EXAMPLES,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    db = tmp_path_factory.mktemp("sound") / "map.db"
    kitchen.make_kitchen(db)
    with closing(sqlite3.connect(db)) as connection:
        connection.execute("PRAGMA journal_mode = DELETE")
    return db.read_bytes()


def read_all(db: Path) -> None:
    """Every reading command ends well, or with one line of an error that names what is wrong."""
    for command in READING:
        began = time.monotonic()
        result = supermap(*command, "--db", db)
        assert time.monotonic() - began < LIMIT_S, command
        error = result.exception
        if isinstance(error, SystemExit) or error is None:
            continue
        if not isinstance(error, SupermapError):
            raise AssertionError(f"{command}: {error!r}") from error  # noqa: TRY004 - a bug, whatever it is
        assert "\n" not in str(error)


def fresh(folder: Path, content: bytes) -> Path:
    for path in folder.iterdir():
        path.unlink()
    (folder / "map.db").write_bytes(content)
    return folder / "map.db"


@FUZZED
@given(places=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=40))
def test_damaged_bytes(sound: bytes, tmp_path: Path, places: list[tuple[float, int]]) -> None:
    content = bytearray(sound)
    for share, value in places:
        content[int(share * len(content))] = value
    read_all(fresh(tmp_path, bytes(content)))


@FUZZED
@given(share=st.floats(0, 1), filled=st.sampled_from([b"\0", b"\xff"]), pages=st.lists(st.integers(0, 60), max_size=3))
def test_lost_pages_and_ends(sound: bytes, tmp_path: Path, share: float, filled: bytes, pages: list[int]) -> None:
    content = bytearray(sound)
    for page in pages:
        content[page * 4096 : (page + 1) * 4096] = filled * 4096
    read_all(fresh(tmp_path, bytes(content[: max(1, int(share * len(content)))] if not pages else content)))


@FUZZED
@given(data=st.data())
def test_values_that_cannot_be(sound: bytes, tmp_path: Path, data: st.DataObject) -> None:
    db = fresh(tmp_path, sound)
    with closing(sqlite3.connect(db)) as connection, connection:
        connection.execute("PRAGMA ignore_check_constraints = ON")
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            connection.execute(f"DROP TRIGGER {name}")
        for _ in range(data.draw(st.integers(1, 3))):
            table = data.draw(st.sampled_from(TABLES))
            column = data.draw(st.sampled_from([column.name for column in table.columns]))
            row = data.draw(st.integers(0, 20))
            statement = (
                f"UPDATE {table.name} SET {column} = ? WHERE rowid = (SELECT rowid FROM {table.name} LIMIT 1 OFFSET ?)"
            )
            try:
                connection.execute(statement, (data.draw(HOSTILE), row))
            except (sqlite3.Error, OverflowError):
                continue  # SQLite itself refuses it in this column
    read_all(db)


@pytest.mark.parametrize("name", ["instance", "state", "traversal", "observation", "visit"])
def test_views_in_the_place_of_tables_do_not_run(sound: bytes, tmp_path: Path, name: str) -> None:
    db = fresh(tmp_path, sound)
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS number, i AS id FROM n"
    with closing(sqlite3.connect(db)) as connection, connection:
        connection.execute("PRAGMA legacy_alter_table = ON")
        connection.execute(f"ALTER TABLE {name} RENAME TO real_{name}")
        connection.execute(f"CREATE VIEW {name} AS {endless}")
    read_all(db)


def test_a_view_that_never_ends_is_stopped(sound: bytes, tmp_path: Path) -> None:
    db = fresh(tmp_path, sound)
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT max(i) AS id FROM n"
    with closing(sqlite3.connect(db)) as connection, connection:
        connection.execute("DROP VIEW current_objects")
        connection.execute(f"CREATE VIEW current_objects AS {endless}")
    refused = supermap("db", "sql", "SELECT * FROM current_objects", "--db", db, "--timeout", "1")
    assert "takes too long" in str(refused.exception)
    read_all(db)


def test_bombs_in_blobs_cost_little(sound: bytes, tmp_path: Path) -> None:
    import zlib

    db = fresh(tmp_path, sound)
    bomb = b"SMV1" + zlib.compress(bytes(400_000_000), 9)
    with closing(sqlite3.connect(db)) as connection, connection:
        connection.execute("UPDATE instance SET voxels = ? WHERE number = 1", (bomb,))
    read_all(db)
