"""A scenario becomes recordings that the program reads, and a truth that fits them."""

from __future__ import annotations

import errno
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import NonSeekingReader

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.se3 import inverse
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.simulation.detection.detector import SimulatedDetector
from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.recording.place_visibility import VisibilityModel
from supermap_cli.simulation.recording.recorder import RecordedScenario, record
from supermap_cli.simulation.rigs import OdometryDrift, SimulatedRig
from supermap_cli.simulation.scenario import Scenario
from supermap_cli.simulation.sensors.camera_view import render
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.truth_file import read_truth
from support import perfect_map, simulated, simulated_traversals

TOPICS = (
    *("/camera/color/image_raw/compressed", "/imu/data", "/odom", "/detections", "/detections/masks"),
    "/camera/aligned_depth_to_color/image_raw/compressedDepth",
)


def one_second(rig: SimulatedRig) -> Scenario:
    """The first traversal of the small world, cut to a second."""
    scenario = simulated_traversals.two_traversals(rig)
    traversal = replace(scenario.traversals[0], route=simulated_traversals.route(simulated.START_NS, 1))
    return replace(scenario, traversals=(traversal,))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> RecordedScenario:
    folder = tmp_path_factory.mktemp("recorded")
    return record(simulated_traversals.two_traversals(), folder, errors=DetectorErrors.perfect())


def test_there_is_a_recording_for_each_visit_and_the_truth_and_nothing_else(recorded: RecordedScenario) -> None:
    assert [path.name for path in recorded.recordings] == ["monday.mcap", "tuesday.mcap"]
    assert recorded.truth.name == "truth.json"
    assert {path.name for path in recorded.truth.parent.iterdir()} == {"monday.mcap", "tuesday.mcap", "truth.json"}
    truth = read_truth(recorded.truth)
    assert (truth.scenario, truth.seed, truth.questions) == ("test", 3, recorded.ground_truth.questions)
    assert [traversal.recording for traversal in truth.traversals] == ["monday.mcap", "tuesday.mcap"]


def test_a_perfect_map_answers_all_the_questions(recorded: RecordedScenario, tmp_path: Path) -> None:
    texts = [question.text for question in recorded.ground_truth.questions]
    assert {"chair in monday", "chair", "where was the chair", "chair earlier"} <= set(texts)
    assert perfect_map.wrong_answers(recorded.ground_truth, tmp_path / "map.db") == []


def test_what_happened_is_told(recorded: RecordedScenario) -> None:
    changes = [(change.kind, change.object_id, change.between) for change in recorded.ground_truth.changes]
    assert changes == [
        ("moved", "box-1", ("monday", "monday")),
        ("disappeared", "chair-1", ("monday", "tuesday")),
        ("disappeared", "cup-1", ("monday", "tuesday")),
    ]


def test_images_depth_and_masks_are_those_of_the_world_at_the_true_pose(recorded: RecordedScenario) -> None:
    scenario = simulated_traversals.two_traversals()
    recording = open_bag_recording(recorded.recordings[0], RecordingRequest(fit_color=False))
    frames, found = list(recording.frames()), {detections.stamp_ns: detections for detections in recording.detections()}
    assert len(frames) == 26
    scene, route = Scene(scenario.world), scenario.traversals[0].route
    for frame in frames[::8]:
        T_world_base = route.T_world_base(np.array([frame.stamp_ns]))[0]
        view = render(scene, scenario.rig.cameras[0].model, T_world_base @ frame.T_base_camera, frame.stamp_ns)
        assert frame.depth_m is not None
        returned = frame.depth_m > 0
        assert returned.mean() > 0.8
        np.testing.assert_allclose(frame.depth_m[returned], view.depth_m[returned], atol=6e-4)
        assert np.abs(frame.rgb.astype(int) - view.rgb).mean() < 8
        detections = found[frame.stamp_ns]
        for label, mask in zip(detections.labels, detections.masks, strict=True):
            assert mask is not None
            (thing,) = np.unique(view.thing[mask.full(*view.thing.shape)])
            np.testing.assert_array_equal(mask.full(*view.thing.shape), view.thing == thing)
            assert scenario.world.things[thing - 1].label == label


