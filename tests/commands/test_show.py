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


def test_an_id_whose_word_is_no_longer_the_label_says_so(tmp_path: Path) -> None:
    first = m.instance(1, "keyboard", seen=(1, 9), observations=0)
    delta = MapDelta(instances=(first,), states=(m.state(1, 0, (1, 9), label="keyboard"),))
    renamed = MapDelta(instances=(replace(first, label="dining table"),))
    path = m.make_memory(tmp_path / "map.db", ("a", (0, 10), delta), ("b", (100, 110), renamed))
    assert "keyboard-1, now dining table" in supermap("show", "--db", path).stdout
    assert "keyboard-1, now dining table" in supermap("show", "keyboard-1", "--db", path).stdout


def test_what_is_doubted_is_shown_with_what_speaks_for_and_against_it(tmp_path: Path) -> None:
    chair = m.instance(1, "chair", seen=(1, 9), presence="doubted", observations=0)
    delta = MapDelta(instances=(chair,), states=(m.state(1, 0, (1, 9)),), visits=(m.visit(1, 5, 9),))
    path = m.make_memory(tmp_path / "map.db", ("a", (0, 10), delta))
    assert [instance["id"] for instance in document("show", "show", "--db", path)["doubted"]] == ["chair-1"]
    printed = supermap("show", "--db", path).stdout
    assert "1 doubted" in printed
    assert "found in 5 of 9 keyframes" in printed


def test_several_detectors_are_told_apart(tmp_path: Path) -> None:
    chair = m.instance(1, "chair", seen=(1, 109), observations=2)
    path = tmp_path / "map.db"
    with open_store(str(path), create=True) as store:
        for since, detector, label in ((0, "strong", "chair"), (100, "weak", "bench")):
            traversal_id = store.begin_traversal(
                replace(m.start(detector, (since, since + 10)), config={"detector": detector})
            )
            seen = MapDelta(keyframes=m.keyframes([since + 5]), observations=(m.observation(1, since + 5, label),))
            store.commit(traversal_id, MapDelta(instances=(chair,), states=(m.state(1, 0, (1, 109)),)))
            store.commit(traversal_id, replace(seen, visits=(m.visit(1, 1, 1),)))
            store.finish_traversal(traversal_id)
    shown = document("object", "show", "chair-1", "--db", path)
    assert [(view["detector"], view["label"]) for view in shown["called"]] == [("strong", "chair"), ("weak", "bench")]
    assert "chair in strong (by strong); bench in weak (by weak)" in supermap("show", "chair-1", "--db", path).stdout
    assert "read by strong in strong, by weak in weak" in supermap("history", "chair-1", "--db", path).stdout
