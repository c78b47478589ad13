"""An object's geometry while it is being mapped: packed arrays sorted by voxel code.

Holds the occupancy log-odds L(o_k) of the paper's eq. 8, of voxels instead of points, clamped as in OctoMap (Hornung et
al. 2013). Departs from the paper in what is kept of the semantic check: how often a voxel lay inside and outside masks.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray, UInt8Array
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.geometry.voxels import (
    dilate_codes,
    is_member,
    neighbour_counts,
    pack_keys,
    unpack_codes,
    voxel_centers,
    voxel_keys,
)
from supermap_cli.types.memory import VoxelCloud
from supermap_cli.types.parameters import TUNED, parameter

Column = TypeVar("Column", IntArray, Float32Array)


@dataclass(frozen=True)
class VoxelMapParameters:
    """Resolution and evidence of an object's voxels."""

    log_odds_max: float = parameter(
        4.0,
        "1",
        "occupancy is clamped to it, so that a thing that stood for an hour can still be seen to have gone",
        "clamping: Hornung et al. 2013 (OctoMap), eq. 4; value: " + TUNED,
    )
    finest_voxel_m: float = parameter(
        0.01, "m", "edge of a new object's voxels", "about what a depth camera resolves at 2 m", at_least=0.001
    )
    max_side_voxels: int = parameter(
        64, "1", "voxels along an object's longest side; more show no more of its shape", TUNED, at_least=4
    )
    often_inside: float = parameter(
        2.0, "1", "keyframes in which a voxel lay inside the object's masks before it counts as seen often", TUNED
    )
    often_percentile: float = parameter(
        90.0,
        "%",
        "percentile of these counts at which, if it is less, a voxel counts as seen often",
        TUNED,
        at_most=100,
    )
    min_often_share: float = parameter(
        0.3, "1", "share of the trusted voxels seen often from which only these are the object's", TUNED
    )
    min_neighbours: int = parameter(2, "1", "trusted voxels among the 26 around one that is no stray", TUNED)


DEFAULT = VoxelMapParameters()

FINEST_VOXEL_M = DEFAULT.finest_voxel_m
LOG_ODDS_MAX = DEFAULT.log_odds_max


