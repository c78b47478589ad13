"""Where in a level map a level piece of structure may belong: an exhaustive search over heading, place and height.

Both are drawn as plan views, one for each kind of surface (level ones by height, upright ones by height and by where
they face), and the views are correlated for every heading by FFT. Part of alignment, which the
paper does not have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.mapping.structure import Structure
from supermap_cli.types.parameters import TUNED, parameter

_FACINGS = np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])
"""Horizontal directions that upright surfaces are told apart by."""


@dataclass(frozen=True)
class PlaceSearchParameters:
    """The grid of the search, the plan views, and which placements are different ones."""

    headings: int = parameter(90, "1", "headings tried over a full turn", "steps of 4 degrees", at_least=1)
    cell_m: float = parameter(0.1, "m", "edge of a plan view's cell", TUNED, at_least=0.01)
    max_grid: int = parameter(
        512, "1", "cells along a plan view's side; larger places get larger cells", "bounds the time"
    )
    level_edges_m: tuple[float, float, float] = parameter(
        (0.2, 0.6, 1.0), "m", "heights that part level surfaces: floor, seats, tables, what is higher", "furniture"
    )
    upright_edges_m: tuple[float, float, float] = parameter(
        (0.3, 0.8, 1.4), "m", "heights that part upright surfaces", "furniture"
    )
    floor_weight: float = parameter(0.2, "1", "weight of the lowest level surfaces: the floor is everywhere", TUNED)
    blur_weight: float = parameter(0.5, "1", "weight of a cell in its neighbours, which forgives half a cell", TUNED)
    min_level_z: float = parameter(0.85, "1", "z of the normals of level surfaces in plan views, at least", TUNED)
    max_upright_z: float = parameter(0.35, "1", "z of the normals of upright surfaces, at most", TUNED)
    peaks_per_heading: int = parameter(3, "1", "places taken for each heading", TUNED, at_least=1)
    peak_radius_cells: int = parameter(4, "1", "cells around a place in which no other is taken", TUNED)
    max_candidates: int = parameter(12, "1", "different placements that are refined", "bounds the time", at_least=1)
    same_turn_deg: float = parameter(8.0, "deg", "turn up to which two placements are one", TUNED)
    same_shift_m: float = parameter(0.4, "m", "shift up to which two placements are one", TUNED)
    rise_range_m: float = parameter(3.0, "m", "heights about the floor whose level surfaces tell a rise", TUNED)
    rise_bin_m: float = parameter(0.05, "m", "bin of the histograms of heights", TUNED, at_least=0.005)
    rise_level_z: float = parameter(0.9, "1", "z of the normals that count in these histograms, at least", TUNED)
    min_rise_m: float = parameter(0.1, "m", "difference in height up to which the floors are one", TUNED)


DEFAULT = PlaceSearchParameters()


@dataclass(frozen=True)
class Candidate:
    """A placement (4, 4), a turn about z and a shift, and how well the plan views agree there, in [0, 1]."""

    T_map_level: FloatArray
    score: float


def search(
    structure_map: Structure, structure_level: Structure, parameters: PlaceSearchParameters = DEFAULT
) -> list[Candidate]:
    """The best placements, all different ones, best first."""
    found: list[Candidate] = []
    for rise_m in _rises(structure_map, structure_level, parameters):
        found += _search_plan(structure_map, structure_level, rise_m, parameters)
    found.sort(key=lambda candidate: -candidate.score)
    return distinct(found, parameters.max_candidates, parameters)


def distinct(candidates: list[Candidate], most: int, parameters: PlaceSearchParameters = DEFAULT) -> list[Candidate]:
    """The first of every group of nearly equal placements."""
    kept: list[Candidate] = []
    for candidate in candidates:
        if len(kept) == most:
            break
        if not any(same_place(candidate.T_map_level, other.T_map_level, parameters) for other in kept):
            kept.append(candidate)
    return kept


def same_place(T_a: FloatArray, T_b: FloatArray, parameters: PlaceSearchParameters = DEFAULT) -> bool:
    """Whether two level placements differ by little."""
    turn = np.arctan2(T_a[1, 0], T_a[0, 0]) - np.arctan2(T_b[1, 0], T_b[0, 0])
    apart_deg = np.degrees(abs((turn + np.pi) % (2 * np.pi) - np.pi))
    shift_m = np.linalg.norm(T_a[:3, 3] - T_b[:3, 3])
    return bool(apart_deg < parameters.same_turn_deg and shift_m < parameters.same_shift_m)


def _rises(structure_map: Structure, structure_level: Structure, parameters: PlaceSearchParameters) -> list[float]:
    """Up to two likely differences in height: none, and where the histograms of level surfaces agree best."""
    bin_m = parameters.rise_bin_m
    bins = np.arange(-parameters.rise_range_m, parameters.rise_range_m, bin_m)
    level_map, level = (
        np.sqrt(np.histogram(_level_heights(structure, parameters.rise_level_z), bins)[0])
        for structure in (structure_map, structure_level)
    )
    agreement = np.correlate(level_map, level, mode="full")
    best = (int(np.argmax(agreement)) - (len(bins) - 2)) * bin_m
    return [0.0] if abs(best) <= parameters.min_rise_m else [0.0, best]


def _level_heights(structure: Structure, min_z: float) -> FloatArray:
    heights: FloatArray = structure.points[structure.normals[:, 2] > min_z, 2]
    return heights


def _search_plan(
    structure_map: Structure, structure_level: Structure, rise_m: float, parameters: PlaceSearchParameters
) -> list[Candidate]:
    from scipy.fft import irfft2, next_fast_len, rfft2  # noqa: PLC0415 - heavy

    centre_map, centre = structure_map.points.mean(axis=0), structure_level.points.mean(axis=0)
    radius = np.linalg.norm((structure_level.points - centre)[:, :2], axis=1).max()
    half_map = np.abs((structure_map.points - centre_map)[:, :2]).max()
    reach_m = float(radius + half_map)
    cell_m = max(parameters.cell_m, 2 * reach_m / parameters.max_grid)
    side = next_fast_len(int(2 * reach_m / cell_m) + 4, real=True)
    plan_map = _plan(
        structure_map.points - [*centre_map[:2], 0], structure_map.normals, side, cell_m, parameters=parameters
    )
    target = rfft2(_blurred(plan_map, parameters.blur_weight))
    found = []
    for yaw in np.arange(parameters.headings) * 2 * np.pi / parameters.headings:
        R = _yaw_rotation(yaw)
        points = (structure_level.points - [*centre[:2], 0]) @ R.T + [0, 0, rise_m]
        plan = _plan(points, structure_level.normals @ R.T, side, cell_m, parameters=parameters)
        agreement = irfft2((target * np.conj(rfft2(plan))).sum(axis=0), s=(side, side)) / max(
            float(np.square(plan).sum()), 1
        )
        for _ in range(parameters.peaks_per_heading):
            row, column = np.unravel_index(int(np.argmax(agreement)), agreement.shape)
            score = float(agreement[row, column])
            shift = (np.array([row, column]) + side // 2) % side - side // 2
            t = np.array([*(centre_map[:2] + shift * cell_m), rise_m]) - R @ np.array([*centre[:2], 0])
            found.append(Candidate(make_transform(R, t), score))
            near = np.arange(-parameters.peak_radius_cells, parameters.peak_radius_cells + 1)
            agreement[np.ix_((row + near) % side, (column + near) % side)] = -np.inf
    return found


def _plan(
    points: FloatArray, normals: FloatArray, side: int, cell_m: float, *, parameters: PlaceSearchParameters
) -> Float32Array:
    """Plan views (20, side, side): 4 of level surfaces by height, 16 of upright ones by height and facing."""
    cell = np.floor(points[:, :2] / cell_m).astype(np.int64) + side // 2
    inside = ((cell >= 0) & (cell < side)).all(axis=1)
    views = np.zeros((20, side, side), np.float32)
    level = inside & (normals[:, 2] > parameters.min_level_z)
    band = np.digitize(points[level, 2], parameters.level_edges_m)
    views[band, cell[level, 0], cell[level, 1]] = np.where(band == 0, parameters.floor_weight, 1.0)
    upright = inside & (np.abs(normals[:, 2]) < parameters.max_upright_z)
    band = np.digitize(points[upright, 2], parameters.upright_edges_m)
    facing = np.maximum(normals[upright, :2] @ _FACINGS.T, 0)
    for k in range(4):
        np.maximum.at(views, (4 + 4 * band + k, cell[upright, 0], cell[upright, 1]), facing[:, k].astype(np.float32))
    return views


def _blurred(views: Float32Array, weight: float) -> Float32Array:
    """Every cell spread to its neighbours with a part of its weight."""
    spread = views.copy()
    for axis in (1, 2):
        for step in (-1, 1):
            spread = np.maximum(spread, weight * np.roll(views, step, axis=axis))
    return spread


def _yaw_rotation(yaw: float) -> FloatArray:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