def test_odometry_starts_from_its_own_frame_and_the_truth_is_on_a_topic_of_its_own(recorded: RecordedScenario) -> None:
    scenario = simulated_traversals.two_traversals()
    route = scenario.traversals[0].route
    own = list(open_bag_recording(recorded.recordings[0], RecordingRequest()).poses())
    first = inverse(simulated_traversals.T_WORLD_ODOM) @ route.T_world_base(np.array([own[0].stamp_ns]))[0]
    np.testing.assert_allclose(own[0].T_odom_base, first, atol=1e-9)
    request = RecordingRequest(topics={"odometry": "/ground_truth/odom"})
    true = list(open_bag_recording(recorded.recordings[0], request).poses())
    np.testing.assert_allclose(
        np.array([pose.T_odom_base for pose in true]),
        route.T_world_base(np.array([pose.stamp_ns for pose in true])),
        atol=1e-9,
    )


def test_everything_lies_in_the_file_in_the_order_of_log_time_and_detections_come_late(tmp_path: Path) -> None:
    slow = DetectorErrors(latency_min_s=0.3, latency_max_s=0.5)
    short = one_second(simulated_traversals.small_rig())
    (path,) = record(short, tmp_path, errors=slow).recordings
    with path.open("rb") as file:
        stored = [
            (channel.topic, message.log_time)
            for _, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False)
        ]
    assert {topic for topic, _ in stored} >= set(TOPICS)
    assert [log_ns for _, log_ns in stored] == sorted(log_ns for _, log_ns in stored)
    stamps = open_bag_recording(path, RecordingRequest()).detection_stamps_ns()
    late_s = (np.array([log_ns for topic, log_ns in stored if topic == "/detections"]) - stamps) / 1e9
    assert len(stamps) == 6
    assert ((late_s >= 0.3) & (late_s < 0.8)).all()


def test_the_lidar_rig_is_recorded_too(tmp_path: Path) -> None:
    short = one_second(simulated_traversals.small_panorama_rig())
    (path,) = record(short, tmp_path).recordings
    recording = open_bag_recording(path, RecordingRequest())
    assert recording.streams == {"color", "lidar", "poses", "imu", "detections", "masks"}
    route = short.traversals[0].route
    for sweep in recording.sweeps():
        T = route.T_world_base(sweep.point_stamps_ns) @ sweep.T_base_lidar
        points = np.einsum("nij,nj->ni", T[:, :3, :3], sweep.points_lidar) + T[:, :3, 3]
        off_m = simulated.distance_to_surfaces(short.world, points, sweep.stamp_ns)
        assert np.percentile(off_m, 90) < 0.05


def test_the_same_seed_gives_the_same_bytes_and_another_one_other_noise(tmp_path: Path) -> None:
    short = one_second(replace(simulated_traversals.small_rig(), drift=OdometryDrift()))
    files = [record(short, tmp_path / str(k), seed=seed) for k, seed in enumerate((5, 5, 6))]
    same, again, other = ([path.read_bytes() for path in (*made.recordings, made.truth)] for made in files)
    assert same == again
    assert same[0] != other[0]


def test_an_interrupted_run_leaves_nothing(tmp_path: Path) -> None:
    def interrupt(name: str, done: int, total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record(simulated_traversals.two_traversals(), tmp_path / "new" / "out", progress=interrupt)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_run_leaves_a_folder_that_was_there(tmp_path: Path) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record(simulated_traversals.two_traversals(), tmp_path, progress=interrupt)
    assert list(tmp_path.iterdir()) == []


def test_files_are_not_overwritten_unasked(tmp_path: Path) -> None:
    (tmp_path / "truth.json").write_text("mine", encoding="utf-8")
    with pytest.raises(SimulationError, match=r"truth\.json would be overwritten.*--overwrite"):
        record(simulated_traversals.two_traversals(), tmp_path)
    assert (tmp_path / "truth.json").read_text(encoding="utf-8") == "mine"


def never(*_: object) -> None:
    raise AssertionError("it simulates, though it cannot write")


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_folder_where_a_file_should_be_is_told_before_anything_is_simulated(tmp_path: Path, overwrite: bool) -> None:
    (tmp_path / "truth.json").mkdir()
    with pytest.raises(SimulationError, match=r"truth\.json is a folder.*--out"):
        record(simulated_traversals.two_traversals(), tmp_path, overwrite=overwrite, progress=never)


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(SimulationError, match=r"cannot write: .*file/out.*--out"):
        record(simulated_traversals.two_traversals(), tmp_path / "file" / "out", progress=never)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="there is no /proc here")
@pytest.mark.parametrize("name", ["", "supermap-out"])
def test_a_folder_that_cannot_be_written_to_is_told(name: str) -> None:
    with pytest.raises(SimulationError, match=r"cannot write: .*/proc.*--out"):
        record(simulated_traversals.two_traversals(), Path("/proc") / name, progress=never)


def test_a_full_disk_is_told_and_leaves_nothing(tmp_path: Path) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(SimulationError, match=r"No space left on device.*out.*there is space"):
        record(simulated_traversals.two_traversals(), tmp_path / "out", progress=full)
    assert list(tmp_path.iterdir()) == []


