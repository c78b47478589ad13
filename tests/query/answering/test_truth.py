"""Yes, no or unknown: nothing is denied that the map cannot know."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from supermap_cli.types.memory import MapDelta
from support import kitchen
from support import memories as m
from support.asking import Ask, asker, ids


@pytest.fixture(scope="module")
def ask(tmp_path_factory: pytest.TempPathFactory) -> Ask:
    return asker(kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db"))


@pytest.mark.parametrize(
    ("question", "verdict"),
    [
        ("is there a chair", "yes"),
        ("are there two chairs", "yes"),
        ("are there three chairs", "no"),
        ("is there a piano", "no"),
        ("is there a cup", "no"),
        ("was there a lamp on monday", "unknown"),
        ("was there a vase on monday", "no"),
        ("is the tv still there", "yes"),
        ("is the cup still there", "no"),
        ("is the book still there", "unknown"),
        ("is chair-1 still there", "no"),
        ("is the cup still on the table", "no"),
        ("is the vase on the table", "yes"),
        ("is the tv on the table", "no"),
        ("are all chairs near the tv", "no"),
        ("was the vase there at the start", "no"),
        ("was the cup there originally", "yes"),
        ("is there a chair and a piano", "no"),
        ("is there both a chair and a tv", "yes"),
        ("is there a piano or a chair", "yes"),
        ("are the chairs near the tv", "no"),
        ("are the chairs still there", "no"),
        ("is the chair near the tv", "yes"),
        ("is any chair near the tv", "yes"),
    ],
)
def test_verdicts(ask: Ask, question: str, verdict: str) -> None:
    assert ask(question).verdict == verdict


def test_a_verdict_of_still_tells_its_evidence(ask: Ask) -> None:
    assert ask("is the cup still there").message == (
        "No: cup-1 is gone: it left between 2026-01-05T09:01:30.0Z and 2026-01-05T09:16:45.0Z."
    )
    assert "nobody has looked at its place since" in ask("is the book still there").message
    assert "has moved 3.61 m" in ask("is chair-1 still there").message


def test_what_is_doubted_is_neither_there_nor_denied(tmp_path: Path) -> None:
    record = replace(m.instance(1, "oven", seen=(1, 2), presence="doubted"), existence_log_odds=-0.5)
    delta = MapDelta(keyframes=m.keyframes([1]), instances=(record,), states=(m.state(1, 0, (1, 2), label="oven"),))
    found = asker(m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta)))("is there an oven")
    assert (found.verdict, [miss.id for miss in found.nearest]) == ("unknown", ["oven-1"])
    assert "doubted since: real with 38%" in found.message


def test_people_are_told_of_where_and_when_they_were_seen(tmp_path: Path) -> None:
    delta = MapDelta(
        keyframes=m.keyframes([1, 9]),
        instances=(m.instance(1, "person", seen=(3, 5), presence="doubted"), m.instance(2, "desk", (0.9, 0, 0.4))),
        states=(m.state(1, 0, (3, 5), label="person"), m.state(2, 0, (1, 9), (0.9, 0, 0.4), label="desk")),
    )
    ask = asker(m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta)))
    found = ask("did you meet anybody")
    assert (found.verdict, ids(found)) == ("yes", ["person-1"])
    assert "from 2026-01-05T09:00:03.0Z to 2026-01-05T09:00:05.0Z, 0.40 m from desk-1" in found.message
    assert ids(ask("where is person-1")) == ["person-1"]
    assert ask("is anyone here now").verdict == "unknown"
    assert ask("did you see a dog").verdict == "no"


def test_another_name_of_a_detector_is_told_before_it_is_answered_with(ask: Ask) -> None:
    found = ask("is there a desk")
    assert found.verdict == "unknown"
    assert found.message.startswith("Nothing in the map is called a desk; what is called a dining table was taken")
    assert ids(found) == ["dining-table-1"]


def test_a_missing_part_of_a_question_is_not_answered_for(ask: Ask) -> None:
    assert ask("is the cup near the piano").verdict == "no"
    assert "There is no piano in the map" in ask("cup near the piano").message


def test_what_is_missing_of_several_things_is_told(ask: Ask) -> None:
    found = ask("where are the tv and the piano")
    assert ids(found) == ["tv-1"]
    assert any("no piano" in note for note in found.notes)


def test_the_robot_is_where_it_was_last(ask: Ask) -> None:
    assert ask("where are you").message.startswith("The robot was last at (")
