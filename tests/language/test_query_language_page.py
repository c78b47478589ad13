"""The questions of docs/query-language.md are read as the page says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from support.typed_questions import read

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "query-language.md").read_text(encoding="utf-8")
TYPES = re.findall(r"^\| `([^`]+)` \| ([A-Z]\w+) \|$", PAGE, re.MULTILINE)
REFUSED = PAGE[PAGE.index("## What is refused") : PAGE.index("## For programmers")]
REFUSALS = re.findall(r"^\| `([^`]+)` \| ([a-z ]+) \|$", REFUSED, re.MULTILINE)
TIMES = re.findall(r'"([^"]+)"', PAGE[PAGE.index("## Times") : PAGE.index("## What is refused")])


def test_the_page_has_examples() -> None:
    assert (len(TYPES), len(REFUSALS), len(TIMES)) >= (20, 7, 20)


@pytest.mark.parametrize(("question", "kind"), TYPES)
def test_a_question_of_the_page_is_of_its_type(question: str, kind: str) -> None:
    assert read(question).startswith(f"{kind}(")


@pytest.mark.parametrize(("question", "kind"), REFUSALS)
def test_a_refusal_of_the_page_is_of_its_kind(question: str, kind: str) -> None:
    assert read(question) == f"refused: {kind}"


@pytest.mark.parametrize("words", TIMES)
def test_a_time_of_the_page_is_one(words: str) -> None:
    assert " @ " in read(f"where was the cup {words}")
