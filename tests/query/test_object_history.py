"""The history of an instance, as values and as text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.clock import clock_of
from supermap_cli.query.history_text import MAX_SENTENCES, history_sentences, shorten_lines
from supermap_cli.query.object_history import MAX_RELATIONS, ObjectHistory, object_history
from supermap_cli.query.time_points import parse_time_point
from supermap_cli.types.memory import MapDelta
from support import kitchen
from support import memories as m


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MapReader]:
    path = kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        yield reader


def history_and_text(reader: MapReader, text_id: str, at: str | None = None) -> tuple[ObjectHistory, list[str]]:
    clock = clock_of(reader)
    history = object_history(reader, text_id, None if at is None else parse_time_point(at, reader, clock), clock)
    return history, history_sentences(history, clock)


def test_the_history_gives_places_times_and_relations(reader: MapReader) -> None:
    history, sentences = history_and_text(reader, "chair-1")
    where = "(0.00, 1.00, 0.50), beside dining-table-1 and near potted-plant-1"
    assert sentences == [
        f"first seen 09:00:01.0Z at {where}; nobody had seen its place empty before",
        "moved 3.61 m between 2026-01-05T09:01:30.0Z and 2026-01-05T09:16:41.0Z: stands at (-3.00, 3.00, 0.50)",
        "last seen 09:18:10.0Z; stands there as far as anybody knows",
    ]
    near, none = history.surroundings
    assert [(relation.name, relation.object) for relation in near.relations] == [
        ("beside", "dining-table-1"),
        ("near", "potted-plant-1"),
    ]
    assert none.relations == ()


def test_arrivals_and_departures_have_bounds(reader: MapReader) -> None:
    _, cup = history_and_text(reader, "cup-1")
    assert cup[1] == "left (0.50, 0.00, 0.80) between 2026-01-05T09:01:30.0Z and 2026-01-05T09:16:45.0Z: found empty"
    assert "may be vase-1 as well (20%): the evidence does not single it out" in cup
    assert cup[-1] == "last seen 09:01:30.0Z"
    _, vase = history_and_text(reader, "vase-1")
    assert vase[0].startswith("came between 2026-01-05T09:01:30.0Z and 2026-01-05T09:16:41.0Z: stands at (-0.50,")
    assert "on dining-table-1" in vase[0]


def test_a_history_ends_at_the_given_time(reader: MapReader) -> None:
    history, sentences = history_and_text(reader, "chair-1", "09:10")
    assert [interval.state for interval in history.intervals] == [0]
    assert [sighting.traversal for sighting in history.sightings] == ["monday"]
    assert (history.presence, history.last_seen_ns) == ("unknown", m.ns(90))
    assert sentences[-1].startswith("as of 2026-01-05T09:10:00.0Z: left between")
    assert [event.kind for event in history.events] == ["moved"]
    assert history_and_text(reader, "chair-1", "60 s")[0].events == ()


def test_label_changes_are_part_of_the_history(tmp_path: Path) -> None:
    def labelled(label: str, at: float) -> MapDelta:
        stamps = [at + i for i in range(4)]
        return MapDelta(
            keyframes=m.keyframes(stamps),
            instances=(m.instance(1, label, seen=(1, stamps[-1])),),
            observations=tuple(m.observation(1, stamp_s, label) for stamp_s in stamps),
            visits=(m.visit(1, 4, 4),),
            states=(m.state(1, 0, (1, stamps[-1]), label=label),),
        )

    days = [
        (f"day-{n}", (100 * n, 100 * n + 10), labelled("chair" if n < 2 else "bench", 100 * n + 1)) for n in range(3)
    ]
    path = m.make_memory(tmp_path / "map.db", *days)
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        history, sentences = history_and_text(reader, "chair-1")
    assert [sighting.labels for sighting in history.sightings] == [{"chair": 1.0}, {"chair": 1.0}, {"bench": 1.0}]
    assert "called chair in day-0, day-1, then bench in day-2" in sentences


def test_a_merged_id_gives_the_history_of_the_merged_instance(tmp_path: Path) -> None:
    whole, part = m.instance(1, "cup", seen=(1, 9)), m.instance(2, "cup", seen=(3, 4))
    delta = MapDelta(
        keyframes=m.keyframes([1, 3, 9]),
        instances=(whole, replace(part, merged_into=1)),
        observations=(m.observation(1, 1, "cup"), m.observation(2, 3, "cup"), m.observation(1, 9, "cup")),
        states=(m.state(1, 0, (1, 9), label="cup"), m.state(2, 0, (3, 4), label="cup")),
        visits=(m.visit(1, 2, 2), m.visit(2, 1, 1)),
        temporal_edges=(m.temporal("merged", (2, 0), (1, 0), 3, 9),),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        history, sentences = history_and_text(reader, "cup-2")
    assert (history.id, history.asked_id, history.merged_ids) == ("cup-1", "cup-2", ("cup-2",))
    assert history.evidence.observation_count == 3
    assert "cup-2 turned out to be it (09:00:09.0Z)" in sentences


def test_a_long_history_is_shortened(tmp_path: Path) -> None:
    """A hundred moves, and forty neighbours in each place."""
    moves = 100
    boxes = tuple(m.instance(number, "box", (number, 0, 0.5), seen=(0, 10 * moves)) for number in range(2, 42))
    delta = MapDelta(
        keyframes=m.keyframes([10.0 * at for at in range(moves)]),
        instances=(m.instance(1, "cart", seen=(0, 10 * moves)), *boxes),
        observations=tuple(m.observation(1, 10.0 * at, "cart") for at in range(moves)),
        states=(
            *(m.state(1, at, (10 * at, 10 * at + 5), (at % 7, 0, 0.5), label="cart") for at in range(moves)),
            *(
                m.state(instance.number, 0, (0, 10 * moves), (instance.number, 0, 0.5), label="box")
                for instance in boxes
            ),
        ),
        spatial_edges=tuple(m.spatial(1, "near", instance.number, 0) for instance in boxes),
        visits=(m.visit(1, moves, moves),),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10 * moves), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        history, sentences = history_and_text(reader, "cart-1")
    assert len(history.intervals) == moves
    assert len(sentences) == MAX_SENTENCES + 1
    assert sentences[MAX_SENTENCES // 2].startswith("... ")
    assert {(len(surroundings.relations), surroundings.more) for surroundings in history.surroundings} == {
        (MAX_RELATIONS, 40 - MAX_RELATIONS)
    }


def test_lines_are_shortened_only_where_there_are_too_many() -> None:
    lines = [str(number) for number in range(10)]
    assert shorten_lines(lines, 10) == lines
    assert shorten_lines(lines, 4) == ["0", "1", "... 6 more ...", "8", "9"]
