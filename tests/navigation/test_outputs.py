"""What leaves the program: nav2's files, an MCAP, a picture, JSON; and the command line's refusals."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from supermap_cli.errors import SupermapError
from supermap_cli.navigation.grid import FREE, OCCUPIED, OccupancyGrid
from support.cli import document, supermap

TWO_GOALS = "go to the ball, then to the table"


@pytest.fixture(scope="module")
def written(room_db: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """A folder with every output of one run, and its JSON."""
    folder = tmp_path_factory.mktemp("route")
    outputs = ("--nav2", folder / "goals.yaml", "--mcap", folder / "route.mcap", "--plot", folder / "plan.svg")
    return folder, document("navigate", "navigate", TWO_GOALS, "--db", room_db, *outputs)


def test_nav2_gets_the_poses_of_the_answer(written: tuple[Path, dict]) -> None:
    folder, route = written
    text = (folder / "goals.yaml").read_text()
    number = r"(-?[\d.]+(?:e-?\d+)?)"
    positions = re.findall(rf"position: {{x: {number}, y: {number}, z: {number}}}", text)
    turned = re.findall(rf"orientation: {{x: {number}, y: {number}, z: {number}, w: {number}}}", text)
    poses = [waypoint["pose"] for waypoint in route["waypoints"]]
    assert [[float(x) for x in each] for each in positions] == [pose["position"] for pose in poses]
    assert [[float(x) for x in each] for each in turned] == [pose["orientation_xyzw"] for pose in poses]
    assert text.count("frame_id: map") == 2
    assert np.allclose([np.linalg.norm(pose["orientation_xyzw"]) for pose in poses], 1, atol=1e-5)


def test_the_mcap_is_read_by_another_library(written: tuple[Path, dict]) -> None:
    folder, route = written
    with AnyReader([folder / "route.mcap"]) as reader:
        found = {
            connection.topic: reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages()
        }
    path, markers = found["/plan"], found["/goals"]
    assert path.header.frame_id == "map"
    end = path.poses[-1].pose.position
    assert [end.x, end.y, end.z] == route["waypoints"][-1]["pose"]["position"]
    assert {marker.ns for marker in markers.markers} == {"goal", "thing", "name"}
    assert [marker.text for marker in markers.markers if marker.ns == "name"] == ["1: ball-1", "2: table-1"]


def test_the_picture_is_an_svg(written: tuple[Path, dict]) -> None:
    assert "<svg" in (written[0] / "plan.svg").read_text()[:1000]


def test_the_grid_is_what_map_server_reads(room_db: Path, grid: OccupancyGrid, tmp_path: Path) -> None:
    result = supermap("export", "--db", room_db, "--out", tmp_path / "grid.yaml")
    assert result.exit_code == 0, result.output
    entries = dict(line.split(": ", 1) for line in (tmp_path / "grid.yaml").read_text().splitlines())
    image = cv2.imread(str(tmp_path / entries["image"].strip('"')), cv2.IMREAD_UNCHANGED)
    darkness = (255 - image[::-1].T.astype(float)) / 255
    assert image.shape == grid.cells.shape[::-1]
    assert ((darkness > float(entries["occupied_thresh"])) == (grid.cells == OCCUPIED)).all()
    assert ((darkness < float(entries["free_thresh"])) == (grid.cells == FREE)).all()
    x, y, yaw = (float(value) for value in entries["origin"].strip("[]").split(","))
    assert np.allclose([x, y, yaw], [*grid.origin_xy, 0])
    assert float(entries["resolution"]) == grid.cell_m


@pytest.mark.parametrize("options", [("--label", "chair"), ("--at", "noon"), ("--traversal", "noon")])
def test_a_grid_of_a_part_is_wrong_usage(room_db: Path, tmp_path: Path, options: tuple[str, str]) -> None:
    assert supermap("export", "--db", room_db, "--out", tmp_path / "grid.yaml", *options).exit_code == 2


def test_goals_of_which_one_has_no_pose_are_not_written(room_db: Path, tmp_path: Path) -> None:
    result = supermap("navigate", "go to the ball, then to the cup", "--db", room_db, "--nav2", tmp_path / "goals.yaml")
    assert isinstance(result.exception, SupermapError)
    assert "1 of 2 goals have no pose" in str(result.exception)
    assert "cup-1 no longer stands there" in result.stdout  # the answer is told all the same
    assert not (tmp_path / "goals.yaml").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--from", "here"), "no pose"),
        (("--from", "1 2"), "no pose"),
        (("--from", "nan 0 0"), "no pose"),
        (("--plot", "plan.xyz"), "unknown kind"),
        (("--language", "xx"), "no grammar"),
    ],
)
def test_wrong_options_are_refused_with_the_cure(room_db: Path, options: tuple[str, str], said: str) -> None:
    result = supermap("navigate", "go to the ball", "--db", room_db, *options)
    assert isinstance(result.exception, SupermapError)
    assert said in str(result.exception)


def test_no_other_file_is_written_over(room_db: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.yaml").write_text("mine: 1\n")
    result = supermap("navigate", "go to the ball", "--db", room_db, "--nav2", tmp_path / "notes.yaml")
    assert isinstance(result.exception, SupermapError)
    assert (tmp_path / "notes.yaml").read_text() == "mine: 1\n"


def test_the_table_is_for_people(room_db: Path) -> None:
    result = supermap("navigate", "go to the chair", "--db", room_db, "--from", "1.9 0 90")
    assert result.exit_code == 0, result.output
    assert "ambiguous" in result.stdout
    assert "chair-2 stands" in result.stdout
