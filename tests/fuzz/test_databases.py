"""Maps that others made or that were damaged: every command that reads gives an answer or one line, and in time.

A found one becomes a test of its own.
"""

from __future__ import annotations

import math
import shutil
import sqlite3
import zlib
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_schema.models import Base
from support import bags, kitchen
from support.cli import supermap
from support.fuzzed_commands import run
from support.fuzzing import MUTATIONS, Edit, fuzzing, mutated, one_input

pytestmark = pytest.mark.sqlite_only("files of a map")

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
WITH_PICTURES = (
    ("history", "chair-1", "--html", "page.html"),
    ("history", "cup-1", "--crops", "crops"),
    ("diff", "--html", "diff.html"),
    ("db", "check"),
)
PICTURES = (("observation", "crop_jpeg"), ("keyframe", "thumbnail_jpeg"), ("keyframe", "depth_png"))
Commands = list[tuple[str, ...]]
SOME = st.lists(st.sampled_from(READING), min_size=2, max_size=4, unique=True)
"""Of the commands that read."""

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


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    db = tmp_path_factory.mktemp("sound") / "map.db"
    kitchen.make_kitchen(db)
    with closing(sqlite3.connect(db)) as connection:
        connection.execute("PRAGMA journal_mode = DELETE")
    return db.read_bytes()


def read_all(db: Path, form: str, commands: Sequence[Sequence[str]] = READING) -> None:
    """Every reading command ends well, or with one line of an error, and leaves the map as it was."""
    before = db.read_bytes()
    with one_input(f"map {form}"):
        for command in commands:
            run([*command, "--db", str(db)])
    assert db.read_bytes() == before


def fresh(folder: Path, content: bytes) -> Path:
    for path in folder.iterdir():
        if path.is_file():
            path.unlink()
    (folder / "map.db").write_bytes(content)
    return folder / "map.db"


@fuzzing(12)
@given(
    commands=SOME,
    places=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=40),
)
def test_damaged_bytes(sound: bytes, tmp_path: Path, commands: Commands, places: list[tuple[float, int]]) -> None:
    content = bytearray(sound)
    for share, value in places:
        content[int(share * len(content))] = value
    read_all(fresh(tmp_path, bytes(content)), "bytes", commands)


@fuzzing(12)
@given(
    commands=SOME,
    share=st.floats(0, 1),
    filled=st.sampled_from([b"\0", b"\xff"]),
    pages=st.lists(st.integers(0, 60), max_size=3),
)
def test_lost_pages_and_ends(
    sound: bytes, tmp_path: Path, commands: Commands, share: float, filled: bytes, pages: list[int]
) -> None:
    content = bytearray(sound)
    for page in pages:
        content[page * 4096 : (page + 1) * 4096] = filled * 4096
    ended = content if pages else content[: max(1, int(share * len(content)))]
    read_all(fresh(tmp_path, bytes(ended)), "pages", commands)


@contextmanager
def unguarded(db: Path) -> Iterator[sqlite3.Connection]:
    """A connection that writes what the map itself would refuse."""
    with closing(sqlite3.connect(db)) as connection, connection:
        connection.execute("PRAGMA ignore_check_constraints = ON")
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            connection.execute(f"DROP TRIGGER {name}")
        yield connection


@fuzzing(15, share=2)
@given(data=st.data(), commands=SOME)
def test_values_that_cannot_be(sound: bytes, tmp_path: Path, data: st.DataObject, commands: Commands) -> None:
    db = fresh(tmp_path, sound)
    with unguarded(db) as connection:
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
    read_all(db, "values", commands)


@fuzzing(12, share=0.5)
@given(
    form=st.sampled_from(["jpg", "png", "webp"]),
    changes=st.lists(MUTATIONS, min_size=1, max_size=3),
    shape=st.sampled_from([(64, 64, 3), (1, 1, 3), (3, 4, 3), (1, 4000, 3), (16, 16)]),
)
def test_pictures_that_are_none(
    sound: bytes, tmp_path: Path, form: str, changes: list[list[Edit]], shape: tuple[int, ...]
) -> None:
    """Crops, thumbnails and depths of any bytes, read by what shows or compares them."""
    db = fresh(tmp_path, sound)
    picture = cv2.imencode(f".{form}", np.arange(np.prod(shape), dtype=np.uint8).reshape(shape))[1].tobytes()
    with unguarded(db) as connection:
        for number, change in enumerate(changes):
            content = mutated(picture, change)
            for table, column in PICTURES:
                where = f"rowid % {len(changes)} = {number}"
                connection.execute(f"UPDATE {table} SET {column} = ? WHERE {where}", (content,))
    read_all(db, "pictures", WITH_PICTURES)


@fuzzing(4, share=0.1)
@given(data=st.data())
def test_builds_and_merges_over_a_damaged_map(sound: bytes, tmp_path: Path, data: st.DataObject) -> None:
    """A build restores all objects, free space and relations before it begins; what it cannot, it does not touch."""
    db = fresh(tmp_path, sound)
    recording = bags.write_recording(tmp_path / "run.mcap", frames=8)
    with unguarded(db) as connection:
        for _ in range(data.draw(st.integers(1, 2))):
            table = data.draw(st.sampled_from(TABLES))
            column = data.draw(st.sampled_from([column.name for column in table.columns]))
            with suppress(sqlite3.Error, OverflowError):
                connection.execute(f"UPDATE {table.name} SET {column} = ?", (data.draw(HOSTILE),))
    shutil.copy(db, tmp_path / "other.db")
    with one_input("map built on"):
        run(["build", str(recording), "--db", str(db), "--align", "0 0 0 0"])
        run(["db", "merge", str(tmp_path / "other.db"), "--db", str(db), "--dry-run", "--align", "0 0 0 0"])


@pytest.mark.parametrize("name", ["instance", "state", "traversal", "observation", "visit"])
def test_views_in_the_place_of_tables_do_not_run(sound: bytes, tmp_path: Path, name: str) -> None:
    db = fresh(tmp_path, sound)
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS number, i AS id FROM n"
    with closing(sqlite3.connect(db)) as connection, connection:
        connection.execute("PRAGMA legacy_alter_table = ON")
        connection.execute(f"ALTER TABLE {name} RENAME TO real_{name}")
        connection.execute(f"CREATE VIEW {name} AS {endless}")
    read_all(db, "views")


def test_a_view_that_never_ends_is_stopped(sound: bytes, tmp_path: Path) -> None:
    db = fresh(tmp_path, sound)
    endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT max(i) AS id FROM n"
    with closing(sqlite3.connect(db)) as connection, connection:
        connection.execute("DROP VIEW current_objects")
        connection.execute(f"CREATE VIEW current_objects AS {endless}")
    refused = supermap("db", "sql", "SELECT * FROM current_objects", "--db", db, "--timeout", "1")
    assert "takes too long" in str(refused.exception)
    read_all(db, "views")


def test_bombs_in_blobs_cost_little(sound: bytes, tmp_path: Path) -> None:
    db = fresh(tmp_path, sound)
    bomb = b"SMV1" + zlib.compress(bytes(400_000_000), 9)
    with closing(sqlite3.connect(db)) as connection, connection:
        connection.execute("UPDATE instance SET voxels = ? WHERE number = 1", (bomb,))
    read_all(db, "blobs")
