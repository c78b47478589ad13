"""A whole build: a rendered recording through every stage into a real database."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.config import BuildConfig
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
from supermap_cli.memory.values import TraversalStart
from supermap_cli.traversal_build import BuildSummary, TraversalBuild
from supermap_cli.types.memory import KeyframeRecord, MapDelta
from supermap_cli.types.relations import SpatialPredicate
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
    assert (summary.tally.frames, summary.tally.keyframes, summary.tally.without_pose) == (12, 6, 0)
    assert summary.tally.labels == {"cup": 1, "dining table": 1}
    assert summary.tally.observations == summary.tally.detections == summary.tally.masks == 12
    assert summary.instances == 2
    assert summary.recorded_s == pytest.approx(11 / 6)
    assert summary.backends == dict.fromkeys(("odometry", "detector", "segmenter", "tracker"), "fake")
    assert "floor at z = 0" in summary.placement.method
    assert {"decode", "detect", "map", "graph", "write"} <= {each.stage for each in summary.timings}

    (traversal,) = store.traversals()
    assert (traversal.name, traversal.status, traversal.keyframes) == ("monday", "complete", 6)
    assert traversal.config["used"] == summary.backends
    assert set(traversal.timings) == {"total", *(each.stage for each in summary.timings)}
    instances = {each.label: each for each in store.load_instances()}
    np.testing.assert_allclose(instances["cup"].centroid_map, s.CUP.center, atol=0.1)
    assert [each.stamp_ns for each in store.keyframe_depths()] == [s.ns(i / 3) for i in range(6)]
    edges = {(each.subject, each.relation, each.object) for each in store.load_spatial_edges()}
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
    assert summary.tally.masks == summary.tally.detections
    assert summary.tally.labels == {"chair": 1}


def test_further_predicates_are_asked(store: MapStore) -> None:
    alike = SpatialPredicate("alike", lambda pair, slack: 0.7)
    build(store, monday(), f.FakePlugins(predicates=[alike]))
    assert {(each.subject, each.relation, each.object) for each in store.load_spatial_edges()} >= {
        (1, "alike", 2),
        (2, "alike", 1),
    }


def test_progress_is_told_after_every_keyframe(store: MapStore) -> None:
    told: list[tuple[int, int]] = []
    build(store, monday(), progress=lambda stamp_ns, keyframes: told.append((stamp_ns, keyframes)))
    assert told == [(s.ns(i / 3), i + 1) for i in range(6)]


def test_keyframe_mapped_is_called_once_for_every_keyframe_after_its_batch_was_written(
    store: MapStore, tmp_path: Path
) -> None:
    seen: list[tuple[int, int, int]] = []

    def look_at_the_database(keyframe: KeyframeRecord, changes: MapDelta) -> None:
        ((written,),) = databases.query(tmp_path / "map.db", "SELECT count(*) FROM keyframe")
        seen.append((keyframe.stamp_ns, len(changes.keyframes), written))

    build(store, monday(), f.FakePlugins(on_keyframe=look_at_the_database), f.config(keyframes={"batch": 4}))
    batches, written = [4] * 4 + [2] * 2, [4] * 4 + [6] * 2
    assert seen == [(s.ns(i / 3), batches[i], written[i]) for i in range(6)]


def test_the_size_of_a_batch_makes_no_difference_to_the_memory(tmp_path: Path) -> None:
    found = []
    for batch in (1, 10):
        with open_store(str(tmp_path / f"{batch}.db"), create=True) as store:
            build(store, monday(), config=f.config(keyframes={"batch": batch}))
            found.append(
                (
                    [(each.number, each.label, each.observations) for each in store.load_instances()],
                    [(each.subject, each.relation, each.object, each.since_ns) for each in store.load_spatial_edges()],
                    [(each.object_number, each.first_seen_ns, each.last_seen_ns) for each in store.load_states()],
                )
            )
    assert found[0] == found[1]


# -- a second traversal


def test_a_second_traversal_goes_on_with_the_same_things_and_numbers(store: MapStore) -> None:
    build(store, monday())
    before = {each.label: each.number for each in store.load_instances()}
    summary = build(store, tuesday(s.TABLE, s.CUP, s.BOX.at(1.6, 1.0)), align="auto")
    after = {each.label: each.number for each in store.load_instances()}
    assert after == {**before, "box": 3}
    assert [each.name for each in store.traversals()] == ["monday", "tuesday"]
    assert summary.tally.labels == {"box": 1, "cup": 1, "dining table": 1}
    first = {each.object_number: each.first_seen_ns for each in store.load_open_states()}
    assert first[before["cup"]] == s.ns(0)
    assert first[3] >= s.ns(DAY_S)


def test_what_was_taken_away_in_between_has_gone_with_its_relations(store: MapStore) -> None:
    build(store, monday())
    cup = next(each.number for each in store.load_instances() if each.label == "cup")
    build(store, tuesday(s.TABLE))
    (state,) = store.load_states([cup])
    assert state.last_seen_ns < s.ns(DAY_S) <= (state.gone_ns or 0)
    assert next(each.presence for each in store.load_instances() if each.number == cup) == "absent"
    assert all(cup not in (each.subject, each.object) for each in store.load_spatial_edges())
    ended = [
        each for each in store.load_spatial_edges(open_only=False) if each.relation == "near" and each.subject == cup
    ]
    assert [each.until_ns is not None and each.until_ns >= s.ns(DAY_S) for each in ended] == [True]


def test_a_room_found_empty_is_worth_knowing(store: MapStore) -> None:
    build(store, f.FakeRecording(f.film((*s.ROOM, s.CHAIR))))
    summary = build(store, tuesday())
    assert summary.instances == 0
    assert [each.presence for each in store.load_instances()] == ["absent"]


def test_a_traversal_that_says_nothing_of_what_is_in_the_map_is_none(store: MapStore) -> None:
    build(store, f.FakeRecording(f.film((*s.ROOM, s.CHAIR))))
    elsewhere = f.FakeRecording(f.film(s.ROOM, start_s=DAY_S, target=(1.6, 4, 0.4)), Path("tuesday.fake"))
    with pytest.raises(DetectorError, match="found nothing in 6 images"):
        build(store, elsewhere)
    assert [each.name for each in store.traversals()] == ["monday"]


def test_what_came_in_between_stands_where_the_first_traversal_saw_nothing(store: MapStore) -> None:
    build(store, monday())
    build(store, tuesday(s.TABLE, s.CUP, s.CUP.at(1.4, 0.45)))
    (new,) = (each for each in store.load_open_states() if each.first_seen_ns >= s.ns(DAY_S))
    assert new.empty_before_ns is not None
    assert new.empty_before_ns < s.ns(DAY_S)


def test_the_same_recording_again_finds_everything_unchanged(store: MapStore) -> None:
    first = build(store, monday())
    again = build(store, monday(), again=True)
    assert again.tally.labels == first.tally.labels
    assert [each.name for each in store.traversals()] == ["monday", "monday-2"]
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
        each for each in summary.warnings if "monday's clock starts before tuesday's end: the order given is" in each
    ]
    stamps_ns = [each.stamp_ns - second.clock_shift_ns for each in store.keyframe_depths([second.id])]
    assert stamps_ns == [s.ns(i / 3) for i in range(6)]
    assert {each.label for each in store.load_instances()} == {"dining table", "cup"}


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
                    (each.number, each.label, each.existence_log_odds, each.last_seen_ns - since_ns, each.presence)
                    for each in store.load_instances()
                ),
                *((tuple(each.voxels.log_odds), tuple(each.centroid_map)) for each in store.load_instances()),
                *(
                    (each.object_number, each.index, each.gone_ns and each.gone_ns - since_ns, tuple(each.centroid_map))
                    for each in store.load_states()
                ),
                *((each.subject, each.relation, each.object) for each in store.load_spatial_edges()),
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
    assert [each.name for each in store.traversals()] == ["first", "tuesday"]
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
    assert (summary.tally.keyframes, summary.tally.without_pose) == (5, 5)
    assert any("5 images had no pose" in each for each in summary.warnings)


# -- keyframes


def test_recorded_detections_decide_which_images_are_decoded(store: MapStore) -> None:
    recording = f.FakeRecording(f.film(KITCHEN, 40, rate_hz=10))
    spoken_of = recording.frame_stamps_ns()[1::4]
    plugins = f.FakePlugins(detector=lambda r: f.FakeDetector(r, only_ns=spoken_of))
    summary = build(store, recording, plugins)
    assert summary.tally.keyframes == 10
    assert [each.stamp_ns for each in store.keyframe_depths()] == spoken_of.tolist()


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
    assert 0 < summary.tally.perceived < summary.tally.keyframes == 12
    assert any("came over 0.4 s late" in each for each in summary.warnings)


@pytest.mark.parametrize("perception", [{"rate_hz": 3.0}, {"dropped": 0.3}])
def test_with_fewer_detections_depth_tells_what_has_gone(tmp_path: Path, perception: dict[str, float]) -> None:
    summary = two_days(tmp_path / "map.db", perception)
    assert 0 < summary.tally.perceived < summary.tally.keyframes == 12
    assert summary.tally.labels == {"cup": 1, "dining table": 1}
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
    assert [each.name for each in store.traversals()] == ["tuesday"]


def test_what_a_stopped_build_had_written_is_taken_out_when_asked(store: MapStore) -> None:
    stopped_build(store)
    summary = build(store, monday(), unfinished="restart")
    assert [each.name for each in store.traversals()] == ["monday"]
    assert any("'tuesday' had been stopped" in warning for warning in summary.warnings)
