import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from supermap_cli.drivers.odometry import run_odometry
from supermap_cli.errors import OdometryError
from supermap_cli.geometry.se3 import inverse, make_transform
from supermap_cli.types.sensing import StampedPose, Sweep
from supermap_kiss_icp import KissIcpOptions
from supermap_kiss_icp.odometry import KissIcpOdometry
from supermap_kiss_icp.registration import clean_scan, exp_se3, log_se3
from support.synthetic_room import RoomTruth, room_sweeps


@dataclass
class SweepsOnly:
    given: list[Sweep] = field(default_factory=list)
    path: Path = Path("drive.bag")

    def sweeps(self) -> Any:
        return iter(self.given)


def odometry(**options: Any) -> KissIcpOdometry:
    return KissIcpOdometry(cast("Any", SweepsOnly()), KissIcpOptions(**options))


def poses_of(sweeps: list[Sweep], pushed_into: KissIcpOdometry | None = None) -> list[StampedPose]:
    return list(run_odometry(pushed_into or odometry(), cast("Any", SweepsOnly(sweeps))))


def sweep_of(points: np.ndarray, stamp_ns: int = 0, stamps_ns: np.ndarray | None = None) -> Sweep:
    times = np.full(len(points), stamp_ns, np.int64) if stamps_ns is None else stamps_ns
    return Sweep(stamp_ns, "lidar", points, times, np.eye(4))


@pytest.fixture(scope="module")
def drive() -> tuple[list[Sweep], RoomTruth]:
    return room_sweeps(12.0)


def ape_rmse_m(poses: list[StampedPose], truth: RoomTruth) -> float:
    """Translation RMSE after the best rigid alignment (Umeyama 1991, without scale), as `evo_ape --align`."""
    estimated = np.array([pose.T_odom_base[:3, 3] for pose in poses])
    true = np.array([truth.T_odom_base(pose.stamp_ns)[:3, 3] for pose in poses])
    turn, _ = Rotation.align_vectors(true - true.mean(axis=0), estimated - estimated.mean(axis=0))
    residual = turn.apply(estimated - estimated.mean(axis=0)) - (true - true.mean(axis=0))
    return float(np.sqrt((residual**2).sum(axis=1).mean()))


def test_no_sweeps_is_an_error_with_a_cure() -> None:
    with pytest.raises(OdometryError, match=r"no LiDAR motion.*drive\.bag.*--topic lidar=/x"):
        poses_of([])


def test_twelve_metres_through_a_room_stay_within_three_centimetres(drive: tuple[list[Sweep], RoomTruth]) -> None:
    sweeps, truth = drive
    kiss_icp = odometry()
    poses = poses_of(sweeps, kiss_icp)
    assert len(poses) == len(sweeps)
    assert kiss_icp.warnings == []
    way = np.diff([pose.T_odom_base[:3, 3] for pose in poses], axis=0)
    assert np.linalg.norm(way, axis=1).sum() > 10
    assert ape_rmse_m(poses, truth) < 0.03


def test_the_first_pose_is_the_identity_at_the_scan_s_last_point(drive: tuple[list[Sweep], RoomTruth]) -> None:
    first = odometry().register_sweep(drive[0][0])
    assert first is not None
    np.testing.assert_allclose(first.T_odom_base, np.eye(4), atol=1e-12)
    assert first.stamp_ns == drive[0][0].point_stamps_ns.max()


def test_dropped_and_empty_sweeps_are_bridged(drive: tuple[list[Sweep], RoomTruth]) -> None:
    sweeps, truth = drive
    kept = [sweep for k, sweep in enumerate(sweeps[:40]) if k % 5 != 3]
    kept.insert(7, sweep_of(np.zeros((0, 3)), kept[6].stamp_ns + 1))
    kiss_icp = odometry()
    poses = poses_of(kept, kiss_icp)
    assert len(poses) == len(kept) - 1
    assert len(kiss_icp.warnings) == 1
    assert ape_rmse_m(poses, truth) < 0.03


def test_the_same_sweeps_give_the_same_poses(drive: tuple[list[Sweep], RoomTruth]) -> None:
    runs = [np.array([pose.T_odom_base for pose in poses_of(drive[0][:15])]) for _ in range(2)]
    np.testing.assert_array_equal(runs[0], runs[1])


