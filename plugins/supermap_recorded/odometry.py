"""The robot's own poses as odometry, checked and made continuous: those of a recording, or pushed."""

from __future__ import annotations

from supermap_cli.errors import OdometryError
from supermap_cli.protocols import Recording
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose, Sweep
from supermap_recorded.continuous_poses import ContinuousPoses, PoseJump

LEAST_JUMPS, MOST_JUMPS = 5, 0.1
"""A trajectory with more jumps than this, and in a larger share of its steps, is none (estimate)."""


class RecordedOdometry:
    """The poses of the recording's odometry topic or TF; without a recording, those that are pushed.

    `warnings` grows while the poses are read: from a pose that jumps (a localisation that relocated, a filter that was
    reset) on, all are brought back to where the body went on, and it is reported (`ContinuousPoses`); a trajectory that
    mostly jumps is an error.
    """

    def __init__(self, recording: Recording | None) -> None:
        self._where = "pushed poses" if recording is None else str(recording.path)
        self._pushed = recording is None
        self.warnings: list[str] = []
        self._last_ns: int | None = None
        self._continuous = ContinuousPoses()
        self._steps = 0
        self._jumps = 0

    @property
    def inputs(self) -> frozenset[str]:
        """Recorded poses."""
        return frozenset({"poses"})

    def register_pose(self, pose: StampedPose) -> StampedPose | None:
        """The pose, brought back behind a jump; strictly forward in time, repeated stamps are left out.

        Raises `OdometryError` when time goes back, or when a tenth of all steps are jumps.
        """
        if self._last_ns is not None:
            elapsed_s = (pose.stamp_ns - self._last_ns) / 1e9
            if elapsed_s == 0:
                return None
            self._check_order(elapsed_s, pose)
        self._last_ns = pose.stamp_ns
        self._steps += 1
        continuous, jump = self._continuous.add(pose)
        if jump is not None:
            self._jumps += 1
            self._report_jump(jump, pose)
        return continuous

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
        if self._last_ns is None:
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

    def _report_jump(self, jump: PoseJump, pose: StampedPose) -> None:
        if self._jumps > LEAST_JUMPS and self._jumps > MOST_JUMPS * self._steps:
            raise OdometryError(
                f"the recorded poses jump again and again ({self._jumps} of {self._steps} steps)",
                where=self._where,
                cure=self._cure("name another odometry topic with --topic odometry=/x, or use --odometry kiss-icp"),
            )
        self.warnings.append(
            f"the recorded pose jumps by {jump.distance_m:.2f} m and {jump.turn_deg:.1f} degrees at {pose.stamp_ns} ns "
            f"({self._where}), farther than anything moves: the poses after it are brought back"
        )
