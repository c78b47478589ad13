"""`supermap export`: the content of each format, read back by independent readers, and protection of files."""

from __future__ import annotations

import csv
import json
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from plyfile import PlyData

from supermap_cli.errors import ExportError, QueryError
from supermap_cli.exporting import parquet_tables
from supermap_cli.geometry.boxes import polygon_area_m2
from supermap_cli.geometry.open3d_loader import load_open3d
from supermap_cli.memory import reading, streaming
from supermap_cli.types.memory import MapDelta
from supermap_schema.json_schemas import load_schema
from support import kitchen, large_memories
from support import memories as m
from support.cli import supermap


@pytest.fixture
def db(tmp_path: Path) -> Path:
    return kitchen.make_kitchen(tmp_path / "map.db")


def export(db: Path, out: Path | str, *options: str) -> None:
    result = supermap("export", "--db", db, "--out", out, *options)
    assert result.exit_code == 0, result.output or repr(result.exception)


def document(db: Path, *options: str) -> Any:
    result = supermap("export", "--db", db, "--out", "-", "--format", "json", *options)
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    Draft202012Validator(load_schema("export")).validate(found)
    return found


def plan(db: Path, *options: str) -> dict[str, Any]:
    """Features by id."""
    result = supermap("export", "--db", db, "--out", "-", "--format", "geojson", *options)
    assert result.exit_code == 0, result.output
    return {feature["id"]: feature for feature in json.loads(result.stdout)["features"]}


def cloud(path: Path) -> tuple[Any, dict[int, str], dict[int, str]]:
    """Vertices, ids by number and labels by index, read by plyfile."""
    read = PlyData.read(path)
    words = [comment.split() for comment in read.comments]
    ids = {int(words[1]): words[2] for words in words if words[0] == "instance" and words[3] == "label"}
    labels = {int(words[1]): " ".join(words[2:]) for words in words if words[0] == "label"}
    return read["vertex"].data, ids, labels


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


# JSON


def test_the_document_is_the_whole_memory(db: Path) -> None:
    found = document(db, "--observations")
    assert [traversal["name"] for traversal in found["traversals"]] == ["monday", "tuesday"]
    assert {instance["id"] for instance in found["instances"]} == {
        *("dining-table-1", "cup-1", "chair-1", "chair-2", "tv-1", "potted-plant-1", "book-1", "vase-1", "lamp-1")
    }
    chair = next(instance for instance in found["instances"] if instance["id"] == "chair-1")
    assert [interval["position"] for interval in chair["intervals"]] == [[0.0, 1.0, 0.5], [-3.0, 3.0, 0.5]]
    assert [visit["traversal"] for visit in chair["visits"]] == ["monday", "tuesday"]
    assert {edge["kind"] for edge in found["temporal_edges"]} == {"disappeared", "moved", "appeared", "candidate"}
    assert len(found["spatial_edges"]) == 4
    assert len(found["keyframes"]) == 6
    assert len(found["observations"]) == 39
    assert "observations" not in document(db)


def test_a_document_of_a_label_has_what_belongs_to_it(db: Path) -> None:
    found = document(db, "--observations", "--label", "Chair")
    assert {instance["id"] for instance in found["instances"]} == {"chair-1", "chair-2"}
    assert {observation["id"] for observation in found["observations"]} == {"chair-1", "chair-2"}
    assert [edge["kind"] for edge in found["temporal_edges"]] == ["moved"]
    assert found["spatial_edges"] == []


def test_a_document_of_a_traversal_has_what_it_saw(db: Path) -> None:
    found = document(db, "--observations", "--traversal", "tuesday")
    assert "book-1" not in {instance["id"] for instance in found["instances"]}
    assert {observation["traversal"] for observation in found["observations"]} == {"tuesday"}
    assert [traversal["name"] for traversal in found["traversals"]] == ["tuesday"]
    chair = next(instance for instance in found["instances"] if instance["id"] == "chair-1")
    assert [interval["state"] for interval in chair["intervals"]] == [1]


