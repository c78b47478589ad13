"""`supermap query`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError, QueryError
from support import databases, kitchen
from support.cli import document, supermap


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")


@pytest.mark.parametrize(
    "question",
    [
        "chairs",
        "cup",
        "how many chairs",
        "piano",
        "chair near plant earlier",
        "chair near tv",
        "cup in monday",
        "vaze",
        "chair-1",
        "cup at 09:10",
        "chair in nowhere",
    ],
)
def test_answers_follow_the_published_schema(db: Path, question: str) -> None:
    assert document("answer", "query", question, "--db", db)["query"] == question


def test_a_question_is_asked_as_of_a_time(db: Path) -> None:
    found = document("answer", "query", "how many cups", "--at", "09:10", "--db", db)
    assert (found["count"], found["count_at_most"]) == (0, 1)
    assert supermap("query", "how many cups", "--at", "09:10", "--db", db).stdout.startswith("0 (perhaps cup-1)\n")
    printed = supermap("query", "cup", "--at", "60 s", "--db", db).stdout
    assert printed.startswith("cup as of 2026-01-05T09:01:00.0Z: cup-1\n")


def test_only_how_many_has_a_count(db: Path) -> None:
    assert document("answer", "query", "how many chairs", "--db", db)["count"] == 2
    assert "count" not in document("answer", "query", "chairs", "--db", db)


def test_nothing_found_is_an_answer(db: Path) -> None:
    assert document("answer", "query", "piano", "--db", db)["instances"] == []
    result = supermap("query", "piano", "--db", db)
    assert (result.exit_code, result.stdout) == (0, "there is no piano in the map\n")


def test_the_table_says_where_and_why(db: Path) -> None:
    printed = supermap("query", "chair", "near", "plant", "earlier", "--db", db).stdout
    for part in ("chair-1", "0.00 1.00 0.50", "near potted-plant-1 (stored, 0.60 m)", "09:01:30.0Z .. 09:16:41.0Z"):
        assert part in printed


def test_a_question_not_understood_and_a_missing_map_are_errors(db: Path, tmp_path: Path) -> None:
    assert isinstance(supermap("query", "why chairs", "--db", db).exception, QueryError)
    assert isinstance(supermap("query", "chairs", "--db", tmp_path / "no.db").exception, MemoryStoreError)


def test_a_query_imports_nothing_heavy(db: Path) -> None:
    program = (
        "import sys; from supermap_cli.main import make_app;"
        f"make_app()(['query', 'chairs', '--db', {databases.place(db)!r}], standalone_mode=False);"
        "heavy = {'open3d', 'onnxruntime', 'cv2', 'rosbags', 'kiss_icp', 'scipy', 'alembic'};"
        "print('heavy:', sorted(heavy & set(sys.modules)))"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert "chair-2" in result.stdout
    assert "heavy: []" in result.stdout
