"""The recording's own poses as odometry, checked."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from supermap_cli.errors import OdometryError
from supermap_cli.protocols import Recording
from supermap_cli.types.sensing import StampedPose

# A base does not leave its constant-velocity prediction by more than this slack and this acceleration allow.
_JUMP_SLACK_M = 0.5
_JUMP_ACCELERATION = 20.0
_MOST_JUMPS = 0.1


class RecordedOdometry:
    """The poses of the recording's odometry topic or TF.

    `warnings` grows while the poses are read: a pose that jumps (a localisation that relocated, a clock that was reset)
    is kept and reported, because a map can live with one; a trajectory that mostly jumps is an error.
    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.warnings: list[str] = []

    def poses(self) -> Iterator[StampedPose]:
        """`T_odom_base`, strictly forward in time; repeated stamps are left out.

        Raises `OdometryError` when there is no pose, when time goes back, or when a tenth of all steps are jumps.
        """
        previous: StampedPose | None = None
        velocity = np.zeros(3)
        steps = jumps = 0
        for pose in self._recording.poses():
            if previous is not None:
                elapsed_s = (pose.stamp_ns - previous.stamp_ns) / 1e9
                if elapsed_s == 0:
                    continue
                self._check_order(elapsed_s, pose)
                step = pose.T_odom_base[:3, 3] - previous.T_odom_base[:3, 3]
                surprise_m = float(np.linalg.norm(step - velocity * elapsed_s))
                steps += 1
                if steps > 1 and surprise_m > _JUMP_SLACK_M + 0.5 * _JUMP_ACCELERATION * elapsed_s**2:
                    jumps += 1
                    self._report_jump(jumps, steps, surprise_m, pose)
                else:
                    velocity = step / elapsed_s
            previous = pose
            yield pose
        if previous is None:
            raise OdometryError(
                "no usable pose in the recording",
                where=str(self._recording.path),
                cure="name the odometry topic with --topic odometry=/x, or use --odometry kiss-icp if there is a LiDAR",
            )

    def _check_order(self, elapsed_s: float, pose: StampedPose) -> None:
        if elapsed_s < 0:
            raise OdometryError(
                f"the recorded poses go back in time by {-elapsed_s:.3f} s at {pose.stamp_ns} ns",
                where=str(self._recording.path),
                cure="cut the recording there with --start and --end, or name another topic with --topic odometry=/x",
            )

    def _report_jump(self, jumps: int, steps: int, surprise_m: float, pose: StampedPose) -> None:
        where = str(self._recording.path)
        if jumps > 5 and jumps > _MOST_JUMPS * steps:
            raise OdometryError(
                f"the recorded poses jump again and again ({jumps} of {steps} steps)",
                where=where,
                cure="name another odometry topic with --topic odometry=/x, or use --odometry kiss-icp",
            )
        self.warnings.append(
            f"the recorded pose jumps by {surprise_m:.2f} m at {pose.stamp_ns} ns ({where}): things seen before and "
            "after may be mapped twice"
        )
