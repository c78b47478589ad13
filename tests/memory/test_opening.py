"""What can be opened, what cannot, and what the error says."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import open_store
from supermap_cli.memory.databases.sqlite import SqliteFile
from supermap_cli.types.memory import MapDelta
from supermap_schema import SCHEMA_VERSION
from support import memories as m


def folder(path: Path) -> None:
    path.mkdir()


def text_file(path: Path) -> None:
    path.write_text("chair, table, cup, and much more of that kind\n")


def recording(path: Path) -> None:
    path.write_bytes(b"\x89MCAP0\r\n" + bytes(100))


def foreign_database(path: Path) -> None:
    m.run_sql(path, "CREATE TABLE recipe (name TEXT)")


def newer_database(path: Path) -> None:
    m.make_memory(path, ("monday", (0, 10), MapDelta()))
    m.run_sql(path, f"PRAGMA user_version = {SCHEMA_VERSION + 1}")


def older_database(path: Path) -> None:
    m.make_memory(path, ("monday", (0, 10), MapDelta()))
    m.run_sql(path, "PRAGMA user_version = 0")


def damaged_database(path: Path) -> None:
    path.write_bytes(b"SQLite format 3\x00" + b"\xff" * 5000)


@pytest.mark.sqlite_only("about files")
@pytest.mark.parametrize("mode", [{"create": True}, {}, {"read_only": True}])
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (folder, "a folder, not a map database"),
        (text_file, "no map database"),
        (recording, "no map database"),
        (foreign_database, "no SuperMap map"),
        (newer_database, f"newer version {SCHEMA_VERSION + 1}, this program knows {SCHEMA_VERSION}"),
        (older_database, "older version 0.*supermap db upgrade"),
        (damaged_database, "cannot be read"),
    ],
)
def test_what_is_no_map_is_refused_and_left_alone(
    tmp_path: Path, make: Callable[[Path], None], message: str, mode: dict[str, bool]
) -> None:
    path = tmp_path / "map.db"
    make(path)
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(MemoryStoreError, match=message) as caught:
        open_store(str(path), **mode)
    assert caught.value.where == str(path)
    assert caught.value.cure
    assert [path.name for path in tmp_path.iterdir()] == ["map.db"]
    assert before is None or path.read_bytes() == before


@pytest.mark.parametrize("read_only", [False, True])
def test_a_missing_database_says_how_to_make_one(tmp_path: Path, read_only: bool) -> None:
    with pytest.raises(MemoryStoreError, match=r"no map database.*supermap build"):
        open_store(str(tmp_path / "map.db"), read_only=read_only)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.sqlite_only("about files")
def test_a_database_without_any_table_is_filled(tmp_path: Path) -> None:
    """A build that is killed right after it made the file leaves such a one."""
    path = tmp_path / "map.db"
    m.run_sql(path, "PRAGMA journal_mode = WAL")
    assert path.stat().st_size > 0
    with pytest.raises(MemoryStoreError, match="no map database"):
        open_store(str(path), read_only=True)
    m.make_memory(path, ("monday", (0, 10), MapDelta()))
    with open_store(str(path), read_only=True) as store:
        assert [traversal.name for traversal in store.traversals()] == ["monday"]


@pytest.mark.sqlite_only("about files")
def test_a_missing_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(MemoryStoreError, match="folder of the map database does not exist"):
        open_store(str(tmp_path / "no" / "map.db"), create=True)


@pytest.mark.sqlite_only("about files")
@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a folder that even root cannot write: /proc")
def test_an_unwritable_folder_is_an_error() -> None:
    with pytest.raises(MemoryStoreError, match=r"cannot be written.*--db"):
        open_store("/proc/map.db", create=True)


@pytest.mark.parametrize("url", ["mysql://host/map", ""])
def test_other_databases_are_refused(url: str) -> None:
    with pytest.raises(MemoryStoreError):
        open_store(url)


@pytest.mark.sqlite_only("about files")
def test_a_url_and_a_path_mean_the_same(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "my map?.db", ("monday", (0, 10), MapDelta()))
    for url in (str(path), f"sqlite:///{path}"):
        with open_store(url, read_only=True) as store:
            assert [traversal.name for traversal in store.traversals()] == ["monday"]


def test_a_second_build_is_refused_while_readers_are_not(tmp_path: Path) -> None:
    path = tmp_path / "map.db"
    with open_store(str(path), create=True) as store:
        m.add_traversal(store, "monday", (0, 10))
        traversal_id = store.begin_traversal(m.start("tuesday", (20, 30)))
        with pytest.raises(MemoryStoreError, match="another build is writing this map"):
            open_store(str(path), create=True)
        with open_store(str(path), read_only=True) as reader, reader.reader() as moment:
            before = moment.counts()
            store.commit(traversal_id, MapDelta(keyframes=(m.keyframe(21),)))
            assert moment.counts() == before
    with open_store(str(path)):
        pass


@pytest.mark.sqlite_only("a lock file, and links to files")
def test_a_link_leads_to_the_same_lock(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta()))
    (tmp_path / "elsewhere").mkdir()
    link = tmp_path / "elsewhere" / "link.db"
    link.symlink_to(path)
    with open_store(str(path)), pytest.raises(MemoryStoreError, match="another build is writing"):
        open_store(str(link))
    with open_store(str(link), read_only=True) as store:
        assert [traversal.name for traversal in store.traversals()] == ["monday"]


@pytest.mark.sqlite_only("files beside a file")
def test_a_map_on_a_full_disk_is_read_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SQLite wants to make its shared memory beside a file that it may write to."""
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta()))
    assert not path.with_name("map.db-wal").exists()
    connect = SqliteFile._connect_reader

    def full(self: SqliteFile, mode: str) -> sqlite3.Connection:
        if mode == "mode=rw":
            error = sqlite3.OperationalError("disk I/O error")
            error.sqlite_errorname = "SQLITE_IOERR_SHMSIZE"
            raise error
        return connect(self, mode)

    monkeypatch.setattr(SqliteFile, "_connect_reader", full)
    with open_store(str(path), read_only=True) as store:
        assert [traversal.name for traversal in store.traversals()] == ["monday"]
    path.with_name("map.db-wal").write_bytes(b"what a killed build had not moved into the file yet")
    with pytest.raises(MemoryStoreError, match="free space"):
        open_store(str(path), read_only=True)


@pytest.mark.sqlite_only("about files")
def test_a_killed_build_gives_its_lock_back(tmp_path: Path) -> None:
    path = tmp_path / "map.db"
    program = (
        "import os, signal, sys; from supermap_cli.memory import open_store;"
        "store = open_store(sys.argv[1], create=True); os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", program, str(path)], check=False)
    with open_store(str(path), create=True) as store:
        m.add_traversal(store, "monday", (0, 10))
    assert [path.name for path in tmp_path.iterdir()] == ["map.db"]


@pytest.mark.sqlite_only("about files")
def test_a_reader_leaves_no_files_behind_and_writes_nothing(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta()))
    before = path.read_bytes()
    with open_store(str(path), read_only=True) as store:
        assert len(store.traversals()) == 1
        with pytest.raises(MemoryStoreError, match="not open for writing"):
            store.commit(1, MapDelta())
    assert [path.name for path in tmp_path.iterdir()] == ["map.db"]
    assert path.read_bytes() == before
