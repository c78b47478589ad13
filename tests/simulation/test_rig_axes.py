"""Each level of the robot's axes does what it says, and any of them go together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import NonSeekingReader
from scipy.spatial.transform import Rotation

from supermap_cli.geometry.cameras import EquirectangularCamera, PinholeCamera
from supermap_cli.geometry.se3 import check_transform, transform_points
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.domains.axes import AXES, apply_levels, random_levels
from supermap_cli.simulation.domains.domain import Domain
from supermap_cli.simulation.domains.rig_axes import RIG_AXES
from supermap_cli.simulation.recording.messages import RigMessages
from supermap_cli.simulation.recording.recorder import record
from supermap_cli.simulation.rigs import RIGS, SimulatedRig, make_rig, small_rgbd_rig
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.scenario import Scenario
from supermap_cli.simulation.scenarios import make_scenario
from supermap_cli.simulation.sensors.camera_view import render
from supermap_cli.simulation.sensors.depth_sensor import measure_depth
from supermap_cli.simulation.sensors.lidar_sensor import LidarSensor
from supermap_cli.simulation.sensors.odometry import drifting_odometry
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.views import RenderedView
from support import simulated, simulated_traversals

START_NS = simulated.START_NS
SEEDS = range(6)


def rig_of(*levels: str, base: SimulatedRig | None = None) -> SimulatedRig:
    """`rig_of("camera=low")`: a rig as these levels make it."""
    chosen = dict(level.split("=") for level in levels)
    return apply_levels(Domain(base or small_rgbd_rig()), chosen).rig


def recorded(folder: Path, rig: SimulatedRig, *, seconds: float = 1.0, sways: bool = False) -> Scenario:
    """A scenario of the small world that was recorded to folder/monday.mcap."""
    scenario = simulated_traversals.two_traversals(rig)
    traversal = replace(scenario.traversals[0], route=simulated_traversals.route(START_NS, seconds))
    if sways:
        traversal = traversal.carried(1.4, (0,))
    scenario = replace(scenario, traversals=(traversal,))
    record(scenario, folder, errors=DetectorErrors.perfect())
    return scenario


def stamps_ns(recording: Path) -> Mapping[str, list[int]]:
    """When what was logged, by topic."""
    found: dict[str, list[int]] = {}
    with recording.open("rb") as file:
        for _, channel, message in NonSeekingReader(file).iter_messages():
            found.setdefault(channel.topic, []).append(message.log_time)
    return found


# -- all axes


def test_every_axis_has_three_levels_or_more_and_a_text_for_each() -> None:
    assert [axis.name for axis in RIG_AXES] == ["lidar", "camera", "depth", "sync", "image-rate", "odometry"]
    for axis in RIG_AXES:
        assert len(axis.levels) >= 3
        assert all(level.text for level in axis.levels.values())


@pytest.mark.parametrize("name", RIGS)
def test_usual_levels_leave_a_rig_as_it_is(name: str) -> None:
    rig = make_rig(name)
    assert apply_levels(Domain(rig), {axis.name: axis.usual for axis in RIG_AXES}).rig is rig


def test_usual_levels_leave_a_scenario_as_it_is() -> None:
    usual = make_scenario("tiny", 1, levels={axis.name: axis.usual for axis in RIG_AXES})
    (traversal,) = usual.traversals
    assert traversal.route.sway is None
    assert usual.rig.depth_delay_s == 0


@pytest.mark.parametrize("name", RIGS)
def test_all_levels_that_are_drawn_at_random_go_together(name: str) -> None:
    for seed in range(60):
        levels = {axis.name: random_levels(seed)[axis.name] for axis in RIG_AXES}
        rig = apply_levels(Domain(make_rig(name)), levels).rig
        assert (rig.lidar is None) == (rig.T_base_lidar is None)
        assert rig.detection_every >= 1
        for camera in rig.cameras:
            check_transform("T_base_camera", camera.T_base_camera)
            assert (camera.depth_namespace is None) == (rig.depth is None)
        if rig.depth is not None:
            assert np.isfinite(measure_depth(noisy_view(24, 36), rig.depth, np.random.default_rng(0))).all()
    assert RigMessages(rig).mounting(START_NS).data


@pytest.mark.parametrize("levels", [("lidar=beams-16", "camera=hand-held"), ("camera=hand-held", "sync=5ms")])
def test_levels_together_are_recorded_and_read(levels: tuple[str, ...], tmp_path: Path) -> None:
    rig = rig_of(*levels, "depth=stereo", "odometry=jump")
    panoramic = rig.lidar is not None
    rig = simulated_traversals.with_camera_model(
        rig, EquirectangularCamera(200, 100) if panoramic else PinholeCamera(160, 120, 116.0, 116.0, 79.5, 59.5)
    )
    recorded(tmp_path, rig, seconds=0.6, sways=True)
    recording = open_bag_recording(tmp_path / "monday.mcap", RecordingRequest(fit_color=False))
    assert recording.streams == {"color", "poses", "detections", "masks", "lidar" if panoramic else "depth"}
    assert len(list(recording.frames())) == (4 if panoramic else 3)  # the last depth image would come too late


# -- odometry


@pytest.fixture(scope="module")
def way() -> Route:
    """Half a minute, 9 m or so, to and fro and round."""
    times_s = np.linspace(0, 30, 61)
    knots_xy = np.column_stack([2 * np.sin(0.25 * times_s), np.cos(0.4 * times_s)])
    return Route(START_NS, times_s, knots_xy, 0.3 * times_s + np.sin(times_s / 3))


def errors_of(level: str, route: Route, seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """(n, 2) metres and (n,) degrees off the truth, and the length of the way in metres."""
    T_world_odom = route.T_world_base(np.array([route.start_ns]))[0]
    samples = drifting_odometry(route, rig_of(f"odometry={level}").drift, T_world_odom, np.random.default_rng(seed))
    truth, estimate = route.T_world_base(samples.stamps_ns), T_world_odom @ samples.T_odom_base
    turned = Rotation.from_matrix(truth[:, :3, :3]).inv() * Rotation.from_matrix(estimate[:, :3, :3])
    way_m = float(np.linalg.norm(np.diff(truth[:, :2, 3], axis=0), axis=1).sum())
    return (estimate - truth)[:, :2, 3], np.degrees(turned.as_rotvec()[:, 2]), way_m


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("percent", [0.5, 1.0, 3.0])
def test_drift_ends_at_its_share_of_the_way(percent: float, seed: int, way: Route) -> None:
    off_m, off_deg, way_m = errors_of(f"drift-{percent:g}", way, seed)
    assert 100 * np.linalg.norm(off_m[-1]) / way_m == pytest.approx(percent, abs=0.1)
    assert np.linalg.norm(off_m, axis=1).max() < 0.04 * percent * way_m
    assert 0 < np.abs(off_deg).max() < 6 * percent


def test_perfect_odometry_is_the_truth(way: Route) -> None:
    off_m, off_deg, _ = errors_of("perfect", way, 0)
    assert np.abs(off_m).max() < 1e-9
    assert np.abs(off_deg).max() < 1e-6


def test_jitter_is_white_and_does_not_grow(way: Route) -> None:
    off_m, off_deg, _ = errors_of("jitter", way, 0)
    np.testing.assert_allclose(off_m[1:].std(axis=0), 0.01, rtol=0.1)
    assert off_deg[1:].std() == pytest.approx(0.3, rel=0.1)
    assert abs(np.corrcoef(off_m[1:-1, 0], off_m[2:, 0])[0, 1]) < 0.15


@pytest.mark.parametrize("seed", SEEDS)
def test_a_jump_comes_once_in_the_middle_half(seed: int, way: Route) -> None:
    off_m, off_deg, _ = errors_of("jump", way, seed)
    steps_m, steps_deg = np.linalg.norm(np.diff(off_m, axis=0), axis=1), np.abs(np.diff(off_deg))
    at = int(steps_m.argmax())
    assert steps_m[at] == pytest.approx(0.3, abs=0.02)
    assert steps_deg.max() == pytest.approx(5.0, abs=0.5)
    assert np.delete(steps_m, at).max() < 0.02
    assert 0.25 <= at / len(steps_m) <= 0.75


def test_a_biased_heading_grows_with_the_way(way: Route) -> None:
    _, off_deg, way_m = errors_of("yaw", way, 0)
    assert abs(off_deg[-1]) == pytest.approx(0.5 * way_m, rel=0.01)
    assert (np.diff(np.abs(off_deg)) > -1e-6).all()


# -- depth


def noisy_view(height: int = 200, width: int = 300) -> RenderedView:
    """A board 1.5 m away before a wall 3 m away; the upper half is textured, the lower one plain."""
    depth_m = np.full((height, width), 3.0, np.float32)
    depth_m[:, width // 3 : 2 * width // 3] = 1.5
    rgb = np.full((height, width, 3), 120, np.uint8)
    rgb[: height // 2] = np.random.default_rng(0).integers(60, 180, (height // 2, width, 1))
    return RenderedView(0, depth_m, np.zeros(depth_m.shape, np.int32), np.ones(depth_m.shape, np.float32), rgb)


def depth_of(level: str, seed: int = 0) -> tuple[np.ndarray, RenderedView]:
    sensor, view = rig_of(f"depth={level}").depth, noisy_view()
    assert sensor is not None
    return measure_depth(view, sensor, np.random.default_rng(seed)), view


def flying_share(measured: np.ndarray) -> float:
    """The share of pixels within 3 of the board's edges that lie between board and wall."""
    beside = np.concatenate([measured[:, edge - 3 : edge + 3] for edge in (100, 200)], axis=1)
    return float(((beside > 1.6) & (beside < 2.8)).mean())


