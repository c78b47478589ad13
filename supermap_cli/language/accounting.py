"""Whether a typed question holds every word that says something: a guard against a word being lost on the way."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from supermap_cli.language import questions as tree
from supermap_cli.language import times
from supermap_cli.language.forest import Word

_COLOURS = frozenset({"black", "white", "grey", "red", "green", "blue", "yellow", "orange", "brown", "pink", "purple"})

_NAMED_BY = {
    **dict.fromkeys(("NOUN", "NOUN_PERSON", "PERSON", "ID"), "noun"),
    **dict.fromkeys(("USE", "USE_VERB"), "use"),
    **dict.fromkeys(("TRAVERSAL", "CLOCK", "DATE", "WEEKDAY"), "time"),
    "MATERIAL": "attribute",
}
"""Terminals, and what they put into the tree."""


def lost_words(words: Sequence[Word], asked: Any) -> tuple[str, ...]:
    """The words whose meaning is nowhere in the typed question (its body and its time)."""
    held = Counter(_held(asked))
    lost = []
    for word in words:
        meaning = _meaning(word)
        if meaning is None:
            continue
        if not held[meaning]:
            lost.append(word.written)
        held[meaning] -= 1
    return tuple(lost)


def _meaning(word: Word) -> tuple[str, str] | None:
    """What a terminal must have put into the tree; `None` for one that only shapes it."""
    kind = word.kind
    if kind == "RELATION":
        return "relation", str(word.value).partition("|")[0]
    if kind.lower() in _COLOURS:
        return "attribute", kind.lower()
    named = _NAMED_BY.get(kind)
    return None if named is None else (named, "" if named in {"noun", "time"} else str(word.value))


def _held(value: Any) -> Iterator[tuple[str, str]]:
    match value:
        case tree.Named() | tree.Identified():
            yield ("noun", "")
        case tree.Usable(use):
            yield ("use", use)
        case tree.Related(relation) | tree.MostOf(relation=relation):
            yield ("relation", relation)
        case times.AtClock(written) if written[:1] not in "0123456789":
            yield ("time", "")
        case tree.Colour(name) | tree.MadeOf(name):
            yield ("attribute", name)
    if is_dataclass(value):
        if type(value).__module__.endswith("language.times") and "Event" not in type(value).__name__:
            yield ("time", "")
        for field in fields(value):
            yield from _held(getattr(value, field.name))
    elif isinstance(value, tuple):
        for part in value:
            yield from _held(part)
