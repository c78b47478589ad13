"""The robot's own poses as odometry, checked: those of a recording, or pushed."""

from __future__ import annotations

import numpy as np

from supermap_cli.errors import OdometryError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.protocols import Recording
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose, Sweep

JUMP_SLACK_M, LARGEST_ACCELERATION = 0.5, 20.0
"""m and m/s^2; a base that leaves its constant-velocity prediction by more than these allow has jumped: 2 g is more
than wheels, legs and hands give.
"""

LEAST_JUMPS, MOST_JUMPS = 5, 0.1
"""A trajectory with more jumps than this, and in a larger share of its steps, is none (estimate)."""


class RecordedOdometry:
    """The poses of the recording's odometry topic or TF; without a recording, those that are pushed.

    `warnings` grows while the poses are read: a pose that jumps (a localisation that relocated, a clock that was reset)
    is kept and reported, because a map can live with one; a trajectory that mostly jumps is an error.
    """

    def __init__(self, recording: Recording | None) -> None:
        self._where = "pushed poses" if recording is None else str(recording.path)
        self._pushed = recording is None
        self.warnings: list[str] = []
        self._last: StampedPose | None = None
        self._velocity: FloatArray = np.zeros(3)
        self._steps = 0
        self._jumps = 0

    @property
    def inputs(self) -> frozenset[str]:
        """Recorded poses."""
        return frozenset({"poses"})

    def register_pose(self, pose: StampedPose) -> StampedPose | None:
        """The pose itself, strictly forward in time; repeated stamps are left out.

        Raises `OdometryError` when time goes back, or when a tenth of all steps are jumps.
        """
        if self._last is not None:
            elapsed_s = (pose.stamp_ns - self._last.stamp_ns) / 1e9
            if elapsed_s == 0:
                return None
            self._check_order(elapsed_s, pose)
            step = pose.T_odom_base[:3, 3] - self._last.T_odom_base[:3, 3]
            deviation_m = float(np.linalg.norm(step - self._velocity * elapsed_s))
            self._steps += 1
            if self._steps > 1 and deviation_m > JUMP_SLACK_M + 0.5 * LARGEST_ACCELERATION * elapsed_s**2:
                self._jumps += 1
                self._report_jump(deviation_m, pose)
            else:
                self._velocity = step / elapsed_s
        self._last = pose
        return pose

    def add_imu(self, sample: ImuSample) -> None:
        """Not used."""

    def register_sweep(self, sweep: Sweep) -> StampedPose | None:  # noqa: ARG002 - not used
        """Not used."""
        return None

    def register_frame(self, frame: CameraFrame) -> StampedPose | None:  # noqa: ARG002 - not used
        """Not used."""
        return None

    def finish(self) -> None:
        """Raises `OdometryError` when there was no pose."""
        if self._last is None:
            raise OdometryError(
                "no usable pose was pushed" if self._pushed else "no usable pose in the recording",
                where=self._where,
                cure=self._cure(
                    "name the odometry topic with --topic odometry=/x, or use --odometry kiss-icp if there is a LiDAR"
                ),
            )

    def _cure(self, of_a_recording: str) -> str:
        return "push poses in the order of their stamps, from one odometry" if self._pushed else of_a_recording

    def _check_order(self, elapsed_s: float, pose: StampedPose) -> None:
        if elapsed_s < 0:
            raise OdometryError(
                f"the recorded poses go back in time by {-elapsed_s:.3f} s at {pose.stamp_ns} ns",
                where=self._where,
                cure=self._cure(
                    "cut the recording there with --start and --end, or name another topic with --topic odometry=/x"
                ),
            )

    def _report_jump(self, deviation_m: float, pose: StampedPose) -> None:
        if self._jumps > LEAST_JUMPS and self._jumps > MOST_JUMPS * self._steps:
            raise OdometryError(
                f"the recorded poses jump again and again ({self._jumps} of {self._steps} steps)",
                where=self._where,
                cure=self._cure("name another odometry topic with --topic odometry=/x, or use --odometry kiss-icp"),
            )
        self.warnings.append(
            f"the recorded pose jumps by {deviation_m:.2f} m at {pose.stamp_ns} ns ({self._where}): things seen "
            "before and after may be mapped twice"
        )
