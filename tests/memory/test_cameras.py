"""Cameras of a rig: keyframes that share a stamp, and what each of them saw."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy.exc import IntegrityError

from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from supermap_cli.memory.images import crop_jpegs, crops_of, thumbnails_of
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.streaming import stream_keyframes
from supermap_cli.types.memory import KeyframeRecord, MapDelta, Observation
from support import memories as m

CHAIR, LAMP = 1, 2


def keyframe(at: float, camera_id: str) -> KeyframeRecord:
    return replace(m.keyframe(at, camera_id=camera_id), thumbnail_jpeg=b"\xff\xd8\xff" + camera_id.encode())


def observation(number: int, at: float, label: str, camera_id: str) -> Observation:
    crop = b"\xff\xd8\xff" + f"{label} by {camera_id}".encode()
    return replace(m.observation(number, at, label, camera_id=camera_id), crop_jpeg=crop)


SEEN = MapDelta(
    keyframes=tuple(keyframe(at, camera_id) for at in (1, 2) for camera_id in ("front", "left")),
    observations=(
        observation(CHAIR, 1, "chair", "front"),
        observation(LAMP, 1, "lamp", "left"),
        observation(CHAIR, 2, "chair", "left"),
        observation(LAMP, 2, "lamp", "left"),
    ),
    instances=(
        m.instance(CHAIR, "chair", seen=(1, 2), observations=2),
        m.instance(LAMP, "lamp", seen=(1, 2), observations=2),
    ),
    states=(m.state(CHAIR, 0, (1, 2)), m.state(LAMP, 0, (1, 2), label="lamp")),
    visits=(m.visit(CHAIR, 2, 2, seen=(1, 2)), m.visit(LAMP, 2, 2, seen=(1, 2))),
)
"""A chair passes from the front camera to the left one; the left camera sees a lamp throughout."""


@pytest.fixture
def db(tmp_path: Path) -> Path:
    return m.make_memory(tmp_path / "map.db", ("monday", (0, 10), SEEN))


@pytest.fixture
def reader(db: Path) -> Iterator[MapReader]:
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        yield reader


def camera_of_keyframe(reader: MapReader) -> dict[int, str]:
    return {row.id: row.camera_id for row in stream_keyframes(reader)}


def test_keyframes_of_one_stamp_come_back_with_their_cameras(db: Path) -> None:
    with open_store(str(db), read_only=True) as store:
        found = [(record.stamp_ns, record.camera_id) for record in store.keyframe_depths()]
    assert found == [(record.stamp_ns, record.camera_id) for record in SEEN.keyframes]


def test_a_map_of_several_cameras_is_sound(reader: MapReader) -> None:
    assert check(reader) == []
    assert reader.traversals[0].keyframes == 4


def test_an_observation_belongs_to_the_keyframe_of_its_own_camera(reader: MapReader) -> None:
    cameras = camera_of_keyframe(reader)
    chair, lamp = reader.instances
    assert [(ref.stamp_ns, cameras[ref.keyframe_id]) for ref in reader.observations(chair)] == [
        (m.ns(1), "front"),
        (m.ns(2), "left"),
    ]
    assert {cameras[ref.keyframe_id] for ref in reader.observations(lamp)} == {"left"}


def test_an_observation_of_a_camera_without_a_keyframe_is_refused(tmp_path: Path) -> None:
    delta = MapDelta(keyframes=(keyframe(1, "front"),), observations=(observation(CHAIR, 1, "chair", "left"),))
    with pytest.raises(ValueError, match=r"no keyframe.*left"):
        m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))


def test_one_camera_has_one_keyframe_of_a_stamp(tmp_path: Path) -> None:
    with pytest.raises(IntegrityError):
        m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta(keyframes=(keyframe(1, "front"),) * 2)))


def test_crops_and_thumbnails_are_those_of_the_camera_that_saw_it(reader: MapReader) -> None:
    cameras = camera_of_keyframe(reader)
    crops = crops_of(reader, [CHAIR])[CHAIR]
    jpegs = crop_jpegs(reader, [crop.observation for crop in crops])
    assert [(cameras[crop.keyframe_id], jpegs[crop.observation][3:]) for crop in crops] == [
        ("front", b"chair by front"),
        ("left", b"chair by left"),
    ]
    images = thumbnails_of(reader, [m.ns(1)])[m.ns(1)]
    assert [(image.camera_id, cameras[image.keyframe_id], image.jpeg[3:]) for image in images] == [
        ("front", "front", b"front"),
        ("left", "left", b"left"),
    ]


def test_a_trajectory_has_a_stamp_once(reader: MapReader) -> None:
    stamps_ns, T_map_base = reader.poses(reader.traversals[0].id)
    assert stamps_ns.tolist() == [m.ns(1), m.ns(2)]
    assert T_map_base.shape == (2, 4, 4)


def test_the_view_of_trajectories_names_the_camera(db: Path) -> None:
    assert m.query(db, "SELECT at, camera_id FROM trajectory WHERE stamp_ns = " + str(m.ns(1))) == [
        ("2026-01-05T09:00:01.0Z", "front"),
        ("2026-01-05T09:00:01.0Z", "left"),
    ]


def test_a_build_that_is_taken_out_takes_all_its_cameras_along(tmp_path: Path) -> None:
    path = tmp_path / "map.db"
    with open_store(str(path), create=True) as store:
        store.commit(store.begin_traversal(m.start("monday", (0, 10))), SEEN)
        assert store.roll_back_unfinished() == ("monday",)
        assert list(store.keyframe_depths()) == []
