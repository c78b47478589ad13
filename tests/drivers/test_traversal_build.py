"""A whole build: a rendered recording through every stage into a real database."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.build_summary import BuildSummary
from supermap_cli.drivers.traversal_build import TraversalBuild
from supermap_cli.errors import (
    ConfigError,
    DetectorError,
    MemoryStoreError,
    OdometryError,
    RecordingError,
    SupermapError,
)
from supermap_cli.memory import MapStore, open_store
from supermap_cli.memory.checking import check
from supermap_cli.memory.values import Checkpoint, TraversalStart
from supermap_cli.types.detections import Detections
from supermap_cli.types.memory import MapDelta
from supermap_cli.types.relations import SpatialPredicate
from supermap_cli.types.sensing import CameraFrame
from support import databases
from support import fakes as f
from support import scenes as s

DAY_S = 86_400.0
KITCHEN = (*s.ROOM, s.TABLE, s.CUP)


def build(
    store: MapStore,
    recording: f.FakeRecording,
    plugins: f.FakePlugins | None = None,
    config: BuildConfig | None = None,
    **options: object,
) -> BuildSummary:
    """Build one traversal; where odom stands in the map is known, unless told otherwise."""
    loaded = (plugins or f.FakePlugins()).load()
    return TraversalBuild(recording, loaded, config or f.config(), store).run(**{"align": "none", **options})  # type: ignore[arg-type]


@pytest.fixture
def store(tmp_path: Path) -> Iterator[MapStore]:
    with open_store(str(tmp_path / "map.db"), create=True) as opened:
        yield opened


def monday() -> f.FakeRecording:
    return f.FakeRecording(f.film(KITCHEN))


def tuesday(*things: s.Thing) -> f.FakeRecording:
    return f.FakeRecording(f.film((*s.ROOM, *things), start_s=DAY_S), Path("tuesday.fake"))


# -- from end to end


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


# -- several cameras


def two_cameras(images: int = 12) -> f.FakeRecording:
    return f.FakeRecording(f.film(KITCHEN, images), cameras=("front", "left"))


def test_every_camera_is_mapped_at_its_rate_and_in_the_order_of_stamps(store: MapStore) -> None:
    summary = build(store, two_cameras())
    stored = [(record.stamp_ns, record.camera_id) for record in store.keyframe_depths()]
    assert stored == [(s.ns(i / 3), camera_id) for i in range(6) for camera_id in ("front", "left")]
    assert summary.statistics.keyframes == summary.statistics.perceived == 12
    assert summary.statistics.labels == {"cup": 1, "dining table": 1}
    with store.reader() as reader:
        assert check(reader) == []


def test_the_rate_of_all_cameras_together_is_bounded(store: MapStore) -> None:
    summary = build(store, two_cameras(), config=f.config(keyframes={"rate_hz": 6, "total_rate_hz": 6}))
    assert summary.statistics.keyframes == 12


class FailingDetector(f.FakeDetector):
    """Fails at its n-th image."""

    left = 15

    def detect(self, frame: CameraFrame) -> Detections | None:
        FailingDetector.left -= 1
        if FailingDetector.left == 0:
            raise DetectorError("no power", cure="plug it in")
        return super().detect(frame)


@pytest.mark.parametrize("images_before", [5, 8, 15])
def test_a_build_of_several_cameras_goes_on_between_images_of_one_moment(tmp_path: Path, images_before: int) -> None:
    """Whatever a batch ends with, the memory is that of an undisturbed build."""
    config = f.config(keyframes={"batch": 3, "checkpoint_s": 0, "rate_hz": 6})
    undisturbed, stopped = tmp_path / "undisturbed.db", tmp_path / "stopped.db"
    with open_store(str(undisturbed), create=True) as store:
        build(store, two_cameras(), f.FakePlugins(tracker=f.ResumableTracker), config)
    FailingDetector.left = images_before
    failing = f.FakePlugins(tracker=f.ResumableTracker, detector=FailingDetector)
    with open_store(str(stopped), create=True) as store:
        with pytest.raises(DetectorError):
            build(store, two_cameras(), failing, config)
        before = [record.stamp_ns for record in store.keyframe_depths()]
        log = f.ObserverLog()
        sound = f.FakePlugins(tracker=f.ResumableTracker, observer=log)
        build(store, two_cameras(), sound, config, unfinished="resume")
    assert databases.contents(stopped, but=("traversal",)) == databases.contents(undisturbed, but=("traversal",))
    told = [stamp_ns for stamp_ns, _ in log.mapped_keyframes if stamp_ns is not None]
    assert len(before) + len(told) == 24


def test_a_build_killed_before_its_last_changes_ends_like_an_undisturbed_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who moves by itself is nowhere when the traversal has ended, also if only that was left to be written."""
    config = f.config(keyframes={"batch": 1, "checkpoint_s": 0})
    recording = f.FakeRecording(f.film((*KITCHEN, s.PERSON)))
    plugins = f.FakePlugins(tracker=f.ResumableTracker)
    with open_store(str(tmp_path / "undisturbed.db"), create=True) as store:
        build(store, recording, plugins, config)
    commit = MapStore.commit

    def power_cut(store: MapStore, traversal_id: int, delta: MapDelta, checkpoint: Checkpoint | None = None) -> None:
        if not delta.keyframes:
            raise KeyboardInterrupt
        commit(store, traversal_id, delta, checkpoint)

    with open_store(str(tmp_path / "stopped.db"), create=True) as store:
        monkeypatch.setattr(MapStore, "commit", power_cut)
        with pytest.raises(KeyboardInterrupt):
            build(store, recording, plugins, config)
        monkeypatch.setattr(MapStore, "commit", commit)
        log = f.ObserverLog()
        build(store, recording, f.FakePlugins(tracker=f.ResumableTracker, observer=log), config, unfinished="resume")
    contents = [databases.contents(tmp_path / name, but=("traversal",)) for name in ("stopped.db", "undisturbed.db")]
    assert contents[0] == contents[1]
    assert [stamp_ns for stamp_ns, _ in log.mapped_keyframes] == [None]


