"""`supermap show`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from supermap_cli.errors import QueryError
from supermap_cli.memory import open_store
from supermap_cli.types.memory import MapDelta
from support import kitchen
from support import memories as m
from support.cli import document, supermap


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")


def test_the_overview_holds_what_is_there_now(db: Path) -> None:
    shown = document("show", "show", "--db", db)
    assert shown["counts"]["chair"] == 2
    assert "cup-1" not in [instance["id"] for instance in shown["instances"]]
    assert shown["absent"] == 1
    assert [traversal["name"] for traversal in shown["traversals"]] == ["monday", "tuesday"]
    printed = supermap("show", "--db", db).stdout
    assert "8 objects" in printed
    assert "dining-table-1" in printed


def test_one_object_is_shown_with_its_relations(db: Path) -> None:
    shown = document("object", "show", "vase-1", "--db", db)
    assert [relation["stored_as"] for relation in shown["relations"]] == ["on(vase-1, dining-table-1)"]
    assert shown["evidence"]["observation_count"] == 3
    assert "on" in supermap("show", "VASE-1", "--db", db).stdout


def test_an_unknown_id_is_an_error(db: Path) -> None:
    error = supermap("show", "piano-1", "--db", db).exception
    assert isinstance(error, QueryError)
    assert "supermap show" in str(error)


@pytest.mark.parametrize("at", ["monday", "09:10", "2026-01-04T00:00:00Z", "tuesday"])
def test_the_past_is_shown_by_the_published_schemas(db: Path, at: str) -> None:
    shown = document("show", "show", "--at", at, "--db", db)
    instances = [*shown["instances"], *shown["unknown"]]
    assert {instance["standing"]["presence"] for instance in instances} <= {"present", "unknown"}
    assert document("object", "show", "cup-1", "--at", at, "--db", db)["standing"]["words"]


def test_show_at_lists_unknown_presence(db: Path) -> None:
    printed = supermap("show", "--at", "09:10", "--db", db).stdout
    assert "5 objects as of 2026-01-05T09:10:00.0Z" in printed
    assert "4 of which nobody can say" in printed
    assert "left between" in supermap("show", "cup-1", "--at", "09:10", "--db", db).stdout


def test_a_shifted_clock_is_shown(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("tuesday", (50, 100), MapDelta(keyframes=m.keyframes([60]))))
    assert "shifted" not in supermap("show", "--db", path).stdout
    with open_store(str(path), create=True) as store:
        start = replace(m.start("monday", (180, 280)), clock_shift_ns=180 * 10**9)
        store.finish_traversal(store.begin_traversal(start))
    shown = document("show", "show", "--db", path)
    assert [traversal["clock_shift_ns"] for traversal in shown["traversals"]] == [0, 180 * 10**9]
    for command in (("show",), ("db", "info")):
        printed = supermap(*command, "--db", path).stdout
        assert "monday@2026-01-05T09:00:00.0Z" in printed
        assert "+ 3 min" in printed
        assert "the order of building is kept" in printed
    assert document("db_info", "db", "info", "--db", path)["traversals"][1]["clock_shift_ns"] == 180 * 10**9
