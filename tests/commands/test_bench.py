"""`supermap bench`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from supermap_cli.commands import bench
from supermap_cli.commands.bench_numbers import parse_objects
from supermap_cli.costs.report import MAPPING_STAGES, read_bench
from supermap_cli.errors import ConfigError, EvaluationError, SupermapError
from support import synthetic_room as room
from support.cli import document, supermap


@pytest.fixture(autouse=True)
def in_an_empty_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("room") / "room.mcap"
    room.write_room_recording(path, seconds=2.0)
    return path


@pytest.fixture(scope="module")
def earlier(recording: Path) -> Path:
    """The document of one measurement, with 3 and 30 objects in the map."""
    printed = document("bench", "bench", recording, "--objects", "3,30")
    path = recording.with_name("earlier.json")
    path.write_text(json.dumps(printed), encoding="utf-8")
    return path


def test_the_document_says_what_a_build_costs(earlier):
    found = json.loads(earlier.read_text(encoding="utf-8"))
    assert found["keyframes"] > 0
    assert found["objects"] > 0
    assert {stage["stage"] for stage in found["stages"] if stage["kind"] == "mapping"} == set(MAPPING_STAGES)
    assert sum(stage["share"] for stage in found["stages"]) == pytest.approx(1)
    mapping_s = sum(stage["total_s"] for stage in found["stages"] if stage["kind"] == "mapping")
    floor = found["floor"]
    assert floor["mapping_ms"] == pytest.approx(1000 * mapping_s / found["keyframes"])
    assert floor["ratio"] == pytest.approx(floor["mapping_ms"] / floor["decode_ms"])
    assert floor["peak_memory_mb"] < found["build"]["peak_memory_mb"]
    assert found["build"]["database_mb"] > 0
    assert {rate["module"]: rate["paper_hz"] for rate in found["rates"]} == {
        "pose": 10,
        "map": 3,
        "segmentation": 1,
        "graph": 5,
    }
    assert found["compared"] is None


def test_the_map_is_filled_up_with_copies(earlier):
    few, many = json.loads(earlier.read_text(encoding="utf-8"))["growth"]
    assert (few["wanted"], many["wanted"]) == (3, 30)
    assert few["keyframes"] == many["keyframes"] > 0
    assert few["objects"] < 30 <= many["objects"]


def test_figures_are_set_against_earlier_ones(recording, earlier, tmp_path):
    printed = document("bench", "bench", recording, "--end", "1", "--compare", earlier)
    changes = {change["figure"]: change for change in printed["compared"]["changes"]}
    then = json.loads(earlier.read_text(encoding="utf-8"))
    assert printed["compared"]["document"] == str(earlier)
    peak = changes["peak memory, MB"]
    assert (peak["then"], peak["now"]) == (then["build"]["peak_memory_mb"], printed["build"]["peak_memory_mb"])
    assert peak["ratio"] == pytest.approx(peak["then"] / peak["now"])
    assert "map, mean ms" in changes
    assert list(tmp_path.iterdir()) == []


def test_people_get_tables(monkeypatch, recording, earlier):
    monkeypatch.setattr(bench, "measure", lambda *_: read_bench(earlier))
    result = supermap("bench", recording, "--compare", earlier)
    assert result.exit_code == 0, result.output
    for words in ("visibility   mapping", "the paper's Hz", "mapping / decoding alone", "peak memory", "then / now"):
        assert words in result.stdout


@pytest.mark.parametrize("content", ["", "{}", '{"keyframes": 3}', "[]", "no JSON"])
def test_a_file_that_is_no_such_document_is_refused_before_anything_is_measured(recording, tmp_path, content):
    (tmp_path / "old.json").write_text(content, encoding="utf-8")
    result = supermap("bench", recording, "--compare", "old.json")
    assert isinstance(result.exception, EvaluationError)
    assert "this is no document of `supermap bench --json`" in str(result.exception)
    assert "(old.json)" in str(result.exception)


def test_a_missing_document_is_named(recording):
    result = supermap("bench", recording, "--compare", "gone.json")
    assert isinstance(result.exception, EvaluationError)
    assert "(gone.json)" in str(result.exception)


def test_what_ends_the_measured_process_ends_the_command_as_one_line(tmp_path):
    result = supermap("bench", "missing.mcap")
    assert isinstance(result.exception, SupermapError)
    assert "missing.mcap" in str(result.exception)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("text", "objects"), [(None, ()), ("40", (40,)), ("40, 400,40", (40, 400))])
def test_numbers_of_objects_stand_with_commas(text, objects):
    assert parse_objects(text) == objects


@pytest.mark.parametrize("text", ["", "0", "forty", "40,", "-3"])
def test_anything_else_is_an_error_with_a_cure(text):
    with pytest.raises(ConfigError, match="write --objects 40,400"):
        parse_objects(text)
