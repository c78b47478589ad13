"""The world as surfaces that rays are cast into (open3d's RaycastingScene: Embree), at any time."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray, UInt8Array
from supermap_cli.geometry.open3d_loader import load_open3d
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.simulation.sensors.appearance import Paint, Shading, join_paints, paint
from supermap_cli.simulation.sensors.weak_returns import returns_in_patches
from supermap_cli.simulation.views import RayHits
from supermap_cli.simulation.world import Shape, World

_KEPT_GROUPS = 4  # groups, bounds the memory: of standing surfaces, kept for traversals that take turns
_BLOCK = 1 << 16  # rays cast at once; bounds the memory
_PIXEL_RAD = 0.002  # rad between neighbouring rays of a 640-pixel camera 69 degrees wide
_AT_REST = np.eye(4)
_GLASS_SHARE = 0.3  # share (chosen) of a pixel's colour that is the glass's own, not that of what is behind it


@dataclass(frozen=True)
class _Body:
    """A painted shape that belongs to `thing` (as in `RayHits`)."""

    thing: int
    shape: Shape
    paint: Paint


class Scene:
    """The world's surfaces. Standing things share one stage, which is built anew only when something else stands
    there; every thing that moves has a stage of its own, which only rays that pass near it are cast into. Glass of what
    stands is a stage that rays go through: they end behind it.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        shapes = [*(fixture.shape for fixture in world.fixtures), *(thing.shape for thing in world.things)]
        materials = [material for shape in shapes for material in shape.materials]
        self._weak = any(material.depth_return < 1 for material in materials)
        self._glazed = any(material.see_through for material in materials)
        self._fixtures = [_Body(0, fixture.shape, paint(fixture.shape)) for fixture in world.fixtures]
        self._things = [_Body(k + 1, thing.shape, paint(thing.shape)) for k, thing in enumerate(world.things)]
        self._movers = [
            (_Body(world.index[motion.thing_id] + 1, motion.shape, paint(motion.shape)), motion)
            for motion in world.motions
        ]
        self._standing: OrderedDict[tuple[int, ...], tuple[_SurfaceGroup, _SurfaceGroup | None]] = OrderedDict()

    def cast(
        self,
        stamp_ns: int,
        origins: NDArray[np.floating],
        directions: NDArray[np.floating],
        *,
        colour: bool,
        pixel_rad: float = _PIXEL_RAD,
    ) -> RayHits:
        """Where rays end: `directions` (n, 3) of any length, `origins` (n, 3), or (3,) where all rays share one.

        `pixel_rad` is the angle between neighbouring rays: patterns finer than that are blurred.
        """
        (standing, glass), moving = self._surface_group(stamp_ns), list(self._moving(stamp_ns))
        blocks = []
        for rays in _Rays.of(origins, directions, pixel_rad).blocks():
            hits = standing.cast(rays, colour=colour)
            for stage in moving:
                near = rays.passing(stage.center, stage.radius_m)
                if len(near):
                    _keep_nearer(hits, near, stage.cast(rays.chosen(near), colour=colour))
            if glass is not None:
                _look_through(hits, glass.cast(rays, colour=colour))
            blocks.append(hits)
        return _joined(blocks)

    def _surface_group(self, stamp_ns: int) -> tuple[_SurfaceGroup, _SurfaceGroup | None]:
        """Fixtures and standing things, and their glass; the last few are kept, as traversals may take turns."""
        standing = tuple(k for k, stay in enumerate(self.world.stays) if stay.covers(stamp_ns))
        if standing not in self._standing:
            stays = [self.world.stays[k] for k in standing]
            bodies = [(body, _AT_REST) for body in self._fixtures]
            bodies += [(self._things[self.world.index[stay.thing_id]], stay.T_world_thing) for stay in stays]
            glass = list(_parts(bodies, see_through=True)) if self._glazed else []
            if glass:
                bodies = list(_parts(bodies, see_through=False))
            self._standing[standing] = (
                _SurfaceGroup(bodies, weak=self._weak),
                _SurfaceGroup(glass, weak=False) if glass else None,
            )
            if len(self._standing) > _KEPT_GROUPS:
                self._standing.popitem(last=False)
        self._standing.move_to_end(standing)
        return self._standing[standing]

    def _moving(self, stamp_ns: int) -> Iterator[_SurfaceGroup]:
        """A stage for each thing that moves, with all its bodies where they are now."""
        now: dict[int, list[tuple[_Body, FloatArray]]] = {}
        for body, motion in self._movers:
            T_world_body = motion.at(stamp_ns)
            if T_world_body is not None:
                now.setdefault(body.thing, []).append((body, T_world_body))
        for bodies in now.values():
            yield _SurfaceGroup(bodies, weak=self._weak)


