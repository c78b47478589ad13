"""`supermap query`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError, QueryError
from supermap_cli.language.refusals import RefusedQuestionError
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
        "what changed since monday",
        "is the cup still on the table",
        "where did the chair go",
        "closest chair to the tv",
        "how far is the chair from the robot",
        "which table has most cups on it",
        "when did you last see the cup",
        "chair-1",
        "cup at 09:10",
    ],
)
def test_answers_follow_the_published_schema(db: Path, question: str) -> None:
    assert document("answer", "query", question, "--db", db)["query"] == question


def test_a_question_is_asked_as_of_a_time(db: Path) -> None:
    found = document("answer", "query", "how many cups", "--at", "09:10", "--db", db)
    assert (found["count"], found["count_at_most"]) == (0, 1)
    assert supermap("query", "how many cups", "--at", "09:10", "--db", db).stdout.startswith(
        "No cups were in the map as of"
    )
    printed = supermap("query", "cup", "--at", "60 s", "--db", db).stdout
    when = "as of 2026-01-05T09:01:00.0Z"
    assert printed.startswith(f"cup-1 stood on dining-table-1, at (0.50, 0.00, 0.80) m {when}.\n")


def test_only_how_many_has_a_count(db: Path) -> None:
    assert document("answer", "query", "how many chairs", "--db", db)["count"] == 2
    assert "count" not in document("answer", "query", "chairs", "--db", db)


def test_nothing_found_is_an_answer(db: Path) -> None:
    assert document("answer", "query", "piano", "--db", db)["instances"] == []
    result = supermap("query", "piano", "--db", db)
    assert (result.exit_code, result.stdout) == (0, "There is no piano in the map.\n")


def test_the_table_says_where_and_why(db: Path) -> None:
    printed = supermap("query", "chair", "near", "plant", "earlier", "--db", db).stdout
    for part in ("chair-1", "0.00 1.00 0.50", "near potted-plant-1 (stored, 0.60 m)", "09:01:30.0Z .. 09:16:41.0Z"):
        assert part in printed


def test_a_question_not_understood_and_a_missing_map_are_errors(db: Path, tmp_path: Path) -> None:
    assert isinstance(supermap("query", "why chairs", "--db", db).exception, QueryError)
    assert isinstance(supermap("query", "chairs", "--db", tmp_path / "no.db").exception, MemoryStoreError)


def test_unknown_words_are_refused_with_the_kind_of_refusal(db: Path) -> None:
    refused = supermap("query", "the quix", "--db", db).exception
    assert isinstance(refused, RefusedQuestionError)
    assert (refused.kind, refused.part) == ("unknown word", "quix")


def test_an_explanation_says_why_each_candidate_was_kept_or_dropped(db: Path) -> None:
    found = document("answer", "query", "chair near tv", "--explain", "--db", db)
    decisions = {(each["id"], each["kept"]) for each in found["explanation"]["candidates"]}
    assert decisions == {("chair-1", False), ("chair-2", True)}
    assert "chair" in found["explanation"]["understood"]


def test_many_questions_are_asked_in_one_session(db: Path) -> None:
    result = supermap("query", "-i", "--db", db, stdin="how many chairs\n\nthe quix\npiano\nquit\nchairs\n")
    assert result.exit_code == 0
    assert result.stdout.splitlines()[0] == "Two chairs are in the map: chair-1 and chair-2."
    assert "There is no piano in the map." in result.stdout
    assert "quix" in result.stderr


@pytest.mark.parametrize("arguments", [(), ("chairs", "-i")])
def test_a_question_or_a_session_is_asked_for(db: Path, arguments: tuple[str, ...]) -> None:
    assert isinstance(supermap("query", *arguments, "--db", db).exception, QueryError)


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