def test_stereo_has_patches_without_return_above_all_where_there_is_no_texture() -> None:
    measured, _ = depth_of("stereo")
    wall = measured[:, :90]
    assert 0.01 < (wall[:95] == 0).mean() < 0.08
    assert 0.12 < (wall[105:] == 0).mean() < 0.4
    errors = wall[wall > 0] - 3
    assert errors.std() == pytest.approx(0.004 * 9, rel=0.15)
    inner = wall[5:95]
    both = (inner[:, 1:] > 0) & (inner[:, :-1] > 0)
    assert np.corrcoef(inner[:, 1:][both], inner[:, :-1][both])[0, 1] > 0.7
    assert flying_share(measured) > 0.06


def test_time_of_flight_measures_too_far_and_mixes_edges() -> None:
    measured, _ = depth_of("time-of-flight")
    wall = measured[:, :90]
    assert 0.008 < np.median(wall[wall > 0]) - 3 < 0.03
    assert (wall == 0).mean() < 0.02
    usual, _ = depth_of("usual")
    assert flying_share(measured) > 5 * flying_share(usual)


@pytest.mark.parametrize("reach_m", [3.5, 6, 10])
def test_nothing_returns_beyond_the_reach(reach_m: float) -> None:
    sensor = rig_of(f"depth=reach-{reach_m:g}").depth
    assert sensor is not None
    view = replace(noisy_view(), depth_m=np.tile(np.linspace(1, 12, 300, dtype=np.float32), (200, 1)))
    measured = measure_depth(view, replace(sensor, edge_px=0), np.random.default_rng(0))
    assert reach_m - 0.2 < measured.max() <= reach_m


