"""Where in a level map a level piece of structure may belong: an exhaustive search over heading, place and height.

Both are drawn as plan views, one for each kind of surface (level ones by height, upright ones by height and by where
they face), and the views are correlated for every heading by FFT.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.mapping.structure import Structure

_HEADINGS = 90
_CELL_M = 0.1
_LARGEST_GRID = 512
_LEVEL_EDGES_M = (0.2, 0.6, 1.0)
_UPRIGHT_EDGES_M = (0.3, 0.8, 1.4)
_FLOOR_WEIGHT = 0.2
_COMPASS = np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])


@dataclass(frozen=True)
class Candidate:
    """A placement (4, 4), a turn about z and a shift, and how well the plan views agree there, in [0, 1]."""

    T_map_level: FloatArray
    score: float


def search(structure_map: Structure, structure_level: Structure, *, most: int = 12) -> list[Candidate]:
    """The best placements, all different ones (by more than 8 degrees or 0.4 m), best first."""
    found: list[Candidate] = []
    for rise_m in _rises(structure_map, structure_level):
        found += _search_plan(structure_map, structure_level, rise_m)
    return distinct(sorted(found, key=lambda each: -each.score), most)


def distinct(candidates: list[Candidate], most: int) -> list[Candidate]:
    """The first of every group of nearly equal placements."""
    kept: list[Candidate] = []
    for candidate in candidates:
        if len(kept) == most:
            break
        if not any(same_place(candidate.T_map_level, other.T_map_level) for other in kept):
            kept.append(candidate)
    return kept


def same_place(T_a: FloatArray, T_b: FloatArray, *, turn_deg: float = 8.0, shift_m: float = 0.4) -> bool:
    """Whether two level placements differ by little."""
    turn = np.arctan2(T_a[1, 0], T_a[0, 0]) - np.arctan2(T_b[1, 0], T_b[0, 0])
    apart_deg = np.degrees(abs((turn + np.pi) % (2 * np.pi) - np.pi))
    return bool(apart_deg < turn_deg and np.linalg.norm(T_a[:3, 3] - T_b[:3, 3]) < shift_m)


def _rises(structure_map: Structure, structure_level: Structure) -> list[float]:
    """Up to two likely differences in height: none, and where the histograms of level surfaces agree best."""
    bins = np.arange(-3.0, 3.0, 0.05)
    level_map, level = (
        np.sqrt(np.histogram(_level_heights(each), bins)[0]) for each in (structure_map, structure_level)
    )
    agreement = np.correlate(level_map, level, mode="full")
    best = (int(np.argmax(agreement)) - (len(bins) - 2)) * 0.05
    return [0.0] if abs(best) <= 0.1 else [0.0, best]


def _level_heights(structure: Structure) -> FloatArray:
    heights: FloatArray = structure.points[structure.normals[:, 2] > 0.9, 2]
    return heights


def _search_plan(structure_map: Structure, structure_level: Structure, rise_m: float) -> list[Candidate]:
    from scipy.fft import irfft2, next_fast_len, rfft2  # noqa: PLC0415 - heavy

    centre_map, centre = structure_map.points.mean(axis=0), structure_level.points.mean(axis=0)
    radius = np.linalg.norm((structure_level.points - centre)[:, :2], axis=1).max()
    half_map = np.abs((structure_map.points - centre_map)[:, :2]).max()
    reach_m = float(radius + half_map)
    cell_m = max(_CELL_M, 2 * reach_m / _LARGEST_GRID)
    side = next_fast_len(int(2 * reach_m / cell_m) + 4, real=True)
    target = rfft2(_blurred(_plan(structure_map.points - [*centre_map[:2], 0], structure_map.normals, side, cell_m)))
    found = []
    for turn in np.arange(_HEADINGS) * 2 * np.pi / _HEADINGS:
        R = _turn(turn)
        points = (structure_level.points - [*centre[:2], 0]) @ R.T + [0, 0, rise_m]
        plan = _plan(points, structure_level.normals @ R.T, side, cell_m)
        agreement = irfft2((target * np.conj(rfft2(plan))).sum(axis=0), s=(side, side)) / max(
            float(np.square(plan).sum()), 1
        )
        for _ in range(3):
            row, column = np.unravel_index(int(np.argmax(agreement)), agreement.shape)
            score = float(agreement[row, column])
            shift = (np.array([row, column]) + side // 2) % side - side // 2
            t = np.array([*(centre_map[:2] + shift * cell_m), rise_m]) - R @ np.array([*centre[:2], 0])
            found.append(Candidate(make_transform(R, t), score))
            near = np.arange(-4, 5)
            agreement[np.ix_((row + near) % side, (column + near) % side)] = -np.inf
    return found


def _plan(points: FloatArray, normals: FloatArray, side: int, cell_m: float) -> Float32Array:
    """Plan views (20, side, side): 4 of level surfaces by height, 16 of upright ones by height and facing."""
    cell = np.floor(points[:, :2] / cell_m).astype(np.int64) + side // 2
    inside = ((cell >= 0) & (cell < side)).all(axis=1)
    views = np.zeros((20, side, side), np.float32)
    level = inside & (normals[:, 2] > 0.85)
    band = np.digitize(points[level, 2], _LEVEL_EDGES_M)
    views[band, cell[level, 0], cell[level, 1]] = np.where(band == 0, _FLOOR_WEIGHT, 1.0)
    upright = inside & (np.abs(normals[:, 2]) < 0.35)
    band = np.digitize(points[upright, 2], _UPRIGHT_EDGES_M)
    facing = np.maximum(normals[upright, :2] @ _COMPASS.T, 0)
    for k in range(4):
        np.maximum.at(views, (4 + 4 * band + k, cell[upright, 0], cell[upright, 1]), facing[:, k].astype(np.float32))
    return views


def _blurred(views: Float32Array) -> Float32Array:
    """Every cell spread to its neighbours with half its weight, so that half a cell's error is forgiven."""
    spread = views.copy()
    for axis in (1, 2):
        for step in (-1, 1):
            spread = np.maximum(spread, 0.5 * np.roll(views, step, axis=axis))
    return spread


def _turn(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
