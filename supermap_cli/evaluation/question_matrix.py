"""Answers to a file of questions against what the truth says: how many of each kind are exact, and which are wrong.

- exact: the right things, number, verdict or distance; of what must be refused, a refusal of the right kind.
- partly: some of the right things and no other; or "nobody can say", or a range of numbers that holds the right one.
- refused: a refusal where an answer was expected, or one of another kind.
- wrong: anything else: other things, a false denial, another number, an answer to what no map knows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

from supermap_cli.errors import EvaluationError, QueryError
from supermap_cli.evaluation.answers import object_by_instance
from supermap_cli.evaluation.estimate import EstimatedMap
from supermap_cli.evaluation.known_truth import KnownTruth, known_truth
from supermap_cli.evaluation.matching import same_label
from supermap_cli.evaluation.question_files import ExpectedQuestion
from supermap_cli.evaluation.reading import read_estimate
from supermap_cli.evaluation.shares import share
from supermap_cli.evaluation.true_selection import DISTANCE_MARGIN_M, TrueSelections
from supermap_cli.geometry.boxes import box_iou
from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.answers import Answer, answer
from supermap_cli.simulation.recording.observed_truth import Undetermined
from supermap_cli.truth_file import read_truth
from supermap_cli.types.truth import GroundTruth

Verdict = Literal["exact", "partly", "refused", "wrong"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
MAX_LISTED = 1000
"""Things that an answer may list; more than any scenario has."""


@dataclass(frozen=True)
class Expectation:
    """What the truth says: the `ids` of things (and those that `may` be named), a number, a verdict or metres."""

    ids: frozenset[str] | None = None
    may: frozenset[str] = frozenset()
    count: int | None = None
    verdict: bool | None = None
    distance_m: float | None = None
    refused: str | None = None

    @property
    def text(self) -> str:
        """In words."""
        if self.ids is not None:
            return ", ".join(sorted(self.ids)) or "nothing"
        if self.verdict is not None:
            return "yes" if self.verdict else "no"
        if self.distance_m is not None:
            return f"{self.distance_m:.2f} m"
        return str(self.count) if self.refused is None else f"refused: {self.refused}"


@dataclass(frozen=True)
class JudgedAnswer:
    """A question, what was expected and what was answered, in words."""

    text: str
    kind: str
    language: str
    verdict: Verdict
    expected: str
    answered: str


@dataclass(frozen=True)
class KindRow:
    """How many of the asked questions of a kind (or of a language, or of all) got which verdict."""

    name: str
    asked: int
    exact: int
    partly: int
    refused: int
    wrong: int


@dataclass(frozen=True)
class QuestionMatrix:
    """`exact_share` and `wrong_share` are those of the asked questions; `None` where nothing was asked.

    `left_out` are questions to which the images give no clear answer, or that need more traversals. `not_exact` are all
    others than the exact ones.
    """

    exact_share: float | None
    wrong_share: float | None
    all: KindRow
    kinds: tuple[KindRow, ...]
    languages: tuple[KindRow, ...]
    left_out: tuple[str, ...]
    not_exact: tuple[JudgedAnswer, ...]


def ask_map(db: str, truth_path: Path, questions: Sequence[ExpectedQuestion]) -> QuestionMatrix:
    """Ask a map database all questions (`named_objects` says which true object an instance is).

    Raises what `reading.read_map` raises, and `EvaluationError` where the map lacks a part of the truth's traversals.
    """
    truth = read_truth(truth_path)
    with open_store(db, read_only=True) as store, store.reader() as reader:
        estimate = read_estimate(reader, replace(truth, questions=()))
        known = known_truth(estimate, truth)
        if known.gap is not None:
            raise EvaluationError(known.gap, where=db, cure="build all recordings of the truth into the map")
        countable = frozenset(place.object.id for place in known.places if place.countable)
        return judge_questions(reader, truth, questions, named_objects(estimate, known), countable)


def named_objects(estimate: EstimatedMap, known: KnownTruth) -> dict[str, str]:
    """Instance -> the true object that an answer names by it: the one of its newest identified state (`matching`).

    One that is nowhere identified, for the map saw a part of it and its centre is off, is the object of its label that
    stands in its box while it is seen, if there is but one and no other instance is that.
    """
    true_ids = object_by_instance(estimate, known)
    for instance in estimate.objects:
        if instance.id not in true_ids:
            state = instance.states[-1]
            inside = {
                place.object.id
                for place in known.places
                if same_label(place.object.label, instance.label)
                and place.overlaps(state.first_seen_ns, state.last_seen_ns)
                and box_iou(state.box, place.box) > 0
            } - set(true_ids.values())
            if len(inside) == 1:
                true_ids[instance.id] = inside.pop()
    return true_ids


def judge_questions(
    reader: MapReader,
    truth: GroundTruth,
    questions: Sequence[ExpectedQuestion],
    true_ids: Mapping[str, str],
    countable: frozenset[str] | None = None,
) -> QuestionMatrix:
    """Ask a map all questions. `true_ids` says which true object an instance is; what is not in `countable`
    (true ids; `None`: all are in it) is neither expected nor wrong.
    """
    selections = TrueSelections(truth)
    judged: list[JudgedAnswer] = []
    left_out = []
    for question in questions:
        try:
            expected = expectation(question, selections) if question.traversals <= len(truth.traversals) else None
        except Undetermined:
            expected = None
        if expected is None:
            left_out.append(question.text)
        else:
            judged.append(_judge(reader, question, expected, true_ids, countable))
    everything = _row("all", judged)
    return QuestionMatrix(
        exact_share=share(everything.exact, everything.asked),
        wrong_share=share(everything.wrong, everything.asked),
        all=everything,
        kinds=_rows(judged, [each.kind for each in judged]),
        languages=_rows(judged, [each.language for each in judged]),
        left_out=tuple(left_out),
        not_exact=tuple(each for each in judged if each.verdict != "exact"),
    )


def expectation(question: ExpectedQuestion, truth: TrueSelections) -> Expectation:
    """What the truth says to a question. Raises `Undetermined` where it does not say."""
    value = question.value
    match question.sort:
        case "refused":
            expected = Expectation(refused=value)
        case "ids" | "changes":
            sure, perhaps = _things(question, truth)
            may = frozenset() if question.may is None else truth.sure_and_perhaps(question.may)[0]
            expected = Expectation(ids=sure, may=perhaps | may)
        case "yes" | "changed":
            expected = _yes_or_no(*_things(question, truth))
        case "count":
            expected = Expectation(count=len(truth.ids(value)))
        case "more":
            expected = Expectation(verdict=len(truth.ids(value[0])) > len(truth.ids(value[1])))
        case "at_least":
            expected = Expectation(verdict=len(truth.ids(value[1])) >= int(value[0]))
        case "larger":
            expected = Expectation(verdict=truth.is_larger(*value))
        case _:
            expected = Expectation(distance_m=truth.gap_m(*value))
    return expected


def _things(question: ExpectedQuestion, truth: TrueSelections) -> tuple[frozenset[str], frozenset[str]]:
    """The things that are surely, and perhaps, the answer."""
    if question.sort in {"changes", "changed"}:
        return truth.changed(question.value, question.of)
    return truth.sure_and_perhaps(question.value)


def _yes_or_no(sure: frozenset[str], perhaps: frozenset[str]) -> Expectation:
    if perhaps and not sure:
        raise Undetermined
    return Expectation(verdict=bool(sure))


def _judge(
    reader: MapReader,
    question: ExpectedQuestion,
    expected: Expectation,
    true_ids: Mapping[str, str],
    countable: frozenset[str] | None,
) -> JudgedAnswer:
    try:
        found = answer(question.text, reader, limit=MAX_LISTED)
    except RefusedQuestionError as refusal:
        right = refusal.kind == expected.refused
        verdict: Verdict = "exact" if right else "refused"
        answered = f"refused: {refusal.kind} ({refusal})"
    except QueryError as error:
        verdict, answered = "refused", f"refused: {error}"
    else:
        verdict = _verdict(found, expected, true_ids, countable)
        answered = _answer_text(found, true_ids)
    return JudgedAnswer(question.text, question.kind, question.language, verdict, expected.text, answered)


def _verdict(
    found: Answer, expected: Expectation, true_ids: Mapping[str, str], countable: frozenset[str] | None
) -> Verdict:
    if expected.ids is not None:
        return _ids_verdict(found, expected.ids, expected.may, true_ids, countable)
    if expected.count is not None:
        return _count_verdict(found, expected.count)
    if expected.verdict is not None:
        if found.verdict == "unknown":
            return "partly"
        return "exact" if found.verdict == ("yes" if expected.verdict else "no") else "wrong"
    metres = [measure.value for measure in found.measures or () if measure.unit == "m"]
    if expected.distance_m is None or not metres:
        return "wrong"
    return "exact" if abs(metres[0] - expected.distance_m) <= DISTANCE_MARGIN_M else "wrong"


def _count_verdict(found: Answer, count: int) -> Verdict:
    low, high = found.count, found.count_at_most
    if low == count and high is None:
        return "exact"
    return "partly" if low is not None and high is not None and low <= count <= high else "wrong"


def _ids_verdict(
    found: Answer,
    ids: frozenset[str],
    may: frozenset[str],
    true_ids: Mapping[str, str],
    countable: frozenset[str] | None,
) -> Verdict:
    named = [true_ids.get(instance.id) for instance in found.instances]
    judged = Counter(each for each in named if each is None or countable is None or each in countable)
    expected = ids if countable is None else ids & countable
    other = [each for each in judged if each is None or each not in expected | may]
    if other or max(judged.values(), default=1) > 1:
        return "wrong"
    right = expected & judged.keys()
    if right == expected:
        return "exact"
    return "partly" if right else "wrong"


def _answer_text(found: Answer, true_ids: Mapping[str, str]) -> str:
    named = ", ".join(f"{each.id} = {true_ids.get(each.id, 'no true object')}" for each in found.instances)
    return f"{found.message} [{named}]"


def _rows(judged: Sequence[JudgedAnswer], names: Sequence[str]) -> tuple[KindRow, ...]:
    return tuple(
        _row(name, (each for each, of in zip(judged, names, strict=True) if of == name))
        for name in dict.fromkeys(names)
    )


def _row(name: str, judged: Iterable[JudgedAnswer]) -> KindRow:
    counted = Counter(each.verdict for each in judged)
    return KindRow(name, counted.total(), *(counted[verdict] for verdict in VERDICTS))
