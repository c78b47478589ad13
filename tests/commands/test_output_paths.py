"""No output path writes over a map, a recording, a model, or any file that is no older version of the output."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from supermap_cli.commands.demo import remove_old_map
from supermap_cli.errors import ExportError, MemoryStoreError, SimulationError, SupermapError
from supermap_cli.memory import open_store
from supermap_cli.output_files import check_output, replace_file
from support import kitchen, kitchen_truth
from support.cli import supermap

pytestmark = pytest.mark.sqlite_only("files of a map")

RECORDING, MODEL, EMPTY = b"\x89MCAP0\r\nrecorded", b"\x08\x07\x12\x07pytorch\x00", b""
WRITING = {
    "a page of changes": ("diff", "--html"),
    "a page of a life": ("history", "chair-1", "--html"),
    "a document": ("export", "--format", "json", "--force", "--out"),
    "a plan": ("export", "--format", "geojson", "--force", "--out"),
    "a cloud": ("export", "--format", "ply", "--force", "--out"),
    "tables": ("export", "--format", "csv", "--force", "--out"),
}


@pytest.fixture
def db(tmp_path: Path) -> Path:
    kitchen.make_kitchen(tmp_path / "map.db")
    return tmp_path / "map.db"


def named(db: Path, how: str) -> Path:
    """The map by another name."""
    other = db.parent / "page.html"
    if how == "hard link":
        os.link(db, other)
    elif how == "symbolic link":
        other.symlink_to(db.name)
    elif how == "link to a link":
        (db.parent / "between").symlink_to(db.name)
        other.symlink_to("between")
    return db if how == "itself" else other


@pytest.mark.parametrize("how", ["itself", "hard link", "symbolic link", "link to a link"])
@pytest.mark.parametrize("writing", WRITING.values(), ids=WRITING)
def test_no_command_writes_over_the_map(db: Path, how: str, writing: tuple[str, ...]) -> None:
    before, out = db.read_bytes(), named(db, how)
    refused = supermap(*writing, out, "--db", db)
    assert isinstance(refused.exception, SupermapError), refused.output
    assert db.read_bytes() == before
    assert out.samefile(db)


@pytest.mark.parametrize("suffix", ["-wal", "-shm", "-journal", ".lock"])
def test_nor_over_sqlites_files_beside_it(db: Path, suffix: str) -> None:
    out = db.with_name(db.name + suffix)
    for writing in (*WRITING.values(),):
        refused = supermap(*writing, out, "--db", db)
        assert isinstance(refused.exception, SupermapError)
        assert not out.exists()


@pytest.mark.parametrize("content", [RECORDING, MODEL, b"my notes"])
@pytest.mark.parametrize("writing", WRITING.values(), ids=WRITING)
def test_nor_over_a_file_of_another_kind(db: Path, content: bytes, writing: tuple[str, ...]) -> None:
    out = db.parent / "other"
    out.write_bytes(content)
    assert isinstance(supermap(*writing, out, "--db", db).exception, SupermapError)
    assert out.read_bytes() == content


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
@pytest.mark.parametrize("command", [("diff",), ("eval", "map")])
def test_a_plot_is_not_drawn_over_another_file(db: Path, suffix: str, command: tuple[str, ...]) -> None:
    out = db.parent / f"map{suffix}"
    os.link(db, out)
    before = db.read_bytes()
    truth = db.parent / "truth.json"
    kitchen_truth.write_kitchen_truth(truth)
    arguments = (*command, "--db", db) if command == ("diff",) else (*command, db, truth)
    assert isinstance(supermap(*arguments, "--plot", out).exception, ExportError)
    assert db.read_bytes() == before


def test_the_cure_works_and_an_older_page_is_replaced(db: Path) -> None:
    assert supermap("diff", "--html", db.parent / "other.html", "--db", db).exit_code == 0
    first = (db.parent / "other.html").read_bytes()
    assert supermap("diff", "--html", db.parent / "other.html", "--db", db).exit_code == 0
    assert (db.parent / "other.html").read_bytes() == first
    assert not list(db.parent.glob(".supermap-*"))


def test_a_table_in_a_folder_that_is_a_map_is_kept(db: Path) -> None:
    tables = db.parent / "tables"
    assert supermap("export", "--format", "csv", "--out", tables, "--db", db).exit_code == 0
    (tables / "instances.csv").unlink()
    os.link(db, tables / "instances.csv")
    refused = supermap("export", "--format", "csv", "--force", "--out", tables, "--db", db)
    assert isinstance(refused.exception, ExportError)
    assert (tables / "instances.csv").samefile(db)


@pytest.mark.parametrize("content", [EMPTY, b"<!DOCTYPE html><html>"])
def test_empty_files_and_older_ones_may_be_replaced(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.html").write_bytes(content)
    check_output(tmp_path / "a.html", "html", option="--html")


@pytest.mark.parametrize(("name", "message"), [("x" * 300, "255 bytes"), ("pipe", "pipe"), ("folder", "folder")])
def test_what_is_no_file_is_refused(tmp_path: Path, name: str, message: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    with pytest.raises(ExportError, match=message):
        check_output(tmp_path / name, "html", option="--html")


def test_devices_are_refused() -> None:
    for device in ("/dev/null", "/dev/full"):
        with pytest.raises(ExportError, match="device"):
            check_output(Path(device), "html", option="--html")


def test_a_link_is_followed_and_stays(tmp_path: Path) -> None:
    (tmp_path / "link.html").symlink_to("real.html")
    replace_file(tmp_path / "link.html", b"<html>")
    assert (tmp_path / "link.html").is_symlink()
    assert (tmp_path / "real.html").read_bytes() == b"<html>"


def test_the_demo_keeps_a_map_that_holds_more(tmp_path: Path) -> None:
    kitchen.make_kitchen(tmp_path / "map.db")
    kitchen_truth.write_kitchen_truth(tmp_path / "truth.json")
    with closing(sqlite3.connect(tmp_path / "map.db")) as connection, connection:
        connection.execute("UPDATE traversal SET start_ns = 1, end_ns = 2, mapped_ns = 2 WHERE number = 1")
    with pytest.raises(MemoryStoreError, match=r"holds more than would be built anew: .*move the map away"):
        remove_old_map(tmp_path)
    assert (tmp_path / "map.db").exists()


def test_a_map_in_use_is_not_removed(tmp_path: Path) -> None:
    kitchen.make_kitchen(tmp_path / "map.db")
    kitchen_truth.write_kitchen_truth(tmp_path / "truth.json")
    with open_store(str(tmp_path / "map.db")), pytest.raises(MemoryStoreError, match="another build"):
        remove_old_map(tmp_path)
    assert (tmp_path / "map.db").exists()


def test_a_simulation_overwrites_no_real_recording(tmp_path: Path) -> None:
    (tmp_path / "monday.mcap").write_bytes(RECORDING)
    refused = supermap("simulate", "demo", "--out", tmp_path, "--overwrite", "--seconds", "1")
    assert isinstance(refused.exception, (ExportError, SimulationError)), refused.output
    assert (tmp_path / "monday.mcap").read_bytes() == RECORDING