# -- a second traversal


def test_a_second_traversal_goes_on_with_the_same_things_and_numbers(store: MapStore) -> None:
    build(store, monday())
    before = {instance.label: instance.number for instance in store.load_instances()}
    summary = build(store, tuesday(s.TABLE, s.CUP, s.BOX.at(1.6, 1.0)), align="auto")
    after = {instance.label: instance.number for instance in store.load_instances()}
    assert after == {**before, "box": 3}
    assert [traversal.name for traversal in store.traversals()] == ["monday", "tuesday"]
    assert summary.statistics.labels == {"box": 1, "cup": 1, "dining table": 1}
    first = {state.object_number: state.first_seen_ns for state in store.load_open_states()}
    assert first[before["cup"]] == s.ns(0)
    assert first[3] >= s.ns(DAY_S)


def test_what_was_taken_away_in_between_has_gone_with_its_relations(store: MapStore) -> None:
    build(store, monday())
    cup = next(instance.number for instance in store.load_instances() if instance.label == "cup")
    build(store, tuesday(s.TABLE))
    (state,) = store.load_states([cup])
    assert state.last_seen_ns < s.ns(DAY_S) <= (state.gone_ns or 0)
    assert next(instance.presence for instance in store.load_instances() if instance.number == cup) == "absent"
    assert all(cup not in (edge.subject, edge.object) for edge in store.load_spatial_edges())
    ended = [
        edge for edge in store.load_spatial_edges(open_only=False) if edge.relation == "near" and edge.subject == cup
    ]
    assert [edge.until_ns is not None and edge.until_ns >= s.ns(DAY_S) for edge in ended] == [True]


def test_a_room_found_empty_is_worth_knowing(store: MapStore) -> None:
    build(store, f.FakeRecording(f.film((*s.ROOM, s.CHAIR))))
    summary = build(store, tuesday())
    assert summary.instances == 0
    assert [instance.presence for instance in store.load_instances()] == ["absent"]


def test_a_traversal_that_says_nothing_of_what_is_in_the_map_is_none(store: MapStore) -> None:
    build(store, f.FakeRecording(f.film((*s.ROOM, s.CHAIR))))
    elsewhere = f.FakeRecording(f.film(s.ROOM, start_s=DAY_S, target=(1.6, 4, 0.4)), Path("tuesday.fake"))
    with pytest.raises(DetectorError, match="found nothing in 6 images"):
        build(store, elsewhere)
    assert [traversal.name for traversal in store.traversals()] == ["monday"]


