"""Plans, 3D scenes, graphs and the table of objects, read back by the libraries that people open them with."""

from __future__ import annotations

import csv
import json
import struct
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import cv2
import networkx as nx
import numpy as np
import pydot
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.drawing.colours import colour_of
from supermap_cli.drawing.label_places import Name, place_names
from supermap_cli.drawing.map_plan import MapPlan, PlanThing
from supermap_cli.drawing.observed_floor import observed_floor
from supermap_cli.drawing.plan_picture import plan_picture
from supermap_cli.exporting.plan import map_plan
from supermap_cli.exporting.selection import PRESENT, ExportSource, select_part
from supermap_cli.memory import open_store
from supermap_cli.types.memory import KeyframeRecord, MapDelta
from support import kitchen
from support import memories as m
from support.cli import supermap

HOSTILE = "=cmd|'/c calc'!A0 <b>&\"$x^2$\\N {} \x07 ; -> 椅子"

KEPT = HOSTILE.replace("\x07", "\ufffd")
"""What the memory keeps of it."""


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")


@pytest.fixture(scope="module")
def hostile_db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    delta = MapDelta(
        keyframes=m.keyframes([1, 2]),
        instances=(m.instance(1, HOSTILE), m.instance(2, "cup", (2, 0, 0.5))),
        states=(m.state(1, 0, (1, 2), label=HOSTILE), m.state(2, 0, (1, 2), (2, 0, 0.5), label="cup")),
        spatial_edges=(m.spatial(1, "near", 2, 1),),
    )
    return m.make_memory(tmp_path_factory.mktemp("hostile") / "map.db", ("monday", (0, 10), delta))


def export(db: Path, out: Path, *options: str) -> Path:
    result = supermap("export", "--db", db, "--out", out, *options)
    assert result.exit_code == 0, result.output or repr(result.exception)
    return out


def texts_of(svg: Path) -> set[str | None]:
    elements = ET.fromstring(svg.read_text(encoding="utf-8"))  # noqa: S314 - made by the test
    return {element.text for element in elements.iter("{http://www.w3.org/2000/svg}text")}


def plan_of(db: Path, **part: Any) -> MapPlan:
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        return map_plan(ExportSource(reader, select_part(reader, **part)))


# Plans


def test_a_plan_shows_what_stands_what_changed_and_where_the_robot_went(db: Path) -> None:
    plan = plan_of(db, presences=PRESENT)
    standing = {(thing.id, thing.standing) for thing in plan.things}
    assert {("chair-1", "present"), ("chair-1", "ended"), ("cup-1", "absent"), ("lamp-1", "present")} <= standing
    changes = {(change.kind, change.id) for change in plan.changes}
    assert changes == {("disappeared", "cup-1"), ("moved", "chair-1"), ("appeared", "vase-1")}
    moved = next(change for change in plan.changes if change.kind == "moved")
    np.testing.assert_allclose([moved.start, moved.end], [[0, 1], [-3, 3]])
    assert [(way.traversal, len(way.points)) for way in plan.ways] == [("monday", 3), ("tuesday", 3)]


def test_a_plan_of_a_time_shows_what_was_known_then(db: Path) -> None:
    plan = plan_of(db, at="monday", presences=frozenset({"present", "unknown"}))
    assert {thing.id for thing in plan.things} == {
        *("dining-table-1", "cup-1", "chair-1", "chair-2", "tv-1", "potted-plant-1", "book-1", "vase-1", "lamp-1")
    } - {thing.id for thing in plan.things if thing.standing == "absent"} - {"vase-1"}
    assert not plan.changes
    assert [way.traversal for way in plan.ways] == ["monday"]


def test_the_svg_has_the_ids_as_text(db: Path, tmp_path: Path) -> None:
    assert {"chair-1", "dining-table-1", "cup-1", "lamp-1"} <= texts_of(export(db, tmp_path / "plan.svg"))


def test_the_png_is_a_picture_with_colours(db: Path, tmp_path: Path) -> None:
    picture = cv2.imread(str(export(db, tmp_path / "plan.png", "--traversal", "tuesday")))
    assert picture.shape[1] == 1800
    assert len(np.unique(picture[::5, ::5].reshape(-1, 3), axis=0)) > 30


def test_the_same_map_gives_the_same_svg(db: Path, tmp_path: Path) -> None:
    first, second = (export(db, tmp_path / name).read_bytes() for name in ("a.svg", "b.svg"))
    assert first == second


def test_an_empty_map_has_an_empty_plan(tmp_path: Path) -> None:
    db = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta()))
    assert export(db, tmp_path / "plan.svg").stat().st_size > 1000


