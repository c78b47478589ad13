"""Files of questions with what must be answered, one JSON object a line (JSON Lines).

    {"text": "which mugs are on the desk", "kind": "relation", "language": "en",
     "expected": {"ids": {"label": "mug", "on": {"label": "desk"}}}}

`expected` is one of, with selections (`true_selection`) over the truth:

- `ids`: the things that are the answer. `count`: their number. `yes`: whether there are any.
- `more`: [selection, selection], whether the first has more. `at_least`: [number, selection].
- `larger`: [measure, selection, selection], whether the first one's thing is "largest" ("tallest") of the two.
- `changes`: a kind of change or "any" (`of`: a selection): the things that changed. `changed`: whether any did.
- `distance_m`: [selection, selection], the metres between the nearest two.
- `refused`: the kind of the refusal.

`may` beside `ids` or `changes` is a selection of things that may be in the answer or not: the words leave it open.
`traversals` is the least number of traversals of a truth that the question makes sense for.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from supermap_cli.errors import EvaluationError
from supermap_cli.evaluation.true_selection import MEASURES, RELATION_NAMES, TERMS, TIMES
from supermap_cli.language.refusals import RefusalKind

EXPECTED = frozenset(
    {"ids", "count", "yes", "more", "at_least", "larger", "changes", "changed", "distance_m", "refused"}
)
"""What a line may expect: exactly one of them."""
BESIDES = frozenset({"may", "of"})
CHANGES = frozenset({"any", "appeared", "disappeared", "moved"})


@dataclass(frozen=True)
class ExpectedQuestion:
    """One line of a file: `sort` is the key of `EXPECTED` that it has, `value` what it says there."""

    text: str
    kind: str
    language: str
    sort: str
    value: Any
    may: Mapping[str, Any] | None = None
    of: Mapping[str, Any] | None = None
    traversals: int = 1


def read_questions(path: Path) -> tuple[ExpectedQuestion, ...]:
    """Read a file of questions. Raises `EvaluationError` with the line for what is no question."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise EvaluationError(f"it cannot be read: {error}", where=str(path), cure="name a file of questions") from None
    found = tuple(_question(line, f"{path}:{at}") for at, line in enumerate(lines, 1) if line.strip())
    if not found:
        raise EvaluationError("it holds no question", where=str(path), cure="give one JSON object a line")
    return found


def _question(line: str, where: str) -> ExpectedQuestion:
    cure = 'e.g. {"text": "where is the mug", "kind": "name", "language": "en", "expected": {"ids": {"label": "mug"}}}'
    try:
        document = json.loads(line)
        expected = document["expected"]
        [sort] = EXPECTED & expected.keys()
        question = ExpectedQuestion(
            text=str(document["text"]),
            kind=str(document["kind"]),
            language=str(document["language"]),
            sort=sort,
            value=expected[sort],
            may=expected.get("may"),
            of=expected.get("of"),
            traversals=int(document.get("traversals", 1)),
        )
        for besides in expected.keys() - {sort}:
            _check_one_of(besides, BESIDES)
        _check(question)
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError) as error:
        named = f": {error}" if isinstance(error, _UnknownTermError) else ""
        raise EvaluationError(f"this is no question with what is expected{named}", where=where, cure=cure) from None
    return question


class _UnknownTermError(ValueError):
    """A term that no selection has."""


def _check(question: ExpectedQuestion) -> None:
    value = question.value
    for selection in (question.may, question.of):
        if selection is not None:
            _check_selection(selection)
    match question.sort:
        case "refused":
            _check_one_of(value, frozenset(get_args(RefusalKind)))
        case "changes" | "changed":
            _check_one_of(value, CHANGES)
        case "more" | "distance_m":
            first, second = value
            _check_selection(first)
            _check_selection(second)
        case "larger":
            measure, first, second = value
            _check_one_of(measure, MEASURES)
            _check_selection(first)
            _check_selection(second)
        case "at_least":
            number, selection = value
            int(number)
            _check_selection(selection)
        case _:
            _check_selection(value)


def _check_one_of(value: object, known: frozenset[str]) -> None:
    if value not in known:
        raise _UnknownTermError(f"'{value}' is none of {', '.join(sorted(known))}")


def _check_selection(selection: Mapping[str, Any]) -> None:
    for name, term in selection.items():
        match name:
            case "label":
                if not isinstance(term, str) and not all(isinstance(each, str) for each in term):
                    raise _UnknownTermError("a label is a text, or several")
            case "when":
                _check_one_of(term, TIMES)
            case "changed":
                _check_one_of(term, CHANGES)
            case "first":
                _check_one_of(term[0], MEASURES)
                int(term[1])
                for reference in term[2:]:
                    _check_selection(reference)
            case "within_m" | "beyond_m":
                float(term[0])
                _check_selection(term[1])
            case "or":
                for one in term:
                    _check_selection(one)
            case "not" | "having" | "except":
                _check_selection(term)
            case _:
                _check_one_of(name, RELATION_NAMES | TERMS)
                _check_selection(term)
