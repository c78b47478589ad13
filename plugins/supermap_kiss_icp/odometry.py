"""A recording's LiDAR sweeps become poses of the base."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from supermap_cli.errors import OdometryError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import inverse
from supermap_cli.protocols import Recording
from supermap_cli.types.sensing import StampedPose, Sweep
from supermap_kiss_icp import KissIcpOptions
from supermap_kiss_icp.registration import LEAST_POINTS, LEAST_VOXELS, Registered, Scan, ScanRegistration, clean_scan

_LOST_SLACK_M = 1.0
_LOST_ACCELERATION = 20.0
_LOST_TURN_RAD = np.radians(60)
_MOST_LOST_IN_A_ROW = 3


class KissIcpOdometry:
    """LiDAR odometry. The odom frame is the base at the first usable scan; a pose holds at its scan's last point.

    The voxel is a fifteenth of the first scan's extent (90 % of its points are nearer), between 0.2 and 1 m: small
    rooms need small voxels to be exact, large places large ones to be fast. `warnings` grows while poses are read.
    """

    def __init__(self, recording: Recording, options: KissIcpOptions) -> None:
        self._recording = recording
        self._options = options
        self.warnings: list[str] = []

    def poses(self) -> Iterator[StampedPose]:
        """`T_odom_base`. Raises `OdometryError` without usable sweeps, and when the registration is lost."""
        registration: ScanRegistration | None = None
        placed = failed = lost_in_a_row = 0
        last_ns = 0
        for scan, T_base_lidar in self._scans():
            registration = registration or self._registration_for(scan)
            registered = registration.register(scan)
            if registered is None:
                failed += 1
                self._check_failures(failed, placed, scan)
                continue
            lost_in_a_row = lost_in_a_row + 1 if _is_lost(registered, (scan.stamp_ns - last_ns) / 1e9) else 0
            if lost_in_a_row:
                self._report_lost(lost_in_a_row, registered, scan)
            placed += 1
            last_ns = scan.stamp_ns
            yield StampedPose(scan.stamp_ns, T_base_lidar @ registered.T_first_lidar @ inverse(T_base_lidar))
        if placed < 2:
            raise OdometryError(
                f"no LiDAR motion: fewer than two sweeps have {LEAST_POINTS} usable points in {LEAST_VOXELS} voxels",
                where=str(self._recording.path),
                cure="name the point cloud's topic with --topic lidar=/x, and check min_range_m and max_range_m",
            )

    def _scans(self) -> Iterator[tuple[Scan, FloatArray]]:
        """Usable scans, forward in time, each with its `T_base_lidar`; more than half unusable is an error."""
        poor, usable = 0, 0
        last_ns: int | None = None
        for sweep in self._recording.sweeps():
            scan = self._clean(sweep)
            if scan is None or (last_ns is not None and scan.stamp_ns <= last_ns):
                poor += 1
                if poor > 20 and poor > usable:
                    raise OdometryError(
                        f"{poor} of {poor + usable} LiDAR sweeps are empty, repeated or too near",
                        where=str(self._recording.path),
                        cure="check the LiDAR topic with `supermap inspect`, and min_range_m and max_range_m",
                    )
                continue
            usable += 1
            last_ns = scan.stamp_ns
            yield scan, sweep.T_base_lidar
        if poor and usable:
            self.warnings.append(
                f"{poor} of {poor + usable} LiDAR sweeps were empty, repeated or too near, and left out"
            )

    def _clean(self, sweep: Sweep) -> Scan | None:
        return clean_scan(
            sweep,
            min_range_m=self._options.min_range_m,
            max_range_m=self._options.max_range_m,
            deskew=self._options.deskew,
        )

    def _registration_for(self, first: Scan) -> ScanRegistration:
        extent_m = float(np.quantile(np.linalg.norm(first.points, axis=1), 0.9))
        return ScanRegistration(
            voxel_m=self._options.voxel_m or float(np.clip(extent_m / 15, 0.2, 1.0)),
            min_range_m=self._options.min_range_m,
            max_range_m=self._options.max_range_m,
            threads=self._options.threads,
        )

    def _check_failures(self, failed: int, placed: int, scan: Scan) -> None:
        if failed > 5 and failed > 0.1 * placed:
            raise OdometryError(
                f"{failed} of {placed + failed} LiDAR sweeps cannot be registered, the last at {scan.stamp_ns} ns",
                where=str(self._recording.path),
                cure="use recorded odometry (--odometry recorded), or a smaller voxel_m",
            )

    def _report_lost(self, in_a_row: int, registered: Registered, scan: Scan) -> None:
        where = str(self._recording.path)
        if in_a_row >= _MOST_LOST_IN_A_ROW:
            raise OdometryError(
                f"the LiDAR odometry lost its way at {scan.stamp_ns} ns",
                where=where,
                cure="use recorded odometry (--odometry recorded), a smaller voxel_m, or cut the recording with --end",
            )
        self.warnings.append(
            f"the LiDAR odometry jumps by {registered.surprise_m:.2f} m and "
            f"{np.degrees(registered.surprise_rad):.0f} degrees at {scan.stamp_ns} ns ({where})"
        )


def _is_lost(registered: Registered, elapsed_s: float) -> bool:
    """Whether a pose lies farther from a steady motion than a robot can accelerate."""
    limit_m = _LOST_SLACK_M + 0.5 * _LOST_ACCELERATION * elapsed_s**2
    return registered.surprise_m > limit_m or registered.surprise_rad > _LOST_TURN_RAD
