"""How surfaces look: patterns laid over triangles in the thing's own frame, and light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from zlib import crc32

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray, UInt8Array
from supermap_cli.simulation.sensors.textures import LEVELS, atlas, texels_a_cell
from supermap_cli.simulation.world import Material, Shape

_LIGHT = np.array([0.37, 0.26, 0.89])
"""Direction towards the light in the world, unit length: 63 degrees up; chosen by eye."""
_AMBIENT, _FROM_ABOVE, _DIRECT = 0.62, 0.1, 0.35
"""Shares of full brightness of a Lambertian surface in an evenly lit office; chosen by eye."""
_FADES_M = 25.0
"""m at which a surface is half as bright; chosen by eye, so that within a room distance hardly shows."""


@dataclass(frozen=True)
class Paint:
    """Per triangle, as rows over m triangles: where its first corner lies on the pattern's tile, `corner` (2, m), and
    how its two sides from there run on it, `first_side` and `second_side` (2, m), all float32 texels (across, along);
    `texels_per_m` (m,); `rgb` (3, m) in 0..255 and `contrast` (m,) float32; `pattern` (m,) int32 of the atlas.
    """

    corner: Float32Array
    first_side: Float32Array
    second_side: Float32Array
    texels_per_m: Float32Array
    rgb: Float32Array
    contrast: Float32Array
    pattern: Int32Array

    def rgb_at(
        self, triangle: IntArray, weights: Float32Array, footprint_m: Float32Array, light: Float32Array
    ) -> UInt8Array:
        """Colours (n, 3) of points on triangles (n,): `weights` (n, 2) barycentric, of the second and third corner;
        `footprint_m` (n,) how much surface a pixel covers; `light` (n,) 1 = the material's own brightness.
        """
        u, v = np.ascontiguousarray(weights.T)
        across, along = (
            (
                self.corner[axis].take(triangle)
                + u * self.first_side[axis].take(triangle)
                + v * self.second_side[axis].take(triangle)
            ).astype(np.int32)
            for axis in range(2)
        )
        level = _whole_log2(footprint_m * self.texels_per_m.take(triangle))
        texture = atlas().look_up(self.pattern.take(triangle), level, across, along)
        contrast = self.contrast.take(triangle)
        texture *= contrast
        texture += 1
        texture *= light
        rgb = np.empty((len(triangle), 3), np.uint8)
        for channel in range(3):
            rgb[:, channel] = np.minimum(texture[channel] * self.rgb[channel].take(triangle), 255)
        return rgb


def _whole_log2(ratio: Float32Array) -> Int32Array:
    """The nearest whole logarithm, within the atlas's levels, read off the exponent bits (IEEE 754 binary32)."""
    exponent = ((ratio * np.float32(np.sqrt(2))).view(np.int32) >> 23) - 127
    return np.clip(exponent, 0, LEVELS - 1, out=exponent)


def paint(shape: Shape) -> Paint:
    """Lay each material's pattern over a shape, from three sides: a triangle takes the one that it faces most.

    Patterns run along z on upright faces and along the shape's longer side on level ones. They begin at the shape's
    lowest corner, but for whole cells that depend on the material alone: equal things look equal, others do not.
    """
    low, high = shape.bounds
    corners = (shape.vertices - low)[shape.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    longer = 0 if high[0] - low[0] >= high[1] - low[1] else 1
    across_along = np.array([[1, 2], [0, 2], [1 - longer, longer]])[np.abs(normal).argmax(axis=1)]
    flat = np.take_along_axis(corners, across_along[:, None, :], axis=2)
    texels_per_m = np.array([texels_a_cell(material.pattern) / material.scale_m for material in shape.materials])[
        shape.material
    ]
    cells = np.array([_first_cell(material) for material in shape.materials])[shape.material]
    flat *= texels_per_m[:, None, None]
    patterns = atlas().patterns
    return Paint(
        _rows(flat[:, 0] + cells),
        _rows(flat[:, 1] - flat[:, 0]),
        _rows(flat[:, 2] - flat[:, 0]),
        texels_per_m.astype(np.float32),
        _rows(np.array([material.rgb for material in shape.materials])[shape.material]),
        np.array([material.contrast for material in shape.materials], np.float32)[shape.material],
        np.array([patterns.index(material.pattern) for material in shape.materials], np.int32)[shape.material],
    )


def _rows(columns: FloatArray) -> Float32Array:
    return np.ascontiguousarray(columns.T, np.float32)


def _first_cell(material: Material) -> tuple[int, int]:
    """The texel at which a material's pattern begins on its tile."""
    code = crc32(repr(material).encode())
    cell = texels_a_cell(material.pattern)
    return (code % 16) * cell, (code // 16 % 16) * cell


def join_paints(paints: Sequence[Paint]) -> Paint:
    """One paint of several, and one triangle more at the end for rays that hit nothing: black."""
    point, one = np.zeros((2, 1), np.float32), np.ones(1, np.float32)
    black = Paint(point, point, point, one, np.zeros((3, 1), np.float32), 0 * one, np.zeros(1, np.int32))
    columns = zip(*(vars(one_paint).values() for one_paint in [*paints, black]), strict=True)
    return Paint(*(np.concatenate(column, axis=-1) for column in columns))


@dataclass(frozen=True)
class Shading:
    """The light that falls on the outer and on the inner side of each triangle: `sides` (2 m + 2,) float32, all outer
    ones first, with a last one for rays that hit nothing.

    Lambert's cosine law for one fixed direction, and ambient light that is stronger from above.
    """

    sides: Float32Array

    @classmethod
    def of(cls, normals: FloatArray) -> Shading:
        """The shading of outward unit normals (m, 3) in the world."""
        nothing = np.zeros((1, 3))
        both = np.concatenate([normals, nothing, -normals, nothing])
        light = _AMBIENT + _FROM_ABOVE * (1 + both[:, 2]) + _DIRECT * np.maximum(both @ _LIGHT, 0)
        return cls(light.astype(np.float32))

    def light(
        self, triangle: IntArray, inside: BoolArray, slant_cos: Float32Array, range_m: Float32Array
    ) -> Float32Array:
        """The light (n,) on triangles seen from in- or outside; it fades with the slant and with the distance."""
        light = self.sides.take(triangle + inside * (len(self.sides) // 2))
        light *= np.float32(0.8) + np.float32(0.2) * slant_cos
        light /= 1 + (range_m * np.float32(1 / _FADES_M)) ** 2
        return light
