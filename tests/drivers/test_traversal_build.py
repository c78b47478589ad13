"""A whole build: a rendered recording through every stage into a real database."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from supermap_cli.memory import MapStore, open_store
from supermap_cli.types.relations import SpatialPredicate
from support import databases
from support import fakes as f
from support import scenes as s
from support.fake_builds import KITCHEN, build, monday, tuesday


def test_a_recording_becomes_a_memory(store: MapStore) -> None:
    summary = build(store, monday())
    assert summary.traversal == "monday"
    assert (summary.statistics.frames, summary.statistics.keyframes, summary.statistics.without_pose) == (12, 6, 0)
    assert summary.statistics.labels == {"cup": 1, "dining table": 1}
    assert summary.statistics.observations == summary.statistics.detections == summary.statistics.masks == 12
    assert summary.instances == 2
    assert summary.recorded_s == pytest.approx(11 / 6)
    assert summary.backends == dict.fromkeys(("odometry", "detector", "segmenter", "tracker"), "fake")
    assert "floor at z = 0" in summary.placement.method
    assert {"decode", "detect", "map", "graph", "write"} <= {timing.stage for timing in summary.timings}

    (traversal,) = store.traversals()
    assert (traversal.name, traversal.status, traversal.keyframes) == ("monday", "complete", 6)
    assert traversal.config["used"] == summary.backends
    assert traversal.config["detector"] == "fake"
    assert set(traversal.config["detector_recall"]) <= {"cup", "dining table"}
    assert set(traversal.timings) == {"total", *(timing.stage for timing in summary.timings)}
    instances = {instance.label: instance for instance in store.load_instances()}
    np.testing.assert_allclose(instances["cup"].centroid_map, s.CUP.center, atol=0.1)
    assert [record.stamp_ns for record in store.keyframe_depths()] == [s.ns(i / 3) for i in range(6)]
    edges = {(edge.subject, edge.relation, edge.object) for edge in store.load_spatial_edges()}
    assert (instances["cup"].number, "near", instances["dining table"].number) in edges
    assert store.load_states()[0].gone_ns is None


def test_the_same_recording_gives_the_same_memory(tmp_path: Path) -> None:
    def build_both(path: Path) -> dict[str, list[tuple[object, ...]]]:
        with open_store(str(path), create=True) as store:
            build(store, monday())
            build(store, tuesday(s.TABLE, s.CUP.at(1.4, 0.4)))
        return databases.contents(path, but=("traversal",))

    one, other = build_both(tmp_path / "one.db"), build_both(tmp_path / "other.db")
    assert sum(map(len, one.values())) > 30
    assert one == other


def test_boxes_without_masks_are_segmented(store: MapStore) -> None:
    plugins = f.FakePlugins(detector=lambda recording: f.FakeDetector(recording, without_masks=True))
    summary = build(store, f.FakeRecording(f.film((*s.ROOM, s.CHAIR))), plugins)
    assert summary.statistics.masks == summary.statistics.detections
    assert summary.statistics.labels == {"chair": 1}


def test_further_predicates_are_asked(store: MapStore) -> None:
    alike = SpatialPredicate("alike", lambda pair, slack: 0.7)
    build(store, monday(), f.FakePlugins(predicates=[alike]))
    assert {(edge.subject, edge.relation, edge.object) for edge in store.load_spatial_edges()} >= {
        (1, "alike", 2),
        (2, "alike", 1),
    }


def test_progress_is_told_after_every_keyframe(store: MapStore) -> None:
    told: list[tuple[int, int]] = []
    build(store, monday(), progress=lambda stamp_ns, keyframes: told.append((stamp_ns, keyframes)))
    assert told == [(s.ns(i / 3), i + 1) for i in range(6)]


def test_an_observer_is_told_each_keyframe_once_with_its_own_changes(store: MapStore) -> None:
    log = f.ObserverLog()
    summary = build(store, monday(), f.FakePlugins(observer=log), f.config(keyframes={"batch": 4}))
    assert [context.traversal for context in log.contexts] == ["monday"]
    assert [stamp_ns for stamp_ns, _ in log.mapped_keyframes] == [*(s.ns(i / 3) for i in range(6)), None]
    deltas = [delta for _, delta in log.mapped_keyframes]
    assert [len(delta.keyframes) for delta in deltas] == [1] * 6 + [0]
    assert sum(len(delta.observations) for delta in deltas) == summary.statistics.observations
    assert [len(batch.keyframes) for batch in log.batches] == [4, 2]
    assert sum(len(batch.observations) for batch in log.batches) == summary.statistics.observations
    assert log.perceptions == log.frames == 6
    assert [(ended.complete, ended.objects) for ended in log.summaries] == [(True, 2)]


def test_an_observer_that_fails_is_left_out_with_a_warning(store: MapStore) -> None:
    summary = build(store, monday(), f.FakePlugins(observer=f.ObserverLog(failing=True)))
    assert [warning for warning in summary.warnings if "was left out: ZeroDivisionError" in warning]
    assert summary.instances == 2


def test_the_size_of_a_batch_makes_no_difference_to_the_memory(tmp_path: Path) -> None:
    found = []
    for batch in (1, 10):
        with open_store(str(tmp_path / f"{batch}.db"), create=True) as store:
            build(store, monday(), config=f.config(keyframes={"batch": batch}))
            found.append(
                (
                    [(instance.number, instance.label, instance.observations) for instance in store.load_instances()],
                    [(edge.subject, edge.relation, edge.object, edge.since_ns) for edge in store.load_spatial_edges()],
                    [(state.object_number, state.first_seen_ns, state.last_seen_ns) for state in store.load_states()],
                )
            )
    assert found[0] == found[1]


def test_what_the_odometry_warns_of_is_told_and_stored(store: MapStore) -> None:
    jump = "the recorded pose jumps by 2.00 m"
    summary = build(store, monday(), f.FakePlugins(odometry_warnings=[jump]))
    assert jump in summary.warnings
    assert [traversal.warnings for traversal in store.traversals()] == [(jump,)]


def test_recorded_detections_decide_which_images_are_decoded(store: MapStore) -> None:
    recording = f.FakeRecording(f.film(KITCHEN, 40, rate_hz=10))
    spoken_of = recording.frame_stamps_ns()[1::4]
    plugins = f.FakePlugins(detector=lambda r: f.FakeDetector(r, only_ns=spoken_of))
    summary = build(store, recording, plugins)
    assert summary.statistics.keyframes == 10
    assert [record.stamp_ns for record in store.keyframe_depths()] == spoken_of.tolist()


def test_images_between_keyframes_are_not_decoded(store: MapStore) -> None:
    recording = f.FakeRecording(f.film(KITCHEN, 60, rate_hz=30))
    build(store, recording)
    placing = set(recording.decoded[:30])
    assert len(recording.decoded) == len(placing) + 6


@pytest.mark.parametrize(("width", "kept"), [(0, False), (80, True)])
def test_thumbnails_are_as_wide_as_wanted(tmp_path: Path, width: int, kept: bool) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        build(store, monday(), config=f.config(keyframes={"thumbnail_px": width}))
    images = [row[0] for row in databases.query(tmp_path / "map.db", "SELECT thumbnail_jpeg FROM keyframe")]
    assert [image is not None for image in images] == [kept] * 6
