"""Pages and images of a diff: self-contained, and complete."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import cv2
import numpy as np
import pytest

from supermap_cli.errors import SupermapError
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.cameras import PinholeCamera, camera_to_json
from supermap_cli.memory import open_store
from supermap_cli.memory.images import Thumbnail, crop_jpegs, crops_of, thumbnails_of
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.diff import diff
from supermap_cli.reports.diff_page import diff_page, write_diff_page
from supermap_cli.reports.diff_plan import before_after_panels
from supermap_cli.reports.diff_plot import check_plot, draw_diff
from supermap_cli.reports.floor_plan import Arrow, Outline, extent_of, plan_svg
from supermap_cli.reports.pictures import crop_around_box
from supermap_cli.types.memory import MapDelta
from support import kitchen
from support import memories as m
from support.cli import supermap

CAMERA = PinholeCamera(320, 240, 230.0, 230.0, 159.5, 119.5)
LOOKING_ALONG_X = np.array([[0, 0, 1, -3.0], [-1, 0, 0, 0], [0, -1, 0, 0.8], [0, 0, 0, 1]])


def jpeg(colour: tuple[int, int, int], size: tuple[int, int] = (80, 60)) -> bytes:
    picture = np.full((size[1], size[0], 3), colour, np.uint8)
    return cv2.imencode(".jpg", picture)[1].tobytes()


def with_pictures(delta: MapDelta) -> MapDelta:
    """A traversal of the kitchen with a thumbnail for each keyframe and a crop for each observation."""
    keyframes = tuple(
        replace(frame, camera=camera_to_json(CAMERA), T_map_camera=LOOKING_ALONG_X, thumbnail_jpeg=jpeg((90, 120, 150)))
        for frame in delta.keyframes
    )
    crops = tuple(
        replace(observation, crop_jpeg=jpeg((10, observation.object_number * 20, 200)))
        for observation in delta.observations
    )
    return replace(delta, keyframes=keyframes, observations=crops)


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return m.make_memory(
        tmp_path_factory.mktemp("kitchen") / "map.db",
        ("monday", (0, 100), with_pictures(kitchen.monday)),
        ("tuesday", (1000, 1100), with_pictures(kitchen.tuesday)),
    )


@pytest.fixture(scope="module")
def reader(db: Path) -> Iterator[MapReader]:
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        yield reader


def test_the_page_needs_nothing_from_elsewhere(reader: MapReader) -> None:
    page = diff_page(diff(reader), reader)
    assert page.startswith("<!DOCTYPE html>")
    assert "<script" not in page
    addresses = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert addresses
    assert all(address.startswith("data:image/jpeg;base64,") for address in addresses)
    assert "url(http" not in page
    assert "@import" not in page


def test_the_page_holds_all_that_changed_with_pictures_of_both_sides(reader: MapReader) -> None:
    found = diff(reader)
    page = diff_page(found, reader)
    for change in found.changes:
        assert change.id in page
        assert change.reason.replace("'", "&#x27;") in page
    assert page.count('<article class="card">') == 3
    for caption in ("before: observation", "after: observation", "before: its place, seen empty"):
        assert caption in page
    assert "3.61" in page
    assert "may be cup-1 (20%)" in page


def test_the_plan_shows_the_place_before_and_after_on_one_scale(reader: MapReader) -> None:
    before, after = before_after_panels(diff(reader), reader)
    assert before.extent == after.extent
    (arrow,) = after.arrows
    assert arrow.end.tolist() == [-3.0, 3.0]
    assert {outline.label for outline in before.outlines if outline.style == "disappeared"} == {"cup-1"}
    assert {outline.label for outline in after.outlines if outline.style == "appeared"} == {"vase-1"}
    assert {outline.style for outline in after.outlines if outline.label == "cup-1"} == {"disappeared ghost"}
    assert len(before.trajectories[0]) == 3


def test_user_text_is_escaped(tmp_path: Path, reader: MapReader) -> None:
    name = "<b>bad</b>"
    delta = MapDelta(
        keyframes=m.keyframes([1]),
        instances=(m.instance(1, name, seen=(1, 1)),),
        observations=(m.observation(1, 1, name),),
        visits=(m.visit(1, 1, 1),),
        states=(m.state(1, 0, (1, 1), label=name, gone=101),),
    )
    path = m.make_memory(tmp_path / "map.db", ("<i>a</i>", (0, 10), delta), ("b", (100, 110), MapDelta()))
    with open_store(str(path), read_only=True) as store, store.reader() as other:
        page = diff_page(diff(other), other)
    assert "<b>bad" not in page
    assert "<i>a" not in page
    assert "&lt;b&gt;bad" in page


def test_a_plan_is_well_formed_and_keeps_the_scale() -> None:
    corners = np.array([[0, 0], [2, 0], [2, 1], [0, 1.0]])
    extent = extent_of([corners])
    svg = plan_svg(extent, [Outline(corners, "a & b", "<a>", "moved")], [Arrow(corners[0], corners[2])], [corners], "t")
    root = ET.fromstring(svg)  # noqa: S314 - our own drawing
    polygon = root.find("{http://www.w3.org/2000/svg}polygon")
    assert polygon is not None
    drawn = np.array([tuple(map(float, corner.split(","))) for corner in polygon.attrib["points"].split()])
    assert np.ptp(drawn[:, 0]) == pytest.approx(2 * np.ptp(drawn[:, 1]), abs=0.2)
    assert drawn[2, 1] < drawn[1, 1]  # y upwards
    assert extent_of([]).px_per_m > 0


def test_a_box_is_cropped_from_the_image_that_shows_it() -> None:
    picture = np.zeros((120, 160, 3), np.uint8)
    picture[:, 80:] = (0, 0, 255)
    image = Thumbnail(1, 0, cv2.imencode(".png", picture)[1].tobytes(), camera_to_json(CAMERA), LOOKING_ALONG_X)
    right = Box3D(np.array([0, -1.0, 0.8]), np.array([0.3, 0.3, 0.5]), 0.0)
    behind = Box3D(np.array([-6.0, 0, 0.8]), np.array([0.3, 0.3, 0.5]), 0.0)
    cut = crop_around_box(image, right)
    assert cut is not None
    shown = cv2.imdecode(np.frombuffer(cut, np.uint8), cv2.IMREAD_COLOR)
    assert np.median(shown[..., 2]) > 200  # the red half, with the box drawn on it
    assert ((shown[..., 1] > 120) & (shown[..., 2] > 150)).any()
    assert crop_around_box(image, behind) is None


def test_pictures_are_read_by_number_and_stamp(reader: MapReader) -> None:
    crops = crops_of(reader, [kitchen.CUP])[kitchen.CUP]
    assert [crop.stamp_ns for crop in crops] == [m.ns(1), m.ns(40), m.ns(90)]
    assert set(crop_jpegs(reader, [crop.observation for crop in crops])) == {crop.observation for crop in crops}
    assert set(thumbnails_of(reader, [m.ns(1), m.ns(2)])) == {m.ns(1)}


def test_of_several_cameras_the_one_that_has_the_place_in_view_is_shown(reader: MapReader, tmp_path: Path) -> None:
    def with_rear_camera(delta: MapDelta) -> MapDelta:
        pictured = with_pictures(delta)
        backwards = LOOKING_ALONG_X @ np.diag([-1.0, 1.0, -1.0, 1.0])
        rear = tuple(
            replace(keyframe, camera_id="rear", T_map_camera=backwards, thumbnail_jpeg=jpeg((200, 10, 10)))
            for keyframe in pictured.keyframes
        )
        return replace(pictured, keyframes=rear + pictured.keyframes)

    path = m.make_memory(
        tmp_path / "rig.db",
        ("monday", (0, 100), with_rear_camera(kitchen.monday)),
        ("tuesday", (1000, 1100), with_rear_camera(kitchen.tuesday)),
    )
    pictures = re.compile(r"data:image/jpeg;base64,[^\"]+")
    with open_store(str(path), read_only=True) as store, store.reader() as rig:
        shown = pictures.findall(diff_page(diff(rig), rig))
    assert shown == pictures.findall(diff_page(diff(reader), reader))
    assert shown


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_the_image_is_drawn(reader: MapReader, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / "pictures" / f"changes.{suffix}"
    draw_diff(diff(reader), reader, path)
    assert path.stat().st_size > 5000


def test_files_that_cannot_be_written_are_errors(reader: MapReader, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("x")
    with pytest.raises(SupermapError, match="cannot be written"):
        write_diff_page(diff(reader), reader, blocked / "report.html")
    with pytest.raises(SupermapError, match="unknown kind"):
        check_plot(tmp_path / "changes.gif")


def test_the_command_writes_both(db: Path, tmp_path: Path) -> None:
    page, plot = tmp_path / "report.html", tmp_path / "changes.svg"
    result = supermap("diff", "--db", db, "--html", page, "--plot", plot)
    assert result.exit_code == 0
    assert page.read_text().count("<svg") == 2
    assert plot.read_text().startswith("<?xml")


def test_a_history_is_written_as_a_page(db: Path, tmp_path: Path) -> None:
    page, folder = tmp_path / "chair.html", tmp_path / "crops"
    result = supermap("history", "chair-1", "--db", db, "--html", page, "--crops", folder)
    assert result.exit_code == 0
    content = page.read_text()
    assert "moved 3.61 m" in content
    assert content.count("<img") == 2
    assert len(list(folder.glob("chair-1-state*.jpg"))) == 2
    assert all(path.read_bytes()[:2] == b"\xff\xd8" for path in folder.iterdir())
