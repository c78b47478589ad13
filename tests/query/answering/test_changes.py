"""Questions about changes are answered by what `diff` and `history` know."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.errors import QueryError
from supermap_cli.types.memory import MapDelta
from support import kitchen
from support import memories as m
from support.asking import Ask, asker, ids


@pytest.fixture(scope="module")
def ask(tmp_path_factory: pytest.TempPathFactory) -> Ask:
    return asker(kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db"))


@pytest.mark.parametrize(
    ("question", "changed"),
    [
        ("what changed", {"cup-1", "chair-1", "vase-1"}),
        ("what changed since monday", {"cup-1", "chair-1", "vase-1"}),
        ("what was moved?", {"chair-1"}),
        ("what is new", {"vase-1"}),
        ("what's missing", {"cup-1"}),
        ("what moved on tuesday", {"chair-1"}),
        ("has the tv moved", set()),
        ("has anything on the table changed", {"cup-1", "vase-1"}),
        ("which chairs moved", {"chair-1"}),
        ("chairs that moved since monday", {"chair-1"}),
        ("things that disappeared", {"cup-1"}),
    ],
)
def test_what_changed(ask: Ask, question: str, changed: set[str]) -> None:
    assert set(ids(ask(question))) == changed


def test_a_change_has_bounds_and_places(ask: Ask) -> None:
    (change,) = ask("what was moved").changes or ()
    assert (change.kind, change.not_before_ns, change.not_after_ns) == ("moved", m.ns(90), m.ns(1001))
    assert (change.position_before, change.position_after) == ((0.0, 1.0, 0.5), (-3.0, 3.0, 0.5))


def test_what_nobody_looked_at_is_neither_new_nor_gone(ask: Ask) -> None:
    assert "lamp-1 may be new: nobody had looked at the place before" in ask("what is new").message
    found = ask("did the book disappear")
    assert found.verdict == "unknown"
    assert found.instances == ()


def test_a_yes_or_no_question_has_a_verdict(ask: Ask) -> None:
    assert ask("has the chair moved").verdict == "yes"
    assert ask("has the tv moved").verdict == "no"
    assert ask("how many things moved").count == 1


@pytest.mark.parametrize(
    ("question", "told"),
    [
        ("where did the chair come from", "chair-1 came from 3.61 m away"),
        ("where did the chair go", "chair-1 went 3.61 m"),
        ("where did the cup go", "nobody saw where cup-1 went: it left between"),
        ("where did the cup go", "it may be vase-1 (20%)"),
        ("where did the vase come from", "nobody saw where vase-1 came from: it appeared between"),
        ("where did the tv go", "tv-1 is not known to have moved"),
    ],
)
def test_where_things_came_from_and_went(ask: Ask, question: str, told: str) -> None:
    assert told in ask(question).message


def test_after_the_end_nobody_has_looked(ask: Ask) -> None:
    with pytest.raises(QueryError, match="the map ends with tuesday: nobody has looked since"):
        ask("what changed since tuesday")


def test_within_one_traversal_its_own_events_are_told(tmp_path: Path) -> None:
    delta = MapDelta(
        keyframes=m.keyframes([1, 9]),
        instances=(m.instance(1, "cup", (2, 0, 0.5), seen=(1, 9)), m.instance(2, "book", seen=(1, 9))),
        states=(
            m.state(1, 0, (1, 3), gone=4, label="cup"),
            m.state(1, 1, (6, 9), (2, 0, 0.5), label="cup"),
            m.state(2, 0, (1, 9), (0, 5, 0), label="book"),
        ),
        temporal_edges=(m.temporal("moved", (1, 0), (1, 1), 3, 6, distance_m=2.0),),
    )
    ask = asker(m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta)))
    found = ask("what moved")
    assert ids(found) == ["cup-1"]
    assert "there is no earlier visit to compare it with" in found.notes[-1]
    assert ask("what is new").instances == ()


@pytest.mark.parametrize(
    "question",
    [
        "what moved in the last ten minutes",
        "what moved on monday",
        "did the chair move on monday",
        "did anything move in the first five minutes",
        "what moved after the cup disappeared",
        "chairs that moved in the last ten minutes",
        "how many things moved in the last ten minutes",
    ],
)
def test_what_may_have_happened_outside_the_time_asked_for_is_no_fact(ask: Ask, question: str) -> None:
    """The chair moved some time between 90 s and 1001 s: no part of that lies wholly within these times."""
    found = ask(question)
    assert ids(found) == []
    assert found.verdict in {None, "unknown"}
    assert found.count in {None, 0}
    assert "obody can say" in found.message or "perhaps" in found.message or found.count_at_most
    assert "chair-1" in found.message


def test_what_surely_happened_within_the_time_is_told(tmp_path: Path) -> None:
    delta = MapDelta(
        keyframes=m.keyframes([1, 60, 90]),
        instances=(m.instance(1, "cup", (2, 0, 0.5), seen=(1, 90)), m.instance(2, "vase", (4, 0, 0.5), seen=(1, 90))),
        states=(
            m.state(1, 0, (1, 50), gone=60, label="cup"),
            m.state(1, 1, (60, 90), (2, 0, 0.5), label="cup"),
            m.state(2, 0, (1, 10), (9, 5, 0), gone=80, label="vase"),
            m.state(2, 1, (80, 90), (4, 5, 0), label="vase"),
        ),
        temporal_edges=(
            m.temporal("moved", (1, 0), (1, 1), 50, 60, distance_m=2.0),
            m.temporal("moved", (2, 0), (2, 1), 10, 80, distance_m=5.0),
        ),
    )
    ask = asker(m.make_memory(tmp_path / "map.db", ("monday", (0, 90), delta)))
    found = ask("what moved in the last minute")
    assert ids(found) == ["cup-1"]
    assert "vase-1 may have moved then, some time between" in found.message
    assert ids(ask("what moved")) == ["cup-1", "vase-1"]
