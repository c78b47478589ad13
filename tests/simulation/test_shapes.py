"""Procedural shapes: closed, of real-world size, standing where the conventions say, and different by seed."""

import tomllib
from importlib.resources import files

import numpy as np
import pytest

from supermap_cli.simulation.world import Material, Shape, sample_surface
from supermap_cli.simulation.worlds.pieces import Piece, Solids, vertex_parts
from supermap_cli.simulation.worlds.shapes import HANGING_LABELS, LABELS, build_shape
from supermap_cli.simulation.worlds.shapes.primitives import (
    ball,
    block,
    cylinder,
    extruded,
    lathe,
    leaf,
    pitched,
    rod,
    rounded_block,
    signed_volume_m3,
    vessel,
    wedge,
)

GREY = Material((128, 128, 128))


def parts_of(shape: Shape) -> list[np.ndarray]:
    part = vertex_parts(shape)[shape.triangles[:, 0]]
    return [shape.vertices[shape.triangles[part == k]] for k in range(part.max() + 1)]


def is_closed(shape: Shape) -> bool:
    """Every edge is met by two triangles, in opposite directions."""
    edges = np.concatenate([shape.triangles[:, [0, 1]], shape.triangles[:, [1, 2]], shape.triangles[:, [2, 0]]])
    forth, back = ({tuple(edge) for edge in directed.tolist()} for directed in (edges, edges[:, ::-1]))
    return forth == back and len(forth) == len(edges)


@pytest.mark.parametrize(
    ("shape", "volume_m3"),
    [
        (block((1, 2, 3), GREY), 6.0),
        (extruded([(0, 0), (0, 1), (1, 1), (1, 0)], 2, GREY), 2.0),
        (rounded_block((1, 1, 1), 0.1, GREY, steps=30), 1 - 0.01 * (4 - np.pi)),
        (wedge((1, 1, 1), 0.0, GREY), 0.5),
        (cylinder(1, 1, GREY, sides=400), np.pi),
        (cylinder(1, 3, GREY, top_radius=0.0001, sides=400), np.pi),
        (lathe([(1, 0), (1, 1), (0.5, 1), (0.5, 0.5)], GREY, sides=400), np.pi * (1 - 0.125)),
        (vessel(1, 1, 0.1, GREY), 0.0),
        (ball((1, 1, 1), GREY, sides=200, rings=199), 4 / 3 * np.pi),
        (rod((1, 2, 3), (1, 2, 0), 0.1, GREY, sides=400), 0.03 * np.pi),
        (leaf((0, 0, 0), (1, 0, 0), 0.5, GREY), 0.0),
    ],
    ids=lambda value: None,
)
def test_a_primitive_is_closed_and_holds_its_volume(shape: Shape, volume_m3: float) -> None:
    assert is_closed(shape)
    volume = signed_volume_m3(shape.vertices[shape.triangles])
    assert volume > 0
    if volume_m3:
        assert volume == pytest.approx(volume_m3, rel=2e-3)


def test_tipping_backwards_moves_the_top_towards_plus_y() -> None:
    low, high = pitched(block((0.1, 0.1, 1), GREY), 30).bounds
    assert high[1] == pytest.approx(0.5 + 0.05 * np.cos(np.radians(30)))
    assert low[1] > -0.06


def test_there_are_enough_labels() -> None:
    assert len(LABELS) >= 26
    assert "person" not in LABELS


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("label", LABELS)
def test_every_thing_is_made_of_closed_parts_seen_from_outside(label: str, seed: int) -> None:
    shape = build_shape(label, np.random.default_rng(seed))
    assert is_closed(shape)
    assert all(signed_volume_m3(part) > 0 for part in parts_of(shape))
    assert len(shape.triangles) <= 620
    assert np.isfinite(shape.vertices).all()


@pytest.mark.parametrize("label", LABELS)
def test_sizes_are_those_of_real_things(label: str) -> None:
    """Against what the mapping engine holds possible for the class."""
    table = tomllib.loads((files("supermap_cli.mapping") / "class_sizes.toml").read_text())["longest_side_m"]
    for seed in range(8):
        low, high = build_shape(label, np.random.default_rng(seed)).bounds
        longest = (high - low).max()
        assert 0.05 < longest < 2.5
        assert longest <= table.get(label, 2.5)