def test_merged_instances_are_exported_under_the_merged_id(tmp_path: Path) -> None:
    delta = MapDelta(
        keyframes=m.keyframes([1, 2]),
        instances=(m.instance(1, "cup"), m.instance(2, "cup", merged_into=1), m.instance(3, "cup", merged_into=2)),
        observations=(m.observation(1, 1, "cup"), m.observation(3, 2, "cup")),
        states=(m.state(1, 0, (1, 2), label="cup"),),
        visits=(m.visit(1, 1, 2, 0, (1, 1)), m.visit(3, 1, 2, 0, (2, 2))),
    )
    found = document(m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta)), "--observations")
    assert [observation["id"] for observation in found["observations"]] == ["cup-1", "cup-1"]
    (cup,) = found["instances"]
    (visit,) = cup["visits"]
    assert (visit["supported"], visit["first_support_ns"], visit["last_support_ns"]) == (2, m.ns(1), m.ns(2))


# GeoJSON


def test_the_plan_has_present_objects_and_trajectories(db: Path) -> None:
    found = plan(db)
    objects = {key: feature for key, feature in found.items() if feature["properties"]["kind"] == "object"}
    assert set(objects) == {
        *("dining-table-1#0", "chair-1#1", "chair-2#0", "tv-1#0", "potted-plant-1#0", "book-1#0", "vase-1#0"),
        "lamp-1#0",
    }
    (ring,) = objects["dining-table-1#0"]["geometry"]["coordinates"]
    assert ring[0] == ring[-1]
    assert polygon_area_m2(np.array(ring[:-1])) == pytest.approx(1.9 * 0.9)
    (ax, ay), (bx, by) = np.diff(ring, axis=0)[:2]
    assert ax * by - ay * bx > 0, "RFC 7946: an outer ring goes counter-clockwise"
    table = objects["dining-table-1#0"]["properties"]
    assert (table["z_min"], table["z_max"], table["presence"]) == (0.0, 0.75, "present")
    assert (table["first_seen"], table["first_seen_ns"]) == ("2026-01-05T09:00:01.0Z", m.ns(1))
    assert found["trajectory monday"]["geometry"]["type"] == "LineString"
    assert len(found["trajectory monday"]["geometry"]["coordinates"]) == 3


def test_a_plan_of_all_has_a_feature_for_every_place(db: Path) -> None:
    found = plan(db, "--all")
    assert found["chair-1#0"]["properties"]["presence"] == "ended"
    assert found["cup-1#0"]["properties"]["presence"] == "absent"


def test_a_plan_says_that_it_is_in_metres(db: Path) -> None:
    printed = json.loads(supermap("export", "--db", db, "--out", "-", "--format", "geojson").stdout)
    assert printed["type"] == "FeatureCollection"
    assert printed["crs"] is None
    assert printed["supermap"]["unit"] == "m"


def test_a_traversal_of_one_keyframe_is_a_point(tmp_path: Path) -> None:
    db = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta(keyframes=(m.keyframe(1, x=2.5),))))
    assert plan(db)["trajectory monday"]["geometry"] == {"type": "Point", "coordinates": [2.5, 0.0]}


# PLY


@pytest.mark.parametrize("options", [(), ("--ascii",)], ids=["binary", "ascii"])
def test_the_cloud_reads_back_with_what_each_point_is_of(db: Path, tmp_path: Path, options: tuple[str, ...]) -> None:
    export(db, tmp_path / "cloud.ply", *options)
    vertices, ids, labels = cloud(tmp_path / "cloud.ply")
    assert set(ids.values()) == {
        *("dining-table-1", "chair-1", "chair-2", "tv-1", "potted-plant-1", "book-1", "vase-1", "lamp-1")
    }
    of_tv = vertices[[ids[number] == "tv-1" for number in vertices["instance"]]]
    assert {labels[index] for index in of_tv["label"]} == {"tv"}
    centres = (m.voxels().keys + 0.5) * m.voxels().voxel_m
    np.testing.assert_allclose(np.column_stack([of_tv[axis] for axis in "xyz"]), centres, atol=1e-4)
    assert {tuple(rgb) for rgb in of_tv[["red", "green", "blue"]].tolist()} == {(128, 128, 128)}
    np.testing.assert_allclose(of_tv["voxel_size"], 0.02, rtol=1e-5)


