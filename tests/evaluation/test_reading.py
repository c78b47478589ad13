"""How a map is read for the metrics: laid over the truth by the robot's way, with its answers and changes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.errors import EvaluationError
from supermap_cli.evaluation.reading import read_estimate
from supermap_cli.evaluation.truth_alignment import align_to_truth, fit_level_transform
from supermap_cli.geometry.se3 import make_transform, transform_points
from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.types.memory import KeyframeRecord, MapDelta
from supermap_cli.types.truth import GroundTruth, TrueQuestion, TrueSightings, TrueTraversal
from support import kitchen
from support import memories as m

NONE_SEEN = TrueSightings(
    *(np.zeros(0, kind) for kind in (int, int, int, bool, np.float32, np.float32, int, np.float32))
)


def motion(yaw_deg: float = 0.0, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    c, s = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    return make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [x, y, z])


def truth(
    *drives: tuple[Sequence[float], Sequence[np.ndarray]], questions: Sequence[str] = (), answer: tuple[str, ...] = ()
) -> GroundTruth:
    """The truth of drives, each given by its seconds and its true poses."""
    traversals = tuple(
        TrueTraversal(
            name=f"drive-{k}",
            recording=f"drive-{k}.mcap",
            start_ns=m.ns(seconds[0]),
            end_ns=m.ns(seconds[-1]),
            T_world_odom=np.eye(4),
            stamps_ns=np.array([m.ns(duration_s) for duration_s in seconds]),
            T_world_base=np.array(poses),
            sightings=NONE_SEEN,
        )
        for k, (seconds, poses) in enumerate(drives)
    )
    return GroundTruth(
        "hand-made", 0, traversals, (), (), (), tuple(TrueQuestion(question, answer) for question in questions)
    )


def keyframe(at: float, T_map_base: np.ndarray) -> KeyframeRecord:
    return KeyframeRecord(m.ns(at), T_map_base, T_map_base, '{"model":"pinhole"}', b"\x89PNG", 8, None, detected=True)


@pytest.fixture
def in_the_kitchen(tmp_path: Path) -> Iterator[MapReader]:
    path = kitchen.make_kitchen(tmp_path / "map.db")
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        yield reader


def read_drive(path: Path, poses: dict[float, np.ndarray], against: GroundTruth) -> tuple[np.ndarray, dict[str, float]]:
    """Where the map of a drive stands in the world, and how well it fits."""
    delta = MapDelta(keyframes=tuple(keyframe(at, T) for at, T in poses.items()))
    m.make_memory(path, ("monday", (0, 100), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        alignment = align_to_truth(reader, against)
    return alignment.T_world_map, alignment.rmse_m


# -- laying the map over the truth


@given(st.floats(-180, 180), st.floats(-50, 50), st.floats(-50, 50), st.floats(-2, 2))
def test_a_turn_about_the_vertical_and_a_shift_are_found_exactly(yaw_deg, x, y, z):
    points = np.array([[0.0, 0, 0], [1, 0, 0.5], [0, 2, 0], [3, 1, 1]])
    T = motion(yaw_deg, x, y, z)
    np.testing.assert_allclose(fit_level_transform(points, transform_points(T, points)), T, atol=1e-9)


def test_the_map_is_laid_over_the_truth_by_the_robots_way(tmp_path):
    T_world_map = motion(40, 3, -2, 0.1)
    way = {0.0: motion(0, 0), 1.0: motion(10, 1), 2.0: motion(80, 2, 1)}
    true_way = truth(([0, 1, 2], [T_world_map @ T for T in way.values()]))
    found, rmse_m = read_drive(tmp_path / "map.db", way, true_way)
    np.testing.assert_allclose(found, T_world_map, atol=1e-9)
    assert rmse_m == {"monday": pytest.approx(0, abs=1e-9)}


def test_a_robot_that_never_moved_still_says_how_the_map_is_turned(tmp_path):
    T_world_map = motion(-120, 1, 1)
    found, _ = read_drive(tmp_path / "map.db", {0.5: np.eye(4)}, truth(([0, 1], [T_world_map, T_world_map])))
    np.testing.assert_allclose(found, T_world_map, atol=1e-9)


def test_true_poses_are_interpolated_between_their_stamps(tmp_path):
    way = {0.25: motion(0, 0.25), 0.75: motion(0, 0.75)}
    found, rmse_m = read_drive(tmp_path / "map.db", way, truth(([0, 1], [motion(0, 0), motion(0, 1)])))
    np.testing.assert_allclose(found, np.eye(4), atol=1e-9)
    assert rmse_m["monday"] == pytest.approx(0, abs=1e-9)


def test_keyframes_outside_the_truths_time_take_no_part(tmp_path):
    way = {0.0: np.eye(4), 1.0: motion(0, 1), 50.0: motion(90, 30, 30)}
    found, rmse_m = read_drive(tmp_path / "map.db", way, truth(([0, 1], [np.eye(4), motion(0, 1)])))
    np.testing.assert_allclose(found, np.eye(4), atol=1e-9)
    assert rmse_m["monday"] == pytest.approx(0, abs=1e-9)


def test_drift_is_told_by_traversal(tmp_path):
    way = {0.0: motion(0, 0), 1.0: motion(0, 1.2)}
    _, rmse_m = read_drive(tmp_path / "map.db", way, truth(([0, 1], [motion(0, 0), motion(0, 1)])))
    assert rmse_m["monday"] == pytest.approx(0.1)


def test_the_truth_of_another_recording_is_refused(tmp_path):
    with pytest.raises(EvaluationError, match=r"belongs to other recordings.*give the truth"):
        read_drive(tmp_path / "map.db", {0.0: np.eye(4)}, truth(([500, 501], [np.eye(4), np.eye(4)])))


def test_a_map_without_keyframes_is_refused(tmp_path):
    with pytest.raises(EvaluationError):
        read_drive(tmp_path / "map.db", {}, truth(([0, 1], [np.eye(4), np.eye(4)])))


# -- what the metrics see

T_WORLD_KITCHEN = motion(90, 10, 0)


def dense(span: tuple[int, int]) -> tuple[list[float], list[np.ndarray]]:
    seconds = [float(stamp) for stamp in range(*span)]
    return seconds, [T_WORLD_KITCHEN] * len(seconds)


BOTH_DAYS = truth(dense((0, 101)), dense((1000, 1101)))


def test_objects_stand_in_the_world_frame(in_the_kitchen):
    estimate = read_estimate(in_the_kitchen, BOTH_DAYS)
    chair = next(instance for instance in estimate.objects if instance.id == "chair-1")
    np.testing.assert_allclose(chair.centroid, transform_points(T_WORLD_KITCHEN, np.array([[-3.0, 3, 0.5]]))[0])
    assert chair.box.yaw == pytest.approx(np.pi / 2)
    assert (chair.label, chair.presence) == ("chair", "present")
    assert [state.gone_ns for state in chair.states] == [m.ns(1001), None]
    np.testing.assert_allclose(chair.states[0].centroid, [9, 0, 0.5], atol=1e-9)
    assert [observation.stamp_ns for observation in chair.observations] == [
        m.ns(at) for at in (1, 40, 90, 1001, 1040, 1090)
    ]
    np.testing.assert_allclose(chair.observations[0].centroid, [8, 1, 0.5], atol=1e-9)


def test_points_are_the_centres_of_the_solid_voxels(in_the_kitchen):
    estimate = read_estimate(in_the_kitchen, BOTH_DAYS)
    centres = (m.voxels().keys + 0.5) * 0.02
    np.testing.assert_allclose(estimate.objects[0].points, transform_points(T_WORLD_KITCHEN, centres), atol=1e-9)


def test_confidence_is_what_the_map_says_of_the_last_state(in_the_kitchen):
    shown = {instance.id: instance.states[-1].confidence for instance in in_the_kitchen.believed}
    objects = read_estimate(in_the_kitchen, BOTH_DAYS).objects
    assert {instance.id: instance.confidence for instance in objects} == shown
    assert {instance.label_probability for instance in objects} == {0.9}
    assert objects[0].rank == pytest.approx(0.9 * objects[0].confidence)


def test_doubted_objects_are_left_out(tmp_path):
    delta = MapDelta(
        keyframes=(m.keyframe(1),),
        instances=(m.instance(1, "chair"), m.instance(2, "ghost", presence="doubted")),
        states=(m.state(1, 0, (1, 1)), m.state(2, 0, (1, 1), label="ghost")),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        estimate = read_estimate(reader, truth(([0.5, 1.5], [np.eye(4), np.eye(4)])))
    assert [instance.id for instance in estimate.objects] == ["chair-1"]
    assert estimate.changes == ()


def test_changes_are_those_of_the_diff_but_not_what_nobody_can_tell(in_the_kitchen):
    changes = {change.object_id: change for change in read_estimate(in_the_kitchen, BOTH_DAYS).changes}
    assert {instance_id: change.kind for instance_id, change in changes.items()} == {
        "cup-1": "disappeared",
        "chair-1": "moved",
        "vase-1": "appeared",
    }
    chair = changes["chair-1"]
    assert chair.distance_m == pytest.approx(3.61, abs=0.01)
    np.testing.assert_allclose(chair.position_before, [9, 0, 0.5], atol=1e-9)
    np.testing.assert_allclose(chair.position_after, [7, -3, 0.5], atol=1e-9)
    assert changes["vase-1"].position_before is None


def test_answers_come_as_for_query_and_what_is_not_understood_is_no_answer(in_the_kitchen):
    asked = truth(dense((0, 101)), dense((1000, 1101)), questions=("chair", "piano", "why"))
    chair, piano, why = read_estimate(in_the_kitchen, asked).answers
    assert set(chair.ids) == {"chair-1", "chair-2"}
    assert (piano.ids, piano.error) == ((), None)
    assert why.ids == ()
    assert why.error


def test_keyframes_of_all_traversals_are_in_the_order_of_time(in_the_kitchen):
    estimate = read_estimate(in_the_kitchen, BOTH_DAYS)
    assert estimate.keyframes_ns.tolist() == [m.ns(at) for at in (1, 40, 90, 1001, 1040, 1090)]
    assert set(estimate.alignment_rmse_m) == {"monday", "tuesday"}


# -- clocks that are behind the map's


def add_shifted(path: Path, name: str, own_s: tuple[float, float], shift_s: float, *seconds: float) -> None:
    """A traversal whose keyframes and whose one chair have the map's time."""
    start = replace(m.start(name, (own_s[0] + shift_s, own_s[1] + shift_s)), clock_shift_ns=round(shift_s * 1e9))
    seen = (seconds[0] + shift_s, seconds[-1] + shift_s)
    delta = MapDelta(
        keyframes=tuple(keyframe(at + shift_s, motion(0, at)) for at in seconds),
        instances=(m.instance(1, "chair", seen=seen),),
        states=(m.state(1, 0, seen),),
        observations=tuple(m.observation(1, at + shift_s) for at in seconds),
    )
    with open_store(str(path), create=True) as store:
        traversal_id = store.begin_traversal(start)
        store.commit(traversal_id, delta)
        store.finish_traversal(traversal_id)


