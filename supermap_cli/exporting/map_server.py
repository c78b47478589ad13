"""The floor as nav2's map_server reads it: a PGM image and a YAML file beside it.

Format: https://docs.nav2.org/configuration/packages/configuring-map-server.html, mode `trinary`; grey values as nav2's
map_saver writes them.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from supermap_cli.geometry.arrays import UInt8Array
from supermap_cli.navigation.grid import FREE, OCCUPIED, OccupancyGrid

GREY_FREE, GREY_OCCUPIED, GREY_UNKNOWN = 254, 0, 205
"""Grey values of nav2's map_saver."""
OCCUPIED_THRESHOLD, FREE_THRESHOLD = 0.65, 0.196
"""Shares of darkness: above, a cell is occupied; below, it is free. 205 of 255 (0.196) lies between them."""


def grid_pgm(grid: OccupancyGrid) -> bytes:
    """The image, binary PGM: the first row is the one of the largest y."""
    grey = np.full(grid.cells.shape, GREY_UNKNOWN, np.uint8)
    grey[grid.cells == FREE] = GREY_FREE
    grey[grid.cells == OCCUPIED] = GREY_OCCUPIED
    image: UInt8Array = np.ascontiguousarray(grey.T[::-1])
    height, width = image.shape
    return f"P5\n# supermap, {grid.cell_m:g} m/pixel\n{width} {height}\n255\n".encode() + image.tobytes()


def grid_yaml(grid: OccupancyGrid, image: Path) -> str:
    """The YAML file of an image that lies beside it; `origin` is the pose of the image's lower left corner."""
    x, y = (round(float(value), 4) for value in grid.origin_xy)
    return (
        f"image: {json.dumps(image.name)}\n"
        "mode: trinary\n"
        f"resolution: {grid.cell_m:g}\n"
        f"origin: [{x}, {y}, 0.0]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESHOLD}\n"
        f"free_thresh: {FREE_THRESHOLD}\n"
    )
