"""The simulated world as values: what is in it, where everything stands or moves when, and how its surfaces look.

The world frame is level: z up, z = 0 on the floor. A thing's own frame has its origin at the foot's centre (lying on
the surface it stands on; for what hangs on a wall, the middle of its back side's lower edge), z up, and its front
towards -y. Times are sensor time in nanoseconds, the same clock for all traversals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray, IntArray, check_shape
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import check_transform, interpolate_transform, transform_points

Pattern = Literal["plain", "speckle", "stripes", "checks", "grain", "print"]
"""How a material varies over its surface: `speckle` is carpet or plaster, `grain` wood, `print` pages and pictures."""


@dataclass(frozen=True)
class Material:
    """How a surface looks: `rgb` 0..255, a pattern of size `scale_m` that darkens and lightens it by `contrast`.

    `depth_return` is the share of it from which a depth camera or a LiDAR gets light back, the rest being patches of a
    few centimetres. A surface that is `see_through` is clear glass: both of them measure what is behind it, and images
    show that through it. Neither is part of what a material prints as, which names its pattern.
    """

    rgb: tuple[float, float, float]
    pattern: Pattern = "plain"
    scale_m: float = 0.1
    contrast: float = 0.15
    depth_return: float = field(default=1.0, repr=False)
    see_through: bool = field(default=False, repr=False)


@dataclass(frozen=True)
class Shape:
    """A surface of triangles in its own frame.

    `vertices` (n, 3) float64 metres; `triangles` (m, 3) int64 into them, counter-clockwise seen from outside;
    `material` (m,) int64 into `materials`.
    """

    vertices: FloatArray
    triangles: IntArray
    material: IntArray
    materials: tuple[Material, ...]

    def __post_init__(self) -> None:
        check_shape("vertices", self.vertices, (None, 3))
        check_shape("triangles", self.triangles, (None, 3))
        check_shape("material", self.material, (len(self.triangles),))
        if len(self.triangles) == 0:
            raise ValueError("a shape needs triangles")

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The lowest and the highest corner (3,), (3,)."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    def moved(self, T_target_shape: FloatArray) -> Shape:
        """The same shape in another frame."""
        return Shape(transform_points(T_target_shape, self.vertices), self.triangles, self.material, self.materials)


def join_shapes(shapes: Sequence[Shape]) -> Shape:
    """One shape of several that share a frame; equal materials are kept once."""
    materials = tuple(dict.fromkeys(material for shape in shapes for material in shape.materials))
    offsets = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
    return Shape(
        np.concatenate([shape.vertices for shape in shapes]),
        np.concatenate([shape.triangles + at for shape, at in zip(shapes, offsets[:-1], strict=True)]),
        np.concatenate(
            [np.array([materials.index(material) for material in shape.materials])[shape.material] for shape in shapes]
        ),
        materials,
    )


@dataclass(frozen=True)
class Fixture:
    """A part of the building, in the world frame: wall, floor, ceiling, door or window."""

    label: str
    shape: Shape


@dataclass(frozen=True)
class SimulatedThing:
    """Something the map should know (or, for a person, should know to keep out): `id` is unique in the world."""

    id: str
    label: str
    shape: Shape


@dataclass(frozen=True)
class Stay:
    """The half-open interval [since_ns, until_ns) in which a thing stands in one place; open ends reach for ever.

    `on` names the thing it stands on, in or hangs from, if any.
    """

    thing_id: str
    T_world_thing: FloatArray
    since_ns: int | None = None
    until_ns: int | None = None
    on: str | None = None

    def __post_init__(self) -> None:
        check_transform("T_world_thing", self.T_world_thing)
        if self.since_ns is not None and self.until_ns is not None and self.since_ns >= self.until_ns:
            raise ValueError(f"{self.thing_id} stays from {self.since_ns} to {self.until_ns}")

    def covers(self, stamp_ns: int) -> bool:
        """Whether it stands there at that time."""
        since, until = self.since_ns, self.until_ns
        return (since is None or since <= stamp_ns) and (until is None or stamp_ns < until)


@dataclass(frozen=True)
class Motion:
    """A rigid body in motion during [stamps_ns[0], stamps_ns[-1]): a carried thing, or one limb of a person.

    `T_world_body` (k, 4, 4) at `stamps_ns` (k,) int64, ascending; in between it is interpolated.
    """

    thing_id: str
    shape: Shape
    stamps_ns: IntArray
    T_world_body: FloatArray

    def __post_init__(self) -> None:
        check_shape("stamps_ns", self.stamps_ns, (None,))
        check_shape("T_world_body", self.T_world_body, (len(self.stamps_ns), 4, 4))
        if len(self.stamps_ns) < 2 or (np.diff(self.stamps_ns) <= 0).any():
            raise ValueError("a motion needs two or more ascending stamps")

    def at(self, stamp_ns: int) -> FloatArray | None:
        """`T_world_body` (4, 4) at a time; `None` outside the motion."""
        if not self.stamps_ns[0] <= stamp_ns < self.stamps_ns[-1]:
            return None
        k = int(np.searchsorted(self.stamps_ns, stamp_ns, side="right")) - 1
        fraction = float((stamp_ns - self.stamps_ns[k]) / (self.stamps_ns[k + 1] - self.stamps_ns[k]))
        return interpolate_transform(self.T_world_body[k], self.T_world_body[k + 1], fraction)


@dataclass(frozen=True)
class World:
    """All there is. Stays of one thing do not overlap, nor do they overlap its motions."""

    fixtures: tuple[Fixture, ...]
    things: tuple[SimulatedThing, ...]
    stays: tuple[Stay, ...]
    motions: tuple[Motion, ...] = ()

    def __post_init__(self) -> None:
        if len(self.index) != len(self.things):
            raise ValueError("two things share an id")
        named = {stay.thing_id for stay in self.stays} | {motion.thing_id for motion in self.motions}
        if unknown := named - set(self.index):
            raise ValueError(f"stays or motions of unknown things: {sorted(unknown)}")

    @cached_property
    def index(self) -> dict[str, int]:
        """A thing's id -> its place in `things`."""
        return {thing.id: k for k, thing in enumerate(self.things)}

    def thing(self, thing_id: str) -> SimulatedThing:
        """The thing of an id."""
        return self.things[self.index[thing_id]]

    def stays_of(self, thing_id: str) -> tuple[Stay, ...]:
        """Where a thing stood, in the order given."""
        return tuple(stay for stay in self.stays if stay.thing_id == thing_id)


