"""Texts that would break out of their line (names, labels that are printed), and outputs that are no files."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from supermap_cli.commands.common import out
from supermap_cli.errors import ConfigError, ExportError
from supermap_cli.memory.names import checked_name, traversal_name
from support import kitchen
from support.cli import supermap


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")


@pytest.mark.parametrize(
    "name", ["a\nerror: fake", "a\r", "\x1b[2J", "a\tb", "a\u2028b", "a\u202eb", "", "  ", "é" * 128]
)
def test_a_traversal_is_named_in_one_short_line(name: str, tmp_path: Path) -> None:
    refused = supermap("build", "run.mcap", "--name", name, "--db", tmp_path / "map.db").exception
    assert isinstance(refused, ConfigError)
    assert "--name" in str(refused)
    assert not (tmp_path / "map.db").exists()


def test_a_name_of_255_bytes_is_one() -> None:
    assert checked_name("a" * 255) == "a" * 255
    assert checked_name("Küche 1, 厨房") == "Küche 1, 厨房"


def test_a_recording_whose_name_holds_a_line_end_gives_one_line() -> None:
    assert traversal_name("a\nerror: fake.mcap", ()) == "a\\nerror: fake"


@pytest.mark.parametrize(
    "command", [("show",), ("query", "chairs"), ("diff",), ("db", "info"), ("db", "merge", "b.db")]
)
def test_a_database_that_is_given_has_a_name(command: tuple[str, ...]) -> None:
    refused = supermap(*command, "--db", "").exception
    assert isinstance(refused, ConfigError)
    assert "--db names nothing" in str(refused)


def test_a_text_is_printed_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    out().print("\n1 chair\r\nerror: fake, 2 cups", markup=False)
    assert capsys.readouterr().out == "\n1 chair\\x0d\\nerror: fake, 2 cups\n"


@pytest.mark.parametrize("kind", ["json", "geojson", "ply", "csv"])
def test_an_export_into_a_pipe_or_device_is_refused_at_once(db: Path, tmp_path: Path, kind: str) -> None:
    reading, writing = os.pipe()
    link = tmp_path / "stdout"
    link.symlink_to(f"/proc/self/fd/{writing}")
    try:
        for path in (link, Path("/dev/null")):
            refused = supermap("export", "--db", db, "--format", kind, "--out", path).exception
            assert isinstance(refused, ExportError)
            assert "a device or a pipe" in str(refused)
            assert "--force" not in str(refused)
    finally:
        os.close(reading)
        os.close(writing)
