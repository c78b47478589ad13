"""Surfaces that send too little light back for their depth to be measured: black, or glossy."""

from __future__ import annotations

from functools import cache

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array

_WAVES = 8  # plane waves whose sum is the field of patches
_WAVELENGTHS_M = (0.03, 0.12)  # m: patches of one to a few centimetres, as in depth images of black leather
_RAD_A_TURN = 6.0  # rad by which a wave shifts while the direction of view turns by one radian
_QUANTILES = 4096  # of the field, by which its values become shares


def returns_in_patches(points: Float32Array, directions: Float32Array, share: Float32Array) -> BoolArray:
    """(n,) whether points (n, 3) in the world, seen along unit directions (n, 3), return light: a `share` (n,) of them.

    They do or do not in patches that belong to the surface and drift over it as the view turns; the same view, the same
    patches.
    """
    waves, shifts, phases, quantiles = _field()
    field = np.cos(points @ waves + directions @ shifts + phases).sum(axis=1)
    returns: BoolArray = np.searchsorted(quantiles, field) < share * _QUANTILES
    return returns


@cache
def _field() -> tuple[Float32Array, Float32Array, Float32Array, Float32Array]:
    """Wave vectors (3, w), their shifts with the view (3, w), phases (w,), and the sorted values of their sum."""
    rng = np.random.default_rng(0)
    waves, shifts = rng.normal(size=(2, 3, _WAVES))
    waves *= 2 * np.pi / np.geomspace(*_WAVELENGTHS_M, _WAVES) / np.linalg.norm(waves, axis=0)
    shifts *= _RAD_A_TURN / np.linalg.norm(shifts, axis=0)
    phases = rng.uniform(0, 2 * np.pi, _WAVES)
    sums = np.sort(np.cos(rng.uniform(0, 2 * np.pi, (_QUANTILES, _WAVES))).sum(axis=1))
    return waves.astype(np.float32), shifts.astype(np.float32), phases.astype(np.float32), sums.astype(np.float32)
