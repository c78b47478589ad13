"""LiDAR sweeps become poses of the base."""

from __future__ import annotations

import numpy as np

from supermap_cli.errors import OdometryError
from supermap_cli.geometry.se3 import inverse
from supermap_cli.protocols import Recording
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose, Sweep
from supermap_kiss_icp import KissIcpOptions
from supermap_kiss_icp.registration import LEAST_POINTS, LEAST_VOXELS, Registered, Scan, ScanRegistration, clean_scan

LOST_SLACK_M, LOST_ACCELERATION, LOST_TURN_RAD = 1.0, 20.0, np.radians(60)
"""m, m/s^2, rad; a pose farther from a steady motion than these allow is not the robot's: 2 g is more than wheels, legs
and hands give.
"""

MOST_LOST_IN_A_ROW = 3
"""Scans; after so many such poses the registration is lost."""

MOST_POOR = 20
"""Unusable sweeps from which on it counts that they are the majority."""

LEAST_FAILED, MOST_FAILED = 5, 0.1
"""Sweeps that cannot be registered, and their share of the others, from which on the odometry is none (estimate)."""


class KissIcpOdometry:
    """LiDAR odometry. The odom frame is the base at the first usable scan; a pose holds at its scan's last point.

    The voxel is a fifteenth of the first scan's extent (90 % of its points are nearer), between 0.2 and 1 m: small
    rooms need small voxels to be exact, large places large ones to be fast. `warnings` grows with the sweeps.
    """

    def __init__(self, recording: Recording | None, options: KissIcpOptions) -> None:
        self._where = "pushed sweeps" if recording is None else str(recording.path)
        self._pushed = recording is None
        self._options = options
        self.warnings: list[str] = []
        self._registration: ScanRegistration | None = None
        self._usable = 0
        self._poor = 0
        self._placed = 0
        self._failed = 0
        self._lost_in_a_row = 0
        self._last_scan_ns: int | None = None
        self._last_placed_ns = 0

    @property
    def inputs(self) -> frozenset[str]:
        """LiDAR sweeps."""
        return frozenset({"lidar"})

    def register_sweep(self, sweep: Sweep) -> StampedPose | None:
        """`T_odom_base` at the scan's last point; `None` for a scan that cannot be used or registered.

        Raises `OdometryError` when most sweeps are unusable, and when the registration is lost.
        """
        scan = self._clean(sweep)
        if scan is None or (self._last_scan_ns is not None and scan.stamp_ns <= self._last_scan_ns):
            self._count_poor()
            return None
        self._usable += 1
        self._last_scan_ns = scan.stamp_ns
        self._registration = self._registration or self._registration_for(scan)
        registered = self._registration.register(scan)
        if registered is None:
            self._failed += 1
            self._check_failures(scan)
            return None
        elapsed_s = (scan.stamp_ns - self._last_placed_ns) / 1e9
        self._lost_in_a_row = self._lost_in_a_row + 1 if _is_lost(registered, elapsed_s) else 0
        if self._lost_in_a_row:
            self._report_lost(registered, scan)
        self._placed += 1
        self._last_placed_ns = scan.stamp_ns
        return StampedPose(scan.stamp_ns, sweep.T_base_lidar @ registered.T_first_lidar @ inverse(sweep.T_base_lidar))

    def add_imu(self, sample: ImuSample) -> None:
        """Not used: KISS-ICP is LiDAR alone."""

    def register_pose(self, pose: StampedPose) -> StampedPose | None:  # noqa: ARG002 - not used
        """Not used."""
        return None

    def register_frame(self, frame: CameraFrame) -> StampedPose | None:  # noqa: ARG002 - not used
        """Not used."""
        return None

    def finish(self) -> None:
        """Raises `OdometryError` without usable sweeps."""
        if self._poor and self._usable:
            self.warnings.append(
                f"{self._poor} of {self._poor + self._usable} LiDAR sweeps were empty, repeated or too near, and left "
                "out"
            )
        if self._placed < 2:
            raise OdometryError(
                f"no LiDAR motion: fewer than two sweeps have {LEAST_POINTS} usable points in {LEAST_VOXELS} voxels",
                where=self._where,
                cure=self._cure("name the point cloud's topic with --topic lidar=/x"),
            )

    def _count_poor(self) -> None:
        """More than half unusable is an error."""
        self._poor += 1
        if self._poor > MOST_POOR and self._poor > self._usable:
            raise OdometryError(
                f"{self._poor} of {self._poor + self._usable} LiDAR sweeps are empty, repeated or too near",
                where=self._where,
                cure=self._cure("check the LiDAR topic with `supermap inspect`"),
            )

    def _cure(self, of_a_recording: str) -> str:
        first = "check the sweeps that are pushed" if self._pushed else of_a_recording
        return f"{first}, and check min_range_m and max_range_m"

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

    def _check_failures(self, scan: Scan) -> None:
        if self._failed > LEAST_FAILED and self._failed > MOST_FAILED * self._placed:
            raise OdometryError(
                f"{self._failed} of {self._placed + self._failed} LiDAR sweeps cannot be registered, the last at "
                f"{scan.stamp_ns} ns",
                where=self._where,
                cure="use recorded odometry (--odometry recorded), or a smaller voxel_m",
            )

    def _report_lost(self, registered: Registered, scan: Scan) -> None:
        if self._lost_in_a_row >= MOST_LOST_IN_A_ROW:
            raise OdometryError(
                f"the LiDAR odometry lost its way at {scan.stamp_ns} ns",
                where=self._where,
                cure="use recorded odometry (--odometry recorded), a smaller voxel_m, or cut the recording with --end",
            )
        self.warnings.append(
            f"the LiDAR odometry jumps by {registered.surprise_m:.2f} m and "
            f"{np.degrees(registered.surprise_rad):.0f} degrees at {scan.stamp_ns} ns ({self._where})"
        )


def _is_lost(registered: Registered, elapsed_s: float) -> bool:
    """Whether a pose lies farther from a steady motion than a robot can accelerate."""
    limit_m = LOST_SLACK_M + 0.5 * LOST_ACCELERATION * elapsed_s**2
    return registered.surprise_m > limit_m or registered.surprise_rad > LOST_TURN_RAD