@dataclass
class VoxelMap:
    """n voxels of edge `voxel_m` in the map frame; all arrays are aligned and sorted by `codes`.

    `log_odds` (n,) occupancy; `inside` and `outside` (n,) how often a voxel was seen within and beside the object's
    masks; `rgb` (n, 3) mean colour, 0-255.
    """

    voxel_m: float
    codes: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    log_odds: Float32Array = field(default_factory=lambda: np.zeros(0, np.float32))
    inside: Float32Array = field(default_factory=lambda: np.zeros(0, np.float32))
    outside: Float32Array = field(default_factory=lambda: np.zeros(0, np.float32))
    rgb: Float32Array = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    _keys: Int32Array | None = field(default=None, repr=False)
    _centers: FloatArray | None = field(default=None, repr=False)
    _sphere: tuple[float, float, float, float] | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.codes)

    def keys(self) -> Int32Array:
        """(n, 3) voxel indices (kept, like the centres, until the set of voxels changes)."""
        if self._keys is None:
            self._keys = unpack_codes(self.codes)
        return self._keys

    def centers(self) -> FloatArray:
        """(n, 3) voxel centres in the map frame."""
        if self._centers is None:
            self._centers = voxel_centers(self.keys(), self.voxel_m)
        return self._centers

    def sphere(self) -> tuple[float, float, float, float]:
        """Centre x, y, z and radius of a sphere that holds all centres, n > 0."""
        if self._sphere is None:
            keys = self.keys()
            low, high = (voxel_centers(end, self.voxel_m) for end in (keys.min(axis=0), keys.max(axis=0)))
            x, y, z = ((low + high) / 2).tolist()
            self._sphere = (x, y, z, float(np.linalg.norm(high - low)) / 2)
        return self._sphere

    def _set_changed(self) -> None:
        self._keys = self._centers = self._sphere = None

    def add_points(self, points_map: FloatArray, rgb: UInt8Array, hit_log_odds: float) -> None:
        """Enter the voxels of (m, 3) points with (m, 3) colours that are not there yet, seen once, inside a mask."""
        codes, first = np.unique(pack_keys(voxel_keys(points_map, self.voxel_m)), return_index=True)
        fresh = ~is_member(codes, self.codes)
        self._insert(codes[fresh], hit_log_odds, 1, 0, rgb[first[fresh]].astype(np.float32))

    def _insert(
        self,
        codes: IntArray,
        log_odds: Float32Array | float,
        inside: Float32Array | float,
        outside: Float32Array | float,
        rgb: Float32Array,
    ) -> None:
        """Enter voxels that are not there yet, sorted by their codes, each in its place."""
        if not len(codes):
            return
        new = np.searchsorted(self.codes, codes) + np.arange(len(codes))
        old = np.ones(len(self.codes) + len(codes), dtype=bool)
        old[new] = False
        self.codes = _merged_column(self.codes, old, codes, new)
        self.log_odds = _merged_column(self.log_odds, old, log_odds, new)
        self.inside = _merged_column(self.inside, old, inside, new)
        self.outside = _merged_column(self.outside, old, outside, new)
        self.rgb = _merged_column(self.rgb, old, rgb, new)
        self._set_changed()

    def keep(self, kept: BoolArray) -> None:
        """Drop all voxels but the (n,) marked ones."""
        if kept.all():
            return
        self.codes, self.log_odds = self.codes[kept], self.log_odds[kept]
        self.inside, self.outside, self.rgb = self.inside[kept], self.outside[kept], self.rgb[kept]
        self._set_changed()

    def taken_out(self, taken: BoolArray) -> VoxelMap:
        """The (n,) marked voxels as a map of their own; the others stay."""
        part = VoxelMap(
            self.voxel_m,
            self.codes[taken],
            self.log_odds[taken],
            self.inside[taken],
            self.outside[taken],
            self.rgb[taken],
        )
        self.keep(~taken)
        return part

    def absorb(self, other: VoxelMap, parameters: VoxelMapParameters = DEFAULT) -> None:
        """Take in another object's voxels, evidence added up."""
        if not len(other):
            return
        codes = pack_keys(voxel_keys(other.centers(), self.voxel_m))
        codes, first = np.unique(codes, return_index=True)
        known = is_member(codes, self.codes)
        at = np.searchsorted(self.codes, codes[known])
        source = first[known]
        evidence = self.log_odds[at] + np.maximum(other.log_odds[source], 0)
        self.log_odds[at] = np.minimum(evidence, parameters.log_odds_max)
        self.inside[at] += other.inside[source]
        self.outside[at] += other.outside[source]
        fresh = first[~known]
        self._insert(codes[~known], other.log_odds[fresh], other.inside[fresh], other.outside[fresh], other.rgb[fresh])

    def moved(self, shift_m: FloatArray) -> VoxelMap:
        """The same voxels shifted by (3,) metres, to the nearest voxel."""
        steps = np.rint(shift_m / self.voxel_m).astype(np.int64)
        codes = pack_keys(self.keys() + steps)
        order = np.argsort(codes)
        return VoxelMap(
            self.voxel_m,
            codes[order],
            self.log_odds[order],
            self.inside[order],
            self.outside[order],
            self.rgb[order],
        )

    def carried(self, T_target_source: FloatArray) -> VoxelMap:
        """The same object in another frame, on that frame's grid.

        Each voxel there is what the old voxel at its centre was: other ways round, a turned grid would leave holes.
        """
        if not len(self):
            return VoxelMap(self.voxel_m)
        near = voxel_keys(transform_points(T_target_source, self.centers()), self.voxel_m)
        codes = dilate_codes(np.unique(pack_keys(near)))
        centers = voxel_centers(unpack_codes(codes), self.voxel_m)
        back = transform_points(inverse(T_target_source), centers) + 1e-6 * self.voxel_m  # off the voxels' very sides
        source = pack_keys(voxel_keys(back, self.voxel_m))
        taken = is_member(source, self.codes)
        at = np.searchsorted(self.codes, source[taken])
        return VoxelMap(self.voxel_m, codes[taken], self.log_odds[at], self.inside[at], self.outside[at], self.rgb[at])

    def solid(self, parameters: VoxelMapParameters = DEFAULT) -> BoolArray:
        """(n,) the voxels that are believed to be the object's: occupied, mostly inside its masks, not alone."""
        trusted: BoolArray = (self.log_odds > 0) & (self.inside > self.outside)
        usual = float(percentiles(self.inside, (parameters.often_percentile,))[0]) if len(self) else 0.0
        often = trusted & (self.inside >= min(parameters.often_inside, usual))
        if np.count_nonzero(often) >= parameters.min_often_share * np.count_nonzero(trusted):
            trusted = often
        accompanied = np.zeros(len(self.codes), dtype=bool)
        accompanied[trusted] = neighbour_counts(self.codes[trusted]) >= parameters.min_neighbours
        return accompanied if accompanied.any() else trusted

    def fit_voxel(self, parameters: VoxelMapParameters = DEFAULT) -> None:
        """Double the voxels' edge until the longest side has no more than `max_side_voxels`: adaptive resolution."""
        if not len(self):
            return
        keys = self.keys()
        while (keys.max(axis=0) - keys.min(axis=0)).max() > parameters.max_side_voxels:
            keys = keys >> 1
            self.voxel_m *= 2
            codes, group = np.unique(pack_keys(keys), return_inverse=True)
            members = np.bincount(group).astype(np.float32)
            best = np.full(len(codes), -np.inf, np.float32)
            np.maximum.at(best, group, self.log_odds)
            self.log_odds = best
            self.inside = (np.bincount(group, self.inside) / members).astype(np.float32)
            self.outside = (np.bincount(group, self.outside) / members).astype(np.float32)
            self.rgb = np.stack([np.bincount(group, self.rgb[:, c]) / members for c in range(3)], axis=1).astype(
                np.float32
            )
            self.codes, keys = codes, unpack_codes(codes)
            self._set_changed()

    def to_cloud(self) -> VoxelCloud:
        """The value that the memory keeps."""
        return VoxelCloud(
            self.voxel_m,
            unpack_codes(self.codes),
            self.log_odds.copy(),
            self.inside.copy(),
            self.outside.copy(),
            self.rgb.round().clip(0, 255).astype(np.uint8),
        )


def _merged_column(old: Column, at_old: BoolArray, new: Column | float, at_new: IntArray) -> Column:
    """One array out of two: the old values where they are marked, the new ones at their positions."""
    joined = np.empty((len(at_old), *old.shape[1:]), old.dtype)
    joined[at_old] = old
    joined[at_new] = new
    return joined


def voxel_map_from_cloud(cloud: VoxelCloud) -> VoxelMap:
    """Go on mapping what the memory kept."""
    codes = pack_keys(cloud.keys)
    order = np.argsort(codes)
    return VoxelMap(
        cloud.voxel_m,
        codes[order],
        cloud.log_odds[order].astype(np.float32),
        cloud.inside[order].astype(np.float32),
        cloud.outside[order].astype(np.float32),
        cloud.rgb[order].astype(np.float32),
    )
