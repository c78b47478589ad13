"""A LiDAR whose pattern does not repeat, in the likeness of a Livox Mid-360.

The maker does not publish its pattern; this one shares its traits. Four beams, a quarter of a turn apart, turn about
the vertical 22.4 times a second, while each swings at constant speed between the lowest and the highest elevation 173
times a second. These rates and that of the scans have no common measure, so that every scan falls between the lines of
those before: one hits 42 % of all square degrees, five 98 %, ten all of them.

Or a scanner of several rings, in the likeness of Velodyne's and Ouster's: all beams leave at once, one above the other,
and turn about the vertical once a scan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray, IntArray, check_shape
from supermap_cli.simulation.rigs import Lidar
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.views import RayHits

_BEAMS = 4
_TURNS_HZ, _SWINGS_HZ = 10 * np.sqrt(5), 100 * np.sqrt(3)  # Hz, incommensurable
_SWING_BETWEEN_BEAMS = (3 - np.sqrt(5)) / 2  # of a swing: the golden ratio spreads the beams' phases evenly
_WORLD_STANDS_NS = 20_000_000  # ns for which moving things are held still while rays are cast: 2 cm at a walk


@dataclass(frozen=True)
class LidarScan:
    """One scan's returns: `points_lidar` (n, 3) float32 metres, each in the sensor's frame at its own time `stamps_ns`
    (n,); `intensity` (n,) float32 in 0..255, how much light came back; `ring` (n,) int64, 0 = the lowest, all 0 where
    the sensor has none.
    """

    points_lidar: Float32Array
    stamps_ns: IntArray
    intensity: Float32Array
    ring: IntArray

    def __post_init__(self) -> None:
        check_shape("points_lidar", self.points_lidar, (None, 3))
        check_shape("stamps_ns", self.stamps_ns, (len(self.points_lidar),))
        for name in ("intensity", "ring"):
            check_shape(name, getattr(self, name), (len(self.points_lidar),))


class LidarSensor:
    """One sensor: its pattern and its noise follow from `seed` and the time alone, not from what it scanned before."""

    def __init__(self, lidar: Lidar, seed: int) -> None:
        self.lidar = lidar
        self._seed = seed
        self._first_turn, self._first_swing = np.random.default_rng(seed).random(2)

    def stamps_ns(self, stamp_ns: int) -> IntArray:
        """When the beams of the scan that starts at `stamp_ns` leave (n,), evenly over its time; all rings at once."""
        together = self.lidar.rings or 1
        shots = self.lidar.points_per_scan // together
        step_ns = 1e9 / self.lidar.rate_hz / shots
        stamps_ns: IntArray = stamp_ns + np.round(np.arange(shots) * step_ns).astype(np.int64)
        return np.repeat(stamps_ns, together)

    def rings(self) -> IntArray:
        """(n,) the ring of each beam of a scan, 0 = the lowest."""
        return np.arange(len(self.stamps_ns(0))) % (self.lidar.rings or 1)

    def beams(self, stamp_ns: int) -> FloatArray:
        """Unit directions (n, 3) of a scan's beams in the sensor's frame (x forward, z up)."""
        since_s = (self.stamps_ns(stamp_ns) - stamp_ns) / 1e9
        turn, raised = self._ringed(since_s) if self.lidar.rings else self._swinging(stamp_ns, since_s)
        azimuth = 2 * np.pi * turn
        elevation = np.radians(self.lidar.lowest_deg + (self.lidar.highest_deg - self.lidar.lowest_deg) * raised)
        return np.column_stack(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        )

    def _ringed(self, since_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Azimuth in turns, clockwise as these scanners turn, and elevation as a share of the field of view."""
        turn = self._first_turn - self.lidar.rate_hz * since_s
        return turn, self.rings() / max(self.lidar.rings - 1, 1)

    def _swinging(self, stamp_ns: int, since_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Azimuth in turns, and elevation as a share of the field of view."""
        beam = np.arange(len(since_s)) % _BEAMS
        turn = self._first_turn + _TURNS_HZ * (stamp_ns / 1e9) % 1 + _TURNS_HZ * since_s + beam / _BEAMS
        swing = self._first_swing + _SWINGS_HZ * (stamp_ns / 1e9) % 1 + _SWINGS_HZ * since_s
        swing += beam * _SWING_BETWEEN_BEAMS
        return turn, np.abs(2 * (swing % 1) - 1)

    def scan(self, scene: Scene, T_world_lidar: Callable[[IntArray], FloatArray], stamp_ns: int) -> LidarScan:
        """The scan that starts at `stamp_ns`. `T_world_lidar` gives the sensor's poses (n, 4, 4) at stamps (n,).

        Every beam leaves from the sensor's exact pose at its own time; what moves in the world does so every 20 ms.
        """
        beams, stamps_ns, rings = self.beams(stamp_ns), self.stamps_ns(stamp_ns), self.rings()
        T = T_world_lidar(stamps_ns)
        directions = np.einsum("nij,nj->ni", T[:, :3, :3], beams)
        rng = np.random.default_rng((self._seed, stamp_ns))
        noise_m = rng.normal(0, self.lidar.noise_m, len(beams))
        points, returned, intensity, ring = [], [], [], []
        for block in self._blocks(stamps_ns):
            middle_ns = int(stamps_ns[block].mean())
            hits = scene.cast(middle_ns, T[block, :3, 3], directions[block], colour=True)
            range_m = hits.distance + noise_m[block]
            kept = (range_m >= self.lidar.nearest_m) & (range_m <= self.lidar.farthest_m)
            if hits.returns is not None:
                kept &= hits.returns
            points.append((beams[block][kept] * range_m[kept, None]).astype(np.float32))
            returned.append(stamps_ns[block][kept])
            intensity.append(_intensity(hits)[kept])
            ring.append(rings[block][kept])
        return LidarScan(
            np.concatenate(points), np.concatenate(returned), np.concatenate(intensity), np.concatenate(ring)
        )

    def _blocks(self, stamps_ns: IntArray) -> list[slice]:
        """Portions of a scan for which the world stands still."""
        block = (stamps_ns - stamps_ns[0]) // _WORLD_STANDS_NS
        begins = [0, *(np.flatnonzero(np.diff(block)) + 1).tolist(), len(stamps_ns)]
        return [slice(begin, end) for begin, end in pairwise(begins)]


def _intensity(hits: RayHits) -> Float32Array:
    """(n,) brightness of what was hit times Lambert's cosine."""
    if hits.rgb is None:
        raise ValueError("a scan needs colour")
    intensity: Float32Array = hits.rgb.mean(axis=1, dtype=np.float32) * hits.slant_cos
    return intensity
