"""The plugin for Rerun: its recordings are read back by Rerun's SDK, and a map that is followed is the same map."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from supermap_cli.commands.viewers import viewers
from supermap_cli.drivers.traversal_build import TraversalBuild
from supermap_cli.errors import SupermapError
from supermap_cli.memory import open_store
from supermap_cli.plugin_manager import load_plugins
from supermap_rerun.observer import RerunObserver
from supermap_rerun.streams import close_stream, stream_to
from support import compare_maps, kitchen
from support import fakes as f
from support import memories as m
from support import scenes as s
from support.cli import supermap

Rows = dict[str, list[dict[str, Any]]]


def read(path: Path) -> Rows:
    """By entity, its rows in the order of map time (static ones first): component -> value."""
    found: Rows = defaultdict(list)
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        columns = {
            name: (batch.column(name).cast("int64") if name == "map_time" else batch.column(name)).to_pylist()
            for name in batch.schema.names
            if "RowId" not in name
        }
        for number in range(batch.num_rows):
            row = {name: values[number] for name, values in columns.items() if values[number] is not None}
            found[chunk.entity_path].append(row)
    for rows in found.values():
        rows.sort(key=at_ns)
    return found


def at_ns(row: dict[str, Any]) -> int:
    return int(row.get("map_time", -1))


def only(rows: list[dict[str, Any]], component: str) -> list[tuple[float, Any]]:
    """When, in seconds, and what."""
    return [((at_ns(row) - m.ns(0)) / 1e9, row[component]) for row in rows if component in row]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Rows:
    folder = tmp_path_factory.mktemp("rerun")
    db = kitchen.make_kitchen(folder / "map.db")
    result = supermap("export", "--db", db, "--out", folder / "map.rrd")
    assert result.exit_code == 0, result.output or repr(result.exception)
    assert RrdReader(folder / "map.rrd").blueprints(), "it brings its views along"
    return read(folder / "map.rrd")


def test_a_thing_has_a_box_since_it_was_seen_and_moves_with_its_states(exported: Rows) -> None:
    chair = exported[f"/map/objects/{kitchen.CHAIR}"]
    assert only(chair, "Boxes3D:centers")[0] == (1.0, [pytest.approx([0, 1.0, 0.5])])
    assert only(chair, "Boxes3D:centers")[-1] == (1001.0, [pytest.approx([-3.0, 3.0, 0.5])])
    assert only(chair, "Boxes3D:half_sizes")[0][1] == [pytest.approx(np.array(m.SIZE) / 2)]
    assert only(chair, "Boxes3D:labels")[0][1] == ["chair-1"]


def test_what_left_is_cleared(exported: Rows) -> None:
    cup = exported[f"/map/objects/{kitchen.CUP}"]
    assert [when for when, _ in only(cup, "Clear:is_recursive")] == [1040.0], "at the first keyframe that knows it"
    assert only(cup, "Boxes3D:centers")[0][0] == 1.0


def test_points_are_where_the_thing_stands(exported: Rows) -> None:
    ((when, points),) = only(exported[f"/map/objects/{kitchen.TV}/points"], "Points3D:positions")
    assert when == 1.0
    np.testing.assert_allclose(points, (m.voxels().keys + 0.5) * m.voxels().voxel_m, atol=1e-6)


def test_states_are_lanes_that_say_when_nobody_can_say(exported: Rows) -> None:
    cup = only(exported[f"/states/{kitchen.CUP}"], "StateChange:state")
    assert [(round(when, 3), said) for when, said in cup] == [
        (1.0, ["present"]),
        (90.0, ["nobody can say"]),
        (1005.0, ["gone"]),
    ]
    vase = only(exported[f"/states/{kitchen.VASE}"], "StateChange:state")
    assert vase == [(90.0, ["nobody can say"]), (1001.0, ["present"])]


def test_relations_are_a_graph_of_what_holds(exported: Rows) -> None:
    edges = only(exported["/relations"], "GraphEdges:edges")
    pairs = {(edge["first"], edge["second"]) for edge in edges[-1][1]}
    assert pairs == {(str(kitchen.VASE), str(kitchen.TABLE))}
    assert (str(kitchen.CUP), str(kitchen.TABLE)) in {(edge["first"], edge["second"]) for edge in edges[0][1]}
    labels = only(exported["/relations"], "GraphNodes:labels")
    assert set(labels[-1][1]) == {"vase-1", "dining-table-1"}


def test_changes_are_a_log_with_ids(exported: Rows) -> None:
    said = [text for _, (text,) in only(exported["/changes"], "TextLog:text")]
    assert "chair-1 moved 3.61 m" in said
    assert "cup-1 disappeared" in said
    assert "complete: 3 keyframes, 18 observations, 8 objects" in said


def test_cameras_hang_in_the_tree_with_depth_in_metres(exported: Rows) -> None:
    assert [when for when, _ in only(exported["/map/robot"], "Transform3D:translation")] == [
        1,
        40,
        90,
        1001,
        1040,
        1090,
    ]
    depth = exported["/map/robot/camera/depth"]
    assert only(depth, "EncodedDepthImage:meter")[0][1] == [1000.0]
    assert bytes(only(depth, "EncodedDepthImage:blob")[0][1][0]) == m.DEPTH_PNG
    assert only(depth, "Pinhole:resolution")[0][1] == [[8.0, 6.0]]
    ((_, (K,)), *_) = only(depth, "Pinhole:image_from_camera")
    np.testing.assert_allclose(np.reshape(K, (3, 3)).T, [[6.25, 0, 4.4375], [0, 6.25, 3.4375], [0, 0, 1]])


def test_labels_are_classes_of_one_context(exported: Rows) -> None:
    (context,) = only(exported["/"], "AnnotationContext:context")[-1][1]
    names = {entry["class_id"]: entry["class_description"]["info"]["label"] for entry in context}
    box = exported[f"/map/objects/{kitchen.TV}"]
    ((number,),) = [value for _, value in only(box, "Boxes3D:class_ids")][:1]
    assert names[number] == "tv"


def test_a_recording_as_of_a_time_ends_there(tmp_path: Path) -> None:
    db = kitchen.make_kitchen(tmp_path / "map.db")
    assert supermap("export", "--db", db, "--out", tmp_path / "map.rrd", "--at", "monday").exit_code == 0
    found = read(tmp_path / "map.rrd")
    latest = max(at_ns(row) for rows in found.values() for row in rows)
    assert latest <= m.ns(100)
    assert f"/map/objects/{kitchen.LAMP}" not in found


def build(folder: Path, name: str, asked: dict[str, str]) -> Path:
    plugins = load_plugins([f.FakePlugins().plugin_object()])
    monday = f.FakeRecording(f.film((*s.ROOM, s.TABLE, s.CUP)))
    tuesday = f.FakeRecording(f.film((*s.ROOM, s.TABLE), start_s=86_400.0), Path("tuesday.fake"))
    with open_store(str(folder / name), create=True) as store:
        for recording in (monday, tuesday):
            config = f.config(keyframes={"batch": 4})
            summary = TraversalBuild(recording, plugins, config, store, viewers=asked).run(align="none")
            assert not any("rerun" in warning for warning in summary.warnings), summary.warnings
    return folder / name


def test_a_map_that_is_followed_is_the_same_row_for_row(tmp_path: Path) -> None:
    target = tmp_path / "build.rrd"
    alone = build(tmp_path, "alone.db", {})
    followed = build(tmp_path, "followed.db", {"rerun": str(target)})
    close_stream(str(target))
    assert compare_maps.compare(alone, followed, {}) == []
    found = read(target)
    images = only(found["/map/robot/camera/image"], "EncodedImage:blob") or only(
        found["/map/robot/camera/image"], "Image:buffer"
    )
    assert images, "the images that were perceived"
    assert only(found["/map/robot/camera/image/boxes"], "Boxes2D:half_sizes")
    masks = only(found["/map/robot/camera/image/masks"], "SegmentationImage:buffer")
    assert masks
    assert any(np.any(np.asarray(buffer[0])) for _, buffer in masks), "classes on masks"
    assert len([path for path in found if path.startswith("/states/")]) >= 2


def test_an_observer_is_made_only_where_it_is_asked_for() -> None:
    from supermap_cli.types.session import SessionContext
    from supermap_rerun import observe_session

    assert observe_session(SessionContext("", "", "", (), {})) is None
    assert observe_session(SessionContext("", "", "", (), {}, viewers={"another": "spawn"})) is None


def test_hostile_labels_make_no_paths(tmp_path: Path) -> None:
    target = str(tmp_path / "x.rrd")
    observer = RerunObserver(stream_to(target), target)
    from supermap_cli.types.memory import MapDelta

    instance = m.instance(1, "../../a b/\x00<b>椅子")
    observer.mapped(m.keyframe(1, camera_id="../front cam"), MapDelta(instances=(instance,)))
    observer.close()
    paths = set(read(Path(target)))
    assert "/map/objects/1" in paths
    assert "/map/robot/___front_cam" in paths


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"spawn": True, "connect": "rerun+http://127.0.0.1:9876/proxy", "save": None}, "one viewer"),
        ({"spawn": False, "connect": "127.0.0.1:9876", "save": None}, "no address"),
        ({"spawn": False, "connect": None, "save": Path("map.txt")}, "no .rrd file"),
        ({"spawn": False, "connect": None, "save": Path("nowhere/at/all/map.rrd")}, "no such folder"),
    ],
)
def test_what_cannot_be_shown_is_said_before_a_build(asked: dict[str, Any], said: str) -> None:
    with pytest.raises(SupermapError, match=said):
        viewers("map.db", **asked)


def test_without_rerun_the_command_says_which_extra(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from supermap_cli.exporting import rerun_file

    monkeypatch.setattr(rerun_file, "find_spec", lambda name: None)
    db = kitchen.make_kitchen(tmp_path / "map.db")
    result = supermap("export", "--db", db, "--out", tmp_path / "map.rrd")
    assert "supermap-cli[rerun]" in str(result.exception)
    assert not (tmp_path / "map.rrd").exists()