def test_progress_counts_every_visits_images(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    scenario = simulated_traversals.two_traversals()
    short = replace(scenario, traversals=(scenario.traversals[1],))
    record(short, tmp_path, progress=lambda *progress: told.append(progress))
    assert told == [("tuesday", done, 11) for done in range(1, 12)]


def messages_by_topic(path: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Log time and data of every message."""
    found: dict[str, list[tuple[int, bytes]]] = {}
    with path.open("rb") as file:
        for _, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append((message.log_time, message.data))
    return found


@pytest.fixture(scope="module")
def three_cameras(tmp_path_factory: pytest.TempPathFactory) -> RecordedScenario:
    return record(one_second(simulated_traversals.small_three_camera_rig()), tmp_path_factory.mktemp("three"))


def test_each_of_several_cameras_has_topics_of_its_own_and_all_expose_at_once(three_cameras: RecordedScenario) -> None:
    stored = messages_by_topic(three_cameras.recordings[0])
    stamps_ns = [simulated.START_NS + k * simulated.SECOND_NS // 5 for k in range(6)]
    for name in ("camera_front", "camera_left", "camera_right"):
        for topic in ("color/image_raw/compressed", "color/camera_info", "aligned_depth_to_color/camera_info"):
            assert [log_ns for log_ns, _ in stored[f"/{name}/{topic}"]] == stamps_ns
        assert len(stored[f"/{name}/aligned_depth_to_color/image_raw/compressedDepth"]) == 6
        assert len(stored[f"/{name}/detections"]) == len(stored[f"/{name}/detections/masks"]) == 6
    assert len({data for _, data in stored["/tf_static"]}) == 1


def test_the_messages_of_several_cameras_lie_in_the_order_of_log_time(three_cameras: RecordedScenario) -> None:
    with three_cameras.recordings[0].open("rb") as file:
        log_ns = [found.log_time for _, _, found in NonSeekingReader(file).iter_messages(log_time_order=False)]
    assert log_ns == sorted(log_ns)


@pytest.mark.parametrize("camera_id", ["front", "left"])
def test_a_camera_alone_records_what_it_records_among_others(
    three_cameras: RecordedScenario, camera_id: str, tmp_path: Path
) -> None:
    rig = simulated_traversals.only_camera(simulated_traversals.small_three_camera_rig(), camera_id)
    alone = messages_by_topic(record(one_second(rig), tmp_path).recordings[0])
    among = messages_by_topic(three_cameras.recordings[0])
    own = [topic for topic in alone if topic != "/tf_static"]
    assert any(topic.startswith(f"/camera_{camera_id}/detections") for topic in own)
    assert all(alone[topic] == among[topic] for topic in own)


def test_the_truth_tells_which_camera_took_each_image(three_cameras: RecordedScenario) -> None:
    (traversal,) = read_truth(three_cameras.truth).traversals
    assert traversal.camera_ids == ("front", "left", "right") * 6
    assert (np.diff(traversal.stamps_ns.reshape(6, 3), axis=1) == 0).all()
    truth = three_cameras.ground_truth
    views = {
        camera_id: {truth.objects[k].id for k in traversal.sightings.object[traversal.sightings.frame % 3 == number]}
        for number, camera_id in enumerate(("front", "left", "right"))
    }
    assert "table-1" in views["front"]
    assert views["left"] != views["right"]


def test_the_only_camera_of_a_rig_adds_nothing_to_the_seeds_of_its_noise(tmp_path: Path) -> None:
    scenario = one_second(simulated_traversals.small_rig())
    (path,) = record(scenario, tmp_path, seed=7).recordings
    recording = open_bag_recording(path, RecordingRequest(fit_color=False))
    seed = int(np.random.default_rng((7, 0, 4)).integers(2**31))
    detector = SimulatedDetector(scenario.world, DetectorErrors(), seed)
    scene, (camera,), route = Scene(scenario.world), scenario.rig.cameras, scenario.traversals[0].route
    for read in recording.detections():
        T_world_camera = route.T_world_base(np.array([read.stamp_ns]))[0] @ camera.T_base_camera
        view = render(scene, camera.model, T_world_camera, read.stamp_ns)
        visibility = VisibilityModel(scenario.world, farthest_m=8.0).measure(view, camera.model, T_world_camera)
        found = detector.detect(view, visibility, full_turn=False, camera=camera.model, T_world_camera=T_world_camera)
        assert found.labels == read.labels
        np.testing.assert_allclose(found.scores, read.scores)
