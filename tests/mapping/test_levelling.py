from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import make_transform, rotation_angle_rad
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.mapping.levelling import LevelView, LowReturns, gravity_up, level, level_view
from supermap_cli.mapping.structure import Structure, coarse_depth, join, structure_of_points
from supermap_cli.recordings import open_bag_recording
from supermap_cli.types.sensing import ImuSample, StampedPose, Sweep
from support.synthetic_room import room_sweeps

RECORDING = Path(__file__).parents[3] / "shared" / "data" / "redkitchen.mcap"
UP = np.array([0.0, 0.0, 1.0])


def plane(
    center: list[float], size: list[float], normal: list[float], noise_m: float = 0.0, seed: int = 0
) -> Structure:
    """An axis-aligned rectangle sampled at 4 cm, `size` (x, y, z) with one zero."""
    axes = [np.arange(-side / 2, side / 2 + 1e-9, 0.04) if side else np.zeros(1) for side in size]
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3) + center
    points = points + np.random.default_rng(seed).normal(0, noise_m, len(points))[:, None] * np.array(normal)
    return Structure(points, np.tile(np.array(normal, float), (len(points), 1)))


def room(noise_m: float = 0.0, floor_z: float = 0.0) -> Structure:
    return join(
        [
            plane([0, 0, floor_z], [4, 3, 0], [0, 0, 1], noise_m, 1),
            plane([0.5, 0, floor_z + 0.75], [1.6, 0.8, 0], [0, 0, 1], noise_m, 2),
            plane([2, 0, floor_z + 1.2], [0, 3, 2.4], [-1, 0, 0], noise_m, 3),
            plane([0, 1.5, floor_z + 1.2], [4, 0, 2.4], [0, -1, 0], noise_m, 4),
        ]
    )


def views_in(R_odom_level: np.ndarray, structure: Structure, pitch_deg: float = 0.0) -> list[LevelView]:
    """The room as seen from an odom frame that is turned, by a camera that is pitched down by `pitch_deg`."""
    up = Rotation.from_euler("y", pitch_deg, degrees=True).as_matrix() @ UP
    return [LevelView(structure.moved(make_transform(R_odom_level, [0, 0, 0])), R_odom_level @ up)]


def off_vertical_deg(T_map_odom: np.ndarray, R_odom_level: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((T_map_odom[:3, :3] @ R_odom_level @ UP)[2], -1, 1))))


def test_nothing_seen_keeps_the_odometry_and_says_so() -> None:
    levelling = level([])
    assert levelling.method == "odom"
    assert levelling.warning
    assert not levelling.floor_seen
    np.testing.assert_array_equal(levelling.T_map_odom, np.eye(4))


def test_walls_alone_do_not_tell_up() -> None:
    walls = join([plane([2, 0, 1], [0, 3, 2], [-1, 0, 0]), plane([0, 2, 1], [3, 0, 2], [0, -1, 0])])
    assert level(views_in(np.eye(3), walls)).warning


@given(st.floats(3, 120), st.floats(-180, 180), st.floats(-30, 30))
@settings(max_examples=15, deadline=None)
def test_a_tilted_odom_is_levelled_by_the_floor_and_the_table(
    tilt_deg: float, about_deg: float, pitch_deg: float
) -> None:
    axis = np.array([np.cos(np.radians(about_deg)), np.sin(np.radians(about_deg)), 0])
    R = Rotation.from_rotvec(np.radians(tilt_deg) * axis).as_matrix()
    levelling = level(views_in(R, room(noise_m=0.008), pitch_deg))
    assert levelling.method == "structure"
    assert levelling.floor_seen
    assert off_vertical_deg(levelling.T_map_odom, R) < 0.3
    assert rotation_angle_rad(levelling.T_map_odom[:3, :3]) == pytest.approx(np.radians(levelling.tilt_deg), abs=1e-6)
    assert abs(levelling.T_map_odom[2, 3]) < 0.02


def test_a_level_odom_stays_exactly_as_it_is() -> None:
    R = Rotation.from_euler("x", 1.0, degrees=True).as_matrix()
    levelling = level(views_in(R, room(noise_m=0.01)))
    assert levelling.method == "odom"
    assert levelling.warning is None
    np.testing.assert_array_equal(levelling.T_map_odom, np.eye(4))


def test_the_floor_comes_to_zero() -> None:
    levelling = level(views_in(np.eye(3), room(floor_z=-1.3)))
    assert levelling.method == "odom"
    assert levelling.floor_seen
    np.testing.assert_allclose(levelling.T_map_odom, make_transform(np.eye(3), [0, 0, 1.3]), atol=0.01)


