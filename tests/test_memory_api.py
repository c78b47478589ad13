"""`supermap_cli.open`: the answers of the command line as typed values."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import supermap_cli as supermap
from supermap_cli.errors import MemoryStoreError, QueryError
from supermap_cli.language.questions import Count, Named, Question, Things
from supermap_cli.query.views import to_document
from support import kitchen
from support.cli import supermap as command


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("api") / "kitchen.db")


@pytest.fixture(scope="module")
def memory(db: Path) -> Iterator[supermap.Memory]:
    with supermap.open(str(db)) as opened:
        yield opened


def printed(*arguments: str | Path) -> Any:
    result = command(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_answers_are_those_of_the_command_line(memory: supermap.Memory, db: Path) -> None:
    asked = (
        (memory.query("what is on the table"), ("query", "what is on the table")),
        (memory.query("cup", at="monday"), ("query", "cup", "--at", "monday")),
        (memory.overview(limit=50), ("show",)),
        (memory.show("chair-1"), ("show", "chair-1")),
        (memory.history("cup-1"), ("history", "cup-1")),
        (memory.diff("monday", "tuesday"), ("diff", "monday", "tuesday")),
    )
    for value, arguments in asked:
        assert to_document(value) == printed(*arguments, "--db", db), arguments


def test_a_typed_question_is_a_value_or_its_json(memory: supermap.Memory) -> None:
    typed = Question("chairs", Count(Things(Named("chair", "chairs"))))
    as_json = {"kind": "Count", "things": {"kind": "Things", "noun": {"kind": "Named", "name": "chair"}}}
    assert memory.ask_typed(typed).count == memory.ask_typed(as_json).count == memory.query("how many chairs").count


@pytest.mark.parametrize("relation", ["flies over", ""])
def test_a_relation_that_there_is_none_of_is_refused(memory: supermap.Memory, relation: str) -> None:
    things = {"kind": "Things", "noun": {"kind": "Named", "name": "cup"}}
    condition = {"kind": "Related", "relation": relation, "reference": things}
    with pytest.raises(QueryError, match="there is no relation"):
        memory.ask_typed({"kind": "Find", "things": {**things, "condition": condition}})


def test_objects_are_all_that_stand(memory: supermap.Memory) -> None:
    assert {each.id for each in memory.objects()} == {each.id for each in memory.overview(limit=1000).instances}
    assert "cup-1" in {each.id for each in memory.objects(at="monday")}
    assert "cup-1" not in {each.id for each in memory.objects()}


def test_what_changed_since(memory: supermap.Memory) -> None:
    in_words, by_name = memory.query("what changed since monday"), memory.changes_since("monday")
    assert by_name.changes == in_words.changes
    with pytest.raises(QueryError, match="there are"):
        memory.changes_since("friday")


def test_the_graph_has_the_relations_that_hold(memory: supermap.Memory) -> None:
    graph = memory.graph()
    assert graph.has_edge("vase-1", "dining-table-1", key="on")
    assert not graph.has_edge("cup-1", "dining-table-1", key="on")  # it was taken away
    assert graph.nodes["cup-1"]["presence"] == "absent"
    assert graph.nodes["tv-1"]["x"] == 5.0
    assert memory.graph(at="monday").has_edge("cup-1", "dining-table-1", key="on")


def test_tables_are_those_of_the_export(memory: supermap.Memory, db: Path, tmp_path: Path) -> None:
    result = command("export", "--db", db, "--format", "csv", "--out", tmp_path / "tables")
    assert result.exit_code == 0, result.output
    for name in ("instances", "states", "spatial_edges", "traversals"):
        frame = memory.to_pandas(name)
        lines = (tmp_path / "tables" / f"{name}.csv").read_text().splitlines()
        assert ",".join(frame.columns) == lines[0]
        assert len(frame) == len(lines) - 1
    with pytest.raises(QueryError, match="instances"):
        memory.to_pandas("songs")


def test_without_the_library_the_extra_is_named(memory: supermap.Memory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "networkx", None)
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(QueryError, match=r"supermap-cli\[graph\]"):
        memory.graph()
    with pytest.raises(QueryError, match=r"supermap-cli\[pandas\]"):
        memory.to_pandas()


def test_a_missing_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MemoryStoreError, match="supermap build"):
        supermap.open(str(tmp_path / "none.db"))
