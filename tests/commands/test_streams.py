"""Streams that are closed, full or gone; errors as JSON; what recordings and maps hold does nothing to a terminal."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from support import databases, kitchen
from support.cli import supermap

COMMAND = [sys.executable, "-c", "from supermap_cli.main import main; main()"]
HOSTILE = "cup\x1b[2J\x07\u202e"


@pytest.fixture
def db(tmp_path: Path) -> Path:
    kitchen.make_kitchen(tmp_path / "map.db")
    return tmp_path / "map.db"


def shell(line: str, db: Path) -> subprocess.CompletedProcess[str]:
    command = ["bash", "-c", line, "bash", *COMMAND]
    environment = {**os.environ, "SUPERMAP_DB": databases.place(db)}
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, env=environment)


@pytest.mark.parametrize("command", ["show", "show --json", "db sql 'SELECT * FROM object_history' --json", "db info"])
def test_a_full_disk_behind_stdout_is_one_line(db: Path, command: str) -> None:
    done = shell(f'"$@" {command} > /dev/full', db)
    assert done.returncode == 1
    what = "the output cannot be written: No space left on device (stdout)"
    assert done.stderr == f"error: {what}: free space, or send it elsewhere\n"


def test_a_closed_stdout_is_one_line(db: Path) -> None:
    done = shell('"$@" show >&-', db)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert done.stderr.startswith("error: the output cannot be written")


def test_a_reader_that_has_gone_is_no_error(db: Path) -> None:
    done = shell('"$@" export --format json --out - | head -c 1; echo " ${PIPESTATUS[0]}"', db)
    assert done.stderr == ""
    assert done.stdout.split()[-1] in {"0", "141"}


@pytest.mark.parametrize("command", ["show", "show nothing-1", "query chair"])
def test_without_stderr_commands_work(db: Path, command: str) -> None:
    with_it, without = (shell(f'"$@" {command} {end}', db) for end in ("", "2>&-"))
    assert (without.returncode, without.stdout) == (with_it.returncode, with_it.stdout)


@pytest.mark.parametrize("line", ['"$@" show nothing-1 --json --json-errors', '"$@" --json-errors show nothing-1'])
def test_errors_are_json_where_asked(db: Path, line: str) -> None:
    done = shell(line, db)
    assert (done.returncode, done.stdout) == (1, "")
    error = json.loads(done.stderr)["error"]
    assert error["exit_code"] == 1
    assert "nothing-1" in error["message"]


@pytest.mark.parametrize(
    ("line", "about"),
    [
        ("build --json-errors", "recordings"),
        ("build run.mcap --rate x --json-errors", "--rate"),
        ("--json-errors build --nothing", "--nothing"),
        ("nonsense --json-errors", "nonsense"),
        ("show --limit 0 --json-errors", "--limit"),
        ("--json-errors", "command"),
    ],
)
def test_a_usage_that_is_not_understood_is_one_json_object(line: str, about: str, db: Path) -> None:
    done = shell(f'"$@" {line}', db)
    assert (done.returncode, done.stdout) == (2, "")
    error = json.loads(done.stderr)["error"]
    assert (error["type"], error["exit_code"]) == ("UsageError", 2)
    assert about in error["what"]
    assert "--help" in error["cure"]


def test_json_is_printed_whole_or_not_at_all(db: Path) -> None:
    failing = 'SELECT json(value) FROM json_each(\'["1", "{"]\')'
    result = supermap("db", "sql", failing, "--json", "--db", db)
    assert result.exception is not None
    assert result.stdout == ""


@pytest.mark.sqlite_only("writes behind the program's back")
@pytest.mark.parametrize("command", [("show",), ("show", "cup-1"), ("query", "cup"), ("history", "cup-1"), ("diff",)])
def test_labels_do_nothing_to_a_terminal(db: Path, command: tuple[str, ...]) -> None:
    databases.run_sql(
        db,
        f"""DROP TRIGGER instance_label_update; UPDATE instance SET label = '{HOSTILE}' WHERE label = 'cup';
            UPDATE state SET label = '{HOSTILE}' WHERE label = 'cup';
            UPDATE traversal SET name = 'x{HOSTILE}' WHERE number = 1;""",
    )
    result = supermap(*command, "--db", db)
    told = result.output + str(result.exception or "")
    assert not {"\x1b", "\x07", "\u202e"} & set(result.output), told


@pytest.mark.sqlite_only("writes behind the program's back")
def test_cells_are_no_formulas_and_numbers_stay_numbers(db: Path, tmp_path: Path) -> None:
    databases.run_sql(db, "UPDATE state SET label = '=1+1' WHERE id = 1; UPDATE state SET x = -1.5 WHERE id = 1;")
    assert supermap("export", "--format", "csv", "--out", tmp_path / "out", "--db", db).exit_code == 0
    with (tmp_path / "out" / "states.csv").open(encoding="utf-8", newline="") as file:
        first = next(csv.DictReader(file))
    assert (first["label"], first["x"]) == ("'=1+1", "-1.5")
