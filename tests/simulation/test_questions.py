"""Questions follow from the truth, and a perfect map answers them right."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.language.lexicon import load_lexicon
from supermap_cli.language.questions import Named
from supermap_cli.query.answering.nouns import match_labels
from supermap_cli.simulation.recording.observed_truth import ObservedTruth, Undetermined
from supermap_cli.simulation.recording.questions import KINDS, NEVER_THERE, SPOKEN, ask_questions, means, plural
from supermap_cli.simulation.worlds.shapes import LABELS
from supermap_cli.types.truth import GroundTruth, TrueChange, TrueObject
from support import kitchen_truth as kt
from support import perfect_map, truths

DAYS = (tuple(range(10)), tuple(range(1000, 1010)))
DESK, CHAIR, MUG, BAG, CAN = (1.4, 0.7, 0.74), (0.5, 0.5, 0.9), (0.08, 0.08, 0.1), (0.3, 0.2, 0.4), (0.3, 0.3, 0.5)


def desk(name: str, x: float) -> TrueObject:
    """A desk that is open below: points on its top only."""
    thing = kt.thing(name, "desk", DESK, ((x, 0, 0.37), None, None))
    top = thing.surface_object.copy()
    top[:, 2] = 0.37
    return replace(thing, surface_object=top)


def office() -> GroundTruth:
    """Two desks 4 m apart, a mug on each, a bag under the first; chairs near and far; the trash can goes."""
    objects = (
        desk("desk-1", 0),
        desk("desk-2", 4),
        kt.thing("mug-1", "mug", MUG, ((0.3, 0, 0.79), None, None)),
        kt.thing("mug-2", "mug", MUG, ((4.3, 0, 0.79), None, None)),
        kt.thing("mug-3", "mug", MUG, ((9.0, 0, 0.05), None, None)),
        kt.thing("backpack-1", "backpack", BAG, ((-0.3, 0, 0.2), None, None)),
        kt.thing("chair-1", "chair", CHAIR, ((0, -0.8, 0.45), None, None)),
        kt.thing("armchair-1", "armchair", CHAIR, ((9.5, 3, 0.45), None, None)),
        kt.thing("trash-can-1", "trash can", CAN, ((6, 2, 0.25), None, 500)),
        kt.thing("bucket-1", "bucket", CAN, ((7, 2, 0.25), 500, None)),
    )
    change = TrueChange("disappeared", "trash-can-1", 0, None, 500, 500, None, ("monday", "tuesday"))
    came = replace(change, kind="appeared", object_id="bucket-1", from_state=None, to_state=0)
    traversals = tuple(kt.traversal(name, day, objects) for name, day in zip(("monday", "tuesday"), DAYS, strict=True))
    return GroundTruth("office", 2, traversals, objects, (), (change, came), ())


def asked(truth: GroundTruth) -> dict[str, tuple[str, ...]]:
    return {question.text: question.answer for question in ask_questions(truth)}


def hidden(truth: GroundTruth, object_id: str, *, pixels: int, frames: int = 100) -> GroundTruth:
    """The truth with an object that shows so few pixels in the first images of each traversal, and none later."""
    k = [thing.id for thing in truth.objects].index(object_id)
    traversals = []
    for traversal in truth.traversals:
        rows = traversal.sightings
        shown = np.where(rows.frame < frames, pixels, 0)
        changed = np.where((rows.object == k) & rows.present, shown, rows.pixels)
        traversals.append(replace(traversal, sightings=replace(rows, pixels=changed)))
    return replace(truth, traversals=tuple(traversals))


def test_there_are_no_questions_about_nothing() -> None:
    assert ask_questions(truths.EMPTY) == ()


@pytest.mark.parametrize(
    ("text", "answer_ids"),
    [
        ("mug", ("mug-1", "mug-2", "mug-3")),
        ("chair", ("armchair-1", "chair-1")),
        ("how many desks", ("desk-1", "desk-2")),
        ("mug on the desk", ("mug-1", "mug-2")),
        ("backpack under the desk", ("backpack-1",)),
        ("trash can in monday", ("trash-can-1",)),
        ("trash can in tuesday", ()),
        ("bucket in tuesday", ("bucket-1",)),
        ("trash can earlier", ("trash-can-1",)),
        ("trash can", ()),
        ("where was the trash can", ("trash-can-1",)),
        (NEVER_THERE[2], ()),
    ],
)
def test_what_is_asked_follows_from_the_geometry(text: str, answer_ids: tuple[str, ...]) -> None:
    assert asked(office())[text] == answer_ids


def test_what_is_between_two_answers_is_not_asked() -> None:
    truth = office()
    doubtful = kt.thing("backpack-1", "backpack", BAG, ((-0.75, 0, 0.2), None, None))  # a third of it under the desk
    objects = tuple(doubtful if thing.id == doubtful.id else thing for thing in truth.objects)
    assert "backpack under the desk" not in asked(replace(truth, objects=objects))


def test_a_thing_that_was_hardly_seen_keeps_its_label_from_being_asked() -> None:
    texts = asked(hidden(office(), "mug-2", pixels=60))
    assert not any("mug" in text for text in texts)
    assert "backpack under the desk" in texts


def test_a_thing_that_nobody_could_see_does_not_count() -> None:
    assert asked(hidden(office(), "mug-2", pixels=5))["mug"] == ("mug-1", "mug-3")


def test_a_thing_whose_leaving_nobody_saw_is_not_asked_for() -> None:
    truth = office()
    monday, tuesday = truth.traversals
    unseen = replace(tuesday.sightings, visible=np.where(tuesday.sightings.present, 1, 0).astype(np.float32))
    texts = asked(replace(truth, traversals=(monday, replace(tuesday, sightings=unseen))))
    assert "trash can" not in texts
    assert texts["trash can in monday"] == ("trash-can-1",)


def test_a_witness_of_a_moved_thing_wants_its_old_place_seen_empty() -> None:
    thing = kt.thing("cart-1", "cart", CAN, ((0, 0, 0.2), None, 500), ((3, 0, 0.2), 500, None))
    traversals = tuple(kt.traversal(name, day, (thing,)) for name, day in zip(("monday", "tuesday"), DAYS, strict=True))
    truth = GroundTruth("", 0, traversals, (thing,), (), (), ())
    assert ObservedTruth(truth).now(0) is thing.states[1]
    assert ObservedTruth(truth).earlier(0) is thing.states[0]
    rows = traversals[1].sightings
    blind = replace(traversals[1], sightings=replace(rows, visible=np.where(rows.present, 1, 0).astype(np.float32)))
    with pytest.raises(Undetermined):
        ObservedTruth(replace(truth, traversals=(traversals[0], blind))).now(0)


@pytest.mark.parametrize("label", LABELS)
def test_words_mean_to_the_truth_what_they_mean_to_the_program(label: str) -> None:
    meant = {other for other in LABELS if means(label, other)}
    assert named(SPOKEN.get(label, label)) == meant
    assert named(plural(label)) == meant


def named(text: str) -> set[str]:
    """The labels of the simulation that a noun names to the program."""
    lexicon = load_lexicon("en")
    match = lexicon.longest_noun(text.split(), 0, LABELS)
    assert match is not None, text
    return set(match_labels(Named(match.name, match.written), LABELS, lexicon).labels)


@pytest.mark.parametrize("text", NEVER_THERE)
def test_what_was_never_there_is_called_nothing_that_may_be(text: str) -> None:
    assert not named(text)


def test_the_kinds_are_labels() -> None:
    assert {label for kinds in KINDS.values() for label in kinds} <= set(LABELS)


def test_a_perfect_map_answers_every_question_right(tmp_path: Path) -> None:
    truth = office()
    truth = replace(truth, questions=ask_questions(truth))
    assert perfect_map.wrong_answers(truth, tmp_path / "map.db") == []