def test_floor_is_seen_where_rays_ended_or_passed(tmp_path: Path) -> None:
    """A camera 1 m above the floor looks along x at a wall 2 m ahead."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], (0, 0, 1.0)
    record = KeyframeRecord(m.ns(1), T, T, m.CAMERA, m.DEPTH_PNG, 8, None, detected=True)
    db = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta(keyframes=(record,))))
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        floor = observed_floor(reader)
    assert floor is not None
    rows, columns = np.nonzero(floor.structure)
    x, y = floor.low[0] + (columns + 0.5) * floor.cell_m, floor.low[1] + (rows + 0.5) * floor.cell_m
    np.testing.assert_allclose(x, 2.0, atol=floor.cell_m)
    assert np.ptp(y) > 1.5
    free_x = floor.low[0] + (np.nonzero(floor.free)[1] + 0.5) * floor.cell_m
    assert 0.2 < free_x.min() < 0.5
    assert 1.6 < free_x.max() < 2.0


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 300), st.floats(0, 300), st.floats(4, 60)), min_size=1, max_size=25))
def test_names_never_cover_each_other_and_stay_on_the_picture(things: list[tuple[float, float, float]]) -> None:
    names = [Name(np.array([x, y]), np.array([6.0, 6.0]), np.array([width / 2, 4.0])) for x, y, width in things]
    size = np.array([300.0, 300.0])
    placed = [
        (*(at - name.text_half), *(at + name.text_half))
        for name, at in zip(names, place_names(names, size), strict=True)
        if at is not None
    ]
    for number, (x0, y0, x1, y1) in enumerate(placed):
        assert min(x0, y0) >= 0
        assert max(x1, y1) <= 300
        for u0, v0, u1, v1 in placed[:number]:
            assert min(x1, u1) <= max(x0, u0) or min(y1, v1) <= max(y0, v0)


def test_a_thousand_things_are_drawn_and_the_largest_named() -> None:
    corners = np.array([[0, 0], [0.4, 0], [0.4, 0.4], [0, 0.4]])
    things = [PlanThing(f"chair-{n}", "chair", corners + np.array([n % 40, n // 40]), "present") for n in range(1000)]
    text = plan_picture(MapPlan("hall", things), "svg").decode()
    assert 100 <= text.count(">chair-") <= 250


# Scenes


def test_the_scene_has_a_box_and_points_for_each_thing(db: Path, tmp_path: Path) -> None:
    scene = trimesh.load(export(db, tmp_path / "scene.glb"))
    transform, name = scene.graph["dining-table-1 box"]
    box = scene.geometry[name].copy()
    box.apply_transform(transform)
    box.merge_vertices(merge_norm=True)
    np.testing.assert_allclose(box.extents[[0, 1, 2]], (1.9, 0.75, 0.9), atol=1e-6)  # y up
    assert box.is_volume, "faces look outwards"
    assert box.volume == pytest.approx(1.9 * 0.75 * 0.9)
    transform, name = scene.graph["tv-1 points"]
    points = trimesh.transform_points(scene.geometry[name].vertices, transform)
    x, y, z = ((m.voxels().keys + 0.5) * m.voxels().voxel_m).T
    np.testing.assert_allclose(points, np.column_stack([x, z, -y]), atol=1e-5)


def test_nodes_of_the_scene_say_what_they_are(db: Path, tmp_path: Path) -> None:
    content = export(db, tmp_path / "scene.glb", "--all").read_bytes()
    length, kind = struct.unpack_from("<II", content, 12)
    assert kind == 0x4E4F534A
    assert struct.unpack_from("<I", content, 8) == (len(content),)
    nodes = {node.get("name"): node for node in json.loads(content[20 : 20 + length])["nodes"]}
    assert nodes["cup-1"]["extras"]["presence"] == "absent"
    assert nodes["chair-1#0"]["extras"]["presence"] == "ended"
    assert nodes["chair-1"]["extras"]["first_seen_ns"] == str(m.ns(1))


@pytest.mark.parametrize("suffix", ["ply", "glb"])
def test_points_in_the_colour_of_their_instance(db: Path, tmp_path: Path, suffix: str) -> None:
    path = export(db, tmp_path / f"scene.{suffix}", "--colours", "instance", "--label", "tv")
    read = trimesh.load(path)
    cloud = read if suffix == "ply" else read.geometry[read.graph["tv-1 points"][1]]
    rgb = np.asarray(cloud.colors)[:, :3].astype(float)
    expected = np.array(colour_of("tv-1"), float)
    if suffix == "glb":  # linear light
        expected = 255 * np.where(expected <= 10, expected / 255 / 12.92, ((expected / 255 + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(rgb, np.broadcast_to(expected, rgb.shape), atol=1)


# Graphs


def test_networkx_reads_the_graph_with_both_kinds_of_edges(db: Path, tmp_path: Path) -> None:
    graph = nx.read_graphml(export(db, tmp_path / "graph.graphml"), force_multigraph=True)
    assert (graph.nodes["chair-1"]["label"], graph.nodes["chair-1"]["x"]) == ("chair", -3.0)
    edges = {(a, b, data["layer"], data["kind"]): data for a, b, data in graph.edges(data=True)}
    assert set(edges) == {
        ("cup-1", "dining-table-1", "spatial", "on"),
        ("chair-1", "potted-plant-1", "spatial", "near"),
        ("chair-1", "dining-table-1", "spatial", "beside"),
        ("vase-1", "dining-table-1", "spatial", "on"),
        ("cup-1", "cup-1", "temporal", "disappeared"),
        ("chair-1", "chair-1", "temporal", "moved"),
        ("vase-1", "vase-1", "temporal", "appeared"),
        ("cup-1", "vase-1", "temporal", "candidate"),
    }
    moved = edges["chair-1", "chair-1", "temporal", "moved"]
    assert (moved["distance_m"], moved["confidence"]) == (pytest.approx(13**0.5), pytest.approx(0.85))
    assert edges["cup-1", "dining-table-1", "spatial", "on"]["until_ns"] == m.ns(1005)


def test_a_graph_of_a_time_has_the_relations_that_held(db: Path, tmp_path: Path) -> None:
    graph = nx.read_graphml(export(db, tmp_path / "graph.graphml", "--at", "monday"), force_multigraph=True)
    assert {data["kind"] for *_, data in graph.edges(data=True)} == {"on", "near", "beside"}


def test_graphviz_text_has_what_stands_now(db: Path, tmp_path: Path) -> None:
    (graph,) = pydot.graph_from_dot_file(str(export(db, tmp_path / "graph.dot")))
    names = {node.get_name().strip('"') for node in graph.get_nodes()}
    assert {"chair-1", "vase-1"} <= names
    assert "cup-1" not in names
    edges = {(e.get_source().strip('"'), e.get_destination().strip('"'), e.get_label()) for e in graph.get_edges()}
    assert ("vase-1", "dining-table-1", '"on"') in edges
    assert ("chair-1", "chair-1", '"moved 3.6 m"') in edges


# Labels that are no words


def test_hostile_labels_stay_text_in_every_format(hostile_db: Path, tmp_path: Path) -> None:
    shown = texts_of(export(hostile_db, tmp_path / "plan.svg"))
    graph = nx.read_graphml(export(hostile_db, tmp_path / "graph.graphml"))
    (ours,) = (data for _, data in graph.nodes(data=True) if data["label"] != "cup")
    assert ours["label"] == KEPT
    (dot,) = pydot.graph_from_dot_file(str(export(hostile_db, tmp_path / "graph.dot")))
    assert len(dot.get_edges()) == 1
    scene = trimesh.load(export(hostile_db, tmp_path / "scene.glb"))
    assert len([name for name in scene.graph.nodes_geometry if str(name).endswith(" box")]) == 2
    with export(hostile_db, tmp_path / "objects.csv").open(newline="", encoding="utf-8") as file:
        labels = {row["label"] for row in csv.DictReader(file)}
    assert labels == {"'" + KEPT, "cup"}
    assert "cup-2" in shown or "cup-1" in shown


# The table of objects, and files in the way


def test_a_csv_file_is_the_table_of_what_stands_now(db: Path, tmp_path: Path) -> None:
    with export(db, tmp_path / "objects.csv").open(newline="") as file:
        found = {row["id"]: row for row in csv.DictReader(file)}
    assert "cup-1" not in found
    assert (found["chair-1"]["x"], found["chair-1"]["first_seen"]) == ("-3.0", "2026-01-05T09:00:01.0Z")
    printed = supermap("export", "--db", db, "--out", "-", "--format", "objects")
    assert printed.stdout == (tmp_path / "objects.csv").read_text()


@pytest.mark.parametrize("name", ["plan.svg", "plan.png", "scene.glb", "graph.graphml", "graph.dot", "objects.csv"])
def test_another_file_is_not_written_over(db: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"\x00\x01 a file of something else")
    result = supermap("export", "--db", db, "--out", tmp_path / name, "--force")
    assert result.exit_code == 1
    assert "it is not written over" in str(result.exception)
    assert (tmp_path / name).read_bytes() == b"\x00\x01 a file of something else"


@pytest.mark.parametrize("name", ["plan.svg", "plan.png", "scene.glb", "graph.graphml", "graph.dot", "objects.csv"])
def test_an_older_export_is_replaced_with_force(db: Path, tmp_path: Path, name: str) -> None:
    export(db, tmp_path / name)
    export(db, tmp_path / name, "--force")
