"""Rectilinear solids: walls, floors and ceilings as the closed surface of filled cells, without cracks between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.simulation.world import Material, Shape


def filled_cells(
    edges: Sequence[FloatArray], filled: BoolArray, facing: IntArray, materials: Sequence[Material]
) -> Shape:
    """The surface of all filled cells of a grid.

    `edges` are the (a + 1,), (b + 1,), (c + 1,) ascending coordinates of the cells' sides along x, y and z; `filled`
    (a, b, c); a face takes the material that `facing` (a + 2, b + 2), indices into `materials`, names for the column of
    cells it looks into, one more on every side (or that it belongs to, where it looks up or down).
    """
    padded = np.pad(filled, 1)
    grid = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1)
    quads, chosen = [], []
    for axis in range(3):
        for sign in (-1, 1):
            neighbour = np.roll(padded, -sign, axis=axis)[1:-1, 1:-1, 1:-1]
            cells = np.argwhere(filled & ~neighbour)
            quads.append(_faces(grid, cells, axis, sign))
            looked_into = cells + 1
            looked_into[:, axis] += sign
            chosen.append(facing[looked_into[:, 0], looked_into[:, 1]])
    corners, material = np.concatenate(quads), np.concatenate(chosen)
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]]).reshape(-1, 3)
    vertices, index = np.unique(triangles.round(9), axis=0, return_inverse=True)
    return Shape(vertices, index.reshape(-1, 3).astype(np.int64), np.tile(material, 2), tuple(materials))


def _faces(grid: FloatArray, cells: IntArray, axis: int, sign: int) -> FloatArray:
    """The corners (n, 4, 3) of one side of cells (n, 3), counter-clockwise seen from outside."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    steps = np.zeros((4, 3), np.int64)
    steps[[1, 2], u] = 1
    steps[[2, 3], v] = 1
    steps[:, axis] = sign > 0
    at = cells[:, None] + (steps if sign > 0 else steps[::-1])
    corners: FloatArray = grid[at[..., 0], at[..., 1], at[..., 2]]
    return corners
