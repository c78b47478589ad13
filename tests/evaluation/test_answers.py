"""Answers to questions: figures worked out by hand."""

from dataclasses import replace

import pytest

from supermap_cli.evaluation.answers import score_answers
from supermap_cli.evaluation.estimate import EstimatedAnswer
from supermap_cli.types.truth import TrueQuestion
from support import evaluated as e


def answering(truth, **answers):
    """The perfect map with the given answers, by a word of the question."""
    estimate = e.perfect_map(truth)
    given = tuple(
        EstimatedAnswer(answer.text, tuple(map(e.instance_id, ids))) if ids is not None else answer
        for answer in estimate.answers
        for ids in [next((ids for word, ids in answers.items() if word in answer.text), None)]
    )
    return replace(estimate, answers=given)


def test_without_questions_nothing_is_defined():
    truth = replace(e.still_life(), questions=())
    scores = score_answers(e.perfect_map(truth), truth)
    assert (scores.exact, scores.jaccard, scores.asked) == (None, None, 0)


@pytest.mark.parametrize("truth", [e.still_life(), e.two_days()])
def test_a_perfect_map_answers_all_also_about_what_is_gone(truth):
    scores = score_answers(e.perfect_map(truth), truth)
    assert (scores.exact, scores.jaccard, scores.asked, scores.wrong) == (1, 1, len(truth.questions), ())


def test_no_answer_is_wrong_even_where_nothing_fits():
    truth = e.still_life()
    scores = score_answers(e.empty_map(truth), truth)
    assert (scores.exact, scores.jaccard) == (0, 0)
    assert scores.wrong[2].answered is None


@pytest.mark.parametrize(
    ("answers", "jaccard"),
    [
        ({"chairs": ("chair-1",)}, 1 / 2),
        ({"chairs": ("chair-1", "chair-2", "table-1")}, 2 / 3),
        ({"chairs": ("chair-1", "table-1")}, 1 / 3),
        ({"chairs": ("chair-1", "chair-2", "unknown-1")}, 2 / 3),
        ({"table": ()}, 0),
        ({"piano": ("chair-1",)}, 0),
    ],
)
def test_an_answer_counts_only_if_it_is_exactly_right(answers, jaccard):
    truth = e.still_life()
    scores = score_answers(answering(truth, **answers), truth)
    assert scores.exact == pytest.approx(2 / 3)
    assert scores.jaccard == pytest.approx((2 + jaccard) / 3)
    [wrong] = scores.wrong
    assert wrong.jaccard == pytest.approx(jaccard)


def test_the_second_instance_of_one_thing_is_wrong():
    truth = e.still_life()
    estimate = e.doubled(e.perfect_map(truth), ["table-1"])
    answers = tuple(
        replace(answer, ids=("map-table-1", "map-table-1-again")) if answer.text == "the table" else answer
        for answer in estimate.answers
    )
    [wrong] = score_answers(replace(estimate, answers=answers), truth).wrong
    assert (wrong.answered_objects, wrong.jaccard) == (("table-1", "table-1"), 0.5)


def test_labels_do_not_matter_but_places_do():
    truth = e.still_life()
    mislabelled = e.altered(e.perfect_map(truth), "table-1", lambda instance: e.relabelled(instance, "desk"))
    assert score_answers(mislabelled, truth).exact == 1
    shifted = e.altered(e.perfect_map(truth), "table-1", lambda instance: e.shifted_object(instance, (0, 0.35, 0)))
    assert [answer.text for answer in score_answers(shifted, truth).wrong] == ["the table"]


def test_of_a_map_that_lacks_a_traversal_nothing_is_asked():
    truth = e.two_days()
    monday = replace(e.perfect_map(truth), keyframes_ns=truth.traversals[0].stamps_ns)
    scores = score_answers(monday, truth)
    assert (scores.exact, scores.jaccard, scores.asked, scores.wrong) == (None, None, 0, ())
    assert scores.left_out == ("where was the plant", "the bag")
    assert scores.note == "not judged: the map lacks tuesday"


def test_what_no_image_showed_well_is_not_asked_for():
    objects = e.still_life().objects
    look = lambda object_id, state, second: e.Sight(pixels=9 if object_id != "chair-1" else 1000)  # noqa: E731
    questions = (*e.still_life().questions, TrueQuestion("all", ("chair-1", "plant-1")))
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects, look)], questions=questions)
    scores = score_answers(e.perfect_map(truth), truth)
    assert (scores.exact, scores.asked, scores.left_out) == (1, 3, ("the table",))
    assert score_answers(answering(truth, all=("chair-1",)), truth).exact == 1
