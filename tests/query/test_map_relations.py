"""Relations that no stored edge answers: computed on the surfaces and the walls that a map holds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.cameras import PinholeCamera, camera_to_json
from supermap_cli.memory import open_store
from supermap_cli.query.answers import answer
from supermap_cli.query.map_relations import MapRelations, moved_with
from supermap_cli.types.memory import KeyframeRecord, MapDelta, VoxelCloud
from support import memories as m
from support.graph_nodes import surface

CHAIR, BOOK, TV, DESK = 1, 2, 3, 4
WALL_M = 2.0
CAMERA = camera_to_json(PinholeCamera(160, 120, 100.0, 100.0, 79.5, 59.5))
DEPTH = cv2.imencode(".png", np.full((60, 80), WALL_M * 1000, np.uint16))[1].tobytes()


def at_wall(at: float, *, turned: bool = False) -> KeyframeRecord:
    """A view along x of a wall 2 m ahead, from a height of 1 m; `turned`: of its other face, from the next room."""
    T = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1]])
    if turned:
        T = np.array([[0.0, 0, -1, 2 * WALL_M + 0.12], [1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1]])
    return replace(m.keyframe(at), T_map_camera=T, camera=CAMERA, depth_png=DEPTH, depth_step=2)


def voxels_of(*boxes: Box3D) -> VoxelCloud:
    keys = np.unique(np.concatenate([np.floor(surface(box, 0.02) / 0.02) for box in boxes]).astype(np.int32), axis=0)
    ones = np.ones(len(keys), np.float32)
    return VoxelCloud(0.02, keys, ones * 2, ones, ones * 0, np.full((len(keys), 3), 128, np.uint8))


def two_rooms(path: Path, *, walled: bool = True) -> Path:
    """A chair and a desk in one room, and a tv in the next, or in the same; no relation is stored."""
    things = ((CHAIR, "chair", 1.6, 0.0), (DESK, "desk", 1.5, 0.8), (TV, "tv", 2.6, 0.2))
    frames = (at_wall(1), at_wall(2, turned=True)) if walled else m.keyframes([1, 2])
    delta = MapDelta(
        keyframes=frames,
        observations=tuple(m.observation(number, at, label) for number, label, _, _ in things for at in (1, 2)),
        instances=tuple(
            m.instance(number, label, (x, y, 0.5), seen=(1, 2), observations=2) for number, label, x, y in things
        ),
        states=tuple(m.state(number, 0, (1, 2), (x, y, 0.5), label=label) for number, label, x, y in things),
        visits=tuple(m.visit(number, 2, 2, 0, (1, 2)) for number, *_ in things),
    )
    return m.make_memory(path, ("monday", (0, 10), delta))


def test_what_a_wall_parts_is_not_near_and_what_it_does_not_part_is(tmp_path: Path) -> None:
    with open_store(str(two_rooms(tmp_path / "map.db")), read_only=True) as store, store.reader() as reader:
        assert [found.id for found in answer("chair near the desk", reader).instances] == ["chair-1"]
        assert answer("chair near the tv", reader).instances == ()
        assert answer("tv at the chair", reader).instances == ()
    one_room = two_rooms(tmp_path / "open.db", walled=False)
    with open_store(str(one_room), read_only=True) as store, store.reader() as reader:
        assert [found.id for found in answer("chair near the tv", reader).instances] == ["chair-1"]


def test_what_lies_on_a_seat_is_on_the_chair_as_its_voxels_tell(tmp_path: Path) -> None:
    seat, back = m.upright_box((0, 0, 0.225), (0.45, 0.45, 0.45)), m.upright_box((-0.2, 0, 0.65), (0.05, 0.45, 0.5))
    book = m.upright_box((0.08, 0, 0.48), (0.2, 0.25, 0.06))
    whole = (0.0, 0.0, 0.45), (0.45, 0.45, 0.9)
    delta = MapDelta(
        keyframes=m.keyframes([1, 2]),
        observations=tuple(m.observation(n, 1, label) for n, label in ((CHAIR, "chair"), (BOOK, "book"))),
        instances=(
            replace(m.instance(CHAIR, "chair", *whole, seen=(1, 1), observations=1), voxels=voxels_of(seat, back)),
            m.instance(BOOK, "book", tuple(book.center), tuple(book.size), seen=(1, 1), observations=1),
        ),
        states=(
            m.state(CHAIR, 0, (1, 1), *whole),
            m.state(BOOK, 0, (1, 1), tuple(book.center), tuple(book.size), label="book"),
        ),
        visits=(m.visit(CHAIR, 1, 1, 0, (1, 1)), m.visit(BOOK, 1, 1, 0, (1, 1))),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        (found,) = answer("book on the chair", reader).instances
        assert [relation.basis for relation in found.relations] == ["boxes"]
        relations = MapRelations(reader)
        chair, book_found = reader.instance("chair-1"), reader.instance("book-1")
        assert chair is not None
        assert book_found is not None
        assert relations.measure("on", (book_found, book_found.states[-1]), (chair, chair.states[-1])) > 0.5


def test_a_shape_goes_with_its_box_unless_that_is_of_another_size() -> None:
    box = m.upright_box((1, 0, 0.5), (1.0, 0.4, 1.0))
    turned = m.upright_box((3, 2, 0.5), (1.0, 0.4, 1.0), np.pi / 2)
    moved = moved_with(np.array([[1.5, 0.0, 0.5]]), box, turned)
    assert np.allclose(moved, [[3.0, 2.5, 0.5]])
    assert len(moved_with(np.zeros((4, 3)), box, m.upright_box((0, 0, 0.5), (2.0, 0.4, 1.0)))) == 0
