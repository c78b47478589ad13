from dataclasses import replace

import numpy as np
import pytest

from supermap_cli.geometry.se3 import inverse
from supermap_cli.simulation.rigs import Lidar
from supermap_cli.simulation.sensors.lidar_sensor import LidarSensor
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.world import World
from support import simulated
from support.simulated import SECOND_NS, START_NS

SCAN_NS = SECOND_NS // 10


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(simulated.small_world())


def turning(stamps_ns: np.ndarray) -> np.ndarray:
    """A sensor 0.8 m up that turns by 100 degrees and goes half a metre a second."""
    since_s = (np.asarray(stamps_ns) - START_NS) / 1e9
    return np.stack([simulated.standing(-1.2 + 0.5 * t, -1.2, 0.8, np.radians(100) * t) for t in since_s])


def moved(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", T[:, :3, :3], points) + T[:, :3, 3]


def test_an_empty_world_returns_nothing() -> None:
    scan = LidarSensor(Lidar(), 0).scan(Scene(World((), (), ())), turning, START_NS)
    assert scan.points_lidar.shape == (0, 3)


def test_a_scan_spreads_its_points_over_its_time_and_its_field_of_view(scene: Scene) -> None:
    scan = LidarSensor(Lidar(), 0).scan(scene, turning, START_NS)
    assert len(scan.points_lidar) == 20_000
    gaps_ns = np.diff(scan.stamps_ns)
    assert scan.stamps_ns[0] == START_NS
    assert scan.stamps_ns[-1] < START_NS + SCAN_NS
    assert gaps_ns == pytest.approx(np.full(len(gaps_ns), 5000), abs=1)
    x, y, z = scan.points_lidar.T.astype(float)
    elevation, azimuth = np.degrees(np.arctan2(z, np.hypot(x, y))), np.degrees(np.arctan2(y, x))
    assert [elevation.min(), elevation.max()] == pytest.approx([-7, 52], abs=0.2)
    assert np.histogram(azimuth, 36, (-180, 180))[0].min() > 300
    assert 0 <= scan.intensity.min() < scan.intensity.max() <= 255


def test_points_deskewed_by_their_own_poses_lie_on_surfaces_and_others_do_not(scene: Scene) -> None:
    scan = LidarSensor(Lidar(), 0).scan(scene, turning, START_NS)
    points = scan.points_lidar.astype(float)
    deskewed = moved(turning(scan.stamps_ns), points)
    skewed = moved(np.repeat(turning(np.array([START_NS])), len(points), axis=0), points)
    off, skewed_off = (simulated.distance_to_surfaces(scene.world, points, START_NS) for points in (deskewed, skewed))
    assert off.max() < 5 * 0.02
    assert np.sqrt((off**2).mean()) < 0.02
    assert np.percentile(skewed_off, 90) > 0.1


def test_without_noise_points_lie_on_surfaces_exactly(scene: Scene) -> None:
    scan = LidarSensor(Lidar(noise_m=0.0), 0).scan(scene, turning, START_NS)
    points = moved(turning(scan.stamps_ns), scan.points_lidar.astype(float))
    assert simulated.distance_to_surfaces(scene.world, points, START_NS).max() < 1e-4  # float32


def test_the_pattern_does_not_repeat_and_fills_up() -> None:
    sensor = LidarSensor(Lidar(), 0)

    def coverage(scans: int) -> float:
        beams = np.concatenate([sensor.beams(START_NS + k * SCAN_NS) for k in range(scans)])
        azimuth = np.degrees(np.arctan2(beams[:, 1], beams[:, 0])) + 180
        hit = np.histogram2d(np.degrees(np.arcsin(beams[:, 2])), azimuth, (59, 360), ((-7, 52), (0, 360)))[0] > 0
        return float(hit.mean())

    shares = [coverage(scans) for scans in (1, 2, 5, 10)]
    assert shares[0] < 0.5
    assert shares[1] > 1.5 * shares[0]
    assert shares[2] > 0.95
    assert shares[3] > 0.99


def test_a_scan_follows_from_seed_and_time_alone(scene: Scene) -> None:
    sensor = LidarSensor(Lidar(), 3)
    first = sensor.scan(scene, turning, START_NS + SCAN_NS)
    sensor.scan(scene, turning, START_NS)
    again = sensor.scan(scene, turning, START_NS + SCAN_NS)
    other = LidarSensor(Lidar(), 4).scan(scene, turning, START_NS + SCAN_NS)
    np.testing.assert_array_equal(first.points_lidar, again.points_lidar)
    assert len(first.points_lidar) != len(other.points_lidar) or (first.points_lidar != other.points_lidar).any()


def test_returns_end_at_the_limits(scene: Scene) -> None:
    lidar = replace(Lidar(), nearest_m=1.0, farthest_m=2.0)
    ranges = np.linalg.norm(LidarSensor(lidar, 0).scan(scene, turning, START_NS).points_lidar, axis=1)
    assert 0 < len(ranges) < 20_000
    assert ranges.min() >= 1.0 - 1e-6
    assert ranges.max() <= 2.0 + 1e-6


def test_a_moving_thing_is_hit_where_it_is_at_the_time(scene: Scene) -> None:
    stamp_ns, motion = START_NS + 3 * SECOND_NS, scene.world.motions[0]

    def watching(stamps_ns: np.ndarray) -> np.ndarray:
        return np.tile(simulated.standing(-1.2, 0, 0.2), (len(stamps_ns), 1, 1))

    scan = LidarSensor(Lidar(noise_m=0.0), 0).scan(scene, watching, stamp_ns)
    stamps_ns, points_lidar = scan.stamps_ns[::5], scan.points_lidar[::5].astype(float)
    points = moved(watching(stamps_ns), points_lidar)
    in_box = np.stack([inverse(motion.at(int(stamp))) for stamp in stamps_ns])
    on_it = (np.abs(moved(in_box, points)) < np.array([0.22, 0.17, 0.32])).all(axis=1)
    assert on_it.sum() > 20
    low, high = -np.array([0.2, 0.15, 0.0]), np.array([0.2, 0.15, 0.3])
    beyond = np.maximum(low - moved(in_box, points)[on_it], moved(in_box, points)[on_it] - high).max(axis=1)
    assert np.abs(beyond).max() < 0.02  # it stands still for 20 ms at 1 m/s
