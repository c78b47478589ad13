from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

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


def odometry_of(*xs_at_s: tuple[float, float]) -> RecordedOdometry:
    return RecordedOdometry(cast("Any", PosesOnly(list(xs_at_s))))


def test_a_recording_without_poses_is_an_error_with_a_cure() -> None:
    with pytest.raises(OdometryError, match=r"no usable pose .*walk\.bag.*--odometry kiss-icp"):
        list(odometry_of().poses())


def test_a_steady_drive_passes_without_a_warning_even_when_it_is_fast() -> None:
    odometry = odometry_of(*((k / 10, 3.0 * k) for k in range(20)))
    assert len(list(odometry.poses())) == 20
    assert odometry.warnings == []


def test_repeated_stamps_are_left_out() -> None:
    assert [p.stamp_ns for p in odometry_of((0, 0), (0, 0), (1, 0)).poses()] == [0, 1_000_000_000]


def test_time_that_goes_back_is_an_error() -> None:
    with pytest.raises(OdometryError, match="back in time"):
        list(odometry_of((1, 0), (0.5, 0)).poses())


def test_one_jump_is_reported_and_kept() -> None:
    odometry = odometry_of(*((k / 10, 0.05 * k + (2.0 if k > 8 else 0.0)) for k in range(20)))
    assert len(list(odometry.poses())) == 20
    assert len(odometry.warnings) == 1
    assert "jumps by 2.0" in odometry.warnings[0]


def test_a_trajectory_that_only_jumps_is_an_error() -> None:
    with pytest.raises(OdometryError, match="again and again"):
        list(odometry_of(*((k / 10, 5.0 * (k % 2)) for k in range(40))).poses())