def box_of(shape: Shape, T_world_thing: FloatArray) -> Box3D:
    """The upright box of a shape in a place: tight along the thing's own axes (things stand upright)."""
    low, high = shape.bounds
    center = transform_points(T_world_thing, ((low + high) / 2)[None])[0]
    return Box3D(center, high - low, float(np.arctan2(T_world_thing[1, 0], T_world_thing[0, 0])))


def sample_surface(shape: Shape, spacing_m: float, seed: int = 0) -> tuple[Float32Array, Float32Array]:
    """Points (n, 3) spread evenly at random over a shape, about one per spacing_m^2, and their outward normals (n, 3).

    Every triangle's share is its area; a small shape gets 64 points all the same.
    """
    a, b, c = (shape.vertices[shape.triangles[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    doubled = np.linalg.norm(cross, axis=1)
    area_m2 = float(doubled.sum() / 2)
    count = max(64, round(area_m2 / spacing_m**2))
    rng = np.random.default_rng(seed)
    cumulative = np.cumsum(doubled) / doubled.sum()
    chosen = np.minimum(np.searchsorted(cumulative, (np.arange(count) + rng.random(count)) / count), len(a) - 1)
    u, v = rng.random((2, count, 1))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    points = a[chosen] + u * (b[chosen] - a[chosen]) + v * (c[chosen] - a[chosen])
    normals = cross[chosen] / np.maximum(doubled[chosen], 1e-12)[:, None]
    return points.astype(np.float32), normals.astype(np.float32)