@pytest.mark.parametrize("options", [(), ("--ascii",)], ids=["binary", "ascii"])
def test_open3d_reads_the_cloud(db: Path, tmp_path: Path, options: tuple[str, ...]) -> None:
    export(db, tmp_path / "cloud.ply", *options)
    read = load_open3d().io.read_point_cloud(str(tmp_path / "cloud.ply"))
    vertices, *_ = cloud(tmp_path / "cloud.ply")
    expected = np.column_stack([vertices[axis] for axis in "xyz"])
    np.testing.assert_allclose(np.asarray(read.points), expected, atol=1e-6)
    np.testing.assert_allclose(np.asarray(read.colors), 128 / 255, atol=1e-3)


def test_an_earlier_state_is_a_shifted_shape_with_a_comment(db: Path, tmp_path: Path) -> None:
    export(db, tmp_path / "cloud.ply", "--all", "--label", "chair")
    read = PlyData.read(tmp_path / "cloud.ply")
    moved = [comment for comment in read.comments if comment.startswith("instance 3 state 0")]
    assert moved == ["instance 3 state 0 is its newest shape shifted by 3.0000 -2.0000 0.0000"]
    x = read["vertex"]["x"][read["vertex"]["instance"] == kitchen.CHAIR]
    np.testing.assert_allclose(x[:3] - x[3:], 3.0, atol=1e-5)


# Tables


def test_the_tables_hold_names_instead_of_numbers_and_times_in_words(db: Path, tmp_path: Path) -> None:
    export(db, tmp_path / "tables", "--format", "csv")
    states = {(row["id"], row["state"]): row for row in rows(tmp_path / "tables" / "states.csv")}
    chair = states["chair-1", "0"]
    assert (chair["presence"], chair["gone"], chair["gone_ns"]) == ("ended", "2026-01-05T09:16:41.0Z", str(m.ns(1001)))
    assert (states["chair-1", "1"]["gone"], states["chair-1", "1"]["x"]) == ("", "-3.0")
    observations = rows(tmp_path / "tables" / "observations.csv")
    assert len(observations) == 39
    assert {observation["traversal"] for observation in observations} == {"monday", "tuesday"}
    assert json.loads(observations[0]["hypotheses"]) == [["dining table", 0.8], ["other", pytest.approx(0.2)]]


def test_where_the_clock_was_never_set_times_have_no_words(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(m, "EPOCH_S", 5)
    delta = MapDelta(instances=(m.instance(1, "cup"),), states=(m.state(1, 0, (1, 2)),), keyframes=(m.keyframe(1),))
    export(m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta)), tmp_path / "tables", "--format", "csv")
    (state,) = rows(tmp_path / "tables" / "states.csv")
    assert (state["first_seen_ns"], state["first_seen"]) == ("6000000000", "")


