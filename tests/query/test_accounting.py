"""Nothing is left unsaid: every object of two visits has one row of their diff, and `show` lists or counts them all."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.clock import clock_of
from supermap_cli.query.diff import diff
from supermap_cli.query.overview import overview, overview_at
from supermap_cli.query.presence_at import state_held_at
from supermap_cli.query.time_points import TimePoint, parse_time_point
from supermap_cli.types.existence import probability_of
from supermap_cli.types.memory import MapDelta
from support import memories as m
from support.databases import examples
from support.random_memories import make_random_memory

seeds = st.integers(0, 10_000)
sides = st.sampled_from(["monday", "tuesday", "09:00:20", "09:00:45", "09:01:30", "09:02:00"])


@contextmanager
def random_map(seed: int) -> Iterator[MapReader]:
    with tempfile.TemporaryDirectory() as folder:
        path = make_random_memory(Path(folder) / "map.db", seed)
        with open_store(str(path), read_only=True) as store, store.reader() as reader:
            yield reader


def surviving(reader: MapReader) -> list[StoredInstance]:
    """All instances, also those believed in no more."""
    return list(reader.instances_of(range(1, 20)))


def belongs_to(instance: StoredInstance, side: TimePoint) -> bool:
    """Whether it was seen by a side, or stood there then."""
    seen = side.traversal is not None and instance.visit(side.traversal.id).supported > 0
    return seen or state_held_at(instance.states, side.at_ns) is not None


@settings(max_examples=examples(60), deadline=None)
@given(seeds, st.lists(sides, min_size=2, max_size=2, unique=True))
def test_every_object_of_two_sides_has_exactly_one_row(seed: int, names: list[str]) -> None:
    with random_map(seed) as reader:
        found, clock = diff(reader, *names), clock_of(reader)
        rows = Counter(change.id for change in found.changes)
        points = [parse_time_point(name, reader, clock) for name in names]
        expected = {instance.id for instance in surviving(reader) if any(belongs_to(instance, side) for side in points)}
    assert expected <= rows.keys()
    assert set(rows.values()) <= {1}
    assert sum(found.counts.values()) == len(found.changes)


@settings(max_examples=examples(40), deadline=None)
@given(seeds)
def test_what_was_merged_between_two_sides_is_named_in_one_row(seed: int) -> None:
    with random_map(seed) as reader:
        found, clock = diff(reader, "monday", "tuesday"), clock_of(reader)
        before, after = (parse_time_point(name, reader, clock) for name in ("monday", "tuesday"))
        rows = {change.id for change in found.changes}
        merged = [
            (reader.text_ids[edge.from_number], reader.text_ids[reader.survivors[edge.to_number]])
            for edge in reader.temporal_edges()
            if edge.kind == "merged" and edge.not_after_ns > before.at_ns and (edge.not_before_ns or 0) <= after.at_ns
        ]
    for part, whole in merged:
        named = [change.id for change in found.changes if f"{part}, held apart until" in change.reason]
        assert named == ([whole] if whole in rows else [])


@settings(max_examples=examples(40), deadline=None)
@given(seeds, st.integers(0, 4))
def test_show_lists_or_counts_every_object(seed: int, limit: int) -> None:
    with random_map(seed) as reader:
        whole = len(surviving(reader))
        today = overview(reader, limit)
        then = overview_at(reader, parse_time_point("monday", reader, clock_of(reader)), clock_of(reader), limit)
    for shown in (today, then):
        listed = len(shown.instances) + len(shown.unknown or ()) + len(shown.doubted)
        assert listed + shown.more + shown.more_unknown + shown.more_doubted + shown.absent == whole


def one_chair(path: Path, **visits: tuple[int, int, int]) -> Path:
    """A chair that is doubted today, with (supported, in view, contradicted) of the traversals a and b."""
    chair = m.instance(1, "chair", seen=(1, 9), presence="doubted", observations=0)
    deltas = [MapDelta(visits=(m.visit(1, *visits[name]),)) for name in ("a", "b")]
    first = MapDelta(instances=(chair,), states=(m.state(1, 0, (1, 9)),), visits=deltas[0].visits)
    return m.make_memory(path, ("a", (0, 10), first), ("b", (100, 110), deltas[1]))


def test_a_doubted_object_says_what_speaks_for_and_against_it(tmp_path: Path) -> None:
    path = one_chair(tmp_path / "map.db", a=(5, 9, 0), b=(0, 20, 0))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        (change,) = diff(reader).changes
    assert change.kind == "doubted"
    assert change.confidence == pytest.approx(probability_of(-3), abs=1e-4)
    assert "found in 5 of the 29 keyframes" in change.reason
    assert "never seen empty" in change.reason
    assert "not found in 24" in change.reason


def test_what_neither_visit_looked_at_is_told_apart_from_what_is_unchanged(tmp_path: Path) -> None:
    delta = MapDelta(instances=(m.instance(1, "chair", seen=(1, 9), observations=0),), states=(m.state(1, 0, (1, 9)),))
    nothing = MapDelta()
    path = m.make_memory(
        tmp_path / "map.db", ("a", (0, 10), delta), ("b", (100, 110), nothing), ("c", (200, 210), nothing)
    )
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        (change,) = diff(reader, "b", "c").changes
    assert (change.kind, change.reason) == ("not looked at", "known from other visits; in view of neither")


def test_a_large_map_says_how_many_more_neither_visit_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("supermap_cli.query.diff.MAX_NOT_LOOKED_AT", 2)
    chairs = range(1, 6)
    delta = MapDelta(
        instances=tuple(m.instance(number, "chair", seen=(1, 9), observations=0) for number in chairs),
        states=tuple(m.state(number, 0, (1, 9)) for number in chairs),
    )
    path = m.make_memory(
        tmp_path / "map.db", ("a", (0, 10), delta), ("b", (100, 110), MapDelta()), ("c", (200, 210), MapDelta())
    )
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        found = diff(reader, "b", "c")
    assert [change.id for change in found.changes] == ["chair-4", "chair-5"]
    assert found.notes == ("3 more stood there before where neither looked; `supermap show --at` lists them",)


def test_people_are_named_but_not_compared(tmp_path: Path) -> None:
    person = m.instance(1, "person", seen=(1, 9), observations=0)
    delta = MapDelta(instances=(person,), states=(m.state(1, 0, (1, 9), label="person"),), visits=(m.visit(1, 3, 3),))
    path = m.make_memory(tmp_path / "map.db", ("a", (0, 10), delta), ("b", (100, 110), MapDelta()))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        found = diff(reader)
    assert found.changes == ()
    assert found.notes == ("people and animals come and go, and are not compared: person-1",)
