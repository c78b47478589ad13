from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from supermap_cli.errors import AlignmentError
from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.geometry.se3 import inverse, make_transform, rotation_angle_rad
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.mapping.alignment import align, parse_placement
from supermap_cli.mapping.icp import Surface
from supermap_cli.mapping.levelling import level, level_view
from supermap_cli.mapping.place_search import Candidate, distinct
from supermap_cli.mapping.structure import CoarseDepth, Structure, coarse_depth, join
from supermap_cli.recordings import open_bag_recording
from support import synthetic_room as room

CAMERA = PinholeCamera(room.WIDTH, room.HEIGHT, room.FOCAL, room.FOCAL, room.WIDTH / 2, room.HEIGHT / 2)
RECORDING = Path(__file__).parents[3] / "shared" / "data" / "redkitchen.mcap"


@cache
def views_of_visit(visit: int, shown: float = 1.0) -> tuple[CoarseDepth, ...]:
    """Noisy depth of the first `shown` part of a visit, in the world frame."""
    scene = room.Room(room.furnish() if visit == 1 else room.furnish(room.GONE, room.CHANGED))
    drive, rng = room.Drive(10.0, phase=2.0 * (visit - 1)), np.random.default_rng(visit)
    views = []
    for time_s in np.linspace(0, 10.0 * shown, 24, endpoint=False):
        T_world_camera = drive.T_world_base(time_s) @ room.T_BASE_CAMERA
        depth_m = room.noisy_depth(room.render(scene, T_world_camera)[0], rng)
        views.append(CoarseDepth(depth_m[::4, ::4].astype(np.float32), 4, CAMERA, T_world_camera))
    return tuple(views)


def moved(views: Sequence[CoarseDepth], T: np.ndarray) -> list[CoarseDepth]:
    return [view.moved(T) for view in views]


def turned_about_z(x: float, y: float, z: float, yaw: float) -> np.ndarray:
    return make_transform(Rotation.from_euler("z", yaw).as_matrix(), [x, y, z])


def error_of(T: np.ndarray, T_true: np.ndarray) -> tuple[float, float]:
    """Metres and degrees."""
    change = inverse(T_true) @ T
    return float(np.linalg.norm(change[:3, 3])), float(np.degrees(rotation_angle_rad(change[:3, :3])))


def test_no_views_are_an_error_with_a_cure() -> None:
    with pytest.raises(AlignmentError, match=r"too few surfaces.*--align"):
        align((), (), np.eye(4))


def test_an_odom_that_goes_on_is_kept_exactly() -> None:
    T_map_odom = turned_about_z(1, -2, 0.1, 0.7)
    again = moved(views_of_visit(2), inverse(T_map_odom))
    alignment = align(views_of_visit(1), again, T_map_odom, [np.eye(4), T_map_odom])
    assert alignment.method == "continued"
    assert alignment.fitness > 0.9
    np.testing.assert_array_equal(alignment.T_map_odom, T_map_odom)


def test_a_start_nearly_where_the_last_one_was_is_corrected() -> None:
    T_map_odom = turned_about_z(0.1, -0.05, 0, 0.03)
    alignment = align(views_of_visit(1), moved(views_of_visit(2), inverse(T_map_odom)), np.eye(4), [np.eye(4)])
    assert alignment.method == "refined"
    shift_m, turn_deg = error_of(alignment.T_map_odom, T_map_odom)
    assert shift_m < 0.03
    assert turn_deg < 0.5


