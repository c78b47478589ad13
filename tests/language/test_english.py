"""Questions as people type them, and how each is understood: one a line of `english.jsonl`, checked by hand."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from support.typed_questions import read

ROWS = [json.loads(line) for line in (Path(__file__).parent / "english.jsonl").read_text(encoding="utf-8").splitlines()]


@pytest.mark.parametrize(("text", "expected"), [(row["text"], row["read"]) for row in ROWS])
def test_a_question_is_understood_as_meant(text: str, expected: str) -> None:
    assert read(text) == expected


def test_there_are_enough_questions_of_every_kind() -> None:
    kinds = ("Find", "Count", "Exists", "Holds", "MostOf", "CompareMeasure", "HowFar", "Describe", "When", "Changes")
    told = {kind: sum(row["read"].startswith(f"{kind}(") for row in ROWS) for kind in kinds}
    told["refused"] = sum(row["read"].startswith("refused: ") for row in ROWS)
    assert len(ROWS) >= 400
    assert min(told.values()) >= 5, told