def test_edges_flicker_from_image_to_image() -> None:
    sensor = rig_of("depth=flicker").depth
    assert sensor is not None
    rng = np.random.default_rng(0)
    first, second = (measure_depth(noisy_view(), sensor, rng) for _ in range(2))
    jumped = (np.abs(first - second) > 1) & (first > 0) & (second > 0)
    assert set(np.nonzero(jumped)[1].tolist()) == {*range(97, 103), *range(197, 203)}
    assert 0.3 < np.concatenate([jumped[:, 97:103], jumped[:, 197:203]]).mean() < 0.55
    assert 0.07 < (first[:, 97:103] == 0).mean() < 0.14


@pytest.mark.parametrize("level", AXES["depth"].levels)
def test_a_rig_without_depth_stays_without(level: str) -> None:
    rig = make_rig("panorama")
    assert rig_of(f"depth={level}", "sync=20ms", base=rig) is rig


# -- sync


@pytest.mark.parametrize(("level", "apart_ms"), [("5ms", 5), ("20ms", 20)])
def test_depth_is_taken_later_and_stamped_so(level: str, apart_ms: int, tmp_path: Path) -> None:
    rig = rig_of(f"sync={level}", base=simulated_traversals.small_rig())
    scenario = recorded(tmp_path, rig)
    logged = stamps_ns(tmp_path / "monday.mcap")
    color_ns = np.array(logged["/camera/color/image_raw/compressed"])
    depth_ns = np.array(logged["/camera/aligned_depth_to_color/image_raw/compressedDepth"])
    np.testing.assert_array_equal(depth_ns - color_ns, apart_ms * 1_000_000)
    recording = open_bag_recording(tmp_path / "monday.mcap", RecordingRequest(fit_color=False))
    frames, (camera,), scene = list(recording.frames()), rig.cameras, Scene(scenario.world)
    assert [frame.stamp_ns for frame in frames] == color_ns.tolist()
    T_world_base = scenario.traversals[0].route.T_world_base(depth_ns)
    exact = render(scene, camera.model, T_world_base[2] @ camera.T_base_camera, int(depth_ns[2])).depth_m
    measured = frames[2].depth_m
    assert measured is not None
    np.testing.assert_allclose(measured[measured > 0], exact[measured > 0], atol=6e-4)


