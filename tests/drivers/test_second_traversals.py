"""A recording built into a map that holds others: what stays, goes, comes and moves, and in what order of time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import DetectorError, MemoryStoreError
from supermap_cli.memory import MapStore, open_store
from supermap_cli.memory.checking import check
from support import fakes as f
from support import scenes as s
from support.fake_builds import DAY_S, KITCHEN, build, monday, tuesday


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