@pytest.mark.parametrize("label", LABELS)
def test_the_origin_is_the_foot_or_the_middle_of_the_back(label: str) -> None:
    low, high = build_shape(label, np.random.default_rng(5)).bounds
    assert low[2] == pytest.approx(0)
    assert low[0] + high[0] == pytest.approx(0)
    assert (high[1] if label in HANGING_LABELS else low[1] + high[1]) == pytest.approx(0)


@pytest.mark.parametrize("label", ["chair", "stool", "table", "bookshelf", "cart", "lamp", "potted plant"])
def test_what_is_open_in_life_is_no_box(label: str) -> None:
    """Most of its box belongs to none of its parts."""
    for seed in range(4):
        shape = build_shape(label, np.random.default_rng(seed))
        low, high = shape.bounds
        assert signed_volume_m3(shape.vertices[shape.triangles]) < 0.35 * np.prod(high - low)
        points = np.random.default_rng(0).uniform(low, high, (4000, 1, 3))
        solids = Piece(label, shape).parts
        filled = (np.abs(points - solids.centers) <= solids.sizes / 2).all(axis=2).any(axis=1)
        assert filled.mean() < 0.5


def test_a_chair_has_legs_a_seat_and_a_back_behind() -> None:
    for seed in range(6):
        shape = build_shape("chair", np.random.default_rng(seed))
        points, _ = sample_surface(shape, 0.01)
        high = points[:, 2].max()
        upper, lower = points[points[:, 2] > 0.75 * high], points[points[:, 2] < 0.3 * high]
        assert upper[:, 1].mean() > 0.1
        assert abs(lower[:, 1].mean()) < 0.08
        seats = Piece("chair", shape).surfaces
        assert any(0.4 < seat.z_m < 0.6 for seat in seats)


def test_a_mug_has_a_handle_and_room_for_coffee() -> None:
    shape = build_shape("mug", np.random.default_rng(0))
    body, *handle = parts_of(shape)
    assert len(handle) >= 3
    assert max(part[..., 0].max() for part in handle) > body[..., 0].max()
    assert signed_volume_m3(body) < 0.4 * np.prod(np.ptp(body.reshape(-1, 3), axis=0))


def test_a_bookshelf_holds_things_between_its_boards() -> None:
    shelves = Piece("bookshelf", build_shape("bookshelf", np.random.default_rng(1))).shelves
    assert len(shelves) >= 3
    assert all(0.2 < shelf.clear_m < 0.5 for shelf in shelves)


@pytest.mark.parametrize("label", ["desk", "table", "cabinet", "couch", "cart"])
def test_things_can_stand_on_tops(label: str) -> None:
    piece = Piece(label, build_shape(label, np.random.default_rng(2)))
    assert piece.top.clear_m == np.inf
    assert np.prod(piece.top.high - piece.top.low) > 0.2


def test_nothing_stands_on_a_bottle() -> None:
    with pytest.raises(LookupError, match="bottle"):
        _ = Piece("bottle", build_shape("bottle", np.random.default_rng(2))).top


@pytest.mark.parametrize("label", LABELS)
def test_the_same_seed_gives_the_same_thing_and_another_seed_another(label: str) -> None:
    first, again, other = (build_shape(label, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(first.vertices, again.vertices)
    assert first.materials == again.materials
    assert first.vertices.shape != other.vertices.shape or not np.allclose(first.vertices, other.vertices)


def test_solids_that_touch_do_not_meet() -> None:
    a = Solids(np.zeros((1, 3)), np.ones((1, 3)))
    beside, above = (Solids(np.array([at], float), np.ones((1, 3))) for at in ((1, 0, 0), (0, 0, 1)))
    assert not a.meet(beside)
    assert not a.meet(above)
    assert a.meet(beside, gap_m=0.05)
    assert not a.meet(above, gap_m=0.05)
    assert a.meet(Solids(np.array([[0.95, 0, 0]]), np.ones((1, 3))))


def test_a_turned_solid_reaches_as_far_as_its_corner() -> None:
    a = Solids(np.zeros((1, 3)), np.ones((1, 3)))
    at = np.array([[1.15, 0, 0]])
    assert not a.meet(Solids(at, np.ones((1, 3))))
    assert a.meet(Solids(at, np.ones((1, 3)), np.pi / 4))
