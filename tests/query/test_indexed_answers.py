"""Answers through the indices are those that going through everything gives."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import memories as m
from brute_force import BruteForce
from supermap_cli.memory import open_store
from supermap_cli.query.resolution import answer
from supermap_cli.types.memory import InstanceRecord, MapDelta, SpatialEdge, StateRecord, Visit

LABELS = ("chair", "table", "cup", "lamp")
WORDS = (*LABELS, "everything", "chair-1", "cup-2", "piano", "lampe", "stool")
RELATIONS = ("near", "next to", "on", "under", "inside", "above", "attached to")
TIMES = (
    "",
    "last",
    "first",
    "earlier",
    "in monday",
    "in tuesday",
    "at 2026-01-05T09:00:25Z",
    "at 2026-01-05T09:01:30Z",
)
TRAVERSALS = (("monday", (0, 50)), ("tuesday", (80, 130)))


def make_life(rng: np.random.Generator, number: int) -> tuple[InstanceRecord, list[StateRecord], list[list[Visit]]]:
    """One instance with up to three states, some called otherwise than today, and its visits by traversal."""
    label = str(rng.choice(LABELS))
    times = np.sort(rng.choice(np.r_[0:50, 80:130], 6, replace=False)).tolist()
    states = []
    for index in range(int(rng.integers(1, 4))):
        center = (*rng.uniform(0, 4, 2).tolist(), float(rng.choice([0.25, 0.5, 0.8])))
        size = tuple(rng.uniform(0.1, 1.5, 3).tolist())
        begins, ends = times[2 * index], times[2 * index + 1]
        gone = ends + 0.5 if rng.random() < 0.5 else None
        empty = begins - 0.5 if rng.random() < 0.5 else None
        called = label if rng.random() < 0.7 else str(rng.choice(LABELS))
        state = m.state(number, index, (begins, ends), center, size, gone=gone, empty_before=empty, label=called)
        states.append(state)
    presence = "absent" if states[-1].gone_ns is not None else str(rng.choice(["present", "present", "doubted"]))
    record = m.instance(number, label, seen=(times[0], times[-1]), presence=presence)  # type: ignore[arg-type]
    belief = {label: 0.8, "stool": float(rng.choice([0.05, 0.12, 0.15]))}
    record = replace(record, box=states[-1].box, centroid_map=states[-1].centroid_map, label_belief=belief)
    seen = [m.visit(number, int(rng.integers(0, 3)), 3) for _ in TRAVERSALS]
    return record, states, [[each] if each.supported or rng.random() < 0.5 else [] for each in seen]


def make_edges(rng: np.random.Generator, things: int) -> list[SpatialEdge]:
    """Relations between any two, some over, some twice."""
    edges = []
    for _ in range(int(rng.integers(0, 2 * things))):
        subject, obj = rng.choice(np.arange(1, things + 1), 2, replace=False).tolist()
        since = float(rng.integers(0, 100))
        until = since + float(rng.integers(1, 60)) if rng.random() < 0.5 else None
        relation = str(rng.choice(["near", "on", "beside", "under", "inside", "above"]))
        edges.append(m.spatial(subject, relation, obj, since, until))
    return edges


def make_random_memory(path: Path, seed: int) -> Path:
    rng = np.random.default_rng(seed)
    things = int(rng.integers(2, 14))
    lives = [make_life(rng, number) for number in range(1, things + 1)]
    records = [record for record, _, _ in lives]
    for number in range(3, things + 1):
        if rng.random() < 0.15:
            records[number - 1] = replace(records[number - 1], merged_into=int(rng.integers(1, number)))
    first = MapDelta(
        keyframes=m.keyframes(list(range(50))),
        observations=tuple(m.observation(each.number, 10 + each.number) for each in records),
        instances=tuple(records),
        states=tuple(state for _, states, _ in lives for state in states),
        visits=tuple(visit for _, _, visits in lives for visit in visits[0]),
        spatial_edges=tuple(make_edges(rng, things)),
    )
    second = MapDelta(
        keyframes=m.keyframes(list(range(80, 130))),
        visits=tuple(visit for _, _, visits in lives for visit in visits[1]),
    )
    deltas = (first, second)
    return m.make_memory(path, *((name, span, delta) for (name, span), delta in zip(TRAVERSALS, deltas, strict=True)))


questions = st.builds(
    lambda what, related, time: " ".join(part for part in (what, *related, time) if part),
    st.sampled_from(WORDS),
    st.one_of(
        st.just(()),
        st.tuples(st.sampled_from(RELATIONS), st.sampled_from([word for word in WORDS if word != "everything"])),
        st.tuples(
            st.sampled_from(RELATIONS), st.sampled_from(LABELS), st.sampled_from(RELATIONS), st.sampled_from(LABELS)
        ),
    ),
    st.sampled_from(TIMES),
)


@pytest.mark.parametrize("part", [100, 2])
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), asked=st.lists(questions, min_size=3, max_size=12))
def test_the_indices_find_what_going_through_everything_finds(part: int, seed: int, asked: list[str]) -> None:
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.setattr("supermap_cli.query.candidates.PART", part)
        patch.setattr("supermap_cli.query.misses.FEW", part)
        path = make_random_memory(Path(folder) / "map.db", seed)
        with open_store(str(path), read_only=True) as store, store.reader() as reader:
            for text in asked:
                compare(reader, text)


def compare(reader, text: str) -> None:  # type: ignore[no-untyped-def]
    found, expected = answer(text, reader), BruteForce(reader, text)
    told = {
        each.id: (
            [interval.state for interval in each.intervals],
            [(it.subject, it.object, it.stored_as, it.since_ns, it.until_ns) for it in each.relations],
        )
        for each in found.instances
    }
    fits = expected.found()
    assert told == fits, text
    assert list(told) == sorted(fits, key=list(expected.parts).index), text
    if not found.instances:
        assert [(each.id, each.distance_m) for each in found.nearest] == expected.nearest(), text
    counted = answer(f"how many {text}", reader)
    assert counted.count == sum(each.presence != "unknown" for each in found.instances), text
    assert (counted.count_at_most or counted.count) == len(fits) + expected.perhaps(), text
    few = answer(text, reader, limit=2)
    assert {each.id for each in few.instances} <= fits.keys()
    assert len(few.instances) == min(2, len(fits))
    assert few.more is None or few.more == len(fits) - len(few.instances)
    assert (few.more == 0) == (len(fits) <= 2)
    assert answer(f"how many {text}", reader, limit=2).count == counted.count