def test_what_came_in_between_stands_where_the_first_traversal_saw_nothing(store: MapStore) -> None:
    build(store, monday())
    build(store, tuesday(s.TABLE, s.CUP, s.CUP.at(1.4, 0.45)))
    (new,) = (state for state in store.load_open_states() if state.first_seen_ns >= s.ns(DAY_S))
    assert new.empty_before_ns is not None
    assert new.empty_before_ns < s.ns(DAY_S)


def test_the_same_recording_again_finds_everything_unchanged(store: MapStore) -> None:
    first = build(store, monday())
    again = build(store, monday(), again=True)
    assert again.statistics.labels == first.statistics.labels
    assert [traversal.name for traversal in store.traversals()] == ["monday", "monday-2"]
    assert again.clock_shift_ns > 0
    with store.reader() as reader:
        assert {edge.kind for edge in reader.temporal_edges()} <= {"persisted"}
        assert check(reader) == []


def test_the_same_recording_twice_is_refused(store: MapStore) -> None:
    build(store, monday())
    with pytest.raises(MemoryStoreError, match="already"):
        build(store, monday())
    assert len(store.traversals()) == 1


def test_a_recording_from_before_what_is_in_the_map_follows_in_the_order_given(store: MapStore) -> None:
    build(store, tuesday(s.TABLE))
    summary = build(store, monday())
    first, second = store.traversals()
    assert summary.clock_shift_ns == second.clock_shift_ns > DAY_S * 1e9
    assert first.clock_shift_ns == 0
    assert second.start_ns == monday().start_ns + second.clock_shift_ns > first.end_ns
    assert second.end_ns == monday().end_ns + second.clock_shift_ns
    assert [
        warning
        for warning in summary.warnings
        if "monday's clock starts before tuesday's end: the order given is" in warning
    ]
    stamps_ns = [record.stamp_ns - second.clock_shift_ns for record in store.keyframe_depths([second.id])]
    assert stamps_ns == [s.ns(i / 3) for i in range(6)]
    assert {instance.label for instance in store.load_instances()} == {"dining table", "cup"}


def test_the_map_does_not_depend_on_how_a_clock_is_shifted(tmp_path: Path) -> None:
    """After a night, after a recording that is older, and after one that is newer: the same but for the times."""

    def second_after(start_s: float, path: Path) -> list[tuple[object, ...]]:
        first = f.FakeRecording(f.film((*s.ROOM, s.TABLE, s.CUP.at(1.8, -0.4)), start_s=start_s), Path("first.fake"))
        with open_store(str(path), create=True) as store:
            build(store, first)
            summary = build(store, monday(), config=f.config(perception={"delay_s": 0.4, "dropped": 0.3}))
            since_ns = store.traversals()[1].start_ns
            assert (summary.clock_shift_ns > 0) is (start_s > -60)
            assert len(store.load_states()) == 3
            return [
                *(
                    (
                        instance.number,
                        instance.label,
                        instance.existence_log_odds,
                        instance.last_seen_ns - since_ns,
                        instance.presence,
                    )
                    for instance in store.load_instances()
                ),
                *(
                    (tuple(instance.voxels.log_odds), tuple(instance.centroid_map))
                    for instance in store.load_instances()
                ),
                *(
                    (
                        state.object_number,
                        state.index,
                        state.gone_ns and state.gone_ns - since_ns,
                        tuple(state.centroid_map),
                    )
                    for state in store.load_states()
                ),
                *((edge.subject, edge.relation, edge.object) for edge in store.load_spatial_edges()),
            ]

    night = second_after(-DAY_S, tmp_path / "night.db")
    assert second_after(0, tmp_path / "same.db") == night
    assert second_after(1000 * DAY_S, tmp_path / "later.db") == night


def test_a_recording_built_in_parts_keeps_its_times(store: MapStore) -> None:
    build(store, f.FakeRecording(f.film(KITCHEN)[:6]), name="one")
    summary = build(store, f.FakeRecording(f.film(KITCHEN)[6:], Path("two.fake")))
    assert summary.clock_shift_ns == 0
    assert not summary.warnings