@pytest.mark.parametrize("seed", range(3))
def test_another_odom_frame_is_found_although_furniture_was_moved(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T_map_odom = turned_about_z(*rng.uniform(-5, 5, 2), rng.uniform(-0.1, 0.1), rng.uniform(-3, 3))
    again = moved(views_of_visit(2), inverse(T_map_odom))
    alignment = align(views_of_visit(1), again, level(map(level_view, again)).T_map_odom, [np.eye(4)])
    assert alignment.method == "registered"
    shift_m, turn_deg = error_of(alignment.T_map_odom, T_map_odom)
    assert shift_m < 0.05
    assert turn_deg < 1.0
    assert alignment.rmse_m < 0.03


def test_another_place_is_refused() -> None:
    rng = np.random.default_rng(0)
    scene = room.Room((room.Thing("plant", "potted plant", "plant", (1, 1, 0)),))
    views = []
    for yaw in np.linspace(0, 1.5, 12):
        T = turned_about_z(-1.5, -1, 0, yaw) @ room.T_BASE_CAMERA
        depth_m = room.noisy_depth(room.render(scene, T)[0], rng)
        views.append(CoarseDepth(0.7 * depth_m[::4, ::4].astype(np.float32), 4, CAMERA, T))
    with pytest.raises(AlignmentError, match="--align"):
        align(views_of_visit(1), views, np.eye(4), [np.eye(4)])


def test_a_place_that_looks_the_same_from_both_sides_is_refused() -> None:
    scene = room.Room(tuple(thing for thing in room.THINGS if thing.name == "table"))
    drive = room.Drive(10.0)
    views = []
    for time_s in np.linspace(0, 10, 24):
        T = drive.T_world_base(time_s) @ room.T_BASE_CAMERA
        views.append(CoarseDepth(room.render(scene, T)[0][::4, ::4].astype(np.float32), 4, CAMERA, T))
    with pytest.raises(AlignmentError, match="more than one place"):
        align(views, moved(views, turned_about_z(1, 2, 0, 0.5)), np.eye(4))


@cache
def views_of_kitchen(start_s: float, end_s: float) -> tuple[CoarseDepth, ...]:
    recording = open_bag_recording(RECORDING, RecordingRequest(start_s=start_s, end_s=end_s))
    trajectory = Trajectory(recording.poses())
    chosen = set(recording.frame_stamps_ns()[::8].tolist())
    frames = [
        coarse_depth(frame, T_odom_base)
        for frame in recording.frames(lambda stamp_ns: stamp_ns in chosen)
        if (T_odom_base := trajectory.at(frame.stamp_ns)) is not None
    ]
    return tuple(frame for frame in frames if frame is not None)


@pytest.mark.skipif(not RECORDING.is_file(), reason="../shared/data/redkitchen.mcap is not there")
def test_the_real_kitchen_s_second_half_goes_on_in_the_same_odom() -> None:
    first, second = views_of_kitchen(0, 16.6), views_of_kitchen(16.6, 34)
    T_map_odom = level(map(level_view, first)).T_map_odom
    alignment = align(moved(first, T_map_odom), second, level(map(level_view, second)).T_map_odom, [T_map_odom])
    assert alignment.method == "continued"
    np.testing.assert_array_equal(alignment.T_map_odom, T_map_odom)


@pytest.mark.skipif(not RECORDING.is_file(), reason="../shared/data/redkitchen.mcap is not there")
@pytest.mark.parametrize("seed", range(2))
def test_the_real_kitchen_s_second_half_is_found_from_another_odom(seed: int) -> None:
    first, second = views_of_kitchen(0, 16.6), views_of_kitchen(16.6, 34)
    T_map_first = level(map(level_view, first)).T_map_odom
    rng = np.random.default_rng(seed)
    T_other_odom = make_transform(Rotation.random(rng=rng).as_matrix(), rng.uniform(-4, 4, 3))
    again = moved(second, T_other_odom)
    alignment = align(moved(first, T_map_first), again, level(map(level_view, again)).T_map_odom, [T_map_first])
    assert alignment.method == "registered"
    table = np.array([*np.median(join(view.structure() for view in second).moved(T_map_first).points, axis=0), 1.0])
    change = alignment.T_map_odom @ T_other_odom @ inverse(T_map_first)
    assert np.linalg.norm((change @ table - table)[:3]) < 0.05
    assert np.degrees(rotation_angle_rad(change[:3, :3])) < 1.0


def test_a_placement_by_hand_is_a_turn_and_a_shift() -> None:
    np.testing.assert_allclose(parse_placement("1 -2, 0.5 90", np.eye(4)), turned_about_z(1, -2, 0.5, np.pi / 2))


@pytest.mark.parametrize("text", ["", "1 2 3", "1 2 3 north", "1 2 3 nan"])
def test_a_placement_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(AlignmentError, match="x y z yaw_deg"):
        parse_placement(text, np.eye(4))


def test_icp_with_a_level_start_stays_level() -> None:
    surface = join(view.structure() for view in views_of_visit(1)).thinned(0.05)
    T = turned_about_z(0.1, 0.05, 0.02, 0.05)
    found = Surface(surface).refine(surface, T, (0.3,) * 8, level=True)
    shift_m, turn_deg = error_of(found, np.eye(4))
    assert shift_m < 0.01
    assert turn_deg < 0.2
    assert found[2, 2] == pytest.approx(1, abs=1e-9)


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-3, 3), st.floats(0, 1)), max_size=12))
def test_distinct_places_keep_the_first_of_each_group(places: list[tuple[float, float, float, float]]) -> None:
    candidates = [Candidate(turned_about_z(x, y, 0, yaw), score) for x, y, yaw, score in places]
    kept = distinct(candidates, 5)
    assert len(kept) <= 5
    assert kept[:1] == candidates[:1]


def test_a_wall_gives_normals_that_look_at_the_camera() -> None:
    view = CoarseDepth(np.full((60, 80), 2, np.float32), 4, CAMERA, np.eye(4))
    structure = view.structure()
    np.testing.assert_allclose(structure.normals, np.tile([0, 0, -1], (len(structure), 1)), atol=1e-6)
    np.testing.assert_allclose(structure.points[:, 2], 2)
    assert len(structure) > 2000


def test_thinning_keeps_one_point_a_voxel() -> None:
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (2000, 3))
    thin = Structure(points, np.zeros_like(points)).thinned(0.1)
    assert len(thin) == len(np.unique(np.floor(points / 0.1), axis=0))
    assert len(join([]).thinned(0.1)) == 0
