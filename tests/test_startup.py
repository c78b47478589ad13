"""Start-up is light, and errors end at one boundary: `supermap_cli.main.main`."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from support import kitchen

HEAVY = ("open3d", "onnxruntime", "cv2", "rosbags", "kiss_icp", "scipy", "matplotlib", "trackeval", "psycopg")

RUN_AND_TELL = f"""
import sys
from supermap_cli.main import main
try:
    main()
finally:
    print("heavy:", *sorted(set({HEAVY!r}) & set(sys.modules)))
"""

WITH_A_BUG = """
import supermap_cli.query.answers
from supermap_cli.main import main

def answer(*_, **__):
    raise RuntimeError("a bug of ours")

supermap_cli.query.answers.answer = answer
main()
"""


def run(program: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """A Python program in a process of its own, with arguments as the command line has them."""
    return subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        stdin=subprocess.DEVNULL,
    )


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")


@pytest.mark.parametrize(
    "arguments",
    [
        *(("--version",), ("--help",), ("plugins",)),
        *((command, "--help") for command in ("build", "query", "simulate", "eval", "bench", "demo", "config", "db")),
    ],
    ids=" ".join,
)
def test_help_and_plugins_import_nothing_heavy(arguments):
    done = run(RUN_AND_TELL, *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1] == "heavy:"


@pytest.mark.parametrize(
    "arguments",
    [
        ("query", "chair near plant"),
        ("query", "how many cups", "--json"),
        ("show",),
        ("show", "chair-1"),
        ("history", "chair-1"),
        ("diff",),
        ("db", "info"),
        ("export", "--out", "-", "--format", "json"),
        ("db", "sql", "SELECT id FROM current_objects"),
    ],
    ids=" ".join,
)
def test_reading_the_map_imports_nothing_heavy(db, arguments):
    done = run(RUN_AND_TELL, *arguments, "--db", db)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1] == "heavy:"


def test_the_version_is_that_of_the_distribution():
    assert run(RUN_AND_TELL, "--version").stdout.splitlines()[0] == f"supermap {version('supermap-cli')}"


def test_what_the_user_can_mend_is_one_line_on_stderr_and_exit_code_1(tmp_path):
    missing = tmp_path / "missing.db"
    done = run("from supermap_cli.main import main; main()", "query", "chair", "--db", missing)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"error: there is no map database ({missing}): make one with `supermap build`\n"


def test_wrong_usage_is_exit_code_2():
    done = run("from supermap_cli.main import main; main()", "query", "--no-such-option")
    assert (done.returncode, done.stdout) == (2, "")
    assert "No such option" in done.stderr


def test_a_bug_shows_its_traceback(db):
    done = run(WITH_A_BUG, "query", "chair", "--db", db)
    assert done.returncode == 1
    assert done.stderr.startswith("Traceback (most recent call last):")
    assert done.stderr.endswith("RuntimeError: a bug of ours\n")


def test_the_number_of_blas_threads_is_settled_before_numpy_is_loaded() -> None:
    told = run("import sys; import supermap_cli.main; print('numpy' in sys.modules)")
    assert told.stdout.strip() == "False"
