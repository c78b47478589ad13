"""The solids that things are made of: closed surfaces, counter-clockwise seen from outside, in metres.

`foot` is always the middle of a solid's lower face (3,).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import make_transform, rotation_between
from supermap_cli.simulation.world import Material, Shape, join_shapes

Point = tuple[float, float, float]
ORIGIN: Point = (0.0, 0.0, 0.0)


def solid(vertices: ArrayLike, triangles: ArrayLike, material: Material) -> Shape:
    """A closed surface of one material; it is turned inside out if its signed volume is negative."""
    points, faces = np.asarray(vertices, np.float64), np.asarray(triangles, np.int64)
    if signed_volume_m3(points[faces]) < 0:
        faces = faces[:, ::-1]
    return Shape(points, np.ascontiguousarray(faces), np.zeros(len(faces), np.int64), (material,))


def signed_volume_m3(corners: FloatArray) -> float:
    """The volume within a closed surface of triangles (n, 3, 3); negative where it is inside out (Gauss's theorem)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return float(np.einsum("ni,ni->", a, np.cross(b, c)) / 6)


def extruded(outline: ArrayLike, height: float, material: Material, foot: Point = ORIGIN) -> Shape:
    """A prism: a convex outline (k, 2), counter-clockwise, raised by `height`."""
    xy = np.asarray(outline, np.float64)
    k = len(xy)
    low, high = np.column_stack([xy, np.zeros(k)]), np.column_stack([xy, np.full(k, height)])
    here, then = np.arange(k), np.roll(np.arange(k), -1)
    fan = np.column_stack([np.zeros(k - 2, np.int64), np.arange(1, k - 1), np.arange(2, k)])
    sides = [np.column_stack([here, then, then + k]), np.column_stack([here, then + k, here + k])]
    return solid(np.concatenate([low, high]) + foot, np.concatenate([fan[:, ::-1], fan + k, *sides]), material)


def block(size: Point, material: Material, foot: Point = ORIGIN) -> Shape:
    """A cuboid of `size` along x, y and z."""
    x, y = size[0] / 2, size[1] / 2
    return extruded([(-x, -y), (x, -y), (x, y), (-x, y)], size[2], material, foot)


def rounded_block(size: Point, radius: float, material: Material, foot: Point = ORIGIN, steps: int = 3) -> Shape:
    """A cuboid whose upright edges are rounded."""
    angles = np.linspace(0, np.pi / 2, steps)
    inner = np.array([size[0] / 2 - radius, size[1] / 2 - radius])
    corners = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    arcs = [
        np.array(sign) * inner + radius * np.column_stack([np.cos(angles + turn), np.sin(angles + turn)])
        for sign, turn in zip(corners, np.arange(4) * np.pi / 2, strict=True)
    ]
    return extruded(np.concatenate(arcs), size[2], material, foot)


def wedge(size: Point, top_depth: float, material: Material, foot: Point = ORIGIN) -> Shape:
    """A cuboid whose depth (y) shrinks to `top_depth` at the top, while its back stays upright."""
    outline = [(-size[1] / 2, 0.0), (size[1] / 2, 0.0), (size[1] / 2, size[2]), (size[1] / 2 - top_depth, size[2])]
    prism = extruded(outline, size[0], material)
    upright = make_transform([[0, 0, 1], [1, 0, 0], [0, 1, 0]], [foot[0] - size[0] / 2, foot[1], foot[2]])
    return prism.moved(upright)


def lathe(profile: Sequence[tuple[float, float]], material: Material, foot: Point = ORIGIN, sides: int = 12) -> Shape:
    """A solid of revolution about z: `profile` goes (radius, height) from the axis below, outwards and up, and back.

    Where it turns inwards and down again the solid is hollow, like a mug. It is closed on the axis at both ends.
    """
    path = [(0.0, profile[0][1]), *(point for point in profile if point[0] > 0), (0.0, profile[-1][1])]
    angles = np.arange(sides) * 2 * np.pi / sides
    rings = [np.column_stack([r * np.cos(angles), r * np.sin(angles), np.full(sides, z)]) for r, z in path[1:-1]]
    poles = np.array([[0.0, 0.0, path[0][1]], [0.0, 0.0, path[-1][1]]])
    here, then = np.arange(sides), np.roll(np.arange(sides), -1)
    bottom, top = len(rings) * sides, len(rings) * sides + 1
    faces = [np.column_stack([np.full(sides, bottom), then, here])]
    for ring in range(len(rings) - 1):
        lower, upper = ring * sides, (ring + 1) * sides
        faces.append(np.column_stack([here + lower, then + lower, then + upper]))
        faces.append(np.column_stack([here + lower, then + upper, here + upper]))
    last = (len(rings) - 1) * sides
    faces.append(np.column_stack([here + last, then + last, np.full(sides, top)]))
    return solid(np.concatenate([*rings, poles]) + foot, np.concatenate(faces), material)


def cylinder(
    radius: float,
    height: float,
    material: Material,
    foot: Point = ORIGIN,
    *,
    top_radius: float | None = None,
    sides: int = 12,
) -> Shape:
    """An upright cylinder, or with a `top_radius` of its own a truncated cone."""
    return lathe([(radius, 0), (radius if top_radius is None else top_radius, height)], material, foot, sides)


def vessel(radius: float, height: float, wall: float, material: Material, *, base_radius: float | None = None) -> Shape:
    """A round vessel, open above, that widens from `base_radius` to `radius`."""
    base = radius if base_radius is None else base_radius
    profile = [(base, 0), (radius, height), (radius - wall, height), (base - wall, wall)]
    return lathe(profile, material, sides=16)


def ball(radii: Point, material: Material, foot: Point = ORIGIN, sides: int = 8, rings: int = 5) -> Shape:
    """An ellipsoid of half axes `radii`, standing on its lowest point."""
    heights = np.linspace(-np.pi / 2, np.pi / 2, rings + 2)[1:-1]
    profile = [(0.0, -1.0), *((float(np.cos(a)), float(np.sin(a))) for a in heights), (0.0, 1.0)]
    unit = lathe(profile, material, sides=sides)
    vertices = (unit.vertices + np.array([0, 0, 1])) * radii + foot
    return Shape(vertices, unit.triangles, unit.material, unit.materials)


def rod(start: ArrayLike, end: ArrayLike, radius: float, material: Material, sides: int = 6) -> Shape:
    """A round bar between two points (3,)."""
    along = np.asarray(end, np.float64) - np.asarray(start, np.float64)
    bar = cylinder(radius, float(np.linalg.norm(along)), material, sides=sides)
    return bar.moved(make_transform(rotation_between([0, 0, 1], along), start))


def bent_rod(points: ArrayLike, radius: float, material: Material, sides: int = 5) -> Shape:
    """Bars from point to point (n, 3): a handle, a stem, a frame."""
    path = np.asarray(points, np.float64)
    return join_shapes([rod(a, b, radius, material, sides) for a, b in pairwise(path)])


def leaf(base: ArrayLike, tip: ArrayLike, width: float, material: Material) -> Shape:
    """A leaf folded along its midrib, from `base` to `tip` (3,)."""
    start, end = np.asarray(base, np.float64), np.asarray(tip, np.float64)
    along = end - start
    across = np.cross(along, [0, 0, 1.0])
    across *= width / 2 / max(float(np.linalg.norm(across)), 1e-9)
    widest = start + 0.45 * along + (0, 0, 0.15 * width)
    vertices = np.array([start, widest + across, end, widest - across])
    return solid(vertices, [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)], material)


def shifted(shape: Shape, by: Point) -> Shape:
    """The same, further on by (x, y, z)."""
    return shape.moved(make_transform(np.eye(3), by))


def pitched(shape: Shape, degrees: float, about: Point = ORIGIN) -> Shape:
    """Turned about an axis along x through `about`: a positive angle tips the top backwards, towards +y."""
    sin, cos = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    R = np.array([[1, 0, 0], [0, cos, sin], [0, -sin, cos]])
    return shape.moved(make_transform(R, np.asarray(about) - R @ np.asarray(about)))


def yawed(shape: Shape, radians: float) -> Shape:
    """Turned about z, counter-clockwise seen from above."""
    sin, cos = np.sin(radians), np.cos(radians)
    return shape.moved(make_transform([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], ORIGIN))


def upright(shape: Shape) -> Shape:
    """What lies on its back stands up: its upper side becomes the front, towards -y, and its +y the top."""
    return pitched(shape, -90)
