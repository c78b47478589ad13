"""Where a thing stands is told by what holds, and by what stood there, at the time asked for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from supermap_cli.types.memory import MapDelta
from support import kitchen
from support import memories as m
from support.asking import Ask, asker, ids

STOOL, BOX, BUCKET = 1, 2, 3


@pytest.fixture(scope="module")
def ask(tmp_path_factory: pytest.TempPathFactory) -> Ask:
    """A stool that left the box's side, and a bucket that came where nothing had stood."""
    seen = (1, 90)
    monday = MapDelta(
        keyframes=m.keyframes([1, 90]),
        instances=(m.instance(STOOL, "stool", seen=seen), m.instance(BOX, "box", (0.8, 0, 0.5), seen=seen)),
        states=(
            m.state(STOOL, 0, seen, label="stool"),
            m.state(BOX, 0, seen, (0.8, 0, 0.5), label="box"),
        ),
        visits=(m.visit(STOOL, 2, 2, 0, seen), m.visit(BOX, 2, 2, 0, seen)),
        spatial_edges=(m.spatial(BOX, "beside", STOOL, 1),),
    )
    tuesday = MapDelta(
        keyframes=m.keyframes([1001, 1090]),
        instances=(
            m.instance(STOOL, "stool", (6, 6, 0.5), seen=(1, 1090)),
            m.instance(BOX, "box", (0.8, 0, 0.5), seen=(1, 1090)),
            m.instance(BUCKET, "bucket", (2.6, 0, 0.5), seen=(1001, 1090)),
        ),
        states=(
            m.state(STOOL, 0, seen, gone=1001, label="stool"),
            m.state(STOOL, 1, (1001, 1090), (6, 6, 0.5), label="stool"),
            m.state(BOX, 0, (1, 1090), (0.8, 0, 0.5), label="box"),
            m.state(BUCKET, 0, (1001, 1090), (2.6, 0, 0.5), label="bucket", empty_before=80),
        ),
        visits=tuple(m.visit(number, 2, 2, 0, (1001, 1090)) for number in (STOOL, BOX, BUCKET)),
        spatial_edges=(m.spatial(BOX, "beside", STOOL, 1, 1001),),
    )
    folder = tmp_path_factory.mktemp("places")
    return asker(m.make_memory(folder / "map.db", ("monday", (0, 100), monday), ("tuesday", (1000, 1100), tuesday)))


def test_a_relation_that_has_ended_tells_no_place(ask: Ask) -> None:
    assert "stool-1" not in ask("where is the box").message
    assert "m from bucket-1" in ask("where is the box").message
    assert "beside stool-1" in ask("where was the box on monday").message


def test_a_landmark_stood_there_at_the_time(ask: Ask) -> None:
    assert "bucket-1" not in ask("where was the stool on monday").message
    assert "beside box-1" in ask("where was the stool on monday").message
    assert "bucket-1" in ask("where was the box on tuesday").message


@pytest.mark.parametrize(("when", "is_or_was"), [("", "is"), (" on monday", "was"), (" on tuesday", "was")])
def test_a_told_place_is_confirmed_when_asked_for(tmp_path: Path, when: str, is_or_was: str) -> None:
    ask = asker(kitchen.make_kitchen(tmp_path / "map.db"))
    told = 0
    for thing in ("cup", "chair-1", "chair-2", "tv", "potted plant", "book", "vase", "lamp"):
        message = ask(f"where {is_or_was} {thing if '-' in thing else f'the {thing}'}{when}").message
        for text_id, relation, other in re.findall(
            r"([a-z-]+-\d+) (?:stands|stood) (on|in|beside|near|under) ([a-z-]+-\d+)", message
        ):
            told += 1
            assert ask(f"{is_or_was} {text_id} {relation} {other}{when}").verdict == "yes", message
    assert told


def test_a_stored_relation_of_one_pair_says_nothing_of_another(tmp_path: Path) -> None:
    """Only chair-1 has edges; the cup near it and the chair near the TV are found by their boxes all the same."""
    ask = asker(kitchen.make_kitchen(tmp_path / "map.db"))
    for question, thing in (
        ("what was near the chair on monday", "tv-1"),
        ("chairs near something on monday", "chair-2"),
    ):
        assert thing in ids(ask(question))
    assert ask("was the tv near chair-2 on monday").verdict == "yes"
