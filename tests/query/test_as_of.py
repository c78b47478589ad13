"""Questions, lists and details as of a time or a traversal."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from supermap_cli.errors import QueryError
from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.answers import answer
from supermap_cli.query.clock import clock_of
from supermap_cli.query.details import ObjectDetails, details_at
from supermap_cli.query.overview import Overview, overview_at
from supermap_cli.query.time_points import parse_time_point
from supermap_cli.types.memory import MapDelta
from support import kitchen
from support import memories as m


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MapReader]:
    path = kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        yield reader


def all_at(reader: MapReader, at: str) -> Overview:
    clock = clock_of(reader)
    return overview_at(reader, parse_time_point(at, reader, clock), clock)


def one_at(reader: MapReader, text_id: str, at: str) -> ObjectDetails:
    clock = clock_of(reader)
    return details_at(reader, text_id, parse_time_point(at, reader, clock), clock)


@pytest.mark.parametrize(
    ("written", "at_s"),
    [
        ("monday", 100),
        ("in monday", 100),
        ("TUESDAY", 1100),
        ("1", 100),
        ("first", 100),
        ("last", 1100),
        ("09:01", 60),
        ("at 9:01", 60),
        ("2026-01-05T09:01:30Z", 90),
        ("2026-01-05 09:01:30Z", 90),
        ("12 s", 12),
        ("12.5s", 12.5),
        ("earlier", 1000),
        ("now", 1090),
    ],
)
def test_a_time_or_a_traversal_is_understood(reader: MapReader, written: str, at_s: float) -> None:
    assert parse_time_point(written, reader, clock_of(reader)).at_ns == m.ns(at_s)


@pytest.mark.parametrize("written", ["sunday", "9", "25:00", "", "12 minutes"])
def test_what_is_neither_is_an_error(reader: MapReader, written: str) -> None:
    with pytest.raises(QueryError):
        parse_time_point(written, reader, clock_of(reader))


def test_presence_is_unknown_between_the_last_support_and_the_contradiction(reader: MapReader) -> None:
    shown = all_at(reader, "09:10")
    unknown = {instance.id: instance.standing.words for instance in shown.unknown or () if instance.standing}
    assert {instance.id for instance in shown.instances} == {
        "dining-table-1",
        "chair-2",
        "tv-1",
        "potted-plant-1",
        "book-1",
    }
    assert unknown["cup-1"].startswith("left between 2026-01-05T09:01:30.0Z and 2026-01-05T09:16:45.0Z")
    assert unknown["chair-1"].startswith("left between")
    assert unknown["vase-1"].startswith("came between")
    assert unknown["lamp-1"] == "first seen 2026-01-05T09:16:41.0Z; nobody had seen its place empty before"
    assert shown.absent == 0


def test_the_end_of_a_traversal_shows_the_states_of_that_time(reader: MapReader) -> None:
    (chair,) = [instance for instance in all_at(reader, "60 s").instances if instance.id == "chair-1"]
    assert (chair.position, chair.presence) == ((0.0, 1.0, 0.5), "present")
    assert chair.evidence.observation_count == 2
    shown = all_at(reader, "tuesday")
    (chair,) = [instance for instance in shown.instances if instance.id == "chair-1"]
    assert chair.position == (-3.0, 3.0, 0.5)
    assert shown.absent == 1
    assert [traversal.name for traversal in all_at(reader, "monday").traversals] == ["monday"]


def test_before_the_first_observation_nothing_is_present_or_gone(reader: MapReader) -> None:
    shown = all_at(reader, "2026-01-04T12:00:00Z")
    assert shown.instances == ()
    assert {instance.id for instance in shown.unknown or ()} >= {"cup-1", "lamp-1", "chair-1"}
    assert shown.absent == 1  # the vase's place was seen empty on monday
    assert answer("cup", reader, "2026-01-04T12:00:00Z").notes[0] == "the map begins at 2026-01-05T09:00:00.0Z"


def test_after_the_end_the_last_state_holds(reader: MapReader) -> None:
    assert {instance.id for instance in all_at(reader, "2026-01-09T12:00:00Z").instances} == {
        instance.id for instance in all_at(reader, "now").instances
    }
    assert "what came after, nobody saw" in answer("chairs", reader, "2026-01-09T12:00:00Z").notes[0]


def test_details_have_the_relations_of_that_time(reader: MapReader) -> None:
    then, later = one_at(reader, "chair-1", "60 s"), one_at(reader, "chair-1", "now")
    assert {relation.stored_as for relation in then.relations} == {
        "near(chair-1, potted-plant-1)",
        "beside(chair-1, dining-table-1)",
    }
    assert later.relations == ()
    assert (then.last_seen_ns, later.last_seen_ns) == (m.ns(40), m.ns(1090))
    assert len(then.intervals) == 1


def test_within_a_gap_the_last_known_place_is_shown(reader: MapReader) -> None:
    shown = one_at(reader, "cup-1", "09:10")
    assert (shown.presence, shown.position) == ("unknown", (0.5, 0.0, 0.8))
    assert shown.standing is not None
    assert (shown.standing.not_before_ns, shown.standing.not_after_ns) == (m.ns(90), m.ns(1005))


@pytest.mark.parametrize(
    ("question", "at", "ids", "count", "most"),
    [
        ("how many cups", "60 s", ["cup-1"], 1, None),
        ("how many cups", "09:10", ["cup-1"], 0, 1),
        ("how many cups", "tuesday", [], 0, None),
        ("how many lamps", "monday", [], 0, 1),
        ("how many chairs", "monday", ["chair-1", "chair-2"], 2, None),
        ("how many chairs", "100 s", ["chair-1", "chair-2"], 1, 2),
        ("where was the cup", "60 s", ["cup-1"], None, None),
        ("cup on the table", "60 s", ["cup-1"], None, None),
        ("what is on the table", "tuesday", ["vase-1"], None, None),
    ],
)
def test_a_question_is_asked_as_of_a_time(
    reader: MapReader, question: str, at: str, ids: list[str], count: int | None, most: int | None
) -> None:
    found = answer(question, reader, at)
    assert [instance.id for instance in found.instances] == ids
    assert (found.count, found.count_at_most) == (count, most)


def test_a_question_with_a_time_of_its_own_is_not_asked_as_of_another(reader: MapReader) -> None:
    with pytest.raises(QueryError, match="time of its own"):
        answer("cup earlier", reader, "monday")


def test_a_merged_id_resolves_to_the_merged_instance_at_an_earlier_time(tmp_path: Path) -> None:
    whole, part = m.instance(1, "cup", seen=(1, 9)), m.instance(2, "cup", seen=(4, 5), merged_into=1)
    delta = MapDelta(
        keyframes=m.keyframes([1, 9]),
        instances=(whole, part),
        states=(m.state(1, 0, (1, 9), label="cup"), m.state(2, 0, (4, 5), label="cup")),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        shown = one_at(reader, "cup-2", "4.5 s")
        assert (shown.id, shown.asked_id, shown.presence) == ("cup-1", "cup-2", "present")
        assert [instance.id for instance in all_at(reader, "4.5 s").instances] == ["cup-1"]


def test_what_a_traversal_saw_is_present_at_its_end(reader: MapReader) -> None:
    """The cup was seen last 10 s before monday's end, and found gone on tuesday."""
    shown = one_at(reader, "cup-1", "monday")
    assert shown.presence == "present"
    assert shown.standing is not None
    assert shown.standing.words == (
        "last seen 2026-01-05T09:01:30.0Z, left between 2026-01-05T09:01:30.0Z and 2026-01-05T09:16:45.0Z"
    )
    assert one_at(reader, "cup-1", "100 s").presence == "unknown"
    assert answer("cup", reader, "monday").notes == ()
