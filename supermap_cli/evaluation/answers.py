"""Scores of the answers to questions in plain words: exact match and Jaccard index."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from supermap_cli.evaluation.estimate import EstimatedMap
from supermap_cli.evaluation.known_truth import KnownTruth, known_truth
from supermap_cli.evaluation.matching import identify
from supermap_cli.evaluation.shares import mean, share
from supermap_cli.types.truth import GroundTruth, TrueQuestion


@dataclass(frozen=True)
class WrongAnswer:
    """A question that was not answered right: the true ids, what was answered, and what that is (`None`: nothing)."""

    text: str
    expected: tuple[str, ...]
    answered: tuple[str, ...] | None
    answered_objects: tuple[str | None, ...]
    jaccard: float


@dataclass(frozen=True)
class AnswerScores:
    """`exact` is the share of the `asked` questions whose answer is exactly the right set of objects; `jaccard` the
    mean over them of |right| / |expected or answered|, 1 where nothing is expected and nothing answered.

    An instance counts as the true object that its newest identified state is (`matching.identify`: by place and time,
    whatever the label, past places included). An instance that is no true object, and a second one of an object, are
    wrong.
    Objects that no image showed well (`known_truth`) are neither expected nor wrong; questions that only they answer
    are `left_out`. A question without an answer, or not understood, is answered wrong. `None` where nothing was asked.

    The truth's answers are those after all of its traversals. Of a map that lacks some, or a part of one, nothing is
    asked: all questions are left out, and `note` says why.
    """

    exact: float | None
    jaccard: float | None
    asked: int
    left_out: tuple[str, ...]
    wrong: tuple[WrongAnswer, ...]
    note: str | None = None


def score_answers(estimate: EstimatedMap, truth: GroundTruth) -> AnswerScores:
    """Score the answers to the truth's questions."""
    known = known_truth(estimate, truth)
    if known.gap is not None:
        return AnswerScores(None, None, 0, tuple(question.text for question in truth.questions), (), known.gap)
    countable = {place.object.id for place in known.places if place.countable}
    scorable = [
        question for question in truth.questions if not question.answer or countable.intersection(question.answer)
    ]
    true_ids = object_by_instance(estimate, known)
    answers = {answer.text: answer.ids for answer in estimate.answers if answer.error is None}
    compared = [_compare_answer(question, answers.get(question.text), true_ids, countable) for question in scorable]
    wrong = tuple(answer for answer in compared if answer.answered is None or answer.jaccard < 1)
    return AnswerScores(
        exact=share(len(compared) - len(wrong), len(compared)),
        jaccard=mean(answer.jaccard for answer in compared),
        asked=len(compared),
        left_out=tuple(question.text for question in truth.questions if question not in scorable),
        wrong=wrong,
    )


def object_by_instance(estimate: EstimatedMap, known: KnownTruth) -> dict[str, str]:
    """Instance -> true object, by the newest of its states that is one."""
    true_ids = {}
    for instance, states in zip(estimate.objects, identify(estimate, known), strict=True):
        for state in states:
            if state is not None:
                true_ids[instance.id] = state.object_id
    return true_ids


def _compare_answer(
    question: TrueQuestion, ids: Sequence[str] | None, true_ids: dict[str, str], countable: set[str]
) -> WrongAnswer:
    """Compare an answer with the expected one; it is right where it exists and its Jaccard index is 1."""
    expected = countable.intersection(question.answer)
    objects = [true_ids.get(instance_id) for instance_id in ids or ()]
    counted = Counter(object_id for object_id in objects if object_id is None or object_id in countable)
    right = sum(1 for object_id in counted if object_id in expected)
    union = len(expected) + sum(counted.values()) - right
    return WrongAnswer(
        text=question.text,
        expected=tuple(sorted(expected)),
        answered=None if ids is None else tuple(ids),
        answered_objects=tuple(objects),
        jaccard=0.0 if ids is None else right / union if union else 1.0,
    )
