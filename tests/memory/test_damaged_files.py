"""`supermap db recover` of files of which bytes are damaged or missing."""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.damaged_tables import DamagedTables
from supermap_schema import models
from support import databases, kitchen
from support.cli import supermap

pytestmark = pytest.mark.sqlite_only("files of a map")
PAGE = 4096


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("kitchen") / "map.db"
    kitchen.make_kitchen(path)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return path


def recovered(folder: Path, content: bytes) -> Path | None:
    """The map that is recovered, which is sound and can be shown; `None` where nothing is left."""
    bad, new = folder / "bad.db", folder / "new.db"
    bad.write_bytes(content)
    done = supermap("db", "recover", "--db", bad, "--out", new)
    if isinstance(done.exception, MemoryStoreError):
        assert "nothing of the map can be read" in str(done.exception)
        return None
    assert done.exit_code == 0, done.output
    assert supermap("db", "check", "--db", new).exit_code == 0
    assert supermap("show", "--db", new).exit_code == 0
    return new


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: bytes(100) + content[100:],
        lambda content: bytes(PAGE) + content[PAGE:],
        lambda content: content[:16] + b"\x20\x00" + content[18:],
        lambda content: content[:28] + bytes(4) + content[32:],
        lambda content: content[:-100],
    ],
    ids=["header", "first page", "page size", "page count", "last bytes"],
)
def test_the_things_of_a_damaged_file_are_saved(db: Path, tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    new = recovered(tmp_path, damage(db.read_bytes()))
    assert new is not None
    for table in ("instance", "state"):
        assert databases.query(new, f"SELECT count(*) FROM {table}") == databases.query(
            db, f"SELECT count(*) FROM {table}"
        )


def test_pages_hold_what_sqlite_reads(db: Path) -> None:
    tables = DamagedTables(db)
    for table in models.Base.metadata.sorted_tables:
        with closing(sqlite3.connect(db)) as connection:
            connection.row_factory = sqlite3.Row
            expected = [dict(row) for row in connection.execute(f'SELECT rowid AS "row id", * FROM {table.name}')]
        assert [row for row in tables.rows(table) if row is not None] == sorted(expected, key=lambda row: row["row id"])


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_file_that_was_cut_off_is_named_and_recovered(db: Path, tmp_path: Path, share: float) -> None:
    content = db.read_bytes()
    recovered(tmp_path, content[: int(len(content) * share)])
    checked = supermap("db", "check", "--db", tmp_path / "bad.db")
    assert checked.exit_code == 1
    said = checked.output + str(checked.exception or "")
    assert "supermap db check" not in said
    assert "pages of" in said or "problems in" in said


@settings(max_examples=5, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    hits=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.binary(min_size=1, max_size=300)), max_size=12),
    share=st.sampled_from((1.0, 1.0, 0.9, 0.5)),
)
def test_any_damage_is_survived(db: Path, hits: list[tuple[float, bytes]], share: float) -> None:
    content = bytearray(db.read_bytes())
    for where, what in hits:
        at = int(where * len(content))
        content[at : at + len(what)] = what
    with tempfile.TemporaryDirectory() as folder:
        recovered(Path(folder), bytes(content[: int(len(content) * share)]))