def test_a_name_may_be_given_and_a_place(store: MapStore) -> None:
    build(store, monday(), name="first")
    summary = build(store, tuesday(s.TABLE), align="5 0 0 90")
    assert [traversal.name for traversal in store.traversals()] == ["first", "tuesday"]
    assert summary.placement.method.startswith("given")
    np.testing.assert_allclose(summary.placement.T_map_odom[:3, 3], [5, 0, 0], atol=0.05)


# -- what goes wrong leaves nothing behind


def without_poses(recording: f.FakeRecording) -> Iterator[object]:
    return iter(())


def lost_odometry(recording: f.FakeRecording) -> Iterator[object]:
    yield next(recording.poses())
    raise OdometryError("the odometry is lost")


class BrokenDetectorError(Exception):
    """A bug in a plugin."""


class BrokenDetector(f.FakeDetector):
    def detect(self, frame: object) -> None:
        if len(self.recording.decoded) > 30 + 4:
            raise BrokenDetectorError


FAILURES = [
    pytest.param(monday, {"poses": without_poses}, OdometryError, id="no poses"),
    pytest.param(monday, {"poses": lost_odometry}, OdometryError, id="lost odometry"),
    pytest.param(lambda: f.FakeRecording(()), {}, RecordingError, id="no images"),
    pytest.param(
        monday, {"detector": lambda recording: f.FakeDetector(recording, blind=True)}, DetectorError, id="no detections"
    ),
    pytest.param(
        lambda: f.FakeRecording(f.film(KITCHEN, 2)), {}, RecordingError, id="too few images to confirm anything"
    ),
    pytest.param(
        lambda: f.FakeRecording(f.film((s.CHAIR.at(9, 0),))),
        {},
        SupermapError,
        id="everything out of range",
    ),
]


@pytest.mark.parametrize(("recording", "given", "error"), FAILURES)
def test_a_build_that_comes_to_nothing_says_why_and_leaves_no_database(
    tmp_path: Path, recording: object, given: dict[str, object], error: type[SupermapError]
) -> None:
    path = tmp_path / "map.db"
    with open_store(str(path), create=True) as store, pytest.raises(error) as raised:
        build(store, recording(), f.FakePlugins(**given))  # type: ignore[operator, arg-type]
    assert raised.value.cure or "lost" in str(raised.value)
    assert "\n" not in str(raised.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("recording", "given", "error"), FAILURES)
def test_a_build_that_comes_to_nothing_leaves_an_existing_database_as_it_was(
    tmp_path: Path, recording: object, given: dict[str, object], error: type[SupermapError]
) -> None:
    path = tmp_path / "map.db"
    with open_store(str(path), create=True) as store:
        build(
            store,
            f.FakeRecording(
                f.film((*s.ROOM, s.BOX.at(-1.6, 0)), start_s=-DAY_S, target=(-1.6, 0, 0.4)), Path("sunday.fake")
            ),
        )
    before = databases.contents(path)
    with open_store(str(path)) as store, pytest.raises(error):
        build(store, recording(), f.FakePlugins(**given))  # type: ignore[operator, arg-type]
    assert databases.contents(path) == before


