"""Merging two maps of one place."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.drivers.traversal_build import TraversalBuild
from supermap_cli.errors import AlignmentError, MemoryStoreError
from supermap_cli.geometry.se3 import make_transform, transform_points
from supermap_cli.map_merge.merge import MapMerge, MergeSummary
from supermap_cli.memory import MapStore, open_store
from supermap_cli.memory import map_import as map_import_module
from supermap_cli.memory.checking import check
from supermap_schema.models import Base
from support import databases
from support import fakes as f
from support import memories as m
from support import scenes as s

DAY_S = 86_400.0
STOOL = s.Thing("stool", (2.2, -0.9, 0.25), (0.35, 0.35, 0.5), (40, 160, 60))
BOX = s.Thing("box", (1.5, 1.2, 0.2), (0.4, 0.4, 0.4), (160, 120, 60))
CONFIG = f.config(keyframes={"depth_step": 2})


def film(
    things: Sequence[s.Thing], start_s: float, images: int = 24, room: tuple[s.Thing, ...] = s.ROOM
) -> tuple[s.Scene, ...]:
    """A look at a room from the right to the left."""
    return f.film((*room, *things), images, start_s=start_s, target=(1.8, 0, 0.3))


def build(
    path: Path, name: str, things: Sequence[s.Thing], start_s: float = 0.0, room: tuple[s.Thing, ...] = s.ROOM
) -> Path:
    """A memory with one more traversal."""
    with open_store(str(path), create=True) as store:
        recording = f.FakeRecording(film(things, start_s, room=room), Path(f"{name}.fake"))
        TraversalBuild(recording, f.FakePlugins().load(), CONFIG, store).run(align="none")
    return path


def merge(path: Path, other: Path, align: str = "none", **options: bool) -> MergeSummary:
    with open_store(str(path)) as store, open_store(str(other), read_only=True) as source:
        summary = MapMerge(store, source, again=options.get("again", False)).run(
            align, dry_run=options.get("dry_run", False)
        )
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        assert check(reader) == []
    return summary


def contents(path: Path) -> dict[str, list[tuple[object, ...]]]:
    """All rows of all tables."""
    with closing(databases.connect(path)) as connection:
        return {name: sorted(connection.execute(f"SELECT * FROM {name}"), key=repr) for name in Base.metadata.tables}


def matches_by_id(summary: MergeSummary) -> dict[str, tuple[str, str]]:
    """By the id there: the id here, of what was here before, and how it is known."""
    return {
        summary.other_ids[match.other]: (summary.ids.get(match.number, "new"), match.kind) for match in summary.matches
    }


def states_by_id(store: MapStore) -> dict[str, list[tuple[bool, list[float]]]]:
    """By id: whether each of its states ended, and where it was, to 5 cm."""
    ids = store.instance_ids()
    found: dict[str, list[tuple[bool, list[float]]]] = {}
    for state in store.load_states():
        place = (state.centroid_map / 0.05).round().tolist()
        found.setdefault(ids[state.object_number], []).append((state.gone_ns is not None, place))
    return found


def presences(store: MapStore) -> dict[str, str]:
    ids = store.instance_ids()
    return {ids[record.number]: record.presence for record in store.load_instances()}


def events(path: Path) -> set[tuple[str, str, str]]:
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        return {
            (edge.kind, reader.text_ids[edge.from_number], reader.text_ids[edge.to_number])
            for edge in reader.temporal_edges()
        }


@pytest.fixture
def monday(tmp_path: Path) -> Path:
    return build(tmp_path / "monday.db", "monday", (s.TABLE, s.CUP, STOOL))


# -- identity and change


def test_what_stands_in_its_place_keeps_its_id_and_its_state_goes_on(monday: Path, tmp_path: Path) -> None:
    tuesday = build(tmp_path / "tuesday.db", "tuesday", (s.TABLE, s.CUP, STOOL), DAY_S)
    summary = merge(monday, tuesday)
    assert dict(matches_by_id(summary).values()) == {
        "dining-table-1": "in place",
        "cup-1": "in place",
        "stool-1": "in place",
    }
    with open_store(str(monday), read_only=True) as store:
        assert [traversal.name for traversal in store.traversals()] == ["monday", "tuesday"]
        assert {record.label for record in store.load_instances()} == {"dining table", "cup", "stool"}
        assert all(state.first_seen_ns < s.ns(DAY_S) <= state.last_seen_ns for state in store.load_states())
        assert all(state.gone_ns is None for state in store.load_states())
    with open_store(str(monday), read_only=True) as store, store.reader() as reader:
        for instance in reader.instances:
            assert [visit.supported > 0 for visit in instance.visits] == [True, True]
            assert len(reader.observations(instance)) == instance.observations


def test_a_merge_tells_what_a_build_in_sequence_tells(monday: Path, tmp_path: Path) -> None:
    after = (s.TABLE, STOOL.at(1.2, 0.9), BOX)
    sequence = build(tmp_path / "sequence.db", "monday", (s.TABLE, s.CUP, STOOL))
    build(sequence, "tuesday", after, DAY_S)
    merge(monday, build(tmp_path / "tuesday.db", "tuesday", after, DAY_S))
    with open_store(str(monday), read_only=True) as joined, open_store(str(sequence), read_only=True) as built:
        assert {id_: [gone for gone, _ in states] for id_, states in states_by_id(joined).items()} == {
            id_: [gone for gone, _ in states] for id_, states in states_by_id(built).items()
        }
        for id_, states in states_by_id(joined).items():
            for (_, here), (_, there) in zip(states, states_by_id(built)[id_], strict=True):
                np.testing.assert_allclose(here, there, atol=2)
        assert presences(joined) == presences(built)
    assert events(monday) >= {
        ("disappeared", "cup-1", "cup-1"),
        ("moved", "stool-1", "stool-1"),
        ("appeared", "box-1", "box-1"),
    }
    assert {event for event in events(sequence) if event[0] != "merged"} == events(monday)


def test_bounds_of_changes_lie_between_the_looks_that_tell(monday: Path, tmp_path: Path) -> None:
    merge(monday, build(tmp_path / "tuesday.db", "tuesday", (s.TABLE, STOOL), DAY_S))
    with open_store(str(monday), read_only=True) as store, store.reader() as reader:
        (edge,) = reader.temporal_edges()
        assert edge.kind == "disappeared"
        assert edge.not_before_ns is not None
        assert edge.not_before_ns < s.ns(60) < s.ns(DAY_S) <= edge.not_after_ns
        (cup,) = (instance for instance in reader.instances if instance.label == "cup")
        (visit,) = (stored for stored in cup.visits if stored.supported == 0)
        assert visit.contradicted >= 3
        assert cup.presence == "absent"


def test_what_nobody_looked_at_is_not_gone(monday: Path, tmp_path: Path) -> None:
    """The box hides the stool on tuesday."""
    hiding = s.Thing("box", (1.2, -0.5, 0.6), (0.1, 1.4, 1.2), (90, 60, 30))
    merge(monday, build(tmp_path / "tuesday.db", "tuesday", (s.TABLE, s.CUP, hiding), DAY_S))
    with open_store(str(monday), read_only=True) as store:
        (stool,) = (record for record in store.load_instances() if record.label == "stool")
        assert stool.presence == "present"
    assert not [event for event in events(monday) if event[1] == "stool-1"]


def test_what_had_gone_may_be_back_in_its_place(monday: Path, tmp_path: Path) -> None:
    build(monday, "noon", (s.TABLE, STOOL), 3600.0)
    summary = merge(monday, build(tmp_path / "tuesday.db", "tuesday", (s.TABLE, STOOL, s.CUP), DAY_S))
    assert ("cup-1", "back in place") in matches_by_id(summary).values()
    with open_store(str(monday), read_only=True) as store:
        assert [gone for gone, _ in states_by_id(store)["cup-1"]] == [True, False]
    assert {("disappeared", "cup-1", "cup-1"), ("reappeared", "cup-1", "cup-1")} <= events(monday)


def test_a_place_seen_empty_before_the_thing_was_known_bounds_no_move(tmp_path: Path) -> None:
    """The stool came at noon; it is found where the map saw an empty place in the morning only."""
    hiding = s.Thing("", (0.9, 0.6, 0.7), (0.1, 1.0, 1.4), (90, 60, 30))
    path = build(tmp_path / "monday.db", "morning", (s.TABLE,))
    build(path, "noon", (s.TABLE, STOOL, hiding), 3600.0)
    summary = merge(path, build(tmp_path / "tuesday.db", "tuesday", (s.TABLE, STOOL.at(1.5, 1.0)), DAY_S))
    assert ("stool-1", "moved") in matches_by_id(summary).values()
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        (moved,) = (edge for edge in reader.temporal_edges() if edge.kind == "moved")
        assert moved.not_before_ns is not None
        assert s.ns(3600) < moved.not_before_ns < s.ns(DAY_S) <= moved.not_after_ns


def test_a_thing_pushed_aside_by_less_than_its_width_has_moved(tmp_path: Path) -> None:
    armchair = s.Thing("armchair", (2.0, -0.2, 0.4), (0.7, 0.7, 0.8), (120, 40, 90))
    path = build(tmp_path / "monday.db", "monday", (armchair,))
    summary = merge(path, build(tmp_path / "tuesday.db", "tuesday", (armchair.at(2.0, 0.08),), DAY_S))
    assert matches_by_id(summary) == {"armchair-1": ("armchair-1", "moved")}
    assert summary.matches[0].distance_m == pytest.approx(0.28, abs=0.08)
    assert events(path) == {("moved", "armchair-1", "armchair-1")}


def test_two_alike_that_may_be_one_are_linked_and_stay_two(monday: Path, tmp_path: Path) -> None:
    after = (s.TABLE, s.CUP, STOOL.at(1.2, 0.9), STOOL.at(1.5, 1.4))
    merge(monday, build(tmp_path / "tuesday.db", "tuesday", after, DAY_S))
    kinds = [event for event in events(monday) if event[0] in {"candidate", "moved"}]
    assert {kind[0] for kind in kinds} == {"candidate"}
    assert len(kinds) == 2


def test_relations_that_hold_in_both_go_on_and_those_of_what_left_end(monday: Path, tmp_path: Path) -> None:
    merge(monday, build(tmp_path / "tuesday.db", "tuesday", (s.TABLE, STOOL, BOX), DAY_S))
    with open_store(str(monday), read_only=True) as store:
        ids = store.instance_ids()
        edges = store.load_spatial_edges(open_only=False)
        states = store.load_states()
    cup = [edge for edge in edges if "cup-1" in {ids[edge.subject], ids[edge.object]}]
    assert cup
    assert all(edge.until_ns is not None and edge.until_ns <= s.ns(DAY_S + 60) for edge in cup)
    keys = [(edge.subject, edge.relation, edge.object) for edge in edges if edge.until_ns is None]
    assert len(keys) == len(set(keys))
    first_ns = {state.object_number: state.first_seen_ns for state in reversed(states)}
    assert all(edge.since_ns >= max(first_ns[edge.subject], first_ns[edge.object]) for edge in edges)


# -- frame and time


@pytest.mark.parametrize("yaw_deg", [0.0, 37.0, 180.0])
def test_another_frame_is_turned_into_the_maps(monday: Path, tmp_path: Path, yaw_deg: float) -> None:
    """The other memory has the same things in a frame of its own."""
    yaw = np.radians(yaw_deg)
    T_map_other = make_transform(
        [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]], [1.5, -2.0, 0.0]
    )
    tuesday = tmp_path / "tuesday.db"
    with open_store(str(tuesday), create=True) as store:
        recording = f.FakeRecording(film((s.TABLE, s.CUP, STOOL), DAY_S), Path("tuesday.fake"))
        where = f"{-1.5 * np.cos(yaw) + 2.0 * np.sin(yaw)} {1.5 * np.sin(yaw) + 2.0 * np.cos(yaw)} 0 {-yaw_deg}"
        TraversalBuild(recording, f.FakePlugins().load(), CONFIG, store).run(align=where)
        there = {record.label: record for record in store.load_instances()}
    summary = merge(monday, tuesday, f"1.5 -2 0 {yaw_deg}")
    assert {how for _, how in matches_by_id(summary).values()} == {"in place"}
    with open_store(str(monday), read_only=True) as store:
        for record in store.load_instances():
            moved = transform_points(T_map_other, there[record.label].centroid_map[None])[0]
            np.testing.assert_allclose(record.centroid_map, moved, atol=0.04)
        first, second = (
            [record.T_map_camera for record in store.keyframe_depths([one.id])] for one in store.traversals()
        )
        np.testing.assert_allclose(first, second, atol=5e-3)  # drift is put right
        observed = {record.label: record for record in store.load_instances()}
        assert observed["stool"].box.size[0] == pytest.approx(0.35, abs=0.06)


def test_clocks_that_overlap_keep_the_order_given(monday: Path, tmp_path: Path) -> None:
    tuesday = build(tmp_path / "tuesday.db", "monday", (s.TABLE, s.CUP, STOOL), 1.0)
    summary = merge(monday, tuesday)
    assert [warning for warning in summary.warnings if "the order given is kept" in warning]
    with open_store(str(monday), read_only=True) as store:
        first, second = store.traversals()
        assert (first.name, second.name) == ("monday", "monday-2")
        assert second.clock_shift_ns == summary.time.shift_ns > 0
        assert second.start_ns == s.ns(1) + second.clock_shift_ns > first.end_ns


# -- what may go wrong


def test_the_other_memory_is_not_changed(monday: Path, tmp_path: Path) -> None:
    tuesday = build(tmp_path / "tuesday.db", "tuesday", (s.TABLE, STOOL), DAY_S)
    before = contents(tuesday)
    merge(monday, tuesday)
    assert contents(tuesday) == before


def test_a_dry_run_writes_nothing_and_tells_the_same(monday: Path, tmp_path: Path) -> None:
    tuesday = build(tmp_path / "tuesday.db", "tuesday", (s.TABLE, STOOL.at(1.2, 0.9)), DAY_S)
    before = contents(monday)
    dry = merge(monday, tuesday, dry_run=True)
    assert contents(monday) == before
    wet = merge(monday, tuesday)
    assert dry.matches == wet.matches
    assert contents(monday) != before


@pytest.mark.parametrize("failing", ["_copy_keyframes", "write_delta", "_copy_observations"])
def test_a_merge_that_fails_leaves_the_map_as_it_was(
    monday: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    tuesday = build(tmp_path / "tuesday.db", "tuesday", (s.TABLE, STOOL), DAY_S)
    before = contents(monday)
    done = getattr(map_import_module, failing)

    def fail(*arguments: object) -> None:
        done(*arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(map_import_module, failing, fail)
    with pytest.raises(KeyboardInterrupt):
        merge(monday, tuesday)
    assert contents(monday) == before


def test_the_same_recording_in_both_is_refused_unless_again(monday: Path, tmp_path: Path) -> None:
    other = build(tmp_path / "other.db", "monday", (s.TABLE, s.CUP, STOOL))
    with pytest.raises(MemoryStoreError, match="the same recording is in both maps: 'monday' is 'monday'"):
        merge(monday, other)
    summary = merge(monday, other, again=True)
    assert {how for _, how in matches_by_id(summary).values()} == {"in place"}


def test_a_map_is_not_merged_with_itself(monday: Path) -> None:
    with open_store(str(monday)) as store, pytest.raises(MemoryStoreError, match="with itself"):
        MapMerge(store, store).run()


def test_a_map_whose_build_has_not_ended_is_refused(monday: Path, tmp_path: Path) -> None:
    other = build(tmp_path / "other.db", "tuesday", (s.TABLE,), DAY_S)
    with open_store(str(other)) as store:
        store.begin_traversal(m.start("wednesday", (0, 1)))
    with pytest.raises(MemoryStoreError, match="the build of 'wednesday' has not come to its end"):
        merge(monday, other)


def test_maps_that_fit_nowhere_are_an_error(monday: Path, tmp_path: Path) -> None:
    other = build(tmp_path / "other.db", "tuesday", (s.CUP, s.CUP.at(1.4, 0.4)), DAY_S, room=())
    before = contents(monday)
    with pytest.raises(AlignmentError, match=r"the two maps cannot be laid over one another: .*--align"):
        merge(monday, other, "auto")
    with pytest.raises(AlignmentError, match="not a placement"):
        merge(monday, other, "1 2")
    assert contents(monday) == before


def test_maps_of_one_frame_are_found_to_be(monday: Path, tmp_path: Path) -> None:
    summary = merge(monday, build(tmp_path / "other.db", "tuesday", (s.TABLE, STOOL), DAY_S), "auto")
    np.testing.assert_allclose(summary.placement.T_map_odom, np.eye(4), atol=0.03)
