"""The database opens as it is in others' tools, while a build is writing, too; the README's SQL does what it says."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import sqlite_utils
from datasette.app import Datasette

from supermap_cli.memory import open_store
from supermap_cli.types.memory import MapDelta
from supermap_schema.views import VIEW_NAMES
from support import kitchen
from support import memories as m
from support.cli import document

README = Path(__file__).parents[1] / "README.md"
SECTION = re.search(r"^## Plain SQL\n(.+?)^## ", README.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
assert SECTION is not None
CHAIRS, MOVED, AT_THE_TABLE = re.findall(r"```sql\n(.+?)```", SECTION[1], re.DOTALL)


@pytest.fixture
def db(tmp_path: Path) -> Path:
    return kitchen.make_kitchen(tmp_path / "map.db")


@pytest.fixture
def building(db: Path) -> Iterator[Path]:
    """The kitchen while a build has committed a part and goes on writing."""
    with open_store(str(db)) as store:
        traversal_id = store.begin_traversal(m.start("wednesday", (2000, 2100)))
        store.commit(traversal_id, MapDelta(keyframes=m.keyframes([2001])))
        with store._writing() as connection:
            connection.exec_driver_sql("UPDATE traversal SET end_ns = end_ns + 1 WHERE name = 'wednesday'")
            yield db


def answer(db: Path, sql: str) -> list[dict[str, Any]]:
    told = document("db_sql", "db", "sql", sql, "--db", db)
    return [dict(zip(told["columns"], row, strict=True)) for row in told["rows"]]


# The README's examples


def test_where_every_chair_is_and_since_when(db: Path) -> None:
    found = answer(db, CHAIRS)
    assert [(row["id"], row["x"], row["since"], row["last_traversal"]) for row in found] == [
        ("chair-2", 4.0, "2026-01-05T09:00:01.0Z", "monday"),
        ("chair-1", -3.0, "2026-01-05T09:16:41.0Z", "tuesday"),
    ]


def test_what_moved_in_the_last_traversal(db: Path) -> None:
    (found,) = answer(db, MOVED)
    assert (found["id"], found["from_x"], found["to_x"], found["distance_m"]) == ("chair-1", 0.0, -3.0, 3.606)
    assert (found["not_before"], found["not_after"]) == ("2026-01-05T09:01:30.0Z", "2026-01-05T09:16:41.0Z")


def test_what_stood_at_the_table_on_monday(db: Path) -> None:
    found = answer(db, AT_THE_TABLE)
    assert [(row["subject"], row["relation"], row["until"]) for row in found] == [
        ("chair-1", "beside", "2026-01-05T09:16:41.0Z"),
        ("cup-1", "on", "2026-01-05T09:16:45.0Z"),
        ("vase-1", "on", None),
    ]


# sqlite-utils


@pytest.mark.sqlite_only("these tools open SQLite files")
def test_sqlite_utils_reads_tables_and_views_and_searches_labels(db: Path) -> None:
    with closing(sqlite_utils.Database(db)) as opened:
        assert set(opened.view_names()) == set(VIEW_NAMES)
        assert opened["instance"].count == 9
        assert opened["instance"].pks == ["number"]
        chairs = list(opened["current_objects"].rows_where("label = ?", ["chair"], order_by="id"))
        assert [row["id"] for row in chairs] == ["chair-1", "chair-2"]
        assert [row["id"] for row in opened["instance_label"].search("tables")] == ["dining-table-1"]
        assert {key.other_table for key in opened["observation"].foreign_keys} == {"keyframe", "instance"}


@pytest.mark.sqlite_only("these tools open SQLite files")
def test_sqlite_utils_reads_while_a_build_is_writing(building: Path) -> None:
    with closing(sqlite_utils.Database(building)) as opened:
        assert opened["current_objects"].count == 8


# datasette


def served(db: Path, *paths: str) -> list[Any]:
    """What datasette answers, asked in this process."""

    async def ask() -> list[Any]:
        client = Datasette([str(db)]).client
        answers = [await client.get(path) for path in paths]
        assert [answer.status_code for answer in answers] == [200] * len(paths), [
            answer.text[:200] for answer in answers
        ]
        return [answer.json() if ".json" in path else answer.text for answer, path in zip(answers, paths, strict=True)]

    return asyncio.run(ask())


@pytest.mark.sqlite_only("these tools open SQLite files")
@pytest.mark.parametrize("state", ["db", "building"])
def test_datasette_serves_every_view(state: str, request: pytest.FixtureRequest) -> None:
    db = request.getfixturevalue(state)
    counts = {"current_objects": 8, "object_history": 10, "changes": 4, "relations": 4}
    found = served(db, *(f"/map/{view}.json?_shape=array" for view in VIEW_NAMES))
    assert {view: len(rows) for view, rows in zip(VIEW_NAMES, found, strict=True) if view in counts} == counts
    assert found[VIEW_NAMES.index("trajectory")][0]["at"] == "2026-01-05T09:00:01.0Z"


@pytest.mark.sqlite_only("these tools open SQLite files")
def test_datasette_filters_searches_and_shows_pages(db: Path) -> None:
    chairs, searched, page, own = served(
        db,
        "/map/current_objects.json?label=chair&_shape=array",
        "/map/instance_label.json?_search=tables&_shape=array",
        "/map/current_objects?label=chair",
        "/map.json?_shape=array&sql=SELECT+id+FROM+current_objects+WHERE+stands+LIKE+'on+%25'",
    )
    assert [row["id"] for row in chairs] == ["chair-1", "chair-2"]
    assert [row["id"] for row in searched] == ["dining-table-1"]
    assert "chair-2" in page
    assert own == [{"id": "vase-1"}]