# -- camera


def width_deg(rig: SimulatedRig) -> float:
    model = rig.cameras[0].model
    assert isinstance(model, PinholeCamera)
    assert (model.width, model.height, model.fx) == (400, 300, model.fy)
    return float(np.degrees(2 * np.arctan(model.width / 2 / model.fx)))


@pytest.mark.parametrize(("level", "width"), [("usual", 69), ("narrow", 55), ("wide", 110)])
def test_the_width_of_the_view(level: str, width: float) -> None:
    assert width_deg(rig_of(f"camera={level}")) == pytest.approx(width, abs=0.2)


@pytest.mark.parametrize(
    ("level", "height_m", "down_deg"),
    [("usual", 1.1, 12), ("low", 0.35, 0), ("high", 1.6, 35), ("up", 0.6, -20), ("hand-held", 1.4, 10)],
)
def test_where_the_camera_sits(level: str, height_m: float, down_deg: float) -> None:
    for base in ("small-rgbd", "three-cameras"):
        before, after = make_rig(base), rig_of(f"camera={level}", base=make_rig(base))
        for was, camera in zip(before.cameras, after.cameras, strict=True):
            T = camera.T_base_camera
            check_transform("T_base_camera", T)
            assert T[2, 3] == pytest.approx(height_m)
            assert np.degrees(np.arcsin(-T[2, 2])) == pytest.approx(down_deg, abs=1e-6)
            assert abs(T[2, 0]) < 1e-9  # rows of pixels stay level
            np.testing.assert_allclose(
                np.arctan2(T[1, 2], T[0, 2]), np.arctan2(was.T_base_camera[1, 2], was.T_base_camera[0, 2]), atol=1e-9
            )