def test_parquet_and_csv_say_the_same(db: Path, tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    export(db, tmp_path / "csv", "--format", "csv")
    export(db, tmp_path / "parquet", "--format", "parquet")
    for path in (tmp_path / "csv").iterdir():
        table = pq.read_table(tmp_path / "parquet" / f"{path.stem}.parquet")
        read = [{name: "" if cell is None else str(cell) for name, cell in row.items()} for row in table.to_pylist()]
        assert read == rows(path), path.stem
        for name in table.column_names:
            if name.endswith("_ns"):
                assert str(table.schema.field(name).type) == "int64"


def test_parquet_without_pyarrow_says_how_to_get_it(db: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    result = supermap("export", "--db", db, "--format", "parquet", "--out", tmp_path / "tables")
    assert isinstance(result.exception, ExportError)
    assert "supermap-cli[parquet]" in str(result.exception)
    assert [path.name for path in tmp_path.iterdir() if "tables" in path.name] == []


# Files (see test_destination.py)


def test_existing_files_are_kept_without_force(db: Path, tmp_path: Path) -> None:
    out = tmp_path / "plan.geojson"
    out.write_text("mine")
    assert isinstance(supermap("export", "--db", db, "--out", out).exception, ExportError)
    assert out.read_text() == "mine"
    assert isinstance(supermap("export", "--db", db, "--out", out, "--force").exception, ExportError)
    assert out.read_text() == "mine"
    out.unlink()
    export(db, out)
    export(db, out, "--force")
    assert json.loads(out.read_text())["type"] == "FeatureCollection"


def test_a_folder_with_other_things_is_never_replaced(db: Path, tmp_path: Path) -> None:
    out = tmp_path / "tables"
    export(db, out, "--format", "csv")
    export(db, out, "--format", "csv", "--force", "--label", "chair")
    assert {row["label"] for row in rows(out / "instances.csv")} == {"chair"}
    (out / "thesis.tex").write_text("mine")
    assert isinstance(supermap("export", "--db", db, "--out", out, "--format", "csv", "--force").exception, ExportError)
    assert (out / "thesis.tex").read_text() == "mine"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--label", "piano"), "nothing labelled 'piano'"),
        (("--traversal", "sunday"), "no traversal 'sunday'"),
        (("--at", "noon"), "neither a time nor a traversal"),
        (("--at", "1", "--traversal", "monday"), "at once"),
    ],
)
def test_what_the_map_does_not_know_is_an_error(
    db: Path, tmp_path: Path, options: tuple[str, ...], message: str
) -> None:
    result = supermap("export", "--db", db, "--out", tmp_path / "a.json", *options)
    assert isinstance(result.exception, QueryError)
    assert message in str(result.exception)
    assert not (tmp_path / "a.json").exists()


@pytest.mark.parametrize(
    "options",
    [
        ("--out", "thing.xyz"),
        ("--out", "-", "--format", "ply"),
        ("--out", "a.json", "--ascii"),
        ("--out", "a.ply", "--observations"),
    ],
)
def test_wrong_usage_is_exit_code_2(db: Path, options: tuple[str, ...]) -> None:
    assert supermap("export", "--db", db, *options).exit_code == 2


# Size


@pytest.mark.sqlite_only("blows an SQLite file up")
@pytest.mark.parametrize(
    "options",
    [
        ("--format", "json", "--observations"),
        ("--format", "geojson"),
        ("--format", "ply"),
        ("--format", "csv"),
        ("--format", "parquet"),
        ("--format", "json", "--at", "monday"),
        ("--format", "csv", "--at", "monday", "--label", "box"),
        ("--format", "ply", "--at", "monday"),
    ],
    ids=lambda options: "-".join(options[1::2]),
)
def test_what_an_export_holds_in_memory_does_not_grow_with_the_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...]
) -> None:
    monkeypatch.setattr(parquet_tables, "CHUNK", 50)
    monkeypatch.setattr(streaming, "FETCHED", 50)
    monkeypatch.setattr(reading, "BATCH", 50)
    peaks = []
    for index, size in enumerate((20, 200, 1000)):  # the first one imports
        db = large_memories.grow(kitchen.make_kitchen(tmp_path / f"{size}.db"), size)
        tracemalloc.start()
        export(db, tmp_path / f"{index}.out", *options)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # All of what is added would be 3 MB; Python keeps up to 1 MB of small things that it has done with.
    assert peaks[2] - peaks[1] < 1_000_000, peaks