def test_a_run_that_makes_no_sense_is_an_error(drive: tuple[list[Sweep], RoomTruth]) -> None:
    turned = []
    for k, sweep in enumerate(drive[0][:30]):
        T = make_transform(Rotation.random(rng=k).as_matrix(), np.random.default_rng(k).normal(0, 8, 3))
        points = sweep.points_lidar @ T[:3, :3].T + T[:3, 3]
        turned.append(Sweep(sweep.stamp_ns, "lidar", points, sweep.point_stamps_ns, np.eye(4)))
    with pytest.raises(OdometryError, match="lost its way"):
        poses_of(turned)


def test_mostly_empty_sweeps_are_an_error() -> None:
    sweeps = [sweep_of(np.zeros((3, 3)), k) for k in range(50)]
    with pytest.raises(OdometryError, match="empty, repeated or too near"):
        poses_of(sweeps)


def test_cleaning_keeps_only_points_within_range() -> None:
    points = np.concatenate([np.full((100, 3), 2.0), np.zeros((5, 3)), np.full((5, 3), 1e300), np.full((5, 3), -90.0)])
    scan = clean_scan(sweep_of(points, 7), min_range_m=0.4, max_range_m=100, deskew=True)
    assert scan is not None
    assert len(scan.points) == 100
    assert scan.stamp_ns == 7
    assert scan.duration_s == 0


@pytest.mark.parametrize(("deskew", "stamp_ms", "duration_s"), [(True, 100, 0.1), (False, 50, 0.0)])
def test_the_pose_s_time_follows_the_deskewing(deskew: bool, stamp_ms: int, duration_s: float) -> None:
    stamps_ns = np.linspace(0, 100_000_000, 200).astype(np.int64)
    scan = clean_scan(sweep_of(np.full((200, 3), 2.0), 0, stamps_ns), min_range_m=0, max_range_m=9, deskew=deskew)
    assert scan is not None
    assert scan.stamp_ns == stamp_ms * 1_000_000
    assert scan.duration_s == pytest.approx(duration_s)


@settings(deadline=None)
@given(arrays(np.float64, 6, elements=st.floats(-1.7, 1.7)))
def test_log_inverts_exp(twist: np.ndarray) -> None:
    np.testing.assert_allclose(log_se3(exp_se3(twist)), twist, atol=1e-6)
    np.testing.assert_allclose(exp_se3(twist)[:3, :3], Rotation.from_rotvec(twist[3:]).as_matrix(), atol=1e-9)
    np.testing.assert_allclose(exp_se3(twist) @ exp_se3(-twist), np.eye(4), atol=1e-9)
    np.testing.assert_allclose(exp_se3(twist), inverse(exp_se3(-twist)), atol=1e-9)


FUZZ = """
import sys
from pathlib import Path
import numpy as np
from supermap_cli.drivers.odometry import run_odometry
from supermap_cli.errors import OdometryError
from supermap_cli.types.sensing import Sweep
from supermap_kiss_icp import KissIcpOptions
from supermap_kiss_icp.odometry import KissIcpOdometry

class Recording:
    path = Path("fuzz")
    def __init__(self, rng): self.rng = rng
    def sweeps(self):
        rng = self.rng
        scale = 10.0 ** rng.integers(-3, 4)
        for k in range(12):
            n = int(rng.choice([0, 1, 2, 3, 61, 500, 3000]))
            points = rng.normal(0, scale, (n, 3))
            kind = rng.integers(8)
            if kind == 0: points[:] = rng.normal(0, 3, 3)
            if kind == 1: points = np.repeat(points, 3, axis=0)
            if kind == 2: points[:, 2] = 0
            if kind == 3: points *= 1e30
            if kind == 4: points[: n // 2] = 1e308
            if kind == 5: points[:, :2] = 0
            stamp = int(k * 1e8)
            times = stamp + rng.integers(0, [1, 2, 10**8, 10**18][rng.integers(4)], len(points))
            yield Sweep(stamp, "lidar", points, times, np.eye(4))

poses = errors = 0
for seed in range(60):
    rng = np.random.default_rng(seed)
    options = KissIcpOptions(deskew=bool(rng.integers(2)), min_range_m=float(rng.choice([0, 0.4])))
    try:
        recording = Recording(rng)
        for pose in run_odometry(KissIcpOdometry(recording, options), recording):
            assert np.isfinite(pose.T_odom_base).all()
            poses += 1
    except OdometryError:
        errors += 1
print(poses, errors)
"""


def test_no_input_brings_the_process_down() -> None:
    done = subprocess.run([sys.executable, "-c", FUZZ], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    poses, errors = map(int, done.stdout.split())
    assert poses > 50
    assert errors > 5
