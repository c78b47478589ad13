"""Typed questions in a short form, for tests to compare and people to read; and the names that tests' questions use."""

from __future__ import annotations

from dataclasses import MISSING, fields, is_dataclass
from typing import Any

from supermap_cli.language.known_names import KnownNames
from supermap_cli.language.parsing import parse
from supermap_cli.language.questions import Named, Question
from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.relations.registry import RelationRegistry

LABELS = (
    *("chair", "stool", "armchair", "couch", "desk", "table", "dining table", "bookshelf", "cabinet", "whiteboard"),
    *("cup", "mug", "bottle", "book", "laptop", "monitor", "keyboard", "mouse", "tv", "lamp", "vase", "potted plant"),
    *("suitcase", "backpack", "trash can", "bucket", "cart", "cardboard box", "fire extinguisher", "refrigerator"),
)
KNOWN = KnownNames(LABELS, ("monday", "tuesday"), {"en": dict(RelationRegistry().phrases("en"))})


def short(value: Any) -> str:
    """A value of a typed question, without what has its default: `Find(Things('cup'), place=True)`."""
    if isinstance(value, Named):
        return repr(value.name)
    if is_dataclass(value) and not isinstance(value, type):
        parts = []
        for field in fields(value):
            given = getattr(value, field.name)
            if field.default is MISSING:
                parts.append(short(given))
            elif given != field.default:
                parts.append(f"{field.name}={short(given)}")
        return f"{type(value).__name__}({', '.join(parts)})"
    if isinstance(value, tuple):
        return f"[{', '.join(map(short, value))}]"
    return repr(value)


def short_question(question: Question) -> str:
    """The body and the time of a question."""
    body = short(question.body)
    return body if question.time is None else f"{body} @ {short(question.time)}"


def read(text: str, known: KnownNames = KNOWN, language: str = "en") -> str:
    """How a text is understood, or "refused: " and the kind of refusal."""
    try:
        return short_question(parse(text, known, language))
    except RefusedQuestionError as refused:
        return f"refused: {refused.kind}"
