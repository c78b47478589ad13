"""KISS-ICP's pipeline, one scan a step, behind guards.

The C++ library aborts the whole process on what it does not expect: NaN in points or poses, and per-point times that
are all equal. Here nothing reaches it but finite points within range, times that differ, and finite poses. The steps
are those of `kiss_icp.KissICP.register_frame`; the motion model counts in seconds instead of scans, so that a dropped
scan, or one that lasts shorter than the time between scans, is neither predicted nor deskewed wrongly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from kiss_icp.config import KISSConfig
from kiss_icp.config.config import AdaptiveThresholdConfig, DataConfig, MappingConfig, RegistrationConfig
from kiss_icp.mapping import get_voxel_hash_map
from kiss_icp.preprocess import get_preprocessor
from kiss_icp.registration import get_registration
from kiss_icp.threshold import get_threshold_estimator
from kiss_icp.voxelization import voxel_down_sample

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import inverse, make_transform, quaternion_xyzw_from_rotation, rotation_angle_rad
from supermap_cli.types.sensing import Sweep

LEAST_POINTS = 60
LEAST_VOXELS = 12
_LONGEST_SCAN_NS = 500_000_000
_LONGEST_PREDICTION_S = 1.0


@dataclass(frozen=True)
class Scan:
    """A cleaned scan: points (n, 3) in the LiDAR's frame, their times (n,) seconds relative to `stamp_ns`.

    The pose holds at `stamp_ns`: the last point's time, so that all times are <= 0, or, when the points are taken as
    seen at once, the scan's own stamp or middle, and then all times are 0.
    """

    stamp_ns: int
    points: FloatArray
    times_s: FloatArray

    @property
    def duration_s(self) -> float:
        """Time between the first and the last point."""
        return float(-self.times_s.min(initial=0.0))


@dataclass(frozen=True)
class Registered:
    """A scan's pose (4, 4), and how far it lies from where a steady motion would have led."""

    T_first_lidar: FloatArray
    surprise_m: float
    surprise_rad: float


def clean_scan(sweep: Sweep, *, min_range_m: float, max_range_m: float, deskew: bool) -> Scan | None:
    """Drop what is not finite, too near or too far, and times that make no sense; `None` if too few points remain."""
    points, stamps_ns = sweep.points_lidar, sweep.point_stamps_ns
    within = (np.abs(points) < max_range_m).all(axis=1)
    points, stamps_ns = points[within], stamps_ns[within]
    distance_m = np.linalg.norm(points, axis=1)
    usable = (distance_m > min_range_m) & (distance_m < max_range_m)
    points, stamps_ns = np.ascontiguousarray(points[usable], np.float64), stamps_ns[usable]
    if len(points) < LEAST_POINTS:
        return None
    first_ns, last_ns = int(stamps_ns.min()), int(stamps_ns.max())
    if first_ns == last_ns or last_ns - first_ns > _LONGEST_SCAN_NS:
        return Scan(sweep.stamp_ns, points, np.zeros(len(points)))
    if not deskew:
        return Scan((first_ns + last_ns) // 2, points, np.zeros(len(points)))
    return Scan(last_ns, points, (stamps_ns - last_ns) / 1e9)


class ScanRegistration:
    """Registers scan after scan against a local voxel map; the first scan's pose is the identity."""

    def __init__(self, *, voxel_m: float, min_range_m: float, max_range_m: float, threads: int) -> None:
        config = KISSConfig(
            data=DataConfig(max_range=max_range_m, min_range=min_range_m, deskew=True),
            mapping=MappingConfig(voxel_size=voxel_m),
            registration=RegistrationConfig(max_num_threads=threads),
            adaptive_threshold=AdaptiveThresholdConfig(),
        )
        self._voxel_m = voxel_m
        self._preprocessor = get_preprocessor(config)
        self._registration = get_registration(config)
        self._map = get_voxel_hash_map(config)
        self._threshold = get_threshold_estimator(config)
        self._pose: FloatArray = np.eye(4)
        self._velocity: FloatArray = np.zeros(6)
        self._last_ns: int | None = None

    def register(self, scan: Scan) -> Registered | None:
        """Place a scan, later than the last one; `None` when that fails, and then the map stays as it was."""
        dense = voxel_down_sample(self._deskewed(scan), self._voxel_m * 0.5)
        source = voxel_down_sample(dense, self._voxel_m * 1.5)
        if len(source) < LEAST_VOXELS:
            return None
        elapsed_s = 0.0 if self._last_ns is None else (scan.stamp_ns - self._last_ns) / 1e9
        predicted = self._pose @ exp_se3(self._velocity * min(elapsed_s, _LONGEST_PREDICTION_S))
        pose = predicted if self._last_ns is None else self._aligned(source, predicted)
        if not np.isfinite(pose).all():
            return None
        surprise = inverse(predicted) @ pose
        if self._last_ns is not None:
            self._threshold.update_model_deviation(surprise)
            self._velocity = log_se3(inverse(self._pose) @ pose) / elapsed_s
        self._map.update(dense, pose)
        self._pose, self._last_ns = pose, scan.stamp_ns
        return Registered(pose, float(np.linalg.norm(surprise[:3, 3])), rotation_angle_rad(surprise[:3, :3]))

    def _aligned(self, source: FloatArray, predicted: FloatArray) -> FloatArray:
        """Point-to-point ICP against the map, its reach and robust kernel set by past surprises (section III-C, D)."""
        sigma = self._threshold.get_threshold()
        pose: FloatArray = self._registration.align_points_to_map(
            points=source,
            voxel_map=self._map,
            initial_guess=predicted,
            max_correspondance_distance=3 * sigma,
            kernel=sigma,
        )
        return pose

    def _deskewed(self, scan: Scan) -> FloatArray:
        """The scan as seen at once at its stamp, by the velocity of the last one (section III-A)."""
        if scan.duration_s == 0:
            return scan.points
        motion = exp_se3(self._velocity * scan.duration_s)
        deskewed: FloatArray = self._preprocessor.preprocess(scan.points, scan.times_s, motion)
        return deskewed


_SMALL_RAD = 1e-2
"""Below it, differences of nearly equal numbers are taken from their series."""


def exp_se3(twist: FloatArray) -> FloatArray:
    """The motion (4, 4) of a twist (6,), translation first (Sola et al. 2018, "A micro Lie theory", appendix D)."""
    rho, phi = twist[:3], twist[3:]
    angle = float(np.linalg.norm(phi))
    K = _cross_matrix(phi)
    a, b = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi)) ** 2 / 2
    c = 1 / 6 - angle**2 / 120 if angle < _SMALL_RAD else (angle - np.sin(angle)) / angle**3
    return make_transform(np.eye(3) + a * K + b * K @ K, (np.eye(3) + b * K + c * K @ K) @ rho)


def log_se3(T: FloatArray) -> FloatArray:
    """The twist (6,) of a motion, inverse to `exp_se3` for rotations of less than pi."""
    q = quaternion_xyzw_from_rotation(T[:3, :3])
    sine = float(np.linalg.norm(q[:3]))
    phi = q[:3] * (2 * np.arctan2(sine, q[3]) / sine if sine > 1e-9 else 2.0)
    angle = float(np.linalg.norm(phi))
    K = _cross_matrix(phi)
    if angle < _SMALL_RAD:
        c = 1 / 12 + angle**2 / 720
    else:
        c = (1 - angle * np.sin(angle) / (2 * (1 - np.cos(angle)))) / angle**2
    return np.concatenate([(np.eye(3) - K / 2 + c * K @ K) @ T[:3, 3], phi])


def _cross_matrix(v: FloatArray) -> FloatArray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
