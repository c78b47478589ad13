"""What a depth camera makes of an exact view: noise, and holes where such cameras return nothing."""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, IntArray
from supermap_cli.simulation.rigs import DepthSensor
from supermap_cli.simulation.views import RenderedView

_EDGE_M, _EDGE_SHARE = 0.03, 0.05  # m and share of the depth: the greater is the least jump of an edge
_HOLES_AT_EDGES, _MIXED_AT_EDGES = 0.7, 0.08  # shares of edge pixels without a return, and with a mixed one


def measure_depth(view: RenderedView, sensor: DepthSensor, rng: np.random.Generator) -> Float32Array:
    """Depth (h, w) in metres as the sensor reports it, 0 = no return.

    Beside a depth edge (a jump of more than 3 cm and 5 %) most pixels return nothing and a few fly between both
    surfaces, as where one pixel sees parts of each.
    """
    exact = view.depth_m
    sigma = np.float32(sensor.noise_per_m) * exact * exact
    measured = exact + sigma * rng.standard_normal(exact.shape, dtype=np.float32)
    near, far = _nearest_around(exact, sensor.edge_px), _farthest_around(exact, sensor.edge_px)
    edge = np.flatnonzero((far - near > np.maximum(_EDGE_M, _EDGE_SHARE * near)) & (exact > 0))
    fate = rng.random(len(edge), dtype=np.float32)
    _mix(measured, near, far, edge[fate >= 1 - _MIXED_AT_EDGES], rng)
    lost = (view.slant_cos < np.cos(np.radians(sensor.steepest_deg))) | (exact == 0)
    lost |= rng.random(exact.shape, dtype=np.float32) < sensor.lost_share
    lost |= (measured < sensor.nearest_m) | (measured > sensor.farthest_m)
    lost.flat[edge[fate < _HOLES_AT_EDGES]] = True
    if view.returns is not None:
        lost |= ~view.returns
    measured[lost] = 0
    return measured


def _mix(measured: Float32Array, near: Float32Array, far: Float32Array, at: IntArray, rng: np.random.Generator) -> None:
    """Replace some pixels (flat indices) by a random mean of the nearest and the farthest depth around them."""
    weight = rng.random(len(at), dtype=np.float32)
    measured.flat[at] = near.flat[at] * weight + far.flat[at] * (1 - weight)


def _nearest_around(depth_m: Float32Array, reach_px: int) -> Float32Array:
    """(h, w) the nearest return within a square of `reach_px` around each pixel, inf where there is none."""
    return -_farthest_around(np.where(depth_m > 0, -depth_m, np.float32(-np.inf)), reach_px)


def _farthest_around(depth_m: Float32Array, reach_px: int) -> Float32Array:
    """(h, w) the largest value within a square of `reach_px` around each pixel: rows first, then columns."""
    largest = depth_m.copy()
    for axis in (0, 1):
        values = np.moveaxis(largest.copy(), axis, 0)
        into = np.moveaxis(largest, axis, 0)
        for step in range(1, reach_px + 1):
            np.maximum(into[step:], values[:-step], out=into[step:])
            np.maximum(into[:-step], values[step:], out=into[:-step])
    return largest
