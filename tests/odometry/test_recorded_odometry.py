from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from supermap_cli.drivers.odometry import run_odometry
from supermap_cli.errors import OdometryError
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.types.sensing import StampedPose
from supermap_recorded.odometry import RecordedOdometry


@dataclass
class PosesOnly:
    xs_at_s: list[tuple[float, float]]
    path: Path = Path("walk.bag")

    def poses(self) -> Any:
        for time_s, x in self.xs_at_s:
            yield StampedPose(round(time_s * 1e9), make_transform(np.eye(3), [x, 0, 0]))


def run(*xs_at_s: tuple[float, float]) -> tuple[list[StampedPose], list[str]]:
    recording = cast("Any", PosesOnly(list(xs_at_s)))
    odometry = RecordedOdometry(recording)
    return list(run_odometry(odometry, recording)), odometry.warnings


def test_a_recording_without_poses_is_an_error_with_a_cure() -> None:
    with pytest.raises(OdometryError, match=r"no usable pose .*walk\.bag.*--odometry kiss-icp"):
        run()


def test_a_steady_drive_passes_without_a_warning_even_when_it_is_fast() -> None:
    poses, warnings = run(*((k / 10, 3.0 * k) for k in range(20)))
    assert len(poses) == 20
    assert warnings == []


def test_repeated_stamps_are_left_out() -> None:
    assert [p.stamp_ns for p in run((0, 0), (0, 0), (1, 0))[0]] == [0, 1_000_000_000]


def test_time_that_goes_back_is_an_error() -> None:
    with pytest.raises(OdometryError, match="back in time"):
        run((1, 0), (0.5, 0))


def test_one_jump_is_reported_and_kept() -> None:
    poses, warnings = run(*((k / 10, 0.05 * k + (2.0 if k > 8 else 0.0)) for k in range(20)))
    assert len(poses) == 20
    assert len(warnings) == 1
    assert "jumps by 2.0" in warnings[0]


def test_a_trajectory_that_only_jumps_is_an_error() -> None:
    with pytest.raises(OdometryError, match="again and again"):
        run(*((k / 10, 5.0 * (k % 2)) for k in range(40)))