def test_a_bug_in_a_plugin_shows_itself_and_leaves_nothing(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store, pytest.raises(BrokenDetectorError):
        build(
            store,
            f.FakeRecording(f.film(KITCHEN, 60, rate_hz=10)),
            f.FakePlugins(detector=BrokenDetector),
            f.config(keyframes={"batch": 2, "rate_hz": 10}),
        )
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_option_is_found_before_anything_is_read(store: MapStore, tmp_path: Path) -> None:
    recording = monday()
    with pytest.raises(ConfigError, match="score"):
        build(store, recording, config=f.config(backends={"options": {"fake": {"speed": 1}}}))
    with pytest.raises(ConfigError, match="nobody"):
        build(store, recording, config=f.config(backends={"options": {"nobody": {"speed": 1}}}))
    assert recording.decoded == []


def test_images_without_a_pose_are_left_out_with_a_warning(store: MapStore) -> None:
    def half_of_them(recording: f.FakeRecording) -> Iterator[object]:
        poses = list(recording.poses())
        return iter(poses[: len(poses) // 2])

    summary = build(store, f.FakeRecording(f.film(KITCHEN, 20)), f.FakePlugins(poses=half_of_them))  # type: ignore[arg-type]
    assert (summary.statistics.keyframes, summary.statistics.without_pose) == (5, 5)
    assert any("5 images had no pose" in warning for warning in summary.warnings)


# -- keyframes


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


# -- late, rare and dropped perception


def two_days(path: Path, perception: dict[str, float]) -> BuildSummary:
    """A cup that moves between two visits, built with a detector that takes its time."""
    config = f.config(keyframes={"rate_hz": 6, "batch": 3}, perception=perception)
    with open_store(str(path), create=True) as store:
        build(store, monday(), config=config)
        return build(store, tuesday(s.TABLE, s.CUP.at(1.4, 0.4)), config=config)


@pytest.mark.parametrize("delay_s", [0.3, 2.0])
def test_the_map_does_not_depend_on_how_late_detections_come(tmp_path: Path, delay_s: float) -> None:
    at_once, late = tmp_path / "at_once.db", tmp_path / "late.db"
    two_days(at_once, {})
    summary = two_days(late, {"delay_s": delay_s})
    assert summary.warnings == ()
    assert databases.contents(late, but=("traversal",)) == databases.contents(at_once, but=("traversal",))


def test_detections_that_come_too_late_are_left_out_with_a_warning(tmp_path: Path) -> None:
    summary = two_days(tmp_path / "map.db", {"delay_s": 0.7, "wait_s": 0.4})
    assert 0 < summary.statistics.perceived < summary.statistics.keyframes == 12
    assert any("detections that came over 0.4 s late" in warning for warning in summary.warnings)


@pytest.mark.parametrize("perception", [{"rate_hz": 3.0}, {"dropped": 0.3}])
def test_with_fewer_detections_depth_tells_what_has_gone(tmp_path: Path, perception: dict[str, float]) -> None:
    summary = two_days(tmp_path / "map.db", perception)
    assert 0 < summary.statistics.perceived < summary.statistics.keyframes == 12
    assert summary.statistics.labels == {"cup": 1, "dining table": 1}
    moves = databases.query(tmp_path / "map.db", "SELECT 1 FROM temporal_edge WHERE kind = 'moved'")
    assert moves == [(1,)]


def test_a_detector_that_never_answers_leaves_nothing_and_says_so(store: MapStore) -> None:
    with pytest.raises(RecordingError, match="no object confirmed"):
        build(store, monday(), config=f.config(perception={"dropped": 1.0}))


@pytest.mark.parametrize(("width", "kept"), [(0, False), (80, True)])
def test_thumbnails_are_as_wide_as_wanted(tmp_path: Path, width: int, kept: bool) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        build(store, monday(), config=f.config(keyframes={"thumbnail_px": width}))
    images = [row[0] for row in databases.query(tmp_path / "map.db", "SELECT thumbnail_jpeg FROM keyframe")]
    assert [image is not None for image in images] == [kept] * 6


def stopped_build(store: MapStore) -> None:
    """What a build leaves that was killed before its first batch."""
    store.begin_traversal(
        TraversalStart("tuesday.fake", "killed", s.ns(DAY_S), s.ns(DAY_S + 2), np.eye(4), name="tuesday")
    )


@pytest.mark.parametrize("unfinished", ["refuse", "resume"])
def test_a_stopped_build_of_another_recording_is_in_the_way(store: MapStore, unfinished: str) -> None:
    stopped_build(store)
    with pytest.raises(MemoryStoreError, match=r"'tuesday' was stopped at 0 %.*tuesday.fake --resume.*--restart"):
        build(store, monday(), unfinished=unfinished)
    assert [traversal.name for traversal in store.traversals()] == ["tuesday"]


def test_what_a_stopped_build_had_written_is_taken_out_when_asked(store: MapStore) -> None:
    stopped_build(store)
    summary = build(store, monday(), unfinished="restart")
    assert [traversal.name for traversal in store.traversals()] == ["monday"]
    assert any("'tuesday' had been stopped" in warning for warning in summary.warnings)
