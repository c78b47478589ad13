"""Who may write a map, and what happens to one that is locked, moved or replaced while it is written."""

from __future__ import annotations

import os
import sqlite3
import threading
import time
from contextlib import closing
from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import open_store
from supermap_cli.memory.databases import Waiting
from support import kitchen, memories
from support.cli import supermap

pytestmark = pytest.mark.sqlite_only("locks of files")


@pytest.fixture
def db(tmp_path: Path) -> Path:
    kitchen.make_kitchen(tmp_path / "map.db")
    return tmp_path / "map.db"


def locked(db: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(db, isolation_level=None, check_same_thread=False)
    connection.execute("BEGIN IMMEDIATE")
    return connection


@pytest.mark.parametrize("link", [os.link, os.symlink], ids=["hard link", "symbolic link"])
def test_the_lock_is_of_the_file_not_of_its_name(db: Path, tmp_path: Path, link) -> None:
    (tmp_path / "elsewhere").mkdir()
    other = tmp_path / "elsewhere" / "other.db"
    link(db, other)
    with open_store(str(db)), pytest.raises(MemoryStoreError, match="another build is writing this map"):
        open_store(str(other))
    open_store(str(other)).close()


def test_a_link_made_during_a_build_is_locked_too(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "new.db"), create=True) as store:
        store.begin_traversal(memories.start("monday", (0, 60)))
        os.link(tmp_path / "new.db", tmp_path / "other.db")
        with pytest.raises(MemoryStoreError, match="another build is writing this map under another name"):
            open_store(str(tmp_path / "other.db"))


def test_a_writer_waits_for_another_program_and_says_so(db: Path) -> None:
    other, told = locked(db), list[str]()
    released = threading.Timer(2.0, lambda: (other.execute("ROLLBACK"), other.close()))
    with open_store(str(db), waiting=Waiting(30, told.append)) as store:
        released.start()
        store.begin_traversal(memories.start("friday", (1e6, 1e6 + 60)))
    released.join(30)
    assert told == [f"another program writes to {db}: waiting up to 30 s for it"]


@pytest.mark.parametrize("command", [("db", "vacuum"), ("db", "vacuum", "--keep", "crops=none")])
def test_after_that_it_says_who_is_in_the_way(db: Path, command: tuple[str, ...]) -> None:
    before = db.read_bytes()
    with closing(locked(db)):
        began = time.monotonic()
        refused = supermap(*command, "--db", db, "--wait", "1")
        assert time.monotonic() - began < 10
    assert str(refused.exception).startswith(f"another program writes to the map database ({db}): end its change")
    assert "restore" not in str(refused.exception)
    assert db.read_bytes() == before


def test_readers_do_not_wait(db: Path) -> None:
    with closing(locked(db)):
        assert supermap("show", "--db", db).exit_code == 0


def test_a_reader_of_a_database_in_another_mode_is_told_the_same(db: Path) -> None:
    with closing(sqlite3.connect(db, isolation_level=None)) as other:
        other.execute("PRAGMA journal_mode = DELETE")
        other.execute("BEGIN EXCLUSIVE")
        refused = supermap("show", "--db", db)
    assert str(refused.exception).startswith("another program writes to the map database")


def test_a_map_that_is_removed_while_it_is_written_is_an_error(db: Path) -> None:
    with open_store(str(db)) as store:
        db.unlink()
        with pytest.raises(MemoryStoreError, match=r"removed or moved while it was being written .*put the file back"):
            store.begin_traversal(memories.start("friday", (1e6, 1e6 + 60)))
    assert not db.exists()


def test_a_map_that_is_moved_can_be_put_back(db: Path, tmp_path: Path) -> None:
    with open_store(str(db)) as store:
        db.rename(tmp_path / "moved.db")
        with pytest.raises(MemoryStoreError, match="removed or moved"):
            store.begin_traversal(memories.start("friday", (1e6, 1e6 + 60)))
    (tmp_path / "moved.db").rename(db)
    assert supermap("db", "check", "--db", db).exit_code == 0


def test_what_is_put_in_its_place_is_left_alone(db: Path, tmp_path: Path) -> None:
    kitchen.make_kitchen(tmp_path / "other.db")
    other = (tmp_path / "other.db").read_bytes()
    with open_store(str(db)) as store:
        (tmp_path / "other.db").replace(db)
        with pytest.raises(MemoryStoreError, match="another file was put in the place of the map"):
            store.begin_traversal(memories.start("friday", (1e6, 1e6 + 60)))
        with pytest.raises(MemoryStoreError, match="another file was put in the place of the map"):
            store.remove(lambda _: True)
    assert db.read_bytes() == other
