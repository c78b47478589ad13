"""How an image shows the places of things, and which surfaces any image has shown: truth that needs exact depth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.simulation.views import PlaceVisibility, RenderedView
from supermap_cli.simulation.world import Shape, World, sample_surface

_SAMPLES_A_PLACE = 300  # surface samples: shares are exact to about 3 %
_TOLERANCE_M = 0.01  # m that a sample may lie behind the pixel's surface and still be on it
_STEEPEST_TAN, _PIXEL_REACH = 4.0, 0.75  # slope up to which that grows with the slant; pixels from a sample to its ray


@dataclass(frozen=True)
class _Patches:
    """Small pieces of surface: `points` (n, 3) and outward `normals` (n, 3) in one frame, `area` (n,), `row` (n,) of
    the list of places or samples that they belong to.
    """

    points: FloatArray
    normals: FloatArray
    area: FloatArray
    row: IntArray

    @classmethod
    def of(cls, shape: Shape, spacing_m: float) -> _Patches:
        """Patches of a shape in its own frame, all in row 0."""
        points, normals = sample_surface(shape, spacing_m)
        area = np.full(len(points), area_m2(shape) / len(points))
        return cls(points.astype(np.float64), normals.astype(np.float64), area, np.zeros(len(points), np.int64))

    @classmethod
    def joined(cls, patches: Iterable[_Patches]) -> _Patches:
        """All of several, which share a frame."""
        none = cls(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty(0, np.int64))
        columns = zip(*(vars(part).values() for part in [none, *patches]), strict=True)
        return cls(*(np.concatenate(column) for column in columns))

    def placed(self, T_world_body: FloatArray, row: int) -> _Patches:
        """Where they are while the body is there."""
        points, normals = transform_points(T_world_body, self.points), self.normals @ T_world_body[:3, :3].T
        return _Patches(points, normals, self.area, np.full(len(points), row))

    def chosen(self, which: IntArray | BoolArray) -> _Patches:
        """Some of them."""
        return _Patches(self.points[which], self.normals[which], self.area[which], self.row[which])

    def facing(self, eye: FloatArray) -> BoolArray:
        """(n,) which of them turn their outer side to a point (3,)."""
        facing: BoolArray = np.einsum("ij,ij->i", self.normals, eye - self.points) > 0
        return facing

    def share(self, which: BoolArray, rows: int) -> Float32Array:
        """(rows,) how much of each row's area some of them hold, in [0, 1]."""
        whole = np.bincount(self.row, self.area, rows)
        part = np.bincount(self.row[which], self.area[which], rows)
        share: Float32Array = (part / np.maximum(whole, 1e-12)).clip(0, 1).astype(np.float32)
        return share

    def middle(self) -> FloatArray:
        """The middle (3,) of their bounds."""
        middle: FloatArray = (self.points.min(axis=0) + self.points.max(axis=0)) / 2
        return middle


