"""`supermap bench memory`, and the memories that it makes up."""

from __future__ import annotations

import sqlite3
from collections import Counter
from contextlib import closing
from pathlib import Path

import pytest

from supermap_cli.commands.bench_memory import parse_two_sizes
from supermap_cli.costs.memory import report
from supermap_cli.costs.memory.question_cost import QuestionJob, measure_question
from supermap_cli.costs.memory.questions import questions
from supermap_cli.costs.memory.rooms import INSTANCES_PER_RARE_CLASS, RARE_CLASSES, room_count
from supermap_cli.costs.memory.synthetic_memory import WrittenCounts, make_memory
from supermap_cli.costs.memory.traversals import KEYFRAMES_PER_ROOM, ROOMS_OF_SHORT_TRAVERSAL, plan_traversals
from supermap_cli.errors import ConfigError, EvaluationError
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from support.cli import document, supermap

OBJECTS, TRAVERSALS = 400, 24


def make(path: Path, seed: int = 2, objects: int = OBJECTS) -> WrittenCounts:
    return make_memory(path, objects, TRAVERSALS, seed, progress=lambda _: None)


@pytest.fixture(scope="module")
def memory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("memory") / "map.db"
    make(path)
    return path


def rows(path: Path, statement: str) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(path)) as connection:
        return connection.execute(statement).fetchall()


def test_a_made_up_memory_keeps_every_invariant(memory):
    with open_store(str(memory), read_only=True) as store, store.reader() as reader:
        assert check(reader) == []


def test_it_has_everything_that_a_memory_can_have(memory):
    for statement in (
        "SELECT 1 FROM state WHERE state_index > 0",
        "SELECT 1 FROM instance WHERE merged_into IS NOT NULL",
        "SELECT 1 FROM instance WHERE presence = 'absent'",
        "SELECT 1 FROM spatial_edge WHERE relation = 'on'",
        "SELECT 1 FROM temporal_edge WHERE kind = 'moved'",
        "SELECT 1 FROM observation WHERE crop_jpeg IS NOT NULL",
    ):
        assert rows(memory, statement), statement


def test_common_things_grow_with_it_and_rare_ones_do_not(memory, tmp_path):
    make(tmp_path / "larger.db", objects=3 * OBJECTS)
    few, many = (
        Counter(dict(rows(path, "SELECT label, count(*) FROM instance GROUP BY label")))
        for path in (memory, tmp_path / "larger.db")
    )
    assert (
        {few[label] for label in RARE_CLASSES} == {many[label] for label in RARE_CLASSES} == {INSTANCES_PER_RARE_CLASS}
    )
    assert many["chair"] == pytest.approx(3 * few["chair"], rel=0.1)
    (small,), (large,) = (
        rows(path, "SELECT (max(x) - min(x)) * (max(y) - min(y)) FROM instance")
        for path in (memory, tmp_path / "larger.db")
    )
    assert large[0] == pytest.approx(3 * small[0], rel=0.3)


def test_the_same_seed_makes_the_same_memory(memory, tmp_path):
    make(tmp_path / "again.db")
    make(tmp_path / "other.db", seed=3)
    seen = "SELECT instance_number, keyframe_id, score, x, y, z FROM observation ORDER BY id"
    assert rows(memory, seen) == rows(tmp_path / "again.db", seen)
    assert rows(memory, seen) != rows(tmp_path / "other.db", seen)


def test_the_first_and_the_last_traversals_are_short_and_all_rooms_are_seen():
    planned = plan_traversals(100, room_count(20_000))
    lengths = [len(traversal.rooms) for traversal in planned]
    assert lengths[:2] == lengths[-2:] == [ROOMS_OF_SHORT_TRAVERSAL] * 2
    assert min(lengths[2:-2]) > ROOMS_OF_SHORT_TRAVERSAL
    visits = Counter(room for traversal in planned for room in traversal.rooms)
    assert len(visits) == room_count(20_000)
    assert sum(visits.values()) / len(visits) * KEYFRAMES_PER_ROOM == pytest.approx(100, rel=0.05)


@pytest.mark.parametrize(
    "question", questions(plan_traversals(TRAVERSALS, room_count(OBJECTS))), ids=lambda question: question.text
)
def test_every_question_can_be_asked(memory, monkeypatch, question):
    monkeypatch.setattr("supermap_cli.costs.memory.question_cost.MAX_REPEATS", 1)
    run = measure_question(QuestionJob(db=memory, command=question.command, arguments=question.arguments))
    assert min(run.first_ms, run.again_ms) > 0
    assert run.listed > 0 or question.kind in {"no such label", "inside", "attached", "beside"}


def test_every_kind_of_command_is_asked():
    planned = questions(plan_traversals(100, 56))
    assert {question.command for question in planned} == {"query", "show", "history", "diff", "db info", "db sql"}
    assert {question.bound for question in planned} == {"fixed", "listed", "grows"}
    assert len({question.text for question in planned}) == len(planned)


def test_both_memories_are_made_asked_and_kept(tmp_path, monkeypatch):
    chosen = [
        question
        for question in questions(plan_traversals(6, room_count(60)))
        if question.text in {"query piano", "db info"}
    ]
    monkeypatch.setattr(report, "questions", lambda _: chosen)
    arguments = ("bench", "memory", "--instances", "60,180", "--traversals", "6", "--folder", tmp_path)
    found = document("bench_memory", *arguments)
    assert (found["small"]["instances"], found["large"]["instances"]) == (60, 180)
    assert found["small"]["made_s"] > 0
    assert [row["question"] for row in found["questions"]] == ["query piano", "db info"]
    for row in found["questions"]:
        assert row["ratio"] == pytest.approx(row["large"]["again_ms"] / row["small"]["again_ms"])
    assert found["worst_ratio"] == max(row["ratio"] for row in found["questions"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["memory-180-6-0.db", "memory-60-6-0.db"]
    monkeypatch.setattr(report, "questions", lambda _: chosen[:1])
    result = supermap(*arguments)
    assert result.exit_code == 0, result.output
    for words in ("was there", "query piano", "worst ratio", "fixed: the answer is as large in both memories"):
        assert words in result.stdout


def test_a_disk_that_is_too_small_is_an_error_before_anything_is_made(tmp_path):
    with pytest.raises(EvaluationError, match="GB are needed"):
        report.check_disk_space(tmp_path, [10**12])


@pytest.mark.parametrize("text", ["", "1000", "1000,1000", "2000,1000", "1,2,3", "a,b"])
def test_anything_but_a_small_and_a_large_number_is_an_error(text):
    with pytest.raises(ConfigError, match="write"):
        parse_two_sizes(text)