def imu_run(R_base_level: np.ndarray, force: np.ndarray) -> tuple[list[ImuSample], Trajectory]:
    rng = np.random.default_rng(0)
    samples, poses = [], []
    for k in range(200):
        R_odom_base = Rotation.from_euler("z", 0.01 * k).as_matrix()
        stamp_ns = k * 10_000_000
        poses.append(StampedPose(stamp_ns, make_transform(R_odom_base, [0, 0, 0])))
        specific = R_odom_base.T @ R_base_level @ force + rng.normal(0, 0.05, 3)
        samples.append(ImuSample(stamp_ns, np.zeros(3), specific, np.eye(4)))
    return samples, Trajectory(poses)


def test_gravity_levels_before_any_surface_does() -> None:
    R = Rotation.from_euler("x", 20, degrees=True).as_matrix()
    samples, trajectory = imu_run(R, 9.81 * UP)
    levelling = level([], samples, trajectory)
    assert levelling.method == "imu"
    assert off_vertical_deg(levelling.T_map_odom, R) < 0.2


@pytest.mark.parametrize("force", [np.zeros(3), np.full(3, np.nan)])
def test_an_imu_without_gravity_says_nothing(force: np.ndarray) -> None:
    samples, trajectory = imu_run(np.eye(3), force)
    assert gravity_up(samples, trajectory) is None


def test_an_imu_that_contradicts_the_orientation_says_nothing() -> None:
    samples, _ = imu_run(np.eye(3), 9.81 * UP)
    tumbling = [
        StampedPose(s.stamp_ns, make_transform(Rotation.from_euler("x", 0.1 * k).as_matrix(), [0, 0, 0]))
        for k, s in enumerate(samples)
    ]
    assert gravity_up(samples, Trajectory(tumbling)) is None


def sweep_view(sweep: Sweep, T_odom_base: FloatArray) -> LevelView:
    """A LiDAR's view, from a sweep and the base's pose at its time."""
    T_odom_lidar = T_odom_base @ sweep.T_base_lidar
    return LevelView(structure_of_points(sweep.points_lidar).moved(T_odom_lidar), T_odom_lidar[:3, 2])


def test_a_lidar_levels_by_the_floor_alone() -> None:
    sweeps, truth = room_sweeps(1.0)
    R = Rotation.from_euler("xy", [12, -7], degrees=True).as_matrix()
    T_odom_level = make_transform(R, [0.3, 0.2, 0.9])
    levelling = level(sweep_view(sweep, T_odom_level @ truth.T_odom_base(sweep.stamp_ns)) for sweep in sweeps[::3])
    assert levelling.method == "structure"
    assert off_vertical_deg(levelling.T_map_odom, R) < 1.0
    assert abs((levelling.T_map_odom @ T_odom_level)[2, 3]) < 0.03


def test_a_table_top_with_a_wall_below_it_is_no_floor() -> None:
    """A LiDAR 1 m up that sees a table top 0.5 m up, and of the floor nothing."""
    rng = np.random.default_rng(2)
    top = np.column_stack([rng.uniform(1.5, 3.0, (20000, 2)), rng.normal(-0.5, 0.005, 20000)])
    wall = np.column_stack([np.full(20000, 4.0), rng.uniform(-3, 3, 20000), rng.uniform(-0.9, 0.5, 20000)])
    still = Trajectory([StampedPose(stamp_ns, np.eye(4)) for stamp_ns in (0, 10**9)])

    def floor_seen(points: np.ndarray) -> bool:
        low = LowReturns(still)
        low.add(Sweep(0, "lidar", points, np.zeros(len(points), np.int64), np.eye(4)))
        return level(low.views()).floor_seen

    assert floor_seen(top)
    assert not floor_seen(np.concatenate([top, wall]))


@pytest.mark.skipif(not RECORDING.is_file(), reason="../shared/data/redkitchen.mcap is not there")
@pytest.mark.parametrize(("start_s", "end_s"), [(None, None), (None, 16.6), (16.6, None)])
def test_the_real_kitchen_is_levelled_within_a_degree(start_s: float | None, end_s: float | None) -> None:
    recording = open_bag_recording(RECORDING, RecordingRequest(start_s=start_s, end_s=end_s))
    trajectory = Trajectory(recording.poses())
    chosen = set(recording.frame_stamps_ns()[::12].tolist())
    views = []
    for frame in recording.frames(lambda stamp_ns: stamp_ns in chosen):
        T_odom_base = trajectory.at(frame.stamp_ns)
        assert T_odom_base is not None
        depth = coarse_depth(frame, T_odom_base)
        assert depth is not None
        views.append(level_view(depth))
    levelling = level(views)
    assert levelling.method == "structure"
    assert levelling.floor_seen
    surfaces = join(view.structure for view in views).thinned(0.03).moved(levelling.T_map_odom)
    floor = surfaces.take((np.abs(surfaces.points[:, 2]) < 0.06) & (surfaces.normals[:, 2] > 0.95)).points
    assert len(floor) > 1000
    normal = np.linalg.svd(floor - floor.mean(axis=0), full_matrices=False)[2][2]
    assert np.degrees(np.arccos(abs(normal[2]))) < 1.0