def test_a_panoramic_camera_takes_the_height_alone() -> None:
    (camera,) = rig_of("lidar=livox", "camera=high").cameras
    np.testing.assert_array_equal(camera.T_base_camera[:3, :3], make_rig("panorama").cameras[0].T_base_camera[:3, :3])
    assert camera.T_base_camera[2, 3] == pytest.approx(1.6)


def test_a_hand_held_camera_sways_and_so_do_odometry_and_truth(tmp_path: Path) -> None:
    rig = rig_of("odometry=perfect", "camera=hand-held", base=simulated_traversals.small_rig())
    scenario = recorded(tmp_path, rig, sways=True)
    (traversal,) = scenario.traversals
    at_ns = START_NS + np.arange(0, 10_000_000_000, 20_000_000)
    roll_pitch = Rotation.from_matrix(traversal.route.T_level_base(at_ns)[:, :3, :3]).as_euler("ZYX", degrees=True)
    assert 3 < np.abs(roll_pitch[:, 2]).max() < 5
    assert 4 < np.abs(roll_pitch[:, 1]).max() < 7
    turns = Rotation.from_matrix(traversal.route.T_level_base(at_ns)[:, :3, :3])
    assert 30 < np.degrees((turns[:-1].inv() * turns[1:]).magnitude()).max() / 0.02 < 65
    recording = open_bag_recording(tmp_path / "monday.mcap", RecordingRequest(fit_color=False))
    assert "imu" not in recording.streams
    poses = list(recording.poses())
    T_world_base = traversal.route.T_world_base(np.array([pose.stamp_ns for pose in poses]))
    np.testing.assert_allclose([traversal.T_world_odom @ pose.T_odom_base for pose in poses], T_world_base, atol=1e-6)
    assert np.ptp(T_world_base[:, 2, 3]) > 0.01


@pytest.mark.parametrize("level", ["wide", "high", "up", "hand-held"])
def test_what_such_a_camera_measures_lies_on_surfaces(level: str, tmp_path: Path) -> None:
    base = replace(simulated_traversals.small_rig(), image_rate_hz=20.0)
    rig = rig_of("odometry=perfect", f"camera={level}", base=base)
    scenario = recorded(tmp_path, rig, seconds=4.0, sways=rig.carried_m is not None)
    recording = open_bag_recording(tmp_path / "monday.mcap", RecordingRequest(fit_color=False))
    frame, pose = list(recording.frames())[-1], list(recording.poses())[-1]
    assert frame.stamp_ns == pose.stamp_ns
    assert frame.depth_m is not None
    rows, columns = np.nonzero(frame.depth_m)
    points = frame.camera.rays()[rows, columns] * frame.depth_m[rows, columns, None]
    T = scenario.traversals[0].T_world_odom @ pose.T_odom_base @ frame.T_base_camera
    off_m = simulated.distance_to_surfaces(scenario.world, transform_points(T, points)[::50], frame.stamp_ns)
    assert len(off_m) > 100
    assert off_m.max() < 2e-3


def test_only_what_is_carried_sways_and_its_odometry_starts_level() -> None:
    held, again = (make_scenario("tiny", 1, levels={"camera": "hand-held"}).traversals[0] for _ in range(2))
    driven = make_scenario("tiny", 1).traversals[0]
    assert held.route.sway is not None
    assert held.route.sway == again.route.sway
    assert driven.route.sway is None
    np.testing.assert_array_equal(held.T_world_odom, driven.T_world_odom)


# -- image rate


@pytest.mark.parametrize(
    ("level", "images", "detected"),
    [("1hz", 2, 2), ("2hz", 3, 3), ("usual", 6, 6), ("15hz", 16, 6), ("15hz-all", 16, 16), ("30hz", 31, 6)],
)
def test_images_and_detections_a_second(level: str, images: int, detected: int, tmp_path: Path) -> None:
    recorded(tmp_path, rig_of(f"image-rate={level}", base=simulated_traversals.small_rig()))
    logged = stamps_ns(tmp_path / "monday.mcap")
    assert len(logged["/camera/color/image_raw/compressed"]) == images
    assert len(logged["/camera/aligned_depth_to_color/image_raw/compressedDepth"]) == images
    assert len(logged["/detections"]) == detected


