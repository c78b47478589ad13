"""What the database judges of a time is what going through all lives gives."""

from __future__ import annotations

import tempfile
from collections import Counter
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.memory import open_store
from supermap_cli.memory.presence_query import PresenceQuery
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.candidates import is_called, label_in
from supermap_cli.query.clock import clock_of
from supermap_cli.query.instants import instant_of
from supermap_cli.query.overview import overview_at
from supermap_cli.query.standing import held_at, standing_at
from support import memories as m
from support.databases import examples
from support.random_memories import LABELS, make_random_memory

seeds = st.integers(0, 10_000)
asked = st.tuples(st.integers(-2, 132), st.none() | st.integers(-2, 132))
labels = st.none() | st.sets(st.sampled_from(LABELS), max_size=2).map(frozenset)


@settings(max_examples=examples(40), deadline=None)
@given(seeds, st.lists(st.tuples(asked, labels), min_size=5, max_size=20))
def test_a_time_is_judged_as_each_life_is(
    seed: int, asked: list[tuple[tuple[int, int | None], frozenset[str] | None]]
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = make_random_memory(Path(folder) / "map.db", seed)
        with open_store(str(path), read_only=True) as store, store.reader() as reader:
            for (at, since), wanted in asked:
                compare(reader, m.ns(at), None if since is None else m.ns(min(at, since)), wanted)


def compare(reader: MapReader, at_ns: int, since_ns: int | None, wanted: frozenset[str] | None) -> None:
    as_of = PresenceQuery(reader.connection, at_ns, since_ns)
    lives = sorted(reader.believed, key=lambda each: (-each.last_seen_ns, -each.number))
    known = {each.number: standing_at(each, at_ns, since_ns) for each in lives}
    present = Counter(
        label_in(each, it.state) for each in lives if (it := known[each.number]) and it.presence == "present"
    )
    counts = as_of.counts()
    assert {called: count for (presence, called), count in counts.items() if presence == "present"} == present
    for presence in ("present", "unknown", "absent"):
        of = [each.number for each in lives if (it := known[each.number]) and it.presence == presence]
        assert sum(count for (other, _), count in counts.items() if other == presence) == len(of)
        assert [as_of.last_seen(presence, limit) for limit in (0, 2, 99)] == [of[:0], of[:2], of]
    held = {each.number: held_at(each.states, at_ns) for each in lives}
    fits = [each for each in lives if (it := held[each.number]) and (wanted is None or label_in(each, it) in wanted)]
    unsure = [
        each
        for each in lives
        if (it := known[each.number]) and it.presence == "unknown" and (wanted is None or is_called(each, wanted))
    ]
    tally = as_of.counts_of(wanted)
    assert (tally.matching, tally.unknown) == (len(fits), len(unsure))
    assert tally.certain == sum(each not in unsure for each in fits)
    assert tally.unknown_others == sum(each not in fits for each in unsure)
    numbers = sorted(each.number for each in unsure)
    assert as_of.unknown(wanted, 3) == numbers[:3]
    ids = [each.id for each in unsure if each.number == numbers[0]]
    assert as_of.unknown(wanted, 3, ids) == numbers[1:4]


@settings(max_examples=examples(15), deadline=None)
@given(seeds, st.sampled_from(["monday", "tuesday", "09:00:25", "09:01:30", "0 s"]))
def test_a_short_overview_counts_what_it_does_not_list(seed: int, at: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = make_random_memory(Path(folder) / "map.db", seed)
        with open_store(str(path), read_only=True) as store, store.reader() as reader:
            clock = clock_of(reader)
            instant = instant_of(at, reader, clock)
            whole, short = overview_at(reader, instant, clock), overview_at(reader, instant, clock, limit=2)
    assert len(short.instances) == min(2, len(whole.instances))
    assert len(short.instances) + short.more == len(whole.instances) == sum(short.counts.values())
    assert len(short.unknown or ()) + short.more_unknown == len(whole.unknown or ())
    assert (short.absent, whole.more, whole.more_unknown) == (whole.absent, 0, 0)
    assert whole.counts == Counter(each.label for each in whole.instances)