def area_m2(shape: Shape) -> float:
    """Surface area of a shape."""
    a, b, c = (shape.vertices[shape.triangles[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@dataclass(frozen=True)
class _Comparison:
    """Points held against a view: `on_image` (n,); `thing` (n,) that their pixels show; `behind_m` (n,) how far they
    lie behind what their pixels show, -inf where that is nothing; `slack_m` (n,) how much of that a pixel's size and
    the slant of what it shows may account for. The last three say nothing for points off the image.
    """

    on_image: BoolArray
    thing: Int32Array
    behind_m: FloatArray
    slack_m: FloatArray


def _compare(view: RenderedView, camera: Camera, points_camera: FloatArray) -> _Comparison:
    pixels, on_image = camera.project(points_camera)
    u, v = np.rint(np.where(on_image[:, None], pixels, 0)).astype(np.int64).T
    surface_m = view.depth_m[v, u]
    behind_m = np.where(surface_m > 0, camera.depth_of(points_camera) - surface_m, -np.inf)
    cos = np.maximum(view.slant_cos[v, u], 1e-3)
    tan = np.minimum(np.sqrt(np.maximum(1 - cos**2, 0)) / cos, _STEEPEST_TAN)
    slack_m = _TOLERANCE_M + tan * surface_m * _PIXEL_REACH / camera.focal_px()
    return _Comparison(on_image, view.thing[v, u], behind_m, slack_m)


class VisibilityModel:
    """Measures how an image shows every place in the world, by comparing surface samples with the exact depth.

    Only samples that face the camera count. A thing does not occlude itself: samples behind its own near side count as
    visible, as they do for a place that it has left.
    """

    def __init__(self, world: World, *, farthest_m: float) -> None:
        self.world = world
        self.farthest_m = farthest_m
        self._stays = [
            (k, j, stay) for k, thing in enumerate(world.things) for j, stay in enumerate(world.stays_of(thing.id))
        ]
        own = [_some_patches(thing.shape) for thing in world.things]
        places = [own[k].placed(stay.T_world_thing, row) for row, (k, _, stay) in enumerate(self._stays)]
        self._standing, self._middles = _Patches.joined(places), [place.middle() for place in places]
        self._bodies = [(world.index[motion.thing_id], motion, _some_patches(motion.shape)) for motion in world.motions]

    def measure(self, view: RenderedView, camera: Camera, T_world_camera: FloatArray) -> PlaceVisibility:
        """How a view shows all places: a row for each stay of each thing, in the order of both, then a row for each
        thing that is in motion now.
        """
        moving = self._moving(view.stamp_ns)
        thing = np.array([*(k for k, _, _ in self._stays), *moving], np.int64)
        stay = np.array([*(j for _, j, _ in self._stays), *(-1 for _ in moving)], np.int64)
        present = np.array(
            [*(placed_stay.covers(view.stamp_ns) for _, _, placed_stay in self._stays), *(True for _ in moving)], bool
        )
        eye = T_world_camera[:3, 3]
        centers = np.array([*self._middles, *(patches.middle() for patches in moving.values())]).reshape(-1, 3)
        patches = _Patches.joined([self._standing, *moving.values()])
        front = patches.chosen(patches.facing(eye))
        compared = _compare(view, camera, transform_points(inverse(T_world_camera), front.points))
        in_image = compared.on_image & (np.linalg.norm(front.points - eye, axis=1) <= self.farthest_m)
        itself = (compared.thing == thing[front.row] + 1) & present[front.row]
        visible = in_image & (itself | (compared.behind_m <= compared.slack_m))
        pixels = np.bincount(view.thing.ravel(), minlength=len(self.world.things) + 1)
        return PlaceVisibility(
            thing,
            stay,
            present,
            front.share(in_image, len(thing)),
            front.share(visible, len(thing)),
            np.where(present, pixels[thing + 1], 0),
            np.linalg.norm(centers - eye, axis=1).astype(np.float32),
        )

    def _moving(self, stamp_ns: int) -> dict[int, _Patches]:
        """Patches of all bodies of each thing in motion, where they are now, in rows after those of all stays."""
        placed = [(k, motion.at(stamp_ns), patches) for k, motion, patches in self._bodies]
        now = [(k, T_world_body, patches) for k, T_world_body, patches in placed if T_world_body is not None]
        return {
            k: _Patches.joined(patches.placed(T, row) for moving_thing, T, patches in now if moving_thing == k)
            for row, k in enumerate(dict.fromkeys(k for k, _, _ in now), start=len(self._stays))
        }


def _some_patches(shape: Shape) -> _Patches:
    return _Patches.of(shape, float(np.sqrt(area_m2(shape) / _SAMPLES_A_PLACE)))


class SurfaceCoverage:
    """Collects which surface samples of things (while they stand) and of fixtures any view has shown."""

    def __init__(self, world: World, *, spacing_m: float, fixture_spacing_m: float, farthest_m: float) -> None:
        self.world = world
        self.farthest_m = farthest_m
        self._things = [_Samples(k + 1, thing.shape, spacing_m) for k, thing in enumerate(world.things)]
        self._fixtures = [_Samples(0, fixture.shape, fixture_spacing_m) for fixture in world.fixtures]

    @property
    def things(self) -> tuple[tuple[Float32Array, BoolArray], ...]:
        """Per thing of the world: samples (n, 3) in its own frame, and which of them have been seen (n,)."""
        return tuple((samples.points, samples.seen.copy()) for samples in self._things)

    @property
    def fixtures(self) -> tuple[tuple[Float32Array, BoolArray], ...]:
        """Per fixture of the world: samples (n, 3) in the world frame, and which of them have been seen (n,)."""
        return tuple((samples.points, samples.seen.copy()) for samples in self._fixtures)

    def add(self, view: RenderedView, camera: Camera, T_world_camera: FloatArray) -> None:
        """Take in a view: a sample is seen if it faces the camera and its pixel shows its thing at its depth."""
        T_camera_world = inverse(T_world_camera)
        shown = np.bincount(view.thing.ravel(), minlength=len(self.world.things) + 1) > 0
        placed = [(samples, T_camera_world) for samples in self._fixtures]
        for stay in self.world.stays:
            samples = self._things[self.world.index[stay.thing_id]]
            if shown[samples.thing] and stay.covers(view.stamp_ns):
                placed.append((samples, T_camera_world @ stay.T_world_thing))
        for samples, T_camera_own in placed:
            which, points_camera = samples.to_be_seen(T_camera_own, self.farthest_m)
            compared = _compare(view, camera, points_camera)
            agrees = compared.on_image & (np.abs(compared.behind_m) <= compared.slack_m)
            samples.seen[which[agrees & (compared.thing == samples.thing)]] = True


class _Samples:
    """Surface samples of one thing (as in `RayHits`) or fixture in its own frame; `seen` tells which have been seen."""

    def __init__(self, thing: int, shape: Shape, spacing_m: float) -> None:
        self.thing = thing
        self.points, self._normals = sample_surface(shape, spacing_m)
        self.seen = np.zeros(len(self.points), bool)
        self._planes = np.einsum("ij,ij->i", self._normals, self.points)

    def to_be_seen(self, T_camera_own: FloatArray, farthest_m: float) -> tuple[IntArray, FloatArray]:
        """Those samples (k,) that face the camera, not too far from it, and have not been seen; where they are (k, 3)
        in the camera's frame.
        """
        eye = inverse(T_camera_own)[:3, 3].astype(np.float32)
        which = np.flatnonzero((self._normals @ eye > self._planes) & ~self.seen)
        points_camera = transform_points(T_camera_own, self.points.take(which, axis=0))
        near = np.einsum("ij,ij->i", points_camera, points_camera) <= farthest_m**2
        return which[near], points_camera[near]
