"""Indexed answers equal those of an exhaustive search."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from supermap_cli.memory import open_store
from supermap_cli.query.answers import answer
from support.brute_force import BruteForce
from support.databases import examples
from support.random_memories import LABELS, make_random_memory

WORDS = (*LABELS, "everything", "chair-1", "cup-2", "piano", "stool")
RELATIONS = ("near", "next to", "on", "under", "inside", "above", "attached to")
UNSHRUNK = (Phase.explicit, Phase.reuse, Phase.generate)
"""An input takes a second, so that making one smaller that fails would take minutes."""
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
@settings(max_examples=examples(12), deadline=None, phases=UNSHRUNK)
@given(seed=st.integers(0, 10_000), texts=st.lists(questions, min_size=3, max_size=12))
def test_indexed_answers_equal_exhaustive_search(part: int, seed: int, texts: list[str]) -> None:
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.setattr("supermap_cli.query.candidates.BATCH_SIZE", part)
        patch.setattr("supermap_cli.query.near_misses.EXHAUSTIVE_LIMIT", part)
        patch.setattr("supermap_cli.query.relation_matching.DIRECT_READ_LIMIT", part - 2)
        path = make_random_memory(Path(folder) / "map.db", seed)
        with open_store(str(path), read_only=True) as store, store.reader() as reader:
            for text in texts:
                compare(reader, text)


def compare(reader, text: str) -> None:  # type: ignore[no-untyped-def]
    found, expected = answer(text, reader), BruteForce(reader, text)
    found_relations = {
        instance.id: (
            [interval.state for interval in instance.intervals],
            [
                (relation.subject, relation.object, relation.stored_as, relation.since_ns, relation.until_ns)
                for relation in instance.relations
            ],
        )
        for instance in found.instances
    }
    matching = expected.found()
    assert found_relations == matching, text
    assert list(found_relations) == sorted(matching, key=list(expected.parts).index), text
    if not found.instances:
        assert [(near_miss.id, near_miss.distance_m) for near_miss in found.nearest] == expected.nearest(), text
    counted = answer(f"how many {text}", reader)
    assert counted.count == sum(instance.presence != "unknown" for instance in found.instances), text
    assert (counted.count_at_most or counted.count) == len(matching) + expected.uncertain_count(), text
    few = answer(text, reader, limit=2)
    assert {instance.id for instance in few.instances} <= matching.keys()
    assert len(few.instances) == min(2, len(matching))
    assert few.more is None or few.more == len(matching) - len(few.instances)
    assert (few.more == 0) == (len(matching) <= 2)
    of_few = answer(f"how many {text}", reader, limit=2)
    assert (of_few.count, of_few.count_at_most) == (counted.count, counted.count_at_most), text
    assert of_few.more == max(len(matching) - 2, 0), text