def test_times_of_a_shifted_traversal_are_compared_as_recorded(tmp_path):
    add_shifted(tmp_path / "map.db", "monday", (0, 10), 600, 1.0, 2.0, 3.0)
    true_way = truth(([0, 1, 2, 3], [motion(0, 0), motion(0, 1), motion(0, 2), motion(0, 3)]))
    with open_store(str(tmp_path / "map.db"), read_only=True) as store, store.reader() as reader:
        estimate = read_estimate(reader, true_way)
    assert estimate.alignment_rmse_m == {"monday": pytest.approx(0, abs=1e-9)}
    assert estimate.keyframes_ns.tolist() == [m.ns(1), m.ns(2), m.ns(3)]
    (chair,) = estimate.objects
    assert (chair.states[0].first_seen_ns, chair.states[0].last_seen_ns) == (m.ns(1), m.ns(3))
    assert [observation.stamp_ns for observation in chair.observations] == [m.ns(1), m.ns(2), m.ns(3)]


def test_traversals_built_in_another_order_than_recorded_are_not_compared(tmp_path):
    m.make_memory(tmp_path / "map.db", ("tuesday", (100, 110), MapDelta(keyframes=(keyframe(101, np.eye(4)),))))
    add_shifted(tmp_path / "map.db", "monday", (0, 10), 600, 1.0)
    both = truth(([0, 1], [np.eye(4)] * 2), ([100, 101], [np.eye(4)] * 2))
    with (
        open_store(str(tmp_path / "map.db"), read_only=True) as store,
        store.reader() as reader,
        pytest.raises(EvaluationError, match="monday was recorded before tuesday and built after it"),
    ):
        read_estimate(reader, both)