@dataclass(frozen=True)
class _Rays:
    """Rays with `directions` (n, 3) of `lengths` (n,) from `origins` (n, 3), or (3,) that all share, all float32."""

    origins: Float32Array
    directions: Float32Array
    lengths: Float32Array
    pixel_rad: float

    @classmethod
    def of(cls, origins: NDArray[np.floating], directions: NDArray[np.floating], pixel_rad: float) -> _Rays:
        directions = np.ascontiguousarray(directions, np.float32)
        lengths = np.sqrt(_row_dots(directions, directions))
        return cls(np.asarray(origins, np.float32), directions, lengths, pixel_rad)

    def blocks(self) -> Iterator[_Rays]:
        """All of them, in portions that fit into a processor's cache (a third faster); at least one portion."""
        for begin in range(0, max(len(self.directions), 1), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            origins = self.origins if self.origins.ndim == 1 else self.origins[block]
            yield _Rays(origins, self.directions[block], self.lengths[block], self.pixel_rad)

    def packed(self) -> Float32Array:
        """Open3d's form (n, 6)."""
        rays = np.empty((len(self.directions), 6), np.float32)
        rays[:, :3], rays[:, 3:] = self.origins, self.directions
        return rays

    def chosen(self, at: IntArray) -> _Rays:
        """Some of them."""
        origins = self.origins if self.origins.ndim == 1 else self.origins[at]
        return _Rays(origins, self.directions.take(at, axis=0), self.lengths.take(at), self.pixel_rad)

    def passing(self, center: Float32Array, radius_m: float) -> IntArray:
        """Which of them meet a sphere, ahead of or around their origins."""
        offset = center - self.origins
        along = self.directions @ offset if offset.ndim == 1 else _row_dots(self.directions, offset)
        distance2 = (offset**2).sum(axis=-1)
        met = along * np.abs(along) >= (distance2 - radius_m**2) * self.lengths**2
        return np.flatnonzero(met)


class _SurfaceGroup:
    """Painted bodies in their places, for as long as nothing moves: `center` (3,) and `radius_m` bound them all."""

    def __init__(self, placed: Sequence[tuple[_Body, FloatArray]], *, weak: bool) -> None:
        shapes = [(transform_points(T, body.shape.vertices), body.shape.triangles) for body, T in placed]
        vertices = np.concatenate([np.empty((0, 3)), *(vertices for vertices, _ in shapes)])
        counts = [len(triangles) for _, triangles in shapes]
        begins = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
        triangles = np.concatenate(
            [
                np.empty((0, 3), np.int64),
                *(shape_triangles + at for (_, shape_triangles), at in zip(shapes, begins[:-1], strict=True)),
            ]
        )
        things = np.array([*(body.thing for body, _ in placed), 0], np.int32)
        self._thing = np.repeat(things, [*counts, 1])
        self._paint = join_paints([body.paint for body, _ in placed])
        self._depth_return = _depth_returns(body for body, _ in placed) if weak else None
        self._shading = Shading.of(_normals(vertices[triangles]))
        self._core = load_open3d().core
        self._surfaces = load_open3d().t.geometry.RaycastingScene()
        if len(triangles):
            self.center, self.radius_m = _bounding_sphere(vertices)
            self._surfaces.add_triangles(
                self._core.Tensor(vertices.astype(np.float32)), self._core.Tensor(triangles.astype(np.uint32))
            )

    def cast(self, rays: _Rays, *, colour: bool) -> RayHits:
        """Where rays end on these bodies alone."""
        found = self._surfaces.cast_rays(self._core.Tensor.from_numpy(rays.packed()))
        distance, normals = found["t_hit"].numpy(), found["primitive_normals"].numpy()
        triangle = np.minimum(found["primitive_ids"].numpy(), len(self._thing) - 1).astype(np.intp)
        along = _row_dots(normals, rays.directions)
        inside = along > 0
        normals[np.flatnonzero(inside)] *= -1
        slant_cos = np.abs(along, out=along)
        slant_cos /= rays.lengths
        rgb: UInt8Array | None = None
        if colour:
            range_m = distance * rays.lengths
            light = self._shading.light(triangle, inside, slant_cos, range_m)
            footprint_m = range_m * np.float32(rays.pixel_rad)
            rgb = self._paint.rgb_at(triangle, found["primitive_uvs"].numpy(), footprint_m, light)
        returns = None if self._depth_return is None else self._returns(rays, distance, triangle)
        return RayHits(distance, self._thing.take(triangle), normals, slant_cos, rgb, returns)

    def _returns(self, rays: _Rays, distance: Float32Array, triangle: IntArray) -> BoolArray:
        """(n,) whether light comes back; only surfaces that do not send it all back are looked at closely."""
        returns = np.ones(len(triangle), bool)
        if self._depth_return is not None:
            share = self._depth_return.take(triangle)
            weak = np.flatnonzero(share < 1)
            some = rays.chosen(weak)
            points = some.origins + some.directions * distance[weak, None]
            returns[weak] = returns_in_patches(points, some.directions / some.lengths[:, None], share[weak])
        return returns


def _joined(blocks: Sequence[RayHits]) -> RayHits:
    """The hits of successive portions of rays as one."""
    if len(blocks) == 1:
        return blocks[0]
    rgb = [block.rgb for block in blocks if block.rgb is not None]
    returns = [block.returns for block in blocks if block.returns is not None]
    return RayHits(
        np.concatenate([block.distance for block in blocks]),
        np.concatenate([block.thing for block in blocks]),
        np.concatenate([block.normals for block in blocks]),
        np.concatenate([block.slant_cos for block in blocks]),
        np.concatenate(rgb) if rgb else None,
        np.concatenate(returns) if returns else None,
    )


def _row_dots(a: Float32Array, b: Float32Array) -> Float32Array:
    """(n,) inner products of (n, 3) with (n, 3); several times as fast as einsum on three columns."""
    dots = a[:, 0] * b[:, 0]
    dots += a[:, 1] * b[:, 1]
    dots += a[:, 2] * b[:, 2]
    return dots


def _normals(corners: FloatArray) -> FloatArray:
    """Outward unit normals (m, 3) of triangles (m, 3, 3); zero where they have no area."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals: FloatArray = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-12)[:, None]
    return normals


def _bounding_sphere(vertices: FloatArray) -> tuple[Float32Array, float]:
    """About the bounding box's centre, a millimetre too large against rounding."""
    center = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    return center.astype(np.float32), float(np.linalg.norm(vertices - center, axis=1).max()) + 1e-3


def _keep_nearer(hits: RayHits, at: IntArray, others: RayHits) -> None:
    """Write those `others`, which belong to the rays `at`, that are nearer into `hits`."""
    nearer = np.flatnonzero(others.distance < hits.distance[at])
    into = at[nearer]
    hits.distance[into] = others.distance[nearer]
    hits.thing[into] = others.thing[nearer]
    hits.normals[into] = others.normals[nearer]
    hits.slant_cos[into] = others.slant_cos[nearer]
    if hits.rgb is not None and others.rgb is not None:
        hits.rgb[into] = others.rgb[nearer]
    if hits.returns is not None and others.returns is not None:
        hits.returns[into] = others.returns[nearer]


def _look_through(hits: RayHits, glass: RayHits) -> None:
    """Where glass is nearer than what rays end on, it tints that; before bare fixtures it is the glass's thing that an
    image shows.
    """
    before = np.flatnonzero(glass.distance < hits.distance)
    bare = before[hits.thing[before] == 0]
    hits.thing[bare] = glass.thing[bare]
    if hits.rgb is not None and glass.rgb is not None:
        mixed = (1 - _GLASS_SHARE) * hits.rgb[before] + _GLASS_SHARE * glass.rgb[before]
        hits.rgb[before] = mixed.astype(np.uint8)


def _parts(placed: Sequence[tuple[_Body, FloatArray]], *, see_through: bool) -> Iterator[tuple[_Body, FloatArray]]:
    """The glass of bodies, or all the rest of them."""
    for body, T_world_body in placed:
        shape = body.shape
        wanted = np.array([material.see_through == see_through for material in shape.materials])[shape.material]
        if wanted.all():
            yield body, T_world_body
        elif wanted.any():
            part = Shape(shape.vertices, shape.triangles[wanted], shape.material[wanted], shape.materials)
            yield _Body(body.thing, part, paint(part)), T_world_body


def _depth_returns(bodies: Iterable[_Body]) -> Float32Array:
    """Per triangle the share of light that it sends back, and 1 for rays that hit nothing."""
    shares = [
        np.array([material.depth_return for material in body.shape.materials], np.float32)[body.shape.material]
        for body in bodies
    ]
    return np.concatenate([*shares, np.ones(1, np.float32)])
