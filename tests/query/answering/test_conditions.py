"""Conditions, superlatives, directions and comparisons in a small office."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.types.memory import MapDelta
from support import memories as m
from support.asking import Ask, asker, ids, painted

RED, BLUE, WOOD = (190, 30, 30), (30, 60, 200), (140, 100, 60)
DESK = (1.4, 0.7, 0.7)


@pytest.fixture(scope="module")
def ask(tmp_path_factory: pytest.TempPathFactory) -> Ask:
    """Two desks 4 m apart along x, a mug on the first, two on the second; four chairs; the robot at the origin."""
    things = {
        "desk": [((2, 0, 0.35), DESK), ((6, 0, 0.35), DESK)],
        "mug": [((2, 0, 0.75), (0.1, 0.1, 0.1)), ((5.8, 0, 0.75), (0.1, 0.1, 0.1)), ((6.2, 0, 0.75), (0.1, 0.1, 0.1))],
        "chair": [((2, 0.9, 0.45), (0.5, 0.5, 0.9)), ((2, -0.9, 0.4), (0.5, 0.5, 0.8)), ((4, 0, 0.5), (0.5, 0.5, 1.0)),
                  ((9.5, 3, 0.3), (0.5, 0.5, 0.6))],
    }  # fmt: skip
    placed = [(label, *place) for label, places in things.items() for place in places]
    colours = {"desk": WOOD, "mug": BLUE, "chair": RED}
    instances = [
        painted(m.instance(number, label, center, size), (colours[label], 40))  # type: ignore[arg-type]
        for number, (label, center, size) in enumerate(placed, start=1)
    ]
    instances[-1] = painted(instances[-1], (BLUE, 20), (RED, 20))
    instances[0] = painted(instances[0], (WOOD, 3))
    states = [
        m.state(number, 0, (1, 9), center, size, label=label)  # type: ignore[arg-type]
        for number, (label, center, size) in enumerate(placed, start=1)
    ]
    edges = (m.spatial(3, "on", 1, 1), m.spatial(4, "on", 2, 1), m.spatial(5, "on", 2, 1))
    delta = MapDelta(m.keyframes([1, 9]), (), tuple(instances), tuple(states), (), edges)
    folder = tmp_path_factory.mktemp("office")
    return asker(m.make_memory(folder / "map.db", ("monday", (0, 10), delta)))


@pytest.mark.parametrize(
    ("question", "found"),
    [
        ("mugs on desk-1", ["mug-1"]),
        ("mugs on desk-1 and desk-2", ["mug-1", "mug-2", "mug-3"]),
        ("mugs not on desk-1", ["mug-2", "mug-3"]),
        ("chairs except chair-1", ["chair-2", "chair-3", "chair-4"]),
        ("chairs and desks", ["desk-1", "desk-2", "chair-1", "chair-2", "chair-3", "chair-4"]),
        ("chairs within 1 m of desk-1", ["chair-1", "chair-2"]),
        ("chairs more than 2 m from a desk", ["chair-4"]),
        ("red chairs", ["chair-1", "chair-2", "chair-3"]),
        ("closest chair to desk-2", ["chair-3"]),
        ("second closest chair to desk-2", ["chair-1", "chair-2"]),
        ("farthest chair from desk-1", ["chair-4"]),
        ("tallest chair", ["chair-3"]),
        ("the two tallest chairs", ["chair-1", "chair-3"]),
        ("lowest chair", ["chair-4"]),
        ("nearest desk to you", ["desk-1"]),
        ("what is between desk-1 and desk-2", ["chair-3"]),
        ("chairs to the left of desk-1 seen from the robot", ["chair-1"]),
        ("chairs to the right of desk-1 seen from chair-4", ["chair-1"]),
        ("which desk has the most mugs on it", ["desk-2"]),
        ("which desk has the fewest mugs on it", ["desk-1"]),
        ("which is taller, chair-1 or chair-2", ["chair-1"]),
    ],
)
def test_found(ask: Ask, question: str, found: list[str]) -> None:
    assert ids(ask(question)) == found


@pytest.mark.parametrize(
    ("question", "verdict"),
    [
        ("are there more chairs than mugs", "yes"),
        ("are there more desks than mugs", "no"),
        ("is chair-1 taller than chair-2", "yes"),
        ("is chair-2 taller than chair-1", "no"),
        ("is mug-2 blue", "yes"),
        ("is mug-2 red", "no"),
        ("is chair-4 red", "unknown"),
        ("is desk-1 brown", "unknown"),
        ("is desk-2 wooden", "unknown"),
    ],
)
def test_verdicts(ask: Ask, question: str, verdict: str) -> None:
    assert ask(question).verdict == verdict


def test_a_tie_is_told_and_not_guessed(ask: Ask) -> None:
    found = ask("closest mug to desk-2")
    assert ids(found) == ["mug-2", "mug-3"]
    assert "tie" in found.message


def test_left_and_right_ask_back_for_a_viewpoint(ask: Ask) -> None:
    with pytest.raises(RefusedQuestionError, match="seen from where") as refused:
        ask("what is left of desk-1")
    assert refused.value.kind == "viewpoint"


def test_a_distance_is_measured_between_the_boxes(ask: Ask) -> None:
    (measure,) = ask("how far is chair-1 from desk-1").measures or ()
    assert (measure.value, measure.unit) == (pytest.approx(0.3), "m")


def test_the_sentence_says_how_many_stand_where(ask: Ask) -> None:
    assert ask("mugs on desk-2").message == "Two mugs stand on desk-2: mug-2 and mug-3."
    assert ask("where is mug-1").message == "mug-1 stands on desk-1, at (2.00, 0.00, 0.75) m."


def test_an_explanation_has_a_reason_for_every_candidate(ask: Ask) -> None:
    explained = ask("red chairs", explain=True).explanation
    assert explained is not None
    assert {each.id: each.kept for each in explained.candidates} == {
        "chair-1": True,
        "chair-2": True,
        "chair-3": True,
        "chair-4": False,
    }


def test_a_colour_is_described_with_its_share(ask: Ask) -> None:
    assert ask("what colour is mug-1").message == "mug-1 is blue (100%)."
    assert np.isclose(ask("how tall is chair-1").measures[0].value, 0.9)  # type: ignore[index]


def test_a_thing_is_at_no_distance_from_itself(ask: Ask) -> None:
    assert ids(ask("things more than 2 m from the table")) == ["chair-4"]
