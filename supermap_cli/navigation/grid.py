"""The floor from above as a grid: free, occupied, or never seen; with the clearance around every cell."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import distance_transform_edt

from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray, UInt8Array

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""What a cell is; unknown is what nobody has seen from floor to robot height."""


@dataclass(frozen=True)
class OccupancyGrid:
    """Cells (nx, ny) uint8 of `cell_m` metres; cell (i, j) covers x from `origin_xy[0] + i * cell_m`, y likewise, in
    the map frame. `blocked` (nx, ny, nz) bool are the voxels that hide things, in levels of `level_m` from z = 0 up.
    `driven` (nx, ny) bool are the cells that the robot's centre has passed over.
    """

    cells: UInt8Array
    origin_xy: FloatArray
    cell_m: float
    blocked: BoolArray
    driven: BoolArray
    level_m: float
    robot_height_m: float
    camera_height_m: float

    def indices(self, points_xy: FloatArray) -> IntArray:
        """The cells (n, 2) of points (n, 2); may lie outside of the grid."""
        return np.floor((np.asarray(points_xy, np.float64) - self.origin_xy) / self.cell_m).astype(np.int64)

    def centers(self, indices: IntArray) -> FloatArray:
        """The centres (n, 2) of cells (n, 2)."""
        centers: FloatArray = (np.asarray(indices) + 0.5) * self.cell_m + self.origin_xy
        return centers

    def inside(self, indices: IntArray) -> BoolArray:
        """Which of the cells (n, 2) lie in the grid."""
        within: BoolArray = (indices >= 0) & (indices < np.array(self.cells.shape))
        inside: BoolArray = np.logical_and.reduce(within, axis=1)
        return inside

    @cached_property
    def clearance_m(self) -> FloatArray:
        """(nx, ny) metres from a free cell's centre to the nearest that is not free (less half a cell); 0 elsewhere."""
        return self._distance_m(np.pad(self.cells == FREE, 1))

    @cached_property
    def from_occupied_m(self) -> FloatArray:
        """As `clearance_m`, to the nearest cell that is occupied: what nobody has seen counts as free."""
        return self._distance_m(np.pad(self.cells != OCCUPIED, 1, constant_values=True))

    def _distance_m(self, padded: BoolArray) -> FloatArray:
        if padded.all():
            return np.full(self.cells.shape, np.inf)
        distance = distance_transform_edt(padded)[1:-1, 1:-1] * self.cell_m
        clearance: FloatArray = np.maximum(distance - self.cell_m / 2, 0.0)
        return clearance

    def counts(self) -> dict[str, float]:
        """Square metres of each kind."""
        area = self.cell_m**2
        names = {"free": FREE, "occupied": OCCUPIED, "unknown": UNKNOWN}
        return {name: float((self.cells == kind).sum()) * area for name, kind in names.items()}
