"""Instructions are cut into goals; each is a question of the grammar."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.errors import QueryError
from supermap_cli.language.instructions import MOST_GOALS, parse_instruction
from supermap_cli.language.known_names import KnownNames
from supermap_cli.language.questions import Find, Identified

KNOWN = KnownNames(
    labels=["whiteboard", "painting", "fridge", "chair", "desk", "door", "tv"],
    relations={"en": {"next to": "beside", "near": "near", "on": "on"}},
)


def goals(text: str) -> list[str]:
    return [goal.text for goal in parse_instruction(text, KNOWN)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "go to the whiteboard next to the painting, then to the painting next to the fridge",
            ["the whiteboard next to the painting", "the painting next to the fridge"],
        ),
        ("Go to the chair. Then go to the desk.", ["the chair", "the desk"]),
        ("please drive to the chair and then to a desk", ["the chair", "a desk"]),
        ("visit the chair, the desk and the tv", ["the chair", "desk", "tv"]),
        ("go to the chair near the desk and the tv", ["the chair near the desk and the tv"]),
        ("go to the chair and to the desk", ["the chair", "the desk"]),
        ("first go to the desk, next, the chair", ["the desk", "the chair"]),
        ("the red chair", ["the red chair"]),
        ("could you take me to chair-1 and stop there", ["chair-1"]),
        ("geh zum stuhl, dann zur tür", ["dem stuhl", "der tür"]),
        ("va à la chaise puis à la porte", ["la chaise", "la porte"]),
        ("ve a la silla y luego a la puerta", ["la silla", "la puerta"]),
        ("去椅子 然后去门", ["椅子", "门"]),
    ],
)
def test_an_instruction_is_cut_at_what_separates_goals(text: str, expected: list[str]) -> None:
    assert goals(text) == expected


@pytest.mark.parametrize(
    ("text", "each", "any_of", "wanted"),
    [
        ("go to the chair", False, False, 1),
        ("go to a chair", False, True, 1),
        ("go to any chair", False, True, 1),
        ("visit all chairs", True, False, 1),
        ("visit every chair", True, False, 1),
        ("go to two chairs", False, True, 2),
        ("go to the chair or the desk", False, True, 1),
    ],
)
def test_how_many_are_meant(text: str, each: bool, any_of: bool, wanted: int) -> None:
    (goal,) = parse_instruction(text, KNOWN)
    assert (goal.each, goal.any_of, goal.wanted) == (each, any_of, wanted)


@pytest.mark.parametrize(
    "text",
    [
        *("", "go to", "go to , then", "bring the chair to the desk", "don't go to the chair", "go to the flibber"),
        *("how many chairs are there", "go to where the chair was yesterday", "go to the chair quickly and sing"),
        *("come here", "go to me", "turn left", "go to the chair, then dance"),
    ],
)
def test_what_is_not_understood_is_refused(text: str) -> None:
    with pytest.raises(QueryError):
        parse_instruction(text, KNOWN)


def test_too_many_goals_are_refused() -> None:
    with pytest.raises(QueryError, match="several instructions"):
        parse_instruction("go to the chair" + ", then to the desk" * MOST_GOALS, KNOWN)


SEPARATORS = (", then to ", " and then go to ", ". Then to ", ", and to ", ", ", " then ", "; after that visit ")


@settings(max_examples=40)
@given(st.lists(st.sampled_from(["chair-1", "desk-2", "tv-3", "door-4"]), min_size=1, max_size=6), st.data())
def test_goals_keep_their_number_and_order(ids: list[str], data: st.DataObject) -> None:
    text = "go to " + ids[0]
    for text_id in ids[1:]:
        text += data.draw(st.sampled_from(SEPARATORS)) + text_id
    found = [goal.question.body for goal in parse_instruction(text, KNOWN)]
    assert [body.things.noun for body in found if isinstance(body, Find)] == [Identified(text_id) for text_id in ids]
