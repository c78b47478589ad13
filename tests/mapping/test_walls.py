"""Walls stand between things, and nothing that only looks like one does."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.mapping.structure import Structure
from supermap_cli.mapping.walls import WallMap

Point = tuple[float, float, float]


def face(x: float, y: tuple[float, float], z: tuple[float, float], normal_x: float) -> Structure:
    """An upright surface across x, a point each 5 cm, that was seen from where its normal looks to."""
    rows = np.arange(*y, 0.05), np.arange(*z, 0.05)
    across, height = (grid.ravel() for grid in np.meshgrid(*rows))
    points = np.column_stack([np.full(across.size, x), across, height])
    return Structure(points, np.tile([normal_x, 0.0, 0.0], (len(points), 1)))


def wall(x: float = 0.0, y: tuple[float, float] = (-2, 2), z: tuple[float, float] = (0.2, 2.0)) -> WallMap:
    """A wall 12 cm thick, seen from both rooms."""
    walls = WallMap()
    walls.add_surfaces(face(x - 0.06, y, z, -1.0))
    walls.add_surfaces(face(x + 0.06, y, z, 1.0))
    return walls


def box(x: float, y: float = 0.0, size: Point = (0.5, 0.5, 0.8), yaw: float = 0.0) -> Box3D:
    return Box3D(np.array([x, y, size[2] / 2]), np.array(size), yaw)


def turned(walls: Structure, angle: float) -> Structure:
    c, s = np.cos(angle), np.sin(angle)
    T: FloatArray = np.eye(4)
    T[:2, :2] = [[c, -s], [s, c]]
    return walls.moved(T)


def test_nothing_is_known_before_anything_was_seen() -> None:
    assert WallMap().clear_between(box(-1), box(1))


@pytest.mark.parametrize("gap_m", [0.02, 0.3, 1.0])
def test_a_wall_stands_between_two_rooms_and_not_within_one(gap_m: float) -> None:
    walls, off_m = wall(), 0.06 + gap_m + 0.25
    assert not walls.clear_between(box(-off_m), box(off_m))
    assert not walls.clear_between(box(off_m, 0.4), box(-off_m))
    assert walls.clear_between(box(off_m), box(off_m, 0.7))
    assert walls.clear_between(box(off_m), box(off_m + 1.0))


def test_one_face_is_enough() -> None:
    walls = WallMap()
    walls.add_surfaces(face(-0.06, (-2, 2), (0.2, 2.0), -1.0))
    assert not walls.clear_between(box(-0.5), box(0.5))


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.0, 2.2])
def test_the_direction_of_a_wall_does_not_matter(angle: float) -> None:
    walls = WallMap()
    for x, normal_x in ((-0.06, -1.0), (0.06, 1.0)):
        walls.add_surfaces(turned(face(x, (-2, 2), (0.2, 2.0), normal_x), angle))
    c, s = np.cos(angle), np.sin(angle)
    assert not walls.clear_between(box(-0.6 * c, -0.6 * s, yaw=angle), box(0.6 * c, 0.6 * s, yaw=angle))
    assert walls.clear_between(box(0.6 * c, 0.6 * s, yaw=angle), box(1.6 * c, 1.6 * s, yaw=angle))


def test_what_hangs_on_a_wall_is_on_its_own_side_of_it() -> None:
    walls = wall()
    picture, tv = box(-0.08, 0.0, (0.04, 0.8, 1.4)), box(0.08, 0.2, (0.04, 1.0, 1.4))
    assert walls.clear_between(picture, box(-1.0))
    assert walls.clear_between(picture, box(-0.08, 1.2, (0.04, 0.6, 1.4)))
    assert not walls.clear_between(picture, tv)
    assert not walls.clear_between(picture, box(1.0))


def test_errors_of_a_few_centimetres_put_nothing_behind_the_wall_that_it_stands_against() -> None:
    walls = wall()
    assert walls.clear_between(box(-0.06 - 0.25 + 0.05), box(-1.2))
    assert walls.clear_between(box(-0.04, 0.0, (0.06, 0.8, 1.4)), box(-1.2))


def test_a_doorway_lets_near_things_be_near_although_its_lintel_is_a_wall_above() -> None:
    walls = wall(y=(-3, -0.5))
    for x, normal_x in ((-0.06, -1.0), (0.06, 1.0)):
        walls.add_surfaces(face(x, (0.5, 3), (0.2, 2.4), normal_x))
        walls.add_surfaces(face(x, (-0.5, 0.5), (2.05, 2.6), normal_x))
    assert walls.clear_between(box(-0.5), box(0.5))
    assert not walls.clear_between(box(-0.5, -1.5), box(0.5, -1.5))


@pytest.mark.parametrize(
    ("y", "z", "what"),
    [((-2, 2), (0.0, 0.75), "a counter"), ((-0.25, 0.25), (0.1, 1.8), "a person"), ((-2, 2), (1.5, 2.1), "a lintel")],
)
def test_what_is_low_or_narrow_is_no_wall(y: tuple[float, float], z: tuple[float, float], what: str) -> None:
    assert wall(y=y, z=z).clear_between(box(-0.6), box(0.6)), what


def test_the_sides_of_a_thing_in_the_map_are_no_wall() -> None:
    walls = WallMap()
    walls.add_surfaces(face(-0.2, (-0.5, 0.5), (0.0, 1.9), -1.0))
    cupboard = box(0.0, 0.0, (0.4, 1.0, 1.9))
    assert not walls.clear_between(box(-0.8), box(0.8))
    assert walls.clear_between(box(-0.8), box(0.8), [cupboard])
    assert walls.clear_between(box(-0.8), cupboard)


def test_noise_before_a_wall_does_not_put_what_hangs_on_it_behind() -> None:
    walls = wall()
    rng = np.random.default_rng(0)
    noise = face(-0.06, (-2, 2), (0.2, 2.0), -1.0)
    chosen = rng.random(len(noise)) < 0.2
    walls.add_surfaces(Structure(noise.points[chosen] - [0.15, 0, 0], noise.normals[chosen]))
    assert walls.clear_between(box(-0.08, 0.0, (0.04, 0.8, 1.4)), box(-1.0))
