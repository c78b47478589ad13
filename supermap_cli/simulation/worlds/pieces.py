"""A shape as furniture: what room its parts take up, and which of its surfaces hold other things."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.simulation.world import Shape

TOUCH_M = 0.002
"""How far solids may reach into one another and still only touch."""
_NARROWEST_SURFACE_M = 0.2
"""Least side of a surface that other things can stand on, m."""
_LOWEST_GAP_M = 0.05
"""Least height above such a surface, m."""


@dataclass(frozen=True)
class Solids:
    """Upright cuboids that share a yaw: `centers` (k, 3) and `sizes` (k, 3), along the turned axes and z."""

    centers: FloatArray
    sizes: FloatArray
    yaw: float = 0.0

    def placed(self, T_target_source: FloatArray) -> Solids:
        """The same in another frame that is upright as well."""
        turn = float(np.arctan2(T_target_source[1, 0], T_target_source[0, 0]))
        return Solids(transform_points(T_target_source, self.centers), self.sizes, self.yaw + turn)

    def meet(self, other: Solids, gap_m: float = 0.0) -> bool:
        """Whether any of these cuts into any of the others, or comes nearer than `gap_m` to it sideways.

        By separating axes: z and the sides of both rectangles. What merely touches does not meet.
        """
        between = other.centers[None] - self.centers[:, None]
        reach_z = (self.sizes[:, None, 2] + other.sizes[None, :, 2]) / 2
        together: BoolArray = np.abs(between[..., 2]) < reach_z - TOUCH_M
        if not together.any():
            return False
        for axis in (*_axes(self.yaw), *_axes(other.yaw)):
            reach = self._reach(axis)[:, None] + other._reach(axis)[None] + gap_m - TOUCH_M
            together &= np.abs(between[..., :2] @ axis) < reach
        return bool(together.any())

    def _reach(self, axis: FloatArray) -> FloatArray:
        """(k,) how far each reaches from its centre along a horizontal direction (2,)."""
        reach: FloatArray = (self.sizes[:, :2] / 2) @ np.abs(_axes(self.yaw) @ axis)
        return reach


def _axes(yaw: float) -> FloatArray:
    """The two horizontal axes (2, 2) of a frame, one a row."""
    return np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])


@dataclass(frozen=True)
class SupportSurface:
    """A level rectangle on which things can stand: `low` and `high` (2,) in the shape's frame, at height `z_m`.

    `clear_m` is the room above it up to the next part of the same shape, infinite under the open sky.
    """

    z_m: float
    low: FloatArray
    high: FloatArray
    clear_m: float


@dataclass(frozen=True, eq=False)
class Piece:
    """A shape, with its parts (closed surfaces that share no vertex) told apart once."""

    label: str
    shape: Shape

    @cached_property
    def size(self) -> FloatArray:
        """(3,) of its own upright box."""
        low, high = self.shape.bounds
        return high - low

    @cached_property
    def parts(self) -> Solids:
        """The box of each part, in the shape's frame."""
        vertices, part = self.shape.vertices, vertex_parts(self.shape)
        count = int(part.max()) + 1
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        np.minimum.at(low, part, vertices)
        np.maximum.at(high, part, vertices)
        return Solids((low + high) / 2, high - low)

    @cached_property
    def outline(self) -> Solids:
        """The one box of the whole."""
        low, high = self.shape.bounds
        return Solids(((low + high) / 2)[None], self.size[None])

    @cached_property
    def surfaces(self) -> tuple[SupportSurface, ...]:
        """Where other things can stand, the highest first."""
        return tuple(sorted(self._find_surfaces(), key=lambda surface: -surface.z_m))

    @property
    def top(self) -> SupportSurface:
        """The highest surface. Raises `LookupError` for what holds nothing."""
        if not self.surfaces:
            raise LookupError(f"nothing can stand on a {self.label}")
        return self.surfaces[0]

    @property
    def shelves(self) -> tuple[SupportSurface, ...]:
        """The surfaces within: those with a part of the same shape above them, or else (an open box) the lowest."""
        return tuple(surface for surface in self.surfaces if np.isfinite(surface.clear_m)) or self.surfaces[-1:]

    def _find_surfaces(self) -> Iterator[SupportSurface]:
        corners = self.shape.vertices[self.shape.triangles]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        level = cross[:, 2] > 0.999 * np.linalg.norm(cross, axis=1)
        part = vertex_parts(self.shape)[self.shape.triangles[:, 0]]
        heights = np.round(corners[:, 0, 2], 6)
        for number, z in sorted({(int(p), float(h)) for p, h in zip(part[level], heights[level], strict=True)}):
            chosen = level & (part == number) & (heights == z)
            low, high = corners[chosen].min(axis=(0, 1))[:2], corners[chosen].max(axis=(0, 1))[:2]
            filled = cross[chosen, 2].sum() / 2 > 0.9 * np.prod(high - low)
            clear_m = self._clear_above(z, low, high)
            if filled and (high - low).min() >= _NARROWEST_SURFACE_M and clear_m >= _LOWEST_GAP_M:
                yield SupportSurface(z, low, high, clear_m)

    def _clear_above(self, z: float, low: FloatArray, high: FloatArray) -> float:
        """How far it is from a rectangle up to the next part that covers some of its middle half."""
        quarter = (high - low) / 4
        lower, upper = self.parts.centers - self.parts.sizes / 2, self.parts.centers + self.parts.sizes / 2
        over = (lower[:, :2] < high - quarter).all(axis=1) & (upper[:, :2] > low + quarter).all(axis=1)
        above = lower[over & (upper[:, 2] > z + TOUCH_M), 2]
        return max(float(above.min() - z), 0.0) if len(above) else float("inf")


def vertex_parts(shape: Shape) -> IntArray:
    """(n,) which connected part every vertex belongs to, numbered from 0."""
    number = np.arange(len(shape.vertices))
    while True:
        least = number[shape.triangles].min(axis=1)
        before = number.copy()
        np.minimum.at(number, shape.triangles.ravel(), np.repeat(least, 3))
        number = number[number]
        if (number == before).all():
            return np.unique(number, return_inverse=True)[1].astype(np.int64)