# -- LiDAR


@pytest.mark.parametrize(
    ("level", "rings", "lowest", "highest"),
    [
        ("beams-16", 16, -15, 15),
        ("beams-32", 32, -30.67, 10.67),
        ("beams-64", 64, -22.5, 22.5),
        ("beams-128", 128, -22.5, 22.5),
    ],
)
def test_a_scanner_has_its_rings(level: str, rings: int, lowest: float, highest: float) -> None:
    lidar = rig_of(f"lidar={level}").lidar
    assert lidar is not None
    sensor = LidarSensor(lidar, 0)
    beams = sensor.beams(START_NS)
    elevations, counts = np.unique(np.degrees(np.arcsin(beams[:, 2])).round(3), return_counts=True)
    np.testing.assert_allclose(elevations, np.linspace(lowest, highest, rings), atol=2e-3)
    assert (counts == 1024).all()
    azimuth_deg = np.unwrap(np.degrees(np.arctan2(beams[::rings, 1], beams[::rings, 0])), period=360)
    np.testing.assert_allclose(np.diff(azimuth_deg), -360 / 1024, atol=1e-3)
    assert len(np.unique(sensor.stamps_ns(START_NS))) == 1024


@pytest.mark.parametrize(("level", "height_m"), [("livox", 0.75), ("low", 0.3), ("high", 1.5), ("beams-64", 0.75)])
def test_how_high_the_lidar_sits(level: str, height_m: float) -> None:
    rig = rig_of(f"lidar={level}")
    assert rig.T_base_lidar is not None
    assert rig.T_base_lidar[2, 3] == pytest.approx(height_m)
    assert rig.cameras[0].T_base_camera[2, 3] == pytest.approx(height_m + 0.2)
    assert (rig.cameras[0].model.width, rig.cameras[0].model.height) == (960, 480)


def test_a_blind_lidar_returns_nothing_near() -> None:
    lidar = rig_of("lidar=blind").lidar
    assert lidar is not None
    scene = Scene(simulated.small_world())

    def beside_the_wall(stamps_ns: np.ndarray) -> np.ndarray:
        return np.tile(simulated.standing(-2.6, 0.0, 0.75), (len(stamps_ns), 1, 1))

    ranges = np.linalg.norm(LidarSensor(lidar, 0).scan(scene, beside_the_wall, START_NS).points_lidar, axis=1)
    assert 0.7 <= ranges.min() < 0.8
    assert len(ranges) < 18_000


def test_a_scanner_with_rings_is_read_with_the_time_of_each_point(tmp_path: Path) -> None:
    rig = rig_of("lidar=beams-16")
    scenario = recorded(
        tmp_path, simulated_traversals.with_camera_model(rig, EquirectangularCamera(200, 100)), seconds=0.5
    )
    recording = open_bag_recording(tmp_path / "monday.mcap", RecordingRequest(fit_color=False))
    sweep = next(recording.sweeps())
    assert 0.09e9 < np.ptp(sweep.point_stamps_ns) < 0.1e9
    np.testing.assert_allclose(sweep.T_base_lidar, rig.T_base_lidar, atol=1e-9)
    T = scenario.traversals[0].route.T_world_base(sweep.point_stamps_ns) @ sweep.T_base_lidar
    points = np.einsum("nij,nj->ni", T[:, :3, :3], sweep.points_lidar) + T[:, :3, 3]
    off_m = simulated.distance_to_surfaces(scenario.world, points[::7], START_NS)
    assert np.sqrt((off_m**2).mean()) < 0.03
