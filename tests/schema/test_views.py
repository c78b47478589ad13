"""The views for people: readable names and times, one row for each thing, fast on a large map."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text

from supermap_cli.memory import open_store
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.types.memory import MapDelta
from supermap_schema.views import VIEW_NAMES
from support import kitchen
from support import memories as m


def history() -> MapDelta:
    """A chair that moves, and one thing of every presence."""
    return MapDelta(
        keyframes=(m.keyframe(1, x=2.5), m.keyframe(8)),
        instances=(
            m.instance(1, "chair", (4, 2, 0.5)),
            m.instance(2, "dining table", (5, 5, 0.5)),
            m.instance(3, "cup", (5, 5, 1.0)),
            m.instance(4, "cup", (5, 5, 1.0), merged_into=3),
            m.instance(5, "book", presence="absent"),
            m.instance(6, "vase", presence="doubted"),
        ),
        states=(
            m.state(1, 0, (1, 2), (1, 2, 0.5), gone=5, empty_before=0.5),
            m.state(1, 1, (6, 8), (4, 2, 0.5)),
            m.state(2, 0, (1, 8), (5, 5, 0.5), label="dining table"),
            m.state(3, 0, (1, 8), (5, 5, 1.0), label="cup"),
            m.state(4, 0, (2, 3), (5, 5, 1.0), label="cup"),
            m.state(5, 0, (1, 1), gone=7, label="book"),
            m.state(6, 0, (1, 1), label="vase"),
        ),
        visits=(m.visit(1, 2, 2, 0, (1, 8)), m.visit(2, 2, 2, 0, (1, 8)), m.visit(3, 2, 2, 0, (1, 8))),
        spatial_edges=(m.spatial(3, "on", 2, 1), m.spatial(3, "near", 1, 6), m.spatial(1, "beside", 2, 1, 5)),
        temporal_edges=(
            m.temporal("appeared", (1, None), (1, 0), 0.5, 1),
            m.temporal("disappeared", (1, 0), (1, 0), 2, 5),  # superseded: it was found elsewhere
            m.temporal("moved", (1, 0), (1, 1), 5, 6, distance_m=3.00049),
            m.temporal("persisted", (2, 0), (2, 0), 1, 8),
            m.temporal("merged", (4, 0), (3, 0), 3, 3),
            m.temporal("disappeared", (5, 0), (5, 0), 1, 7),
        ),
    )


@pytest.fixture
def memory(tmp_path: Path) -> Path:
    return m.make_memory(tmp_path / "map.db", ("monday", (0, 10), history()))


def rows(path: Path, sql: str) -> list[dict[str, Any]]:
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        return [dict(row._mapping) for row in reader.connection.execute(text(sql))]


def test_every_present_object_is_one_row_with_what_it_stands_on(memory: Path) -> None:
    found = rows(memory, "SELECT * FROM current_objects ORDER BY id")
    assert [(row["id"], row["stands"]) for row in found] == [
        ("chair-1", None),
        ("cup-1", "on dining-table-1"),
        ("dining-table-1", None),
    ]
    chair = found[0]
    assert (chair["x"], chair["y"], chair["z"], chair["confidence"]) == (4.0, 2.0, 0.5, 0.9)
    assert (chair["first_traversal"], chair["last_traversal"]) == ("monday", "monday")
    assert (chair["since"], chair["since_ns"]) == ("2026-01-05T09:00:06.0Z", m.ns(6))


def test_the_last_traversal_is_the_last_that_saw_it(tmp_path: Path) -> None:
    db = kitchen.make_kitchen(tmp_path / "map.db")
    found = {row["id"]: row["last_traversal"] for row in rows(db, "SELECT * FROM current_objects")}
    assert (found["chair-1"], found["book-1"], found["lamp-1"]) == ("tuesday", "monday", "tuesday")


def test_a_history_says_how_every_state_ended(memory: Path) -> None:
    found = rows(memory, "SELECT * FROM object_history")
    assert [(row["id"], row["state_index"], row["presence"]) for row in found] == [
        ("chair-1", 0, "ended"),
        ("chair-1", 1, "present"),
        ("dining-table-1", 0, "present"),
        ("cup-1", 0, "present"),
        ("cup-2", 0, "merged"),
        ("book-1", 0, "absent"),
        ("vase-1", 0, "doubted"),
    ]
    assert (found[1]["moved_m"], found[0]["moved_m"], found[4]["merged_into"]) == (3.0, None, "cup-1")
    assert (found[0]["gone"], found[0]["empty_before"], found[1]["gone"]) == (
        "2026-01-05T09:00:05.0Z",
        "2026-01-05T09:00:00.5Z",
        None,
    )


def test_changes_say_from_where_to_where(memory: Path) -> None:
    columns = "kind, id, from_x, from_y, to_x, to_y, distance_m, from_id, not_before, not_after"
    found = [tuple(row.values()) for row in rows(memory, f"SELECT {columns} FROM changes")]
    assert [row[:8] for row in found] == [
        ("appeared", "chair-1", None, None, 1.0, 2.0, None, "chair-1"),
        ("merged", "cup-1", 5.0, 5.0, 5.0, 5.0, None, "cup-2"),
        ("moved", "chair-1", 1.0, 2.0, 4.0, 2.0, 3.0, "chair-1"),
        ("disappeared", "book-1", 0.0, 0.0, None, None, None, "book-1"),
    ]
    assert found[2][8:] == ("2026-01-05T09:00:05.0Z", "2026-01-05T09:00:06.0Z")


def test_relations_name_both_ends_and_when(memory: Path) -> None:
    found = rows(memory, "SELECT * FROM relations ORDER BY since_ns, subject")
    assert [(row["subject"], row["relation"], row["object"], row["until"]) for row in found] == [
        ("chair-1", "beside", "dining-table-1", "2026-01-05T09:00:05.0Z"),
        ("cup-1", "on", "dining-table-1", None),
        ("cup-1", "near", "chair-1", None),
    ]


def test_the_trajectory_says_where_the_robot_was(memory: Path) -> None:
    found = [tuple(row.values()) for row in rows(memory, "SELECT traversal, at, x, y, z FROM trajectory")]
    assert found[0] == ("monday", "2026-01-05T09:00:01.0Z", 2.5, 0.0, 0.0)


@pytest.fixture(params=[m.EPOCH_S, 5], ids=["wall time", "clock never set"])
def told(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Iterator[tuple[Path, Clock]]:
    """A memory and its clock."""
    monkeypatch.setattr(m, "EPOCH_S", request.param)
    memory = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), history()))
    with open_store(str(memory), read_only=True) as store, store.reader() as reader:
        yield memory, clock_of(reader)


@pytest.mark.parametrize("view", VIEW_NAMES)
def test_times_are_told_as_the_program_tells_them(told: tuple[Path, Clock], view: str) -> None:
    memory, clock = told
    for row in rows(memory, f"SELECT * FROM {view}"):
        pairs = {name.removesuffix("_ns"): value for name, value in row.items() if name.endswith("_ns")}
        for name, stamp_ns in pairs.items():
            shown = row["at" if name == "stamp" else name]
            assert shown == (None if stamp_ns is None else clock.text(stamp_ns))


@pytest.mark.sqlite_only("reads SQLite's query plans")
@pytest.mark.parametrize(
    "sql",
    [
        "SELECT * FROM current_objects WHERE id = 'chair-1'",
        "SELECT * FROM object_history WHERE id = 'chair-1'",
        "SELECT * FROM changes WHERE id = 'chair-1'",
        "SELECT * FROM relations WHERE subject = 'chair-1'",
        "SELECT * FROM trajectory WHERE traversal = 'monday'",
    ],
)
def test_a_view_of_one_thing_reads_no_table_as_a_whole(memory: Path, sql: str) -> None:
    with closing(sqlite3.connect(memory)) as connection:
        plan = [row[3] for row in connection.execute(f"EXPLAIN QUERY PLAN {sql}")]
    scans = [step for step in plan if step.startswith("SCAN") and "SCAN traversal" not in step]
    assert scans == [], plan


@pytest.mark.sqlite_only("reads SQLite's query plans")
@pytest.mark.parametrize("view", VIEW_NAMES)
def test_a_whole_view_looks_every_neighbour_up(memory: Path, view: str) -> None:
    """At most one table is read as a whole, and the least start of the few traversals."""
    with closing(sqlite3.connect(memory)) as connection:
        plan = [row[3] for row in connection.execute(f"EXPLAIN QUERY PLAN SELECT * FROM {view}")]
    scans = [step for step in plan if step.startswith("SCAN") and "SCAN traversal" not in step]
    assert len(scans) <= 1, plan
