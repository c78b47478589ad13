"""The presence computed by the database equals the presence computed instance by instance."""

from __future__ import annotations

import tempfile
from collections import Counter
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.memory import open_store
from supermap_cli.memory.presence_query import PresenceQuery
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.candidates import had_label, label_in_state
from supermap_cli.query.clock import clock_of
from supermap_cli.query.overview import overview_at
from supermap_cli.query.presence_at import presence_at, state_held_at
from supermap_cli.query.time_points import parse_time_point
from support import memories as m
from support.databases import examples
from support.random_memories import LABELS, make_random_memory

seeds = st.integers(0, 10_000)
queries = st.tuples(st.integers(-2, 132), st.none() | st.integers(-2, 132))
labels = st.none() | st.sets(st.sampled_from(LABELS), max_size=2).map(frozenset)


@settings(max_examples=examples(40), deadline=None)
@given(seeds, st.lists(st.tuples(queries, labels), min_size=5, max_size=20))
def test_counts_at_a_time_equal_those_of_single_instances(
    seed: int, queries: list[tuple[tuple[int, int | None], frozenset[str] | None]]
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = make_random_memory(Path(folder) / "map.db", seed)
        with open_store(str(path), read_only=True) as store, store.reader() as reader:
            for (at, since), wanted in queries:
                compare(reader, m.ns(at), None if since is None else m.ns(min(at, since)), wanted)


def compare(reader: MapReader, at_ns: int, since_ns: int | None, wanted: frozenset[str] | None) -> None:
    as_of = PresenceQuery(reader.connection, at_ns, since_ns)
    instances = sorted(reader.believed, key=lambda instance: (-instance.last_seen_ns, -instance.number))
    known = {instance.number: presence_at(instance, at_ns, since_ns) for instance in instances}
    present = Counter(
        label_in_state(instance, found.state)
        for instance in instances
        if (found := known[instance.number]) and found.value == "present"
    )
    counts = as_of.counts()
    assert {called: count for (presence, called), count in counts.items() if presence == "present"} == present
    for presence in ("present", "unknown", "absent"):
        expected = [
            instance.number for instance in instances if (found := known[instance.number]) and found.value == presence
        ]
        assert sum(count for (other, _), count in counts.items() if other == presence) == len(expected)
        assert [as_of.last_seen(presence, limit) for limit in (0, 2, 99)] == [expected[:0], expected[:2], expected]
    held = {instance.number: state_held_at(instance.states, at_ns) for instance in instances}
    matching = [
        instance
        for instance in instances
        if (found := held[instance.number]) and (wanted is None or label_in_state(instance, found) in wanted)
    ]
    uncertain = [
        instance
        for instance in instances
        if (found := known[instance.number])
        and found.value == "unknown"
        and (wanted is None or had_label(instance, wanted))
    ]
    tally = as_of.counts_of(wanted)
    assert (tally.matching, tally.unknown) == (len(matching), len(uncertain))
    assert tally.certain == sum(instance not in uncertain for instance in matching)
    assert tally.unknown_others == sum(instance not in matching for instance in uncertain)
    numbers = sorted(instance.number for instance in uncertain)
    assert as_of.unknown(wanted, 3) == numbers[:3]
    ids = [instance.id for instance in uncertain if instance.number == numbers[0]]
    assert as_of.unknown(wanted, 3, ids) == numbers[1:4]


@settings(max_examples=examples(15), deadline=None)
@given(seeds, st.sampled_from(["monday", "tuesday", "09:00:25", "09:01:30", "0 s"]))
def test_a_short_overview_counts_what_it_does_not_list(seed: int, at: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = make_random_memory(Path(folder) / "map.db", seed)
        with open_store(str(path), read_only=True) as store, store.reader() as reader:
            clock = clock_of(reader)
            time_point = parse_time_point(at, reader, clock)
            whole, short = overview_at(reader, time_point, clock), overview_at(reader, time_point, clock, limit=2)
    assert len(short.instances) == min(2, len(whole.instances))
    assert len(short.instances) + short.more == len(whole.instances) == sum(short.counts.values())
    assert len(short.unknown or ()) + short.more_unknown == len(whole.unknown or ())
    assert (short.absent, whole.more, whole.more_unknown) == (whole.absent, 0, 0)
    assert whole.counts == Counter(instance.label for instance in whole.instances)
