"""No question scans a large table: the query plans of all its statements are checked."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from sqlalchemy import Engine, event

from supermap_cli.costs.memory.synthetic_memory import make_memory
from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.answers import answer
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.query.details import details, details_at
from supermap_cli.query.diff import diff
from supermap_cli.query.inventory import inventory
from supermap_cli.query.object_history import object_history
from supermap_cli.query.overview import overview, overview_at
from supermap_cli.query.time_points import TimePoint, parse_time_point

pytestmark = pytest.mark.sqlite_only("reads SQLite's query plans")

LARGE = {"keyframe", "instance", "observation", "state", "visit", "spatial_edge", "temporal_edge"}

QUESTIONS = (
    *("piano", "piano-1", "chairs", "how many chairs", "everything", "is there a piano last", "chairs first"),
    *("piano earlier", "chairs at 2026-02-10T10:00:00Z", "chairs in day-003", "how many pianos in day-050"),
    *("chair near the piano", "vase on the desk", "desk under the vase", "lamp next to the monitor", "cup on desk-1"),
    *("chair near a desk near a piano", "everything near the piano", "keyboard above the desk earlier"),
    *("how many chairs at 2026-02-10T10:00:00Z", "how many cups on desks", "how many chairs near desks"),
    *("trumpet", "stool", "piano on the globe", "chairs inside the sink", "chair attached to the chair"),
)
ALLOWED = {
    "show": {"instance": "how many stand there of each label is counted: the index of labels holds all that it needs"},
    "db info": dict.fromkeys(
        ("instance", "state", "visit", "spatial_edge", "temporal_edge"),
        "rows are counted, in the smallest index; keyframes and observations are not, of which there are most",
    ),
    "everything": {"instance": "how many there are at all"},
}
"""Scans that are allowed, and why."""


@pytest.fixture(scope="module")
def memory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("building") / "map.db"
    make_memory(path, 400, 12, seed=1, progress=lambda _: None)
    return path


def plans(path: Path, ask: Callable[[MapReader], object]) -> Iterator[tuple[str, str]]:
    """Every plan step of every statement that a question issues, with the statement."""
    issued = []

    def note(_connection, _cursor, statement, parameters, *_):  # type: ignore[no-untyped-def]
        issued.append((statement, parameters))

    event.listen(Engine, "before_cursor_execute", note)
    try:
        with open_store(str(path), read_only=True) as store, store.reader() as reader:
            ask(reader)
            event.remove(Engine, "before_cursor_execute", note)
            for statement, parameters in issued:
                if statement.lstrip().upper().startswith(("SELECT", "WITH")):
                    explained = reader.connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}", parameters)
                    yield from ((row.detail, statement) for row in explained)
    finally:
        if event.contains(Engine, "before_cursor_execute", note):
            event.remove(Engine, "before_cursor_execute", note)


def scanned(path: Path, ask: Callable[[MapReader], object]) -> dict[str, str]:
    """The large tables that are scanned, with the plan step and statement."""
    found = {}
    for detail, statement in plans(path, ask):
        if (scan := re.match(r"SCAN (?:TABLE )?(\w+)", detail)) is None:
            continue
        name = scan.group(1)
        aliased = re.search(rf"(\w+) AS {name}\b", statement)
        table = aliased.group(1) if aliased else name
        if table in LARGE or (table == "state_box" and not re.search(r"INDEX (1:|2:\w+)", detail)):
            found[table] = f"{detail} in {statement}"
    return found


def day(reader: MapReader, name: str) -> tuple[TimePoint, Clock]:
    clock = clock_of(reader)
    return parse_time_point(name, reader, clock), clock


@pytest.mark.parametrize("few", [0, 100])
@pytest.mark.parametrize("text", QUESTIONS)
def test_no_question_scans_a_large_table(memory: Path, text: str, few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("supermap_cli.query.relation_matching.DIRECT_READ_LIMIT", few)
    found = scanned(memory, lambda reader: answer(text, reader))
    assert {table: how for table, how in found.items() if table not in ALLOWED.get(text, {})} == {}


@pytest.mark.parametrize(
    ("name", "ask"),
    [
        ("show", overview),
        ("show at", lambda reader: overview_at(reader, *day(reader, "day-003"))),
        ("show ID", lambda reader: details(reader, "desk-3")),
        ("show ID at", lambda reader: details_at(reader, "desk-3", *day(reader, "day-003"))),
        ("history", lambda reader: object_history(reader, "chair-1")),
        ("diff", diff),
        ("diff of two", lambda reader: diff(reader, "day-001", "day-005")),
        ("db info", inventory),
    ],
)  # fmt: skip
def test_no_command_scans_a_large_table(memory: Path, name: str, ask: Callable[[MapReader], object]) -> None:
    found = scanned(memory, ask)
    assert {table: how for table, how in found.items() if table not in ALLOWED.get(name, {})} == {}


def test_scans_are_detected(memory: Path) -> None:
    assert scanned(memory, lambda reader: reader.instances).keys() == {"instance"}
    assert "observation" in scanned(
        memory, lambda reader: reader.connection.exec_driver_sql("SELECT avg(score) FROM observation").all()
    )


def test_places_are_found_by_the_index_of_boxes(memory: Path) -> None:
    steps = [detail for detail, _ in plans(memory, lambda reader: answer("chair attached to the chair", reader))]
    assert any(re.search(r"VIRTUAL TABLE INDEX 2:\w+", detail) for detail in steps)


def test_times_are_found_by_an_index(memory: Path) -> None:
    steps = [detail for detail, _ in plans(memory, lambda reader: answer("chairs at 2026-02-10T10:00:00Z", reader))]
    assert any("ix_instance_label_presence_last_seen_ns" in detail for detail in steps)
    steps = [detail for detail, _ in plans(memory, lambda reader: answer("chairs in day-003", reader))]
    assert any("visit" in detail and "traversal_id=?" in detail for detail in steps)
